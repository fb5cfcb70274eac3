"""Names of `numbers` and `view` for modules that do not import these yet."""

from collections.abc import Collection, Sequence

from jblast.registry import law_words as law_words
from jblast.report.numbers import (
    CUSTOMARY as CUSTOMARY,
    LADDERS as LADDERS,
    System as System,
    Unit as Unit,
    capitalised as capitalised,
    finite as finite,
    joined as joined,
    parameter_words as parameter_words,
    printed_number as printed_number,
    quantity_words as quantity_words,
    rounded as rounded,
    scientific as scientific,
    significant as significant,
    split_name as split_name,
    unit_for as unit_for,
)
from jblast.report.view import (
    WIDTH as WIDTH,
    behind as behind,
    comma_separated as comma_separated,
    commented as commented,
    hanging as hanging,
)

GAP = 2
Rows = Sequence[Sequence[str]]


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
