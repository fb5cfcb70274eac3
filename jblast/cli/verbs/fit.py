"""Fit a blast to a log of sensor readings: mass, position, time and their uncertainty.

With --positions the files are pressure records, which are picked first.
"""

import argparse
import os
import sys

from jblast.cli.arguments.logs import (
    add_records,
    each_made,
    from_records,
    made_with_samples,
    scaling_of,
    write_answers,
)
from jblast.cli.arguments.options import (
    add_force,
    add_free,
    add_json,
    add_law,
    add_noise,
    add_reading,
    in_options,
    names_between_commas,
    path,
    reading_options,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import writing

SMALL_LOGS_BYTES = 100_000
"""Total size of logs, about 2,000 rows [bytes].

A fit of fewer rows compiles for longer than it computes, so that it gains by quick
compilation; a longer one gains by optimised code.
"""


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "observations",
        metavar="OBSERVATIONS.csv",
        nargs="+",
        type=path,
        help="log with one reading a row: sensor,quantity,value,sigma and the sensor's "
        "position, as east_m,north_m,up_m, lat_deg,lon_deg,alt_m or range_m. Several "
        "files, or a column shot, are separate logs with one table of answers. With "
        "--positions: pressure records or folders of them, as for jblast pick",
    )
    verb.inputs.add_argument(
        "--one-event",
        action="store_true",
        help="one event in all files: each file has its own clock, free except for the "
        "first",
    )
    add_reading(verb)
    add_records(verb)
    verb.model.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with known values and priors; jblast scene writes one to "
        "start from (default: a surface charge of unknown mass, at an unknown position "
        "and time if the log can identify them, else at the origin at time 0)",
    )
    add_free(verb)
    add_law(verb)
    add_noise(verb)
    verb.advanced.add_argument(
        "--posterior",
        choices=("weighted", "emcee"),
        default="weighted",
        help="method for the intervals: draws weighted by the posterior (weighted) or "
        "MCMC (emcee) (default: weighted)",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="folder for fit.json, figures and report.html; for several logs fits.json "
        "and answers.csv",
    )
    verb.outputs.add_argument(
        "--verbose",
        action="store_true",
        help="reason for each law, method of the intervals and all conversions of the "
        "log, in the printed text",
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Fit, report, and return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.files import check_log_paths
    from jblast.progress import stages

    # With --positions folders are valid; without, the message names the option.
    if not options.positions:
        check_log_paths(options.observations)
    picking = 6.0 if options.positions else 0.3
    # Approximate durations; picking reads and filters whole records, a log is short.
    shares = {"starting": 3.0, "reading": picking, "fitting": 9.0}
    begin = stages(shares | ({"writing": 3.0} if options.out else {}))
    begin("starting")
    # A missing file counts as 0, and is reported by the reader.
    size = sum(os.path.getsize(f) for f in options.observations if os.path.isfile(f))
    start_jax(quick=size < SMALL_LOGS_BYTES)
    from pathlib import Path

    from jblast.inference import fit, fit_each
    from jblast.inference.fitting.fit_input import fit_input, scene_named
    from jblast.report import check_directory, summary, write_report
    from jblast.report.fit.document import fit_answer
    from jblast.report.provenance import provenance_of

    out = Path(options.out) if options.out else None
    if out:
        check_directory(out, options.force)
    scene = scene_named(options.scene) if options.scene else None
    made = None
    files = options.observations
    if out:
        # Digests are taken before the fit: a file may change while it runs.
        whole = [*files, *([options.positions] if options.positions else [])]
        made = provenance_of(whole, options.scene or "", options.words)
    begin("reading")
    recorded = from_records(options)
    scale = {"scaling": scaling_of(options), "high_pass_hz": options.high_pass}
    logs, uncertain = fit_input(
        recorded.picked if recorded else files,
        scene,
        one_event=options.one_event,
        freed=names_between_commas(options.free),
        laws=options.law,
        **reading_options(options),
    )
    picks = recorded.answer().picks if recorded else None
    begin("fitting")
    if len(logs) > 1:
        # Files of records form one log; shots of it have no file of their own.
        apart = () if recorded else files
        made_of = each_made(made, logs, apart) if made else {}
        made_of = {k: made_with_samples(of, logs[k]) for k, of in made_of.items()}
        answers = {
            name: in_options(answer) if isinstance(answer, InputError) else answer
            for name, answer in fit_each(
                logs,
                uncertain,
                noise=options.noise,
                posterior=options.posterior,
                **scale,
            ).items()
        }
        return _many(answers, picks, out, made_of, options)
    (observations,) = logs.values()
    made = made_with_samples(made, observations) if made else None
    answer = fit(
        observations,
        uncertain,
        noise=options.noise,
        posterior=options.posterior,
        **scale,
    )
    if options.json:
        sys.stdout.write(fit_answer(answer, picks=picks).to_json())
    if out:
        begin("writing")
        with writing(out):
            write_report(
                answer,
                out,
                force=options.force,
                records=recorded.figure if recorded else None,
                made=made,
                picks=picks,
            )
            if recorded:
                recorded.write(out / "picks")
    if recorded and not options.json:
        sys.stdout.write(recorded.text + "\n")
    if not options.json:
        sys.stdout.write(summary(answer, out=out, verbose=options.verbose))
    return answer.exit_code


def _many(answers, picks, out, made_of, options: argparse.Namespace) -> int:
    """Print and write the answers of several logs; return the worst exit code."""
    from jblast.report.fit.document import fits_answer
    from jblast.report.fit.terminal import answers_text

    if out:
        write_answers(answers, out, made_of, picks)
    if options.json:
        sys.stdout.write(fits_answer(answers, picks=picks).to_json())
    else:
        sys.stdout.write(answers_text(answers))
    # one bad log must not hide the answers of the others
    fits = [fit for fit in answers.values() if not isinstance(fit, InputError)]
    if not fits:
        raise InputError(f"none of {len(answers)} logs could be fitted")
    # The worst code of all fits, so that one doubtful answer is visible to a script.
    return 4 if len(fits) < len(answers) else max(fit.exit_code for fit in fits)
