"""Measure every method's cost against its error on this machine, and draw it."""

import argparse
import sys

from jblast.cli.arguments.options import path
from jblast.errors import InputError, nearest
from jblast.files import writing

ALL = "all"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "topic",
        nargs="?",
        default=ALL,
        metavar="TOPIC",
        help="arrival, pressure, impulse, duration, waveform, solver, fit, sampler, "
        "events, event_effects, views, vehicle, detector, records, montecarlo or all "
        "(default)",
    )
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="write TOPIC.png, TOPIC.csv and TOPIC.md",
    )
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Measure, print, and write each benchmark as soon as it is through."""
    from jblast.cli.jax_start import start_jax

    start_jax()
    from pathlib import Path

    from jblast.progress import stages
    from jblast.report import check_directory
    from jblast.report.benchmark import chart_markdown, write_chart
    from jblast.verification.benchmark import BENCHMARKS

    known = (*BENCHMARKS, ALL)
    if asked.topic not in known:
        raise InputError(
            f"no topic {asked.topic!r}: expected one of {', '.join(known)}"
            f"{nearest(asked.topic, known)}"
        )
    out = Path(asked.out) if asked.out else None
    if out:
        check_directory(out, asked.force)
    names = list(BENCHMARKS) if asked.topic == ALL else [asked.topic]
    begin = stages(dict.fromkeys(names, 1.0))
    for name in names:
        benchmark = BENCHMARKS[name]
        begin(name)
        points = benchmark.measure()
        sys.stdout.write(chart_markdown(benchmark, points) + "\n")
        sys.stdout.flush()
        if out:
            with writing(out):
                write_chart(benchmark, points, out)
    return 0
