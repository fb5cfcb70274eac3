"""Fit a blast to a log of sensor readings: how big, where, when, and how sure."""

import argparse
import os
import sys
from collections.abc import Sequence

from jblast.cli.arguments.logs import (
    WALK,
    add_records,
    each_made,
    from_records,
    made_with_samples,
    only_a_walk,
    scaling_of,
    write_answers,
)
from jblast.cli.arguments.options import (
    add_free,
    add_law,
    add_noise,
    add_reading,
    in_options,
    names_to_free,
    path,
    reading_asked,
)
from jblast.errors import InputError
from jblast.files import writing

SMALL_LOGS_BYTES = 100_000
"""Total size of the logs, about two thousand rows [bytes]."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "observations",
        metavar="OBSERVATIONS.csv",
        nargs="+",
        type=path,
        help="one measurement a row: sensor,quantity,value,sigma and where it stood: "
        "east_m,north_m,up_m, lat_deg,lon_deg,alt_m or range_m; several files, or a "
        "column shot, are as many logs and give one table. With --positions records of "
        "pressure, or a folder of them, as jblast pick takes them",
    )
    verb.add_argument(
        "--one-event",
        action="store_true",
        help="the files are recordings of one event, each with a clock of its own, "
        "free but for the first",
    )
    verb.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="what is known of the scene; jblast scene writes one to start from "
        "(default: a surface charge of unknown mass at the origin at time 0; of a log "
        "in degrees, or with dates, anywhere at any time)",
    )
    add_reading(verb)
    add_records(verb)
    add_free(verb)
    add_law(verb)
    add_noise(verb)
    verb.add_argument(
        "--posterior",
        choices=("weighted", "laplace", "emcee", "auto"),
        default="weighted",
        help="how intervals are found: draws of a normal approximation weighted by the "
        "posterior (default), that approximation alone, walkers, or walkers where the "
        "approximation is found wanting",
    )
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="write fit.json, figures, report.html; of several logs fits.json and "
        "answers.csv. A walk that was cut short goes on there",
    )
    verb.add_argument(
        "--verbose",
        action="store_true",
        help="also print why each law was chosen, how intervals were computed and all "
        "conversions of the log",
    )
    verb.add_argument("--json", action="store_true", help="print the answer as JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Fit, report, and return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.files import check_log_paths
    from jblast.progress import stages

    if not asked.positions:
        check_log_paths(asked.observations)
    picking = 6.0 if asked.positions else 0.3
    shares = {"starting": 3.0, "reading": picking, "fitting": 9.0}
    begin = stages(shares | ({"writing": 3.0} if asked.out else {}))
    begin("starting")
    start_jax(
        quick=asked.posterior in ("weighted", "laplace")
        and _is_small(asked.observations)
    )
    from pathlib import Path

    from jblast.inference import fit, fit_each
    from jblast.inference.fitting.fit_input import fit_input, scene_named
    from jblast.report import check_directory, summary, write_report
    from jblast.report.fit.document import fit_answer
    from jblast.report.provenance import provenance_of

    out = Path(asked.out) if asked.out else None
    if out and not only_a_walk(out):
        check_directory(out, asked.force)
    scene = scene_named(asked.scene) if asked.scene else None
    made = None
    files = asked.observations
    if out:
        whole = [*files, *([asked.positions] if asked.positions else [])]
        made = provenance_of(whole, asked.scene or "", asked.words)
    begin("reading")
    recorded = from_records(asked)
    scale = {"scaling": scaling_of(asked), "high_pass_hz": asked.high_pass}
    logs, uncertain = fit_input(
        recorded.picked if recorded else files,
        scene,
        one_event=asked.one_event,
        freed=names_to_free(asked.free),
        laws=asked.law,
        **reading_asked(asked),
    )
    picks = recorded.answer().picks if recorded else None
    begin("fitting")
    if len(logs) > 1:
        apart = () if recorded else files
        made_of = each_made(made, logs, apart) if made else {}
        made_of = {k: made_with_samples(of, logs[k]) for k, of in made_of.items()}
        answers = {
            name: in_options(answer) if isinstance(answer, InputError) else answer
            for name, answer in fit_each(
                logs, uncertain, noise=asked.noise, posterior=asked.posterior, **scale
            ).items()
        }
        return _many(answers, picks, out, made_of, asked)
    (observations,) = logs.values()
    made = made_with_samples(made, observations) if made else None
    answer = fit(
        observations,
        uncertain,
        noise=asked.noise,
        posterior=asked.posterior,
        store=out / WALK if out else None,
        **scale,
    )
    if asked.json:
        sys.stdout.write(fit_answer(answer, picks=picks).to_json())
    if out:
        begin("writing")
        with writing(out):
            write_report(
                answer,
                out,
                force=asked.force or only_a_walk(out),
                records=recorded.figure if recorded else None,
                made=made,
                picks=picks,
            )
            if recorded:
                recorded.write(out / "picks")
    if recorded and not asked.json:
        sys.stdout.write(recorded.text + "\n")
    if not asked.json:
        sys.stdout.write(summary(answer, out=out, verbose=asked.verbose) + "\n")
    return answer.exit_code


def _is_small(files: Sequence[str]) -> bool:
    """Return whether logs are so short that a fit compiles for longer than it runs."""
    return (
        sum(os.path.getsize(file) for file in files if os.path.isfile(file))
        < SMALL_LOGS_BYTES
    )


def _many(answers, picks, out, made_of, asked: argparse.Namespace) -> int:
    """Print and write the answers of several logs; the worst decides the exit code."""
    from jblast.report.fit.document import fits_answer
    from jblast.report.fit.terminal import answers_text

    if out:
        write_answers(answers, out, made_of, picks)
    if asked.json:
        sys.stdout.write(fits_answer(answers, picks=picks).to_json())
    else:
        sys.stdout.write(answers_text(answers))
    fits = [fit for fit in answers.values() if not isinstance(fit, InputError)]
    if not fits:
        raise InputError(f"none of {len(answers)} logs could be fitted")
    return 4 if len(fits) < len(answers) else max(fit.exit_code for fit in fits)
