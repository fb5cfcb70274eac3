"""Measure where each method breaks, and look at what jblast does there.

Laws are followed out of their range, fits started far off, clocks run too long. Nothing
is looked up: it takes some minutes.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.options import check_out, path, save_figure
from jblast.files import save_text

FILES = ("stability.csv", "stability.md", "stability.png")


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "areas",
        metavar="AREA",
        nargs="*",
        help="laws, wave-forms, gradients, clocks, solver, fits, walks, events, "
        "flights, detectors, records (default: all)",
    )
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help=f"also write {', '.join(FILES)} there",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite these files in --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Measure, print, and return the exit code."""
    from jblast.verification.stability.failure import AREAS, area_named

    areas = list(dict.fromkeys(map(area_named, asked.areas))) or list(AREAS)
    if asked.out:
        check_out(Path(asked.out), FILES, force=asked.force)
    from jblast.cli.jax_start import start_jax

    start_jax()
    from jblast.progress import stages
    from jblast.report.stability import StabilityAnswer, stability_text
    from jblast.verification.stability.failure import failure_modes_of

    begin, modes = stages(dict.fromkeys(areas, 1.0)), {}
    for area in areas:
        begin(area)
        modes[area] = failure_modes_of(area)
    if asked.out:
        _write(Path(asked.out), modes)
    answer = StabilityAnswer(modes)
    sys.stdout.write(answer.to_json() if asked.json else stability_text(modes))
    if asked.out and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(FILES)}\n")
    return 0


def _write(directory: Path, modes) -> None:
    from jblast.report.stability import stability_csv, stability_markdown
    from jblast.report.stability_figures import stability_figure

    table, page, picture = (directory / name for name in FILES)
    save_text(stability_csv(modes), table)
    save_text(stability_markdown(modes), page)
    save_figure(stability_figure(modes), picture)
