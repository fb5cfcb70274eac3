"""Options that several verbs share, and the functions that read their values.

Paths and output files, `--free`, `--law`, `--noise`, and the options for reading a log.
`option_for` translates an argument of a Python function to its option in
messages. JAX is imported inside functions only, so that `--help` does not load it.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import refuse_existing, writing
from jblast.parameters import PARAMETERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOT_FOUND, DOUBTFUL = 3, 4
"""Exit codes: nothing found; computed, but with a warning about the result."""
FIGURES = (".png", ".svg", ".pdf")
"""Suffixes of figures."""
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
    "recording": "RECORDING.wav",
    "false_alarms_per_hour": "--false-alarms",
    "moment_point_m": "moment_point_m (--profile-moments-about X,Y,Z)",
}
"""Options of Python arguments with another name."""


def path(text: str) -> str:
    """Return the path in an argument.

    Raises:
        ArgumentTypeError: The path is empty, as from an unset variable of the shell.
    """
    # An empty path would be the current folder, which --force may overwrite.
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a path, got {text!r}")
    return text


def check_figure(option: str, file: str, *, force: bool) -> None:
    """Check before the work that a figure can be written.

    Raises:
        InputError: The suffix is none of `FIGURES`, or the file exists.
    """
    if Path(file).suffix.lower() not in FIGURES:
        raise InputError(f"{option} {file}: expected a name in {', '.join(FIGURES)}")
    refuse_existing(file, force=force)


def save_figure(figure: "Figure", file: str | Path) -> None:
    """Write a Matplotlib figure.

    Raises:
        InputError: The file cannot be written.
    """
    # Imported here, as Matplotlib takes a second and few commands draw.
    from jblast.report.figures import write_figure

    with writing(file):
        write_figure(figure, file)


def add_free(verb: VerbParser) -> None:
    """Add `--free`."""
    verb.model.add_argument(
        "--free",
        metavar="PARAMETER,...",
        default="",
        help="parameters to fit without a prior (default: those of the scene): some of "
        f"{', '.join(PARAMETERS)}; with several charges charge_mass_kg.NAME and so on; "
        "for a clock clock_offset_s.NAME",
    )


def names_between_commas(words: str) -> list[str]:
    """Return the names in a list with commas, as of `--free`."""
    return [name.strip() for name in words.split(",") if name.strip()]


def add_law(verb: VerbParser) -> None:
    """Add `--law`, which `sensors.law_choice.laws_named` reads."""
    verb.model.add_argument(
        "--law",
        # argparse copies the list before it appends, so that commands in one process do
        # not share it.
        action="append",
        default=[],
        metavar="auto|NAME|QUANTITY=NAME",
        help="law for all of its quantities, or for one quantity; repeatable (default: "
        "as in the scene)",
    )


def add_noise(verb: VerbParser) -> None:
    """Add `--noise`."""
    verb.advanced.add_argument(
        "--noise",
        choices=("student", "gaussian"),
        default="student",
        help="distribution of the independent errors (default: student)",
    )


def given(options: argparse.Namespace, **arguments: str) -> dict[str, Any]:
    """Return the library arguments of the options that are given.

    Args:
        options: Options; None means that the library's default applies.
        arguments: Name of the library's argument, by option.
    """
    values = {name: getattr(options, option) for option, name in arguments.items()}
    return {name: value for name, value in values.items() if value is not None}


def option_for(argument: str) -> str:
    """Return the option of a Python argument that a message names."""
    return OTHERWISE.get(argument, f"--{argument.replace('_', '-')}")


def in_options(error: InputError) -> InputError:
    """Return an error whose message names options instead of Python arguments."""
    return InputError(error.worded(option_for), row=error.row, line=error.line)


def add_reading(verb: VerbParser) -> None:
    """Add the options of `jblast.read`."""
    verb.inputs.add_argument(
        "--wide",
        action="store_true",
        help="wide log: one column for each quantity, such as peak_overpressure_kpa, "
        "optionally with sigma_peak_overpressure_kpa",
    )
    verb.inputs.add_argument(
        "--date",
        metavar="YYYY-MM-DD",
        help="date of the times in value_utc that have none, in their zone",
    )
    verb.inputs.add_argument(
        "--zone",
        metavar="ZONE",
        help="time zone of the times in value_utc that have none: +02:00, UTC, "
        "Asia/Beirut",
    )


def add_json(
    verb: VerbParser, content: str = "answer as JSON, instead of text"
) -> None:
    """Add `--json`."""
    verb.outputs.add_argument("--json", action="store_true", help=content)


def add_force(verb: VerbParser, files: str = "existing files in --out") -> None:
    """Add `--force`, which allows to overwrite `files`."""
    verb.outputs.add_argument(
        "--force", action="store_true", help=f"permission to overwrite {files}"
    )


def reading_words(options: argparse.Namespace) -> str:
    """Return the options of `add_reading` as text for another command line."""
    # The next command must read the log in the same way, or it finds other columns.
    flags = [" --wide"] if options.wide else []
    values = {name: getattr(options, name) for name in ("date", "zone")}
    return "".join([*flags, *(f" --{name} {v}" for name, v in values.items() if v)])


def reading_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `add_reading` as arguments of `jblast.read`."""
    return {name: getattr(options, name) for name in ("date", "wide", "zone")}
