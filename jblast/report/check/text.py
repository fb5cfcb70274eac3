"""What is said of a log on a terminal before it is fitted."""

import re
import textwrap
from collections.abc import Sequence

from jblast.report.check.answer import CheckAnswer
from jblast.report.words import joined, quantity_words

WIDTH = 79
MOST_LINES = 5
"""Lines that are named of one warning, or of one fault."""
KNOWN = re.compile(r"; expected (?:one|some) of [\w, ]+$")
"""A list of all that could have been meant, at the end of a message."""
MOST_WARNINGS = 40
"""Warnings that are told one by one; a document has them all."""
LINE = re.compile(r"line (\d+)([:,].*)", re.DOTALL)
"""How a message of one line of the file begins."""


def check_text(answer: CheckAnswer) -> str:
    """Return what was understood, what a fit refuses and what is odd."""
    parts = [_head(answer)]
    faults, warnings = (
        _number(len(found), word)
        for found, word in ((answer.faults, "fault"), (answer.warnings, "warning"))
    )
    odd = [f"{_lines([str(n) for n in w.lines])}: {w.message}" for w in answer.warnings]
    if len(odd) > MOST_WARNINGS:
        odd[MOST_WARNINGS:] = [f"and {len(odd) - MOST_WARNINGS:,} more"]
    for title, lines in (
        ("Understood", answer.understood),
        (f"A fit would refuse it: {faults}", _folded(answer.faults, answer.source)),
        (f"Worth a look, though no fit stops there: {warnings}", odd),
    ):
        if lines:
            parts.append("\n".join([title, *map(_item, lines)]))
    if not answer.faults:
        parts.append("Nothing stops a fit." if answer.warnings else "Nothing is wrong.")
    return "\n\n".join(parts) + "\n"


def _head(answer: CheckAnswer) -> str:
    if not answer.rows:
        return f"{answer.source}: no row could be read"
    sentences = [
        f"{answer.source}: {_number(answer.rows, 'row')} of "
        f"{_number(answer.sensors, 'sensor')}"
        + (f", {_number(len(answer.shots), 'shot')}" if len(answer.shots) > 1 else "")
    ]
    counted = [
        f"{quantity_words(quantity)} {count}"
        for quantity, count in answer.quantities.items()
    ]
    sentences.append(f"Quantities: {', '.join(counted)}")
    where = [
        f"{count} {words}"
        for key, words in (
            ("position", "by position"),
            ("range", "by range"),
            ("neither", "by neither"),
        )
        if (count := answer.places[key])
    ]
    sentences.append(f"Places of sensors: {', '.join(where)}")
    if answer.clocks:
        sentences.append(f"Clocks: {joined(answer.clocks)}")
    if answer.lower_bounds:
        sentences.append(f"Lower bounds: {_number(answer.lower_bounds, 'row')}")
    return "\n".join(
        textwrap.fill(line, WIDTH, subsequent_indent="  ") for line in sentences
    )


def _item(line: str) -> str:
    return textwrap.fill(
        line, WIDTH, initial_indent="  ", subsequent_indent="    ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _folded(faults: Sequence[str], source: str) -> list[str]:
    """Tell once what is said of many lines, and each list of all that is known.

    The name of the file stands above. Of what came in many lines the first is told.
    """
    lines: dict[str, list[str]] = {}
    came: dict[str, list[str]] = {}
    lists: set[str] = set()
    for fault in faults:
        numbered = LINE.fullmatch(fault.removeprefix(f"{source}: "))
        what = numbered.group(2) if numbered else fault.removeprefix(f"{source}: ")
        known = KNOWN.search(what)
        if known and known.group() in lists and what not in lines:
            what = what.removesuffix(known.group())
        elif known:
            lists.add(known.group())
        what, got, text = what.partition("; got ") if numbered else (what, "", "")
        lines.setdefault(what, []).extend([numbered.group(1)] if numbered else [])
        came.setdefault(what, []).extend([got + text] if got else [])
    return [
        _lines(numbers)
        + what
        + "".join(came[what][:1])
        + (" and others" if len(set(came[what])) > 1 else "")
        for what, numbers in lines.items()
    ]


def _lines(numbers: Sequence[str]) -> str:
    """Name the lines that something is said of."""
    if len(numbers) < 2:
        return "".join(f"line {number}" for number in numbers)
    kept = list(numbers[:MOST_LINES])
    if len(numbers) > MOST_LINES:
        kept.append(f"{len(numbers) - MOST_LINES} more")
    return f"lines {joined(kept)}"


def _number(count: int, word: str) -> str:
    return f"{count:,} {word}{'' if count == 1 else 's'}"
