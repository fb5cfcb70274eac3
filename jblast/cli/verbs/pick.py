"""Pick blasts from pressure records: arrival, peak, duration, impulse and their errors.

Formats: CSV, WAV, FLAC, miniSEED, SAC, TDMS, HDF5, NetCDF and MATLAB. Exit code 3:
nothing is found, or no pick is accepted as a row of the log. Exit code 2: a file cannot
be read; the picks of the other files are written nevertheless.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.logs import add_records, fit_command, picked
from jblast.cli.arguments.options import NOT_FOUND, add_force, add_json, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import refuse_existing, writing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "records",
        metavar="RECORD",
        nargs="+",
        type=path,
        help="pressure records of any length, one for each channel, or folders of them",
    )
    add_records(verb)
    verb.outputs.add_argument(
        "--out",
        metavar="PICKS.csv",
        type=path,
        help="log of the picks, for jblast fit",
    )
    verb.outputs.add_argument(
        "--report",
        metavar="DIR",
        type=path,
        help="folder for report.html, picks.json, picks.csv and figures of the records "
        "with their fitted pulses",
    )
    add_json(verb)
    add_force(verb, "existing files of --out and --report")


def run(options: argparse.Namespace) -> int:
    """Pick, write, print; return the exit code."""
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "picking": 6.0, "writing": 2.0})
    begin("starting")
    if options.out:
        refuse_existing(options.out, force=options.force)
    if options.report:
        from jblast.report.fit.files import check_directory

        check_directory(options.report, options.force)
    from jblast.observations import write
    from jblast.report.picks import picks_answer, picks_text
    from jblast.report.provenance import provenance_of
    from jblast.signals.picks.pick_files import refusal_of

    begin("picking")
    # Only figures need the samples; days of records would not fit into memory.
    keep = options.report is not None
    of = picked(options.records, options, keep_samples=keep)
    found, log = of.found, of.log
    files = [*of.files, *([options.positions] if options.positions else [])]
    made = provenance_of(files if keep else [], command=options.words)
    begin("writing")
    answer = picks_answer(found, log)
    text = picks_text(found, log, tuple(path.name for path in of.left_out))
    # A log without rows is refused by `jblast fit`, so that none is written.
    if options.out and len(log.observations):
        with writing(options.out):
            write(options.out, log.observations)
    written: list[str] = []
    if options.report:
        from jblast.report.pick_figures import write_picks

        with writing(options.report):
            lines = [str(error) for error in found.refused]
            folder = Path(options.report)
            written = write_picks(folder, found, log, answer, lines, made)
    if options.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(text)
        if written:
            sys.stdout.write(f"\nWritten to {options.report}: {', '.join(written)}\n")
        if options.out:
            line = f"Not written: {options.out}, no pick is accepted as a row"
            if len(log.observations):
                command = fit_command(options.out)
                line = f"Written: {options.out}\nFit it with: {command}"
            sys.stdout.write(f"{line}\n" if written else f"\n{line}\n")
    if found.refused:
        # Last, so that the picks of the other files are printed and written before.
        raise refusal_of(found.refused)
    return 0 if len(log.observations) else NOT_FOUND
