"""Pick blasts from records of samples: when, how loud, how long, and how sure.

Reads CSV, WAV, FLAC, miniSEED, SAC, TDMS, HDF5, NetCDF and MATLAB files. Exit code 3:
nothing was found, or no pick stands in a row; 2: a file cannot be read, and the picks
of the others are written all the same.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.logs import add_records, picked
from jblast.cli.arguments.options import NOT_FOUND, path
from jblast.files import refuse_existing, writing


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "records",
        metavar="RECORD",
        nargs="+",
        type=path,
        help="files of pressure against time, each channel a record, or folders of "
        "them; of any length",
    )
    add_records(verb)
    verb.add_argument(
        "--out",
        metavar="PICKS.csv",
        type=path,
        help="write the picks as a log for jblast fit",
    )
    verb.add_argument(
        "--report",
        metavar="DIR",
        type=path,
        help="write picks.json, picks.csv, pictures of the records with their fitted "
        "pulses, and report.html",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what --out and --report name"
    )


def run(asked: argparse.Namespace) -> int:
    """Pick, write, print; return the exit code."""
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "picking": 6.0, "writing": 2.0})
    begin("starting")
    if asked.out:
        refuse_existing(asked.out, force=asked.force)
    if asked.report:
        from jblast.report.fit.files import check_directory

        check_directory(asked.report, asked.force)
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.observations import write
    from jblast.report.picks import picks_answer, picks_text
    from jblast.report.provenance import provenance_of
    from jblast.signals.picks.pick_files import refusal_of

    begin("picking")
    keep = asked.report is not None
    of = picked(asked.records, asked, keep_samples=keep)
    found, log = of.found, of.log
    files = [*of.files, *([asked.positions] if asked.positions else [])]
    made = provenance_of(files if keep else [], command=asked.words)
    begin("writing")
    answer = picks_answer(found, log)
    text = picks_text(found, log, tuple(path.name for path in of.left_out))
    if asked.out and len(log.observations):
        with writing(asked.out):
            write(asked.out, log.observations)
    written: list[str] = []
    if asked.report:
        from jblast.report.pick_figures import write_picks

        with writing(asked.report):
            lines = [str(error) for error in found.refused]
            folder = Path(asked.report)
            written = write_picks(folder, found, log, answer, lines, made)
    if asked.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(text)
        if written:
            sys.stdout.write(f"\nWritten: {asked.report}, {', '.join(written)}\n")
        if asked.out:
            told = f"Written: {asked.out}; jblast fit takes it"
            if not len(log.observations):
                told = f"Not written: {asked.out}, as no pick stands in a row"
            sys.stdout.write(f"\n{told}\n")
    if found.refused:
        raise refusal_of(found.refused)
    return 0 if len(log.observations) else NOT_FOUND
