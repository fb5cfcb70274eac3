"""The calculator's answer as the terminal shows it."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from jblast.report.calculator.customary import scaled_in
from jblast.report.calculator.header import header, title
from jblast.report.calculator.notes import disagreement_words, notes
from jblast.report.lines import WIDTH, behind
from jblast.report.numbers import Unit, printed_number, significant, unit_for
from jblast.report.tables import aligned
from jblast.report.words import capitalised, quantity_words
from jblast.sensors.calculator.disagreement import Disagreement
from jblast.sensors.calculator.forward import Calculated, Calculation
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question

OUTSIDE = "outside"
"""Mark of a number where its law does not hold."""
PLACES, LAW = (12, 9), 11
"""Widths of columns of the table: range and mass, and each law, unless one is wider."""
Columns = list[list[str]]
Lines = list[str]


def calculation_text(
    question: Question,
    answer: Calculation,
    other: Calculation | None = None,
    apart: Sequence[Disagreement] = (),
) -> str:
    """Return every quantity by every law, each beside its range.

    Args:
        question: What was asked.
        answer: What the laws say.
        other: What those of two curve sets say by the other set, if that is of use.
        apart: Where laws that hold disagree.
    """
    lines = _head(question)
    words = {one.quantity: one for one in apart}
    one_row = len(question.rows()[0]) == 1
    column = law_column(name for by_law in answer.values() for name in by_law)
    for quantity, by_law in answer.items():
        lines.append("")
        if one_row:
            lines.append(capitalised(quantity_words(quantity)))
            beside = {} if other is None else other[quantity]
            lines += _list(question, quantity, by_law, beside, column)
        else:
            lines += _table(question, quantity, by_law)
        if quantity in words:
            said = disagreement_words(words[quantity], question)
            lines += behind("  ! ", scaled_in(said, question.units))
    return "\n".join(line.rstrip() for line in lines) + "\n"


def roots_text(question: Question, answer: Mapping[str, Roots]) -> str:
    """Return the ranges or masses where the laws give the value."""
    lines = [*_head(question), "", "Range" if question.charge_mass else "Mass"]
    column = law_column(answer)
    for law, found in answer.items():
        lines += root_entries(question, law, found, column)
    return "\n".join(line.rstrip() for line in lines) + "\n"


def root_entries(
    question: Question, law: str, found: Roots, column: int
) -> Iterable[str]:
    """Return a line for each range or mass at which one law gives the value."""
    name = "range_m" if question.charge_mass else "charge_mass_kg"
    rows = [
        (
            printed_number(name, value, 5, question.units) + "  ",
            "" if valid else OUTSIDE,
        )
        for value, valid in zip(found.value, found.valid, strict=True)
    ]
    for i, (value, mark) in enumerate(rows or [("none  ", "")]):
        text = "" if i else scaled_in(found.law.range, question.units)
        yield from entry("" if i else law, value, mark, text, column)


def _head(question: Question) -> Lines:
    facts = header(question)
    label = max(len(name) for name, _ in facts) + 4
    lines = [title(question), ""]
    for name, text in facts:
        lines += behind(f"  {name}".ljust(label), text)
    for note in notes(question):
        lines += ["", *behind("Note: ", scaled_in(note, question.units))]
    return lines


def _list(
    question: Question,
    quantity: str,
    by_law: Mapping[str, Calculated],
    other: Mapping[str, Calculated],
    column: int,
) -> Lines:
    """Return a line a law: value, mark, range; `other` is of the other burst."""
    lines = []
    burst = question.scene.charge.burst
    other_burst = "surface" if burst == "free-air" else "free-air"
    unit = one_unit(question, quantity, by_law)
    for name, of_law in by_law.items():
        value, mark = printed_value(of_law, unit)
        where = scaled_in(of_law.range, question.units)
        lines += entry(name, value, mark, where, column)
        if name in other and of_law.two_sets:
            value, mark = printed_value(other[name], unit)
            lines += entry(f"  ({other_burst})", value, mark, "", column)
    return lines


def one_unit(
    question: Question, quantity: str, by_law: Mapping[str, Calculated]
) -> Unit:
    """Return one unit for all, by the value in the middle."""
    values = np.concatenate([of_law.value for of_law in by_law.values()])
    middle = float(np.nanmedian(np.abs(values)))
    return unit_for(quantity, middle, system=question.units)


def printed_value(of_law: Calculated, unit: Unit) -> tuple[str, str]:
    """Return a value of one row in a unit, and its mark."""
    value = f"{significant(of_law.value[0] / unit.size, 4):>8} {unit.symbol:<6}"
    return value, "" if of_law.valid[0] else OUTSIDE


def entry(name: str, value: str, mark: str, text: str, column: int) -> Lines:
    """Return what one law says: name, value, mark, and its range beside them."""
    gap = "" if value.endswith(" ") else " "  # after "psi ms"
    return behind(f"  {name:<{column}}{value:>15}{gap}{mark:<9}", text)


def law_column(names: Iterable[str]) -> int:
    """Return how wide the column of some laws' names is."""
    return max(17, *(len(name) + 1 for name in names))


def _table(
    question: Question, quantity: str, by_law: Mapping[str, Calculated]
) -> Lines:
    """Return a row a range and mass, a column a law, and the laws' ranges below."""
    ranges, masses = question.rows()
    system = question.units
    unit = one_unit(question, quantity, by_law)
    symbol = f" [{unit.symbol}]" if unit.symbol else ""
    lines = [capitalised(quantity_words(quantity)) + symbol]
    places = [["range", *(printed_number("_m", r, system=system) for r in ranges)]]
    if len(question.charge_mass) > 1:
        places.append(
            ["mass", *(printed_number("_kg", m, system=system) for m in masses)]
        )
    columns = [
        [name]
        + [
            significant(v / unit.size, 4) + (" " if ok else "*")
            for v, ok in zip(of_law.value, of_law.valid, strict=True)
        ]
        for name, of_law in by_law.items()
    ]
    while columns:  # as many columns as fit, then again from the left
        shown = 1
        while shown < len(columns) and _fit(places, columns[: shown + 1]):
            shown += 1
        lines += _beside_places(places, columns[:shown])
        columns = columns[shown:]
        lines += [""] if columns else []
    for name, of_law in by_law.items():
        left = "" if of_law.valid.all() else "* outside: "
        lines += behind(f"  {name}: ", left + scaled_in(of_law.range, system))
    return lines


def _fit(places: Columns, columns: Columns) -> bool:
    """Return whether columns beside those of the places are not too wide."""
    return len(_beside_places(places, columns)[0]) < WIDTH


def _beside_places(places: Columns, columns: Columns) -> Lines:
    whole = [*places, *columns]
    least = (*PLACES[: len(places)], *[LAW] * len(columns))
    rows = list(zip(*whole, strict=True))
    return aligned(rows, right=range(len(whole)), least=least)
