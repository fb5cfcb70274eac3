"""Measure the limits of each method, and the behaviour of jblast beyond them.

Laws are evaluated outside their range, fits start far from the solution, clocks run too
long. All cases are computed again, which takes some minutes.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.options import (
    add_force,
    add_json,
    check_out,
    path,
    save_figure,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import save_text

FILES = ("stability.csv", "stability.md", "stability.png")


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "areas",
        metavar="AREA",
        nargs="*",
        help="area: laws, wave-forms, gradients, clocks, solver, fits, walks, events, "
        "flights, detectors, records (default: all)",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help=f"folder for {', '.join(FILES)}",
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Measure, print, and return the exit code."""
    from jblast.verification.stability.failure import AREAS, area_named

    # Each area once, as it takes minutes; a wrong name is rejected before that.
    areas = list(dict.fromkeys(map(area_named, options.areas))) or list(AREAS)
    if options.out:
        check_out(Path(options.out), FILES, force=options.force)
    from jblast.cli.jax_start import start_jax

    # Optimised code, as the samplers run for minutes.
    start_jax()
    from jblast.progress import stages
    from jblast.report.stability import StabilityAnswer, stability_text
    from jblast.verification.stability.failure import failure_modes_of

    begin, modes = stages(dict.fromkeys(areas, 1.0)), {}
    for area in areas:
        begin(area)
        modes[area] = failure_modes_of(area)
    if options.out:
        from jblast.report.stability import stability_csv, stability_markdown
        from jblast.report.stability_figures import stability_figure

        table, page, picture = (Path(options.out) / name for name in FILES)
        save_text(stability_csv(modes), table)
        save_text(stability_markdown(modes), page)
        save_figure(stability_figure(modes), picture)
    answer = StabilityAnswer(modes)
    sys.stdout.write(answer.to_json() if options.json else stability_text(modes))
    if options.out and not options.json:
        sys.stdout.write(f"\nWritten to {options.out}: {', '.join(FILES)}\n")
    return 0
