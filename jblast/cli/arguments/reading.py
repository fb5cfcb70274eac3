"""How a log is read: the options of all verbs that take one."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jblast.errors import InputError
    from jblast.observations import Observations


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
    file: str, asked: argparse.Namespace, faults: "list[InputError] | None" = None
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
