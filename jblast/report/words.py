"""Words, numbers and tables of all reports."""

import csv
import io
import math
import textwrap
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from jblast.parameters import described
from jblast.quantities import UNITS, quantity_named, unit_suffix
from jblast.registry import law_words as law_words
from jblast.units import si_factor

GAP = 2
"""Spaces between two columns on a terminal."""
Rows = Sequence[Sequence[str]]
System = Literal["si", "us"]
"""System of printed units: SI, or feet, pounds and pounds per square inch."""
CUSTOMARY = {
    "_kg": ((0.0, "lb"),),
    "_m": ((0.0, "in"), (0.1, "ft")),
    "_m_s": ((0.0, "in_s"), (0.3, "ft_s")),
    "_pa": ((0.0, "psi"),),
    "_pa_s": ((0.0, "psi_ms"),),
}
"""As `LADDERS`, for US customary units. Other units are the same in both systems."""
SYMBOLS: dict[str, str] = {"in_s": "in/s", "ft_s": "ft/s", "psi_ms": "psi ms"}
WIDTH = 96
"""Width of printed text [characters]: the range of validity of most laws fits."""


def aligned(
    rows: Rows, *, right: Collection[int] = (), least: Sequence[int] = ()
) -> list[str]:
    """Return the lines of a table whose columns are as wide as their widest cell.

    Args:
        rows: Cells; every row has the same number.
        right: Columns, counted from 0, that are aligned right.
        least: Least widths of the first columns [characters].
    """
    if not rows:
        return []
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths[: len(least)] = map(max, widths, least)
    lines = []
    for row in rows:
        cells = (
            cell.rjust(width) if number in right else cell.ljust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        lines.append((" " * GAP).join(cells).rstrip())
    return lines


def markdown(head: Sequence[str], rows: Rows, *, right: Collection[int] = ()) -> str:
    """Return a Markdown table, without the line end of its last row.

    Args:
        head: Titles of the columns.
        rows: Cells; every row has the same number. Bars in cells are escaped.
        right: Columns, counted from 0, that are aligned right.
    """
    rules = ["---:" if number in right else "---" for number in range(len(head))]
    titles = "|".join(f" {title} " if title else " " for title in head)
    lines = [f"|{titles}|", f"|{'|'.join(rules)}|"]
    for row in rows:
        cells = (cell.replace("|", r"\|") for cell in row)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def commented(comments: Iterable[str]) -> str:
    """Return comments as lines that precede a CSV table."""
    # a line break in a comment would begin a row of the table
    return "".join(f"# {' '.join(line.split())}\n" for line in comments)


def comma_separated(rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as CSV; the first holds the names of the columns."""
    text = io.StringIO()
    # the default of csv is CR LF on all systems
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


@dataclass(frozen=True)
class Unit:
    """A unit: printed symbol, and its size in SI."""

    symbol: str
    size: float


LADDERS = {
    "_kg": ((0.0, Unit("g", 1e-3)), (0.1, Unit("kg", 1.0)), (1e6, Unit("kt", 1e6))),
    "_m": (
        (0.0, Unit("nm", 1e-9)),
        (1e-7, Unit("µm", 1e-6)),
        (1e-4, Unit("mm", 1e-3)),
        (0.1, Unit("m", 1.0)),
        (1e4, Unit("km", 1e3)),
    ),
    "_s": ((0.0, Unit("µs", 1e-6)), (1e-3, Unit("ms", 1e-3)), (1.0, Unit("s", 1.0))),
    "_m_s": (
        (0.0, Unit("µm/s", 1e-6)),
        (1e-4, Unit("mm/s", 1e-3)),
        (0.1, Unit("m/s", 1.0)),
    ),
    "_pa": ((0.0, Unit("Pa", 1.0)), (1e3, Unit("kPa", 1e3)), (1e6, Unit("MPa", 1e6))),
    "_pa_s": ((0.0, Unit("Pa s", 1.0)), (1e4, Unit("kPa s", 1e3))),
    "_j": (
        (0.0, Unit("J", 1.0)),
        (1e3, Unit("kJ", 1e3)),
        (1e6, Unit("MJ", 1e6)),
        (1e9, Unit("GJ", 1e9)),
        (1e12, Unit("TJ", 1e12)),
    ),
    "_rad": ((0.0, Unit("mrad", 1e-3)), (0.1, Unit("rad", 1.0))),
}
"""Units of a suffix, each with the least value in SI that is printed in it; other
suffixes have the SI unit alone."""


def finite(number: Any) -> float | None:
    """Return a number as a float, None where it is null, NaN or infinite."""
    return None if number is None or not math.isfinite(number) else float(number)


def unit_for(name: str, *numbers: float | None, system: System = "si") -> Unit:
    """Return the unit for numbers of one parameter or quantity, by the largest."""
    suffix = split_name(name)[1]
    ladder = LADDERS.get(suffix) or ((0.0, Unit(UNITS[suffix], 1.0)),)
    if system == "us" and suffix in CUSTOMARY:
        ladder = tuple(
            (start, Unit(SYMBOLS.get(ending) or ending, si_factor(ending)))
            for start, ending in CUSTOMARY[suffix]
        )
    largest = max((abs(n) for n in numbers if n is not None), default=0.0)
    # 0 has no magnitude to choose a unit by: SI
    if largest == 0.0:
        return next((u for _, u in ladder if u.size == 1.0), ladder[-1][1])
    return [unit for start, unit in ladder if largest >= start][-1]


def rounded(number: float, sd: float) -> str:
    """Return a number rounded to two digits of its standard deviation."""
    # rounded first, as 0.0996 is printed as 0.10 and so needs one decimal fewer
    two_digits = float(f"{sd:.1e}")
    decimals = 1 - math.floor(math.log10(two_digits)) if sd > 0.0 else 12
    decimals = min(decimals, 12)
    # zeros in place of the rounded digits would make it hard to read
    if decimals < 0 and abs(number) >= 1e7:
        digits = math.floor(math.log10(abs(number))) + decimals
        return scientific(number, max(digits, 1))
    text = f"{round(number, decimals):.{max(decimals, 0)}f}"
    # a small negative number rounds to -0
    return text.lstrip("-") if float(text) == 0.0 else text


def significant(number: float, digits: int = 2) -> str:
    """Return a number with some significant digits."""
    if number == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(number)))
    if not -4 <= exponent < 7:
        return scientific(number, digits - 1)
    decimals = digits - 1 - exponent
    # round also rounds to tens and hundreds, which a format does not
    return f"{round(number, decimals):.{max(decimals, 0)}f}"


def scientific(number: float, decimals: int) -> str:
    """Return a number as 2.1e7 rather than 2.1e+07."""
    mantissa, _, exponent = f"{number:.{decimals}e}".partition("e")
    # int drops the plus sign and the leading zero
    return f"{mantissa}e{int(exponent)}"


def printed_number(
    name: str, value: float | int, digits: int = 4, system: System = "si"
) -> str:
    """Return a number of unknown uncertainty with its unit."""
    value = float(value)
    unit = unit_for(name, value, system=system)
    text = significant(value / unit.size, digits)
    # trailing zeros would claim an accuracy that is not known
    if "." in text and "e" not in text:
        text = text.rstrip("0").rstrip(".")
    return f"{text} {unit.symbol}".rstrip()


def hanging(text: str, column: int = 0, indent: int = 2) -> list[str]:
    """Break a text into lines; all but the first are indented by `column` more."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + column),
        break_on_hyphens=False,
    ) or [""]


def behind(start: str, text: str) -> list[str]:
    """Break a text after a start into lines; later lines are aligned with the first."""
    # a no-break space keeps a number and its unit on one line
    for unit in (" m/kg", " ft/lb", " %", " kg", " m "):
        text = text.replace(unit, "\xa0" + unit[1:])
    lines = textwrap.wrap(
        text,
        WIDTH,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_on_hyphens=False,
    )
    return [line.replace("\xa0", " ") for line in lines] or [start]


def split_name(name: str) -> tuple[str, str, str]:
    """Split a parameter's name: `clock_offset_s.B` is ("clock_offset", "_s", "B")."""
    stem, _, label = name.partition(".")
    suffix = unit_suffix(stem)
    return stem.removesuffix(suffix), suffix, label


def parameter_words(name: str) -> str:
    """Return a parameter's name as words; an unknown one loses unit and underscores."""
    known, (stem, _, label) = described(name), split_name(name)
    words = known.words if known else stem.replace("_", " ")
    return f"{words} of {label}" if label else words


def quantity_words(quantity: str) -> str:
    """Return a quantity's name as words."""
    known = quantity_named(quantity)
    return known.words if known else split_name(quantity)[0].replace("_", " ")


def joined(parts: Sequence[str]) -> str:
    """Join words as a sentence does: "a, b and c"."""
    if len(parts) < 2:
        return "".join(parts)
    return ", ".join(parts[:-1]) + " and " + parts[-1]


def capitalised(sentence: str) -> str:
    """Return a sentence with its first letter large and the rest untouched."""
    return sentence[:1].upper() + sentence[1:]
