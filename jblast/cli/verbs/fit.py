"""Fit a blast to a log of sensor readings: mass, position, time and their uncertainty.

With --positions the files are pressure records, which are picked first.

example:
  jblast fit log.csv --scene scene.toml --out report

input:
  OBSERVATIONS.csv...  path; log with one reading a row: sensor,quantity,value,sigma and
      the sensor's position, as east_m,north_m,up_m, lat_deg,lon_deg,alt_m or range_m.
      Several files, or a column shot, are separate logs with one table of answers. With
      --positions: pressure records or folders of them, as for jblast pick
  --one-event          one event in all files: each file has its own clock, free except
      for the first
  ...reading
  ...records
model:
  --scene SCENE.toml   path; scene file with known values and priors; jblast scene
      writes one to start from (default: a surface charge of unknown mass, at an unknown
      position and time if the log can identify them, else at the origin at time 0)
  ...free
  ...law
output:
  --out DIR            path; folder for fit.json, figures and report.html; for several
      logs fits.json, report.html and answers.csv, which is written after each fit
  --verbose            reason for each law, method of the intervals and all conversions
      of the log, in the printed text
  ...out
advanced:
  ...noise
  --posterior weighted|emcee  choice = weighted; method for the intervals: draws
      weighted by the posterior (weighted) or MCMC (emcee)
"""

import argparse

SMALL_LOGS_BYTES = 100_000
"""Total size of logs, about 2,000 rows [bytes].

A fit of fewer rows compiles for longer than it computes, so that it gains by quick
compilation; a longer one gains by optimised code.
"""


def run(options: argparse.Namespace) -> int:
    """Fit, report, and return the exit code."""
    import os
    import sys
    from pathlib import Path

    from jblast.cli.jax_start import start_jax
    from jblast.files import check_log_paths, check_out, write_text, writing
    from jblast.progress import stages
    from jblast.report.output import FIT_FILES, PICKS, deliver

    files, out = options.observations, options.out
    # With --positions folders are valid; without, the message names the option.
    if not options.positions:
        check_log_paths(files)
    if out:
        names = (*FIT_FILES, *PICKS) if options.positions else FIT_FILES
        check_out(out, names, force=options.force)
    picking = 6.0 if options.positions else 0.3
    # Approximate durations; picking reads and filters whole records, a log is short.
    shares = {"starting": 3.0, "reading": picking, "fitting": 9.0}
    begin = stages(shares | ({"writing": 3.0} if out else {}))
    begin("starting")
    # A missing file counts as 0, and is reported by the reader.
    size = sum(os.path.getsize(file) for file in files if os.path.isfile(file))
    start_jax(quick=size < SMALL_LOGS_BYTES)
    from jblast.cli.options import in_options, picked, reading_options, scaling_of
    from jblast.errors import InputError
    from jblast.inference import fit, fit_each
    from jblast.inference.fitting.fit_input import fit_input, scene_named
    from jblast.observations import write
    from jblast.report.fit_report import (
        answers_csv,
        fit_report,
        fits_report,
        made_each,
    )
    from jblast.report.provenance import provenance_of

    scene = scene_named(options.scene) if options.scene else None
    # Digests are taken before the fit: a file may change while it runs.
    whole = [*files, *([options.positions] if options.positions else [])]
    made = provenance_of(whole, options.scene or "", options.words) if out else None
    begin("reading")
    of = picked(files, options, keep_samples=bool(out)) if options.positions else None
    if of and of.found.refused and not options.json:
        # the files are refused below; the picks of the others are not lost
        from jblast.report.picks import picks_report
        from jblast.report.view import terminal

        sys.stdout.write(terminal(picks_report(of).view))
    logs, uncertain = fit_input(
        of or files,
        scene,
        one_event=options.one_event,
        freed=options.free,
        laws=options.law,
        **reading_options(options),
    )
    if out and of:
        picks = Path(out) / "picks"
        with writing(picks):
            picks.mkdir(parents=True, exist_ok=True)
            write(picks / "picks.csv", of.observations())
    begin("fitting")
    settings = {
        "noise": options.noise,
        "posterior": options.posterior,
        "scaling": scaling_of(options),
        "high_pass_hz": options.high_pass,
    }
    # Files of records form one log; shots of it have no file of their own.
    by_log = made_each(made, logs, () if of else files)
    if len(logs) == 1:
        ((name, log),) = logs.items()
        found = fit(log, uncertain, **settings)
        made = by_log.get(name)
        answer = fit_report(found, made=made, of=of)
    else:

        def done(answers):
            if out:
                write_text(Path(out) / "answers.csv", answers_csv(answers))

        fits = fit_each(logs, uncertain, done=done, **settings)
        fits = {
            name: in_options(one) if isinstance(one, InputError) else one
            for name, one in fits.items()
        }
        answer = fits_report(fits, by_log, of, made)
    if out:
        begin("writing")
    kind = "fit" if len(logs) == 1 else "fits"
    return deliver(answer, options, folder=out, names=FIT_FILES, name=kind)
