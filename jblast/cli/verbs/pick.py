"""Pick blasts from pressure records: arrival, peak, duration, impulse and their errors.

Formats: CSV, WAV, FLAC, miniSEED, SAC, TDMS, HDF5, NetCDF and MATLAB. Exit code 3:
nothing is found, or no pick is accepted as a row of the log. Exit code 2: a file cannot
be read; the picks of the other files are written nevertheless.

example:
  jblast pick records/ --positions stations.csv --out picks.csv

input:
  RECORD...       path; pressure records of any length, one for each channel, or folders
      of them
  ...records
output:
  --out PICKS.csv  path; log of the picks, for jblast fit; written every ten seconds
      with the picks so far
  --report DIR     path; folder for report.html, picks.json, picks.csv and figures of
      the records with their fitted pulses
  --json           answer as JSON, instead of text
  --force          permission to overwrite existing files of --out and --report
"""

import argparse


def run(options: argparse.Namespace) -> int:
    """Pick, write, print; return the exit code."""
    from dataclasses import replace
    from pathlib import Path

    from jblast.cli.options import fit_command, picked
    from jblast.files import check_out, refuse_existing, writing
    from jblast.observations import write
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "picking": 6.0, "writing": 2.0})
    begin("starting")
    from jblast.report.output import deliver
    from jblast.report.picks import FILES, LOG, picks_report
    from jblast.report.provenance import provenance_of
    from jblast.signals.picks import PickedFiles
    from jblast.signals.picks.pick_files import refusal_of

    if options.out:
        refuse_existing(options.out, force=options.force)
    if options.report:
        check_out(options.report, FILES, force=options.force)
    logs = [options.out] if options.out else []
    logs += [Path(options.report) / LOG] if options.report else []

    def write_logs(of: PickedFiles) -> None:
        # a log without rows is refused by `jblast fit`, so that none is written
        for path in logs if len(of.log.observations) else ():
            with writing(path):
                write(path, of.log.observations)

    begin("picking")
    # only figures need the samples; days of records would not fit into memory
    keep = options.report is not None
    of = picked(options.record, options, keep_samples=keep, done=write_logs)
    begin("writing")
    write_logs(of)
    files = [*of.files, *([options.positions] if options.positions else [])]
    made = provenance_of(files, command=options.words) if keep else None
    answer, rows = picks_report(of, made), len(of.log.observations)
    after = []
    if options.out:
        after = [f"Not written: {options.out}, no pick is accepted as a row"]
    if options.out and rows:
        after = [f"Written: {options.out}", f"Fit it with: {fit_command(options.out)}"]
    answer = replace(answer, files={LOG: None} if rows else {}, after=after)
    code = deliver(answer, options, folder=options.report, names=FILES, name="picks")
    if of.found.refused:
        # last, so that the picks of the other files are printed and written before
        raise refusal_of(of.found.refused)
    return code
