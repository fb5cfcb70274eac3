"""Columns of a table as numbers, and rules for its rows.

A rule has the rows that violate it and the expected content. Its faults name the line,
the column, what was expected and what was found.
"""

import math
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, foreign_digits, shown
from jblast.observations.names import Header
from jblast.observations.table import DEGREES, NUMBERS
from jblast.observations.text_table import Table, number_of
from jblast.units import ANY, in_si

DMS = re.compile(
    r"""(?P<before>[NSEW])?\s*(?P<deg>\d{1,3}(?:[.,]\d+)?)\s*[°º]\s*
    (?:(?P<min>\d{1,2}(?:[.,]\d+)?)\s*['′’]\s*)?
    (?:(?P<sec>\d{1,2}(?:[.,]\d+)?)\s*(?:["″”]|''|′′)\s*)?(?P<after>[NSEW])?""",
    re.VERBOSE,
)
"""A latitude or longitude in degrees, minutes and seconds, with its hemisphere."""
ADVICE = {
    r"\d{4}-\d{2}-\d{2}.*": ", a date, into which spreadsheets convert 3.5 or 1-2",
    r"\d{1,2}:\d{2}.*": "; a time of day belongs in column value_utc",
    r"[+-]?\d{1,3}(?:[\s'\u2019]\d{3})+(?:[.,]\d+)?": "; write it without marks "
    "between thousands",
    r"[+-]?\d[\d.,]*(?:[eE][+-]?\d+)?\s*[%A-Za-zµ°].*": "; a unit belongs in the name "
    "of the column or quantity",
    r".*,.*": "; write a decimal point",
}
"""Advice by the form of text that is no number."""
DEGREES_ADVICE = (
    "; write decimal degrees, south and west below 0, or degrees, minutes and seconds "
    "with the hemisphere, as 48°12'00.3\"N"
)


class Rule(NamedTuple):
    """A requirement of the rows of a table.

    Attributes:
        column: Our name of the column that a fault names; "" for the whole row.
        bad: True for rows that violate it.
        message: Expected content, with the fields {quantity} and {got}, the text of the
            column, of which the latter follows if "got" is not in it; or a function of
            a row that returns the whole message.
    """

    column: str
    bad: Bool[np.ndarray, " row"] | Sequence[bool]
    message: str | Callable[[int], str]


class Rows:
    """The body of a table by column, as text, and its faults.

    Attributes:
        texts: Fields by our column.
        lines: Line of each row.
        units: Of columns that are in another unit than ours.
        sound: True for rows without a fault so far.
        faults: Faults found.
    """

    def __init__(self, table: Table, header: Header):
        self.table, self.lines, self.faults = table, table.lines, table.faults
        self.texts = dict(zip(table.header, table.columns, strict=True))
        self.theirs = {name: theirs for name, (theirs, _) in header.items()}
        self.units = {name: unit for name, (_, unit) in header.items() if unit}
        self.sound = np.ones(len(self.lines), bool)

    def text(self, column: str) -> list[str]:
        """Return a column of text; "" if the table has no such column."""
        return self.texts.get(column) or [""] * len(self.lines)

    def given(self, column: str) -> Bool[np.ndarray, " row"]:
        """Return True where a column is not empty."""
        return np.array([bool(text) for text in self.text(column)], bool)

    def number(self, column: str) -> Float[np.ndarray, " row"]:
        """Return a column of finite numbers; NaN where it is empty.

        Numbers are in our unit, except in `value` and `sigma`, whose rows may have
        different units. Latitudes and longitudes may be in degrees, minutes, seconds.
        """
        if column not in self.texts:
            return np.full(len(self.lines), np.nan)
        texts = self.texts[column]
        read, joined = (
            degrees_of if column in DEGREES[:2] else number_of,
            "".join(texts),
        )
        try:
            # columns of plain numbers, the usual case, need no further check per field
            if "_" in joined or foreign_digits(joined):
                raise ValueError
            numbers = np.array([float(text) if text else np.nan for text in texts])
        except ValueError:
            numbers = np.array([read(text) for text in texts])
        odd = ~np.isfinite(numbers) & self.given(column)
        rule = Rule(
            column,
            odd,
            lambda at: f"expected a finite number, got {self._advised(column, at)}",
        )
        self.refuse([rule])
        own = None if column in ANY else self.units.get(column)
        return numbers if own is None else in_si(numbers, own.unit)

    def refuse(self, rules: Sequence[Rule]) -> None:
        """Add a fault for each row that violates a rule."""
        for column, bad, message in rules:
            for row in np.flatnonzero(bad).tolist():
                self.sound[row] = False
                if callable(message):
                    text = message(row)
                else:
                    text = message if "got" in message else f"{message}, got {{got}}"
                    got = self.text(column)[row] or "nothing"
                    of = self.text("quantity")[row]
                    text = text.replace("{quantity}", of).replace("{got}", got)
                    text = f"expected {text}"
                name = self.theirs.get(column, column)
                if self.table.is_wide and column in ANY:
                    # the source column of a wide table
                    of = self.texts["quantity"][row]
                    name = of if column == "value" else f"sigma of {of}"
                line = self.lines[row]
                fault = f"{self.table.at(line, name)}: {text}"
                self.faults.append(InputError(fault, row=row, line=line))

    def _advised(self, column: str, row: int) -> str:
        """Return a text that is not a number, with advice."""
        text = self.texts[column][row]
        forms = ADVICE if column in NUMBERS else {}
        advice = (forms[form] for form in forms if re.fullmatch(form, text, re.DOTALL))
        if column in DEGREES[:2]:
            return shown(text) + DEGREES_ADVICE
        return shown(text) + next(advice, "")


def degrees_of(text: str) -> float:
    """Return a latitude or longitude in degrees; NaN for other text.

    Degrees, minutes and seconds have a hemisphere: 48°12'00.3"N, W 11° 30'.
    """
    if not math.isnan(number := number_of(text)):
        return number
    found = DMS.fullmatch(text)
    side = found and (found["before"] or "") + (found["after"] or "")
    if not found or not side or len(side) > 1:
        return math.nan
    parts = [float((found[n] or "0").replace(",", ".")) for n in ("deg", "min", "sec")]
    size = parts[0] + parts[1] / 60.0 + parts[2] / 3600.0
    # sixty minutes or seconds are a misprint
    return (
        math.nan if max(parts[1:]) >= 60.0 else size * (-1.0 if side in "SW" else 1.0)
    )
