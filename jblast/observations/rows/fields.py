"""The fields of a log by column, and how what is wrong with one is told."""

import math
import re
from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, shown
from jblast.observations.dialects.header import PER_ROW, Header
from jblast.observations.dialects.table import Table
from jblast.observations.faults import Faults
from jblast.observations.formats import row_word
from jblast.observations.table import DEGREES
from jblast.observations.understood import MadeLong
from jblast.units import products, si_ratio

DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
TIME_OF_DAY = re.compile(r"\d{1,2}:\d{2}")
MINUTES = re.compile(r"[NSEW]?\s*[+-]?\d+(\.\d+)?\s*([°ºd':\s]|[NSEW]$)")
"""How a latitude or longitude begins in minutes, or with its side."""
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[\s'\u2019]\d{3})+(?:[.,]\d+)?")
"""Numbers with blanks or apostrophes in them, as in France and in Switzerland."""
WITH_UNIT = re.compile(r"[+-]?\d[\d.,]*(?:[eE][+-]?\d+)?\s*[%A-Za-zµ°].*")


class Fields:
    """The body of a table by column, as text.

    Attributes:
        texts: Fields by column.
        lines: Where each row stood.
        units: Of columns that are in another unit than ours.
        sound: Whether nothing is wrong with a row so far.
        wide: Of a wide table, by our column, the column that each row stood in.
    """

    def __init__(self, table: Table, header: Header, faults: Faults):
        self.path = table.source
        self.lines = table.lines
        self.word = row_word(table.source)
        self.faults = faults
        self.texts = dict(zip(table.header, table.columns, strict=True))
        self.theirs, self.units = header.theirs, header.units
        self.sound = np.ones(len(self.lines), bool)
        self.wide: Mapping[str, tuple[str, ...]] = {}
        if any(isinstance(found, MadeLong) for found in table.understood):
            held = self.text("quantity")
            self.wide = {"value": held, "sigma": tuple(f"sigma of {q}" for q in held)}

    def text(self, column: str) -> tuple[str, ...]:
        """Return a column of names; "" where the file has no such column."""
        return tuple(self.texts.get(column) or [""] * len(self.lines))

    def number(
        self, column: str, *, optional: bool = True
    ) -> Float[np.ndarray, " row"]:
        """Return a column of finite numbers; NaN where an optional one is empty.

        In our unit, but for `value` and `sigma`, whose rows may have many.
        """
        if column not in self.texts:
            return np.full(len(self.lines), np.nan)
        texts = self.texts[column]
        try:
            numbers = np.array([float(text) if text else np.nan for text in texts])
        except ValueError:
            numbers = np.array([_number(text) for text in texts])
        odd = ~np.isfinite(numbers)
        if optional and odd.any():
            odd &= np.array([bool(text) for text in texts], bool)
        if "_" in "".join(texts):  # 1_000 is Python
            odd |= np.array(["_" in text for text in texts], bool)
        self.refuse(
            odd,
            column,
            lambda row: f"a finite number, got {_what_came(texts[row], column)}",
        )
        own = None if column in PER_ROW else self.units.get(column)
        return numbers if own is None else products(si_ratio(own.unit), texts)

    def refuse(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        expected: Callable[[int], str],
    ) -> None:
        """Tell each bad row, with what its column should hold: it is left out."""
        self.tell(bad, column, lambda row: f"expected {expected(row)}")

    def tell(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        said: Callable[[int], str],
    ) -> None:
        """Tell each bad row, in words of their own."""
        if not np.any(bad):
            return
        theirs = self.theirs.get(column, column)
        for row in map(int, np.flatnonzero(bad)):
            self.sound[row] = False
            name = self.wide[column][row] if column in self.wide else theirs
            at = f", column {name}" if column else ""
            where = f"{self.path}: {self.word} {self.lines[row]}{at}"
            self.faults.tell(InputError(f"{where}: {said(row)}"))


def _what_came(text: str, column: str) -> str:
    """Say what came in place of a number, and what may be wrong with it."""
    if not text:
        return "nothing"
    if DATE.match(text):
        return f"{shown(text)}: a date, as spreadsheets make of 3.5 or 1-2"
    if TIME_OF_DAY.match(text):
        return f"{shown(text)}; a time of day stands in column value_utc"
    if column == "sigma" and text.endswith("%"):
        return (
            f"{shown(text)}; a sigma is in the unit of its value; per cent of it stand "
            "in a column sigma_percent"
        )
    if column in DEGREES and MINUTES.match(text):
        return f"{shown(text)}; write decimal degrees, south and west below 0"
    if THOUSANDS.fullmatch(text):
        return f"{shown(text)}; write it without marks between thousands"
    if WITH_UNIT.fullmatch(text):
        return f"{shown(text)}; a unit stands in the name of the column or quantity"
    return shown(text) + ("; write a decimal point" if "," in text else "")


def _number(text: str) -> float:
    """Return what a field says; NaN for what is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan
