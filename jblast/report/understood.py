"""The interpretation of a log, in words."""

from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path

import jblast
from jblast.observations import Observations, table
from jblast.observations.table import Understood
from jblast.report.words import joined

MAX_NAMED = 5
"""Largest number of lines, or names, that a sentence lists."""
WAYS = {"CSV": "text"}


def conversion_comments(log: Observations) -> list[str]:
    """Return provenance: where a log comes from, and what was understood of it."""
    lines = [f"converted from {Path(log.source).name} by jblast {jblast.__version__}"]
    lines += understood_lines(log.understood)
    return [" ".join(line.split()) for line in lines]


def conversion_text(log: Observations, out: str) -> str:
    """Return what was written where, and what was done, for the terminal."""
    rows = "1 measurement" if len(log) == 1 else f"{len(log):,} measurements"
    done = understood_lines(log.understood) or ["nothing had to be converted"]
    return "".join(f"{line}\n" for line in (f"wrote {out}: {rows}", *done))


def understood_lines(understood: Sequence[Understood]) -> list[str]:
    """Return a sentence for each thing that was not as we write it."""
    return [understood_words(found) for found in understood]


@singledispatch
def understood_words(found: Understood) -> str:
    """Say what was converted, skipped or supplied."""
    raise NotImplementedError(type(found).__name__)


@understood_words.register
def _(found: table.Dialect) -> str:
    parts = []
    if found.separator:
        parts.append(f"fields separated by {_separator(found.separator)}")
    if found.encoding:
        parts.append(found.encoding)
    if found.sheet:
        parts.append(f"sheet {found.sheet!r}")
    named = WAYS.get(found.format, found.format)
    return f"read as {named}" + (f": {', '.join(parts)}" if parts else "")


@understood_words.register
def _(found: table.DecimalComma) -> str:
    return f"numbers have a decimal comma, as {found.text} in line {found.line} shows"


@understood_words.register
def _(found: table.Renamed) -> str:
    return f"{found.theirs} was taken for {found.ours}"


@understood_words.register
def _(found: table.Converted) -> str:
    if found.unit == "percent":
        return f"{found.theirs}: per cent of each value ({_rows(found.rows)})"
    ours = "SI" if found.ours in ("value", "sigma") else found.ours
    return (
        f"{found.theirs} was converted to {ours}: times {found.factor:.9g} "
        f"({_rows(found.rows)})"
    )


@understood_words.register
def _(found: table.LevelConverted) -> str:
    if found.theirs.lower().startswith("sigma"):
        return (
            f"{found.theirs}: 1 dB is ln(10)/20 = 11.5 % of each value "
            f"({_rows(found.rows)})"
        )
    return (
        f"{found.theirs} was converted to peak_overpressure_pa: 20 uPa times "
        f"10^(dB/20), its sigma of 1 dB is ln(10)/20 = 11.5 % ({_rows(found.rows)})"
    )


@understood_words.register
def _(found: table.ClockTimesTaken) -> str:
    parts = []
    if found.undated:
        parts.append(
            f"times of day taken to be of {found.date} ({_rows(found.undated)})"
        )
    if found.unzoned:
        parts.append(
            f"times without a zone taken in {found.zone} ({_rows(found.unzoned)})"
        )
    if found.moved:
        parts.append(f"times with an offset turned into UTC ({_rows(found.moved)})")
    return f"value_utc: {'; '.join(parts)}"


@understood_words.register
def _(found: table.EmptySkipped) -> str:
    n = len(found.lines)
    which = [str(line) for line in found.lines[:MAX_NAMED]]
    more = [f"{n - MAX_NAMED} more"] if n > MAX_NAMED else []
    lines = "line" if n == 1 else "lines"
    return f"{_rows(n)} without a value left out: {lines} {joined([*which, *more])}"


@understood_words.register
def _(_: table.HeightTaken) -> str:
    return "no column up_m: sensors taken to stand at up = 0"


@understood_words.register
def _(found: table.ColumnsIgnored) -> str:
    columns = "column" if len(found.names) == 1 else "columns"
    return f"{columns} {joined(list(found.names))} left aside as notes"


@understood_words.register
def _(found: table.UnitsRow) -> str:
    return f"line {found.line} was read as the units of the columns"


@understood_words.register
def _(found: table.MadeLong) -> str:
    text = f"a wide table, a column for each of {joined(list(found.quantities))}"
    if found.shares:
        text += f"; errors of {joined(list(found.shares))} per cent of each value"
    if found.without_sigma:
        text += (
            f"; without a column of errors for {joined(list(found.without_sigma))}: "
            "the law's scatter alone"
        )
    return text


def _separator(name: str) -> str:
    return f"{name}s" if name in ("semicolon", "tab") else repr(name)


def _rows(n: int) -> str:
    return f"{n:,} row" if n == 1 else f"{n:,} rows"
