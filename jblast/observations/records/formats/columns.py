"""Columns of samples by their names: which is time, which pressure, in which unit."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from jblast.errors import InputError, shown
from jblast.observations.records.formats.scale import (
    plain_unit,
    pressure_factor,
    time_factor,
    volts_factor,
)

IGNORED = ("note", "comment", "index", "sample", "number", "n", "")
"""Words that a column which holds no measurement begins with, or is."""


class SampleColumns(NamedTuple):
    """What the columns of a table of samples hold.

    Attributes:
        time: Which column the times stand in.
        seconds: Seconds a unit of them.
        pressures: Which columns hold pressure, or volts.
        units: Of each of these, as it is written.
        left_out: Names of columns that hold neither.
    """

    time: int
    seconds: float
    pressures: tuple[int, ...]
    units: tuple[str, ...]
    left_out: tuple[str, ...]


def columns_of(names: list[str], where: str) -> SampleColumns:
    """Return what columns hold, by the units that their names end in.

    Args:
        names: `time_ms`, `Pressure (kPa)`, `ch1_mV`, in any order.
        where: The file and line of the names, for messages.

    Raises:
        InputError: There is not one column of time, or none of pressure; one has no
            unit, or two have one word and two units.
    """
    times: list[tuple[int, float]] = []
    pressures: list[tuple[int, str]] = []
    left_out: list[str] = []
    for number, name in enumerate(names):
        word, unit = word_and_unit(name)
        seconds = time_factor(unit)
        if seconds is not None:
            times.append((number, seconds))
        elif pressure_factor(unit) is not None or volts_factor(unit) is not None:
            pressures.append((number, unit))
        elif re.search(r"(^|[\s_])(date|utc|timestamp)\b", name.lower()):
            raise InputError(
                f"{where}, column {name}: expected seconds or milliseconds since any "
                "moment, as time_s or time_ms, got times of day; when the first sample "
                "was stands in the column start_utc of the table of stations"
            )
        elif re.match(r"(elapsed|time|t)\b", word.lower()) and not unit:
            raise InputError(
                f"{where}, column {name}: expected a unit of time in its name, as in "
                "time_s or time_ms, got none"
            )
        elif word.lower().startswith("pressure") or "overpressure" in word.lower():
            raise InputError(
                f"{where}, column {name}: expected a unit of pressure in its name, as "
                f"in pressure_kpa, got {unit or 'none'}"
            )
        else:
            left_out.append(name)
    if len(times) != 1:
        got = ", ".join(names[at] for at, _ in times) or shown(", ".join(names))
        log = "sensor" in (name.strip().lower() for name in names)
        raise InputError(
            f"{where}: expected one column of time, as time_s or time_ms, got {got}"
            + ("; this is a log, which jblast fit takes" if log else "")
        )
    if not pressures:
        raise InputError(
            f"{where}: expected a column of pressure, as pressure_kpa, or of volts, "
            f"got {shown(', '.join(names))}"
        )
    refuse_two_units([(names[at], unit) for at, unit in pressures], f"{where}, columns")
    return SampleColumns(
        *times[0],
        tuple(at for at, _ in pressures),
        tuple(unit for _, unit in pressures),
        tuple(n for n in left_out if n.split("_")[0].lower() not in IGNORED),
    )


def refuse_two_units(pressures: Iterable[tuple[str, str]], where: str) -> None:
    """Refuse one channel in two units: it is no second one.

    Args:
        pressures: Names of channels with their units, as they are written.
        where: The file, and what the names are of, for messages.

    Raises:
        InputError: Two have one word and two units.
    """
    seen: dict[str, tuple[str, str]] = {}
    for name, unit in pressures:
        first, before = seen.setdefault(
            plain_unit(word_and_unit(name)[0]), (name, unit)
        )
        if plain_unit(before) != plain_unit(unit):
            raise InputError(
                f"{where} {first} and {name}: expected one unit for one channel, got "
                f"{before} and {unit}; keep one of them, or give two channels two names"
            )


def word_and_unit(name: str) -> tuple[str, str]:
    """Take a name apart: `Pressure (kPa)` or `pressure_kpa` into word and unit.

    The unit is "" where the name ends in none that we know; a name may be a unit alone.
    """
    bracketed = re.fullmatch(r"\s*(.*?)[\s_]*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*", name)
    if bracketed:
        return bracketed[1], bracketed[2]
    parts = re.split(r"[\s_]+", name.strip())
    unit = parts[-1]
    if any(known(unit) is not None for known in (time_factor, pressure_factor)):
        return " ".join(parts[:-1]), unit
    if volts_factor(unit) is not None:
        return " ".join(parts[:-1]), unit
    return " ".join(parts), ""
