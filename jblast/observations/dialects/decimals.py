"""Which mark stands before decimals: told from numbers that can be read one way only.

0,05 has a decimal comma, 0.05 a decimal point; 1,234 may be either 1.234 or 1234, and
is read where another number of the file says which. Marks of thousands are refused.
"""

import re
from collections.abc import Collection

from jblast.errors import InputError, shown
from jblast.observations.dialects.table import Table
from jblast.observations.dialects.text import SEPARATORS
from jblast.observations.understood import DecimalComma, Dialect

GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,])\d{3})+")
"""What thousands could be marked in: 1,234 or 12.345.678."""
DECIMALS = {
    mark: re.compile(rf"[+-]?\d*{re.escape(mark)}\d*(?:[eE][+-]?\d+)?") for mark in ",."
}
MINUS = "\u2212"
"""The sign for minus of typesetters, which some spreadsheets write."""
Seen = tuple[int, str, str]
"""Line, column and text of a number."""


def take_decimal_commas(table: Table, numbers: Collection[str]) -> None:
    """Write decimal points where the file has decimal commas, and plain minus signs.

    Args:
        table: Is changed.
        numbers: Columns that hold numbers, as written in the header.

    Raises:
        InputError: Both marks are there, or a number can be read two ways.
    """
    held = [i for i, name in enumerate(table.header) if name in numbers]
    separated = next((f for f in table.understood if isinstance(f, Dialect)), None)
    semicolons = separated is not None and separated.separator == SEPARATORS[";"]
    for i in held:
        if any(MINUS in text for text in table.columns[i]):
            table.columns[i] = [x.replace(MINUS, "-") for x in table.columns[i]]
    columns = [table.columns[i] for i in held]
    if not semicolons and not any("," in "".join(column) for column in columns):
        return
    sure, unsure = _marks(table, held)
    if "," in sure and "." in sure:
        raise InputError(
            f"{_at(table, sure[','])}: expected one decimal mark in the file, got a "
            f"comma here and a point at {_at(table, sure['.'])}"
        )
    if not sure and unsure:
        mark, seen = next(iter(unsure.items()))
        text = seen[2]
        decimal, whole = text.replace(mark, "."), text.replace(mark, "")
        raise InputError(
            f"{_at(table, seen)}: may be {decimal} or {whole}, and no other number "
            f"says which; expected {decimal} with a point in a file with commas "
            f"between fields, or {whole} without a mark"
        )
    for mark in unsure.keys() - sure.keys():
        (known,) = sure.values()
        raise InputError(
            f"{_at(table, unsure[mark])}: expected no mark between thousands, and "
            f"decimals as in {known[2]} at {_at(table, known, text=False)}; write "
            f"{unsure[mark][2].replace(mark, '')}, if that is meant"
        )
    if "," not in sure:
        return
    for i in held:
        table.columns[i] = [
            text.replace(",", ".")
            if DECIMALS[","].fullmatch(text.lstrip("> "))
            else text
            for text in table.columns[i]
        ]
    line, _, text = sure[","]
    table.understood = (*table.understood, DecimalComma(line, text))


def _marks(table: Table, held: list[int]) -> tuple[dict[str, Seen], dict[str, Seen]]:
    """Return the first number by mark: that can be read one way, and two ways.

    Raises:
        InputError: A number has both marks, or one of them twice.
    """
    sure: dict[str, Seen] = {}
    unsure: dict[str, Seen] = {}
    for i in held:
        for line, field in zip(table.lines, table.columns[i], strict=True):
            if "," not in field and "." not in field:
                continue
            text = field.lstrip("> ")
            seen = line, table.header[i], text
            match = GROUPED.fullmatch(text)
            if match and text.count(match[1]) == 1:
                unsure.setdefault(match[1], seen)
                continue
            for mark, decimal in DECIMALS.items():
                if decimal.fullmatch(text):
                    sure.setdefault(mark, seen)
                    break
            else:
                if any(c.isdigit() for c in text) and not text.strip("+-0123456789.,"):
                    raise InputError(
                        f"{_at(table, seen)}: expected a number without marks between "
                        "thousands"
                    )
    return sure, unsure


def _at(table: Table, seen: Seen, *, text: bool = True) -> str:
    """Name where a number stands, and the number."""
    line, column, number = seen
    got = f", got {shown(number)}" if text else ""
    return f"{table.at(line)}, column {column}{got}"
