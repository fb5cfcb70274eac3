"""Options that several verbs share, and the functions that read their values.

Paths and output files, `--free`, `--law`, `--noise`, the options for reading a log, and
`--live`. `option_for` translates an argument of a Python function to its option in
messages. JAX is imported inside functions only: --help does not wait for it.
"""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.numbers import positive
from jblast.errors import InputError
from jblast.files import refuse_existing, writing
from jblast.parameters import PARAMETERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOT_FOUND, DOUBTFUL = 3, 4
"""Exit codes: nothing was found; computed, but there is a doubt."""
FIGURES = (".png", ".svg", ".pdf")
"""What a name of a figure may end in."""
OTHERWISE = {
    "freed": "--free",
    "laws": "--law",
    "full_scale_pa": "--full-scale",
    "high_pass_hz": "--high-pass",
    "states": "--state",
    "inputs": "--input",
    "members": "--ensemble",
    "mass_kg": "--charge",
    "range_m": "--range",
    "rate_hz": "sampling rate",
    "address": "--listen",
    "packets_hz": "--rate",
    "lead_s": "--lead",
    "patience_s": "--patience",
    "ends_s": "--seconds",
    "certificate": "--tls-cert",
    "recording": "RECORDING.wav",
    "false_alarms_per_hour": "--false-alarms",
    "moment_point_m": "moment_point_m (--profile-moments-about X,Y,Z)",
}
"""Arguments of Python whose options have another name."""


def check_out(directory: Path, names: Iterable[str], *, force: bool) -> None:
    """Refuse a directory that cannot be written to, before anything is computed.

    Args:
        directory: Where to write; it is made.
        names: Of the files to write.
        force: Whether they may be overwritten.

    Raises:
        InputError: It cannot be written to, or holds one of the files.
    """
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
    for name in names:
        refuse_existing(directory / name, force=force)


def path(text: str) -> str:
    """Return the path an argument holds; an empty one is an unset shell variable.

    Raises:
        ArgumentTypeError: It is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a path, got {text!r}")
    return text


def check_figure(option: str, file: str, *, force: bool) -> None:
    """Refuse a figure that cannot be drawn, before anything is computed.

    Raises:
        InputError: It is of no kind we draw, or exists already.
    """
    if Path(file).suffix.lower() not in FIGURES:
        raise InputError(f"{option} {file}: expected a name in {', '.join(FIGURES)}")
    refuse_existing(file, force=force)


def save_figure(figure: "Figure", file: str | Path) -> None:
    """Write a figure of Matplotlib.

    Raises:
        InputError: It cannot be written.
    """
    from jblast.report.figure_files import write_figure

    with writing(file):
        write_figure(figure, file)


def add_free(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--free`."""
    verb.add_argument(
        "--free",
        metavar="PARAMETER,...",
        default="",
        help="these are not known either, and have no prior: some of "
        f"{', '.join(PARAMETERS)}; of one of several charges charge_mass_kg.NAME and "
        "so on; of a clock clock_offset_s.NAME",
    )


def names_to_free(words: str) -> list[str]:
    """Return the names after `--free`, which stand between commas."""
    return [name.strip() for name in words.split(",") if name.strip()]


def add_law(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--law` (`sensors.law_choice.laws_named` reads it)."""
    verb.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="auto|NAME|QUANTITY=NAME",
        help="law for all it gives, or for one quantity; may be repeated",
    )


def add_noise(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--noise`."""
    verb.add_argument(
        "--noise",
        choices=("student", "gaussian"),
        default="student",
        help="distribution of the independent errors (default: student)",
    )


def given(asked: argparse.Namespace, **arguments: str) -> dict[str, Any]:
    """Return the arguments of options that are given; others have library defaults.

    Args:
        asked: The options.
        arguments: Name of the library's argument, by option.
    """
    values = {name: getattr(asked, option) for option, name in arguments.items()}
    return {name: value for name, value in values.items() if value is not None}


def option_for(argument: str) -> str:
    """Return how the command line calls an argument that a message names."""
    return OTHERWISE.get(argument, f"--{argument.replace('_', '-')}")


def in_options(error: InputError) -> InputError:
    """Return an error in the words of the command line."""
    return InputError(error.worded(option_for))


def add_reading(verb: argparse.ArgumentParser) -> None:
    """Let a verb take the options of `jblast.read`."""
    verb.add_argument(
        "--strict",
        action="store_true",
        help="take a log in our own columns, units and commas alone",
    )
    verb.add_argument(
        "--wide",
        action="store_true",
        help="the log has a column for each quantity, as peak_overpressure_kpa, beside "
        "it perhaps sigma_peak_overpressure_kpa",
    )
    verb.add_argument(
        "--date",
        metavar="YYYY-MM-DD",
        help="day of the times in value_utc that have none, in their zone",
    )
    verb.add_argument(
        "--zone",
        metavar="ZONE",
        help="zone of the times in value_utc that have none: +02:00, UTC, Asia/Beirut",
    )


def reading_words(asked: argparse.Namespace) -> str:
    """Return the options of reading as they were typed, to be typed again."""
    said = "".join(f" --{name}" for name in ("strict", "wide") if getattr(asked, name))
    options = {name: getattr(asked, name) for name in ("date", "zone")}
    return said + "".join(f" --{name} {word}" for name, word in options.items() if word)


def reading_asked(asked: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `add_reading` as arguments of `jblast.read`."""
    return {name: getattr(asked, name) for name in ("strict", "wide", "date", "zone")}


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
