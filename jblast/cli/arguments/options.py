"""Options that several verbs share, and the functions that read their values.

Paths and output files, `--free`, `--law`, `--noise`, the options for reading a log, and
`--live`. `option_for` translates an argument of a Python function to its option in
messages. JAX is imported inside functions only: --help does not wait for it.
"""

import argparse
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive
from jblast.errors import InputError, nearest
from jblast.files import write_text
from jblast.parameters import PARAMETERS
from jblast.quantities import QUANTITIES
from jblast.registry import LAWS, names, names_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jblast.observations import Observations

FIGURES = (".png", ".svg", ".pdf")
"""What a name of a figure may end in."""
EVENT_FILES = (".h5", ".hdf5", ".npz", ".raw", ".aedat4")
"""Suffixes of `sensors.camera.files.event_files.EVENT_FORMATS`, without its imports."""
OTHERWISE = {
    "freed": "--free",
    "states": "--state",
    "inputs": "--input",
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


def path(text: str) -> str:
    """Return the path an argument holds; an empty one is an unset shell variable.

    Raises:
        ArgumentTypeError: It is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a path, got {text!r}")
    return text


def refuse_existing(path: str | Path, *, force: bool) -> None:
    """Raise InputError if a file is there already and may not be overwritten."""
    if Path(path).exists() and not force:
        raise InputError(
            f"{path}: exists already; expected a new file, or --force to overwrite it"
        )


def check_figure(option: str, file: str, *, force: bool) -> None:
    """Refuse a figure that cannot be drawn, before anything is computed.

    Raises:
        InputError: It is of no kind we draw, or exists already.
    """
    if Path(file).suffix.lower() not in FIGURES:
        raise InputError(f"{option} {file}: expected a name in {', '.join(FIGURES)}")
    refuse_existing(file, force=force)


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Say in one line that a file or directory cannot be written, if it cannot.

    Raises:
        InputError: What is done inside raises an OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"{path}: cannot be written ({reason}); expected a place to write to"
        ) from None


def save_text(text: str, file: str | Path) -> None:
    """Write text.

    Raises:
        InputError: It cannot be written.
    """
    with writing(file):
        write_text(file, text)


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
    """Let a verb take `--law` (`chosen_laws` reads it)."""
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


def option_for(argument: str) -> str:
    """Return how the command line calls an argument that a message names."""
    return OTHERWISE.get(argument, f"--{argument.replace('_', '-')}")


def in_options(error: InputError) -> InputError:
    """Return an error in the words of the command line."""
    return InputError(error.worded(option_for))


def chosen_laws(words: Sequence[str], quantities: Collection[str]) -> dict[str, str]:
    """Turn the words after `--law` into a law for each quantity; later words win.

    Args:
        words: What stood after each `--law`.
        quantities: What the log holds: a word that concerns none of it is refused.

    Raises:
        InputError: There is no such quantity or law, the law does not give it, or the
            log does not hold it.
    """
    import jblast.waves as _waves  # noqa: F401  laws enter the registry
    from jblast.sensors.layout import components

    needed = {part for quantity in quantities for part, _ in components(quantity)}
    chosen: dict[str, str] = {}
    for word in (part.strip() for item in words for part in item.split(",")):
        quantity, equals, name = word.rpartition("=")
        given = _for_one(word, quantity, name) if equals else _for_all(word)
        if not needed & given.keys():
            raise InputError(
                f"--law {word}: expected a law for something the log holds "
                f"({', '.join(sorted(needed))}), got one for "
                f"{', '.join(sorted(given))}"
            )
        chosen |= given
    return chosen


def _for_one(word: str, quantity: str, name: str) -> dict[str, str]:
    """Return the law of QUANTITY=NAME."""
    from jblast.sensors.layout import components

    if quantity not in QUANTITIES:
        raise InputError(
            f"--law {word}: expected a quantity before '=', got {quantity!r}"
            f"{nearest(quantity, QUANTITIES)}"
        )
    parts = [part for part, _ in components(quantity)]
    if parts != [quantity]:
        raise InputError(
            f"--law {word}: {quantity} is made of {' and '.join(parts)}; "
            "expected a law for one of these"
        )
    if name != "auto" and name not in names_for(quantity):
        if _waits(name):
            raise InputError(f"--law {word}: {name} is not supported yet")
        raise InputError(
            f"--law {word}: expected auto or one of "
            f"{', '.join(names_for(quantity)) or '(none yet)'}, got {name!r}"
            f"{nearest(name, names_for(quantity))}"
        )
    return {quantity: name}


def _for_all(name: str) -> dict[str, str]:
    """Return the law of NAME for every quantity it gives."""
    if name == "auto":
        return dict.fromkeys(QUANTITIES, "auto")
    if name in names():
        return {quantity: law for quantity, law in LAWS if law == name}
    if _waits(name):
        raise InputError(f"--law {name}: {name} is not supported yet")
    raise InputError(
        f"--law {name}: expected auto, NAME or QUANTITY=NAME with NAME one of "
        f"{', '.join(names())}, got {name!r}{nearest(name, names())}"
    )


def _waits(name: str) -> bool:
    """Return whether a law is of the contract and not built yet."""
    from jblast.scene.reader.tables import LAW_NAMES_LATER

    return name in LAW_NAMES_LATER and name not in names()


def add_reading(verb: argparse.ArgumentParser) -> None:
    """Let a verb take the options that `read_asked` heeds."""
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


def read_asked(
    file: str, asked: argparse.Namespace, faults: list[InputError] | None = None
) -> "Observations":
    """Read a log as asked for.

    Args:
        file: The log.
        asked: What `add_reading` added.
        faults: As `jblast.observations.read` takes it.

    Raises:
        InputError: It cannot be read.
    """
    from jblast.observations import read

    return read(
        file,
        strict=asked.strict,
        wide=asked.wide,
        faults=faults,
        date=asked.date,
        zone=asked.zone,
    )


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
