"""The interpretation of a log, as sentences."""

from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path

import jblast
from jblast.observations import Observations, table
from jblast.observations.table import Understood
from jblast.report.words import joined

MAX_NAMED = 5
"""Largest number of lines, or names, that a sentence lists."""
FORMAT_NAMES = {"CSV": "text"}
"""Names of formats in a sentence; the others have their own names."""
TEMPLATES: dict[type[Understood], str] = {
    table.DecimalComma: "decimal commas, as in {0.text} (line {0.line})",
    table.HeightTaken: "no column up_m: sensors assumed at up = 0",
    table.Renamed: "{0.theirs} was read as {0.ours}",
    table.UnitsRow: "line {0.line} was read as the units of the columns",
}
"""Sentences with fields of a conversion only; the others have a function."""


def conversion_comments(log: Observations) -> list[str]:
    """Return the provenance of a converted log: its source, and the conversions."""
    lines = [f"converted from {Path(log.source).name} by jblast {jblast.__version__}"]
    lines += understood_lines(log.understood)
    return [" ".join(line.split()) for line in lines]


def conversion_text(log: Observations, out: str) -> str:
    """Return the output file and the conversions, for the terminal."""
    rows = "1 measurement" if len(log) == 1 else f"{len(log):,} measurements"
    done = understood_lines(log.understood) or ["no conversion was necessary"]
    return "".join(f"{line}\n" for line in (f"wrote {out}: {rows}", *done))


def understood_lines(understood: Sequence[Understood]) -> list[str]:
    """Return a sentence for each conversion of a log."""
    return [understood_words(found) for found in understood]


@singledispatch
def understood_words(found: Understood) -> str:
    """Return a sentence on a conversion, an omission or a default."""
    if type(found) not in TEMPLATES:
        raise NotImplementedError(type(found).__name__)
    return TEMPLATES[type(found)].format(found)


@understood_words.register
def _(found: table.Dialect) -> str:
    parts = []
    if found.separator:
        plural = f"{found.separator}s"
        by = plural if plural in ("semicolons", "tabs") else repr(found.separator)
        parts.append(f"fields separated by {by}")
    if found.encoding:
        parts.append(found.encoding)
    if found.sheet:
        parts.append(f"sheet {found.sheet!r}")
    named = FORMAT_NAMES.get(found.format, found.format)
    return f"read as {named}" + (f": {', '.join(parts)}" if parts else "")


@understood_words.register
def _(found: table.LongitudesWrapped) -> str:
    return f"lon_deg above 180 was read as west: less 360 ({_rows(found.rows)})"


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
        f"10^(dB/20); a sigma of 1 dB is ln(10)/20 = 11.5 % ({_rows(found.rows)})"
    )


@understood_words.register
def _(found: table.ClockTimesTaken) -> str:
    parts = []
    if found.undated:
        parts.append(f"times of day read as of {found.date} ({_rows(found.undated)})")
    if found.unzoned:
        parts.append(
            f"times without a zone read as {found.zone} ({_rows(found.unzoned)})"
        )
    if found.moved:
        parts.append(f"times with an offset converted to UTC ({_rows(found.moved)})")
    return f"value_utc: {'; '.join(parts)}"


@understood_words.register
def _(found: table.EmptySkipped) -> str:
    n = len(found.lines)
    which = [str(line) for line in found.lines[:MAX_NAMED]]
    more = [f"{n - MAX_NAMED} more"] if n > MAX_NAMED else []
    lines = "line" if n == 1 else "lines"
    return f"{_rows(n)} without a value left out: {lines} {joined([*which, *more])}"


@understood_words.register
def _(found: table.ColumnsIgnored) -> str:
    columns = "column" if len(found.names) == 1 else "columns"
    return f"{columns} {joined(list(found.names))} ignored"


@understood_words.register
def _(found: table.MadeLong) -> str:
    text = f"a wide table, a column for each of {joined(list(found.quantities))}"
    if found.shares:
        text += f"; errors of {joined(list(found.shares))} are per cent of each value"
    if found.without_sigma:
        text += (
            f"; no column of errors for {joined(list(found.without_sigma))}: only the "
            "law's scatter is used"
        )
    return text


def _rows(n: int) -> str:
    return f"{n:,} row" if n == 1 else f"{n:,} rows"
