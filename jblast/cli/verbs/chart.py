"""Measure the cost and the error of each method on this machine, and draw them."""

import argparse
import sys

from jblast.cli.arguments.options import add_force, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, nearest
from jblast.files import writing

ALL = "all"


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "topic",
        nargs="?",
        default=ALL,
        metavar="TOPIC",
        help="topic: arrival, pressure, impulse, duration, waveform, solver, fit, "
        "sampler, events, event_effects, views, vehicle, detector, records, montecarlo "
        "or all (default: all)",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="folder for TOPIC.png, TOPIC.csv and TOPIC.md",
    )
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Measure, print and write each benchmark as soon as it is complete."""
    from jblast.cli.jax_start import start_jax

    # Without quick compilation: the chart times optimised code, as in long runs.
    start_jax()
    from pathlib import Path

    from jblast.progress import stages
    from jblast.report import check_directory
    from jblast.report.benchmark import chart_markdown, write_chart
    from jblast.verification.benchmark import BENCHMARKS

    known = (*BENCHMARKS, ALL)
    if options.topic not in known:
        raise InputError(
            f"no topic {options.topic!r}: expected one of {', '.join(known)}"
            f"{nearest(options.topic, known)}"
        )
    out = Path(options.out) if options.out else None
    if out:
        check_directory(out, options.force)
    names = list(BENCHMARKS) if options.topic == ALL else [options.topic]
    begin = stages(dict.fromkeys(names, 1.0))
    for name in names:
        benchmark = BENCHMARKS[name]
        begin(name)
        points = benchmark.measure()
        sys.stdout.write(chart_markdown(benchmark, points) + "\n")
        # A pipe is buffered: without this a table appears when all are measured.
        sys.stdout.flush()
        if out:
            with writing(out):
                write_chart(benchmark, points, out)
    return 0
