"""--live: a world in a window, once its folder is written."""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import positive


def add_live(verb: argparse.ArgumentParser) -> None:
    """Let a verb show the world."""
    verb.add_argument(
        "--live",
        type=positive,
        nargs="?",
        const=1.0,
        metavar="SPEED",
        help="then show it in a window as its clock runs, so many times as fast "
        "(default: 1)",
    )


def check_live(asked: argparse.Namespace) -> None:
    """Refuse before the work what could not be shown after it.

    Raises:
        InputError: There is no display.
    """
    if asked.live:
        from jblast.report.world_live import check_display

        check_display()


def show_live(asked: argparse.Namespace, folder: Path) -> None:
    """Show what a folder holds, if that is asked for."""
    if not asked.live:
        return
    from jblast.report.world_live import play
    from jblast.report.world_page import read_run

    sys.stdout.flush()
    play(read_run(folder), asked.live)
