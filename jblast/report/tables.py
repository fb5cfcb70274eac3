"""Rows of cells as text: for a terminal, as Markdown, as CSV."""

import csv
import io
from collections.abc import Collection, Iterable, Sequence
from typing import Any

GAP = 2
"""Spaces between two columns on a terminal."""

Rows = Sequence[Sequence[str]]


def aligned(
    rows: Rows, *, right: Collection[int] = (), least: Sequence[int] = ()
) -> list[str]:
    """Return the lines of a table whose columns are as wide as their widest cell.

    Args:
        rows: Cells, as many in each.
        right: Columns, counted from 0, that end below one another.
        least: Widths of the first columns, where no cell is wider.
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
    """Return a table of Markdown, without the line end of its last row.

    Args:
        head: Titles of the columns.
        rows: Cells, as many in each; a bar in one is written so that it stays one.
        right: Columns, counted from 0, that end below one another.
    """
    rules = ["---:" if number in right else "---" for number in range(len(head))]
    titles = "|".join(f" {title} " if title else " " for title in head)
    lines = [f"|{titles}|", f"|{'|'.join(rules)}|"]
    return "\n".join(lines + [_bars(row) for row in rows])


def _bars(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def commented(comments: Iterable[str]) -> str:
    """Return lines of comment above a table of CSV, each on one line."""
    return "".join(f"# {' '.join(line.split())}\n" for line in comments)


def comma_separated(rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as CSV; the first holds the names of the columns."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
