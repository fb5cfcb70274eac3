"""The answer of `jblast calc` on the terminal.

With `--units us`, ranges and notes of laws are printed in ft/lb^(1/3). They are words,
as their sources give them: numbers before a scaled distance are converted, to four
digits, and the rest is left as it is.
"""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from jblast.report.calculator.answer import (
    disagreement_words,
    header,
    inputs,
    notes,
    title,
    why_recommended,
)
from jblast.report.words import (
    WIDTH,
    System,
    Unit,
    aligned,
    behind,
    capitalised,
    comma_separated,
    joined,
    printed_number,
    quantity_words,
    significant,
    unit_for,
)
from jblast.sensors.calculator import (
    Calculated,
    Calculation,
    Disagreement,
    Question,
    Recommended,
    Roots,
)

LINE = 60
"""How long the line is that other laws stand below."""
SAID = ("as TNT", "burst", "air")
"""Of what it was answered with, what one answer says again."""
OUTSIDE = "outside"
"""Mark of a number where its law does not hold."""
PLACES, LAW = (12, 9), 11
"""Widths of columns of the table: range and mass, and each law, unless one is wider."""
Columns = list[list[str]]
Lines = list[str]
NUMBER = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"
SCALED = re.compile(rf"((?:{NUMBER}|free-air|to|[() ])+) m/(kg|kt)\^\(1/3\)")
"""Numbers, perhaps of two curve sets, up to their unit: 0.0674 (free-air 0.0531) to 40
m/kg^(1/3)."""
OF_ROOT = re.compile(rf"({NUMBER}) sqrt\(Q\) m\b")
"""Of what grows as the root of the charge's mass Q."""


def calculation_csv(
    question: Question, answer: Calculation, apart: Sequence[Disagreement] = ()
) -> str:
    """Return one value a line; the inputs stand above as comments."""
    ranges, masses = question.rows()
    lines = [("range_m", "mass_kg", "quantity", "law", "value", "valid")]
    for quantity, by_law in answer.items():
        for name, of_law in by_law.items():
            for i, (r, m) in enumerate(zip(ranges, masses, strict=True)):
                value, valid = repr(float(of_law.value[i])), bool(of_law.valid[i])
                row = (repr(float(r)), repr(float(m)), quantity, name, value)
                lines.append((*row, str(valid).lower()))
    said = "".join(
        f"# {one.quantity}: {disagreement_words(one, question)}\n" for one in apart
    )
    return _comments(question) + said + comma_separated(lines)


def roots_csv(question: Question, answer: dict[str, Roots]) -> str:
    """Return one root a line; the inputs stand above as comments."""
    lines = [(str(inputs(question).asked), "law", "valid")]
    for name, found in answer.items():
        for value, valid in zip(found.value, found.valid, strict=True):
            lines.append((repr(float(value)), name, str(bool(valid)).lower()))
    return _comments(question) + comma_separated(lines)


def _comments(question: Question) -> str:
    said = [title(question), *(f"{name}: {text}" for name, text in header(question))]
    said += notes(question, beside=False)
    return "".join(f"# {line}\n" for line in said)


def value_line(
    question: Question, recommended: Recommended, by_law: Mapping[str, Calculated]
) -> str:
    """Return one quantity at one range from one charge by the law we take.

    Args:
        question: Of one range and one mass.
        recommended: The answer.
        by_law: Values of all laws.
    """
    words = quantity_words(recommended.quantity)
    value = printed_number(
        recommended.quantity, recommended.value, system=question.units
    )
    unit = one_unit(question, recommended.quantity, by_law)
    others = [
        line
        for name, of_law in by_law.items()
        if name != recommended.law
        for line in entry(
            name,
            *printed_value(of_law, unit),
            scaled_in(of_law.range, question.units),
            law_column(by_law),
        )
    ]
    first = f"{title(question)}: {words} {value}, {_sure(recommended)}"
    return _whole(first, others, question, recommended, by_law[recommended.law].range)


def root_line(
    question: Question, recommended: Recommended, by_law: Mapping[str, Roots]
) -> str:
    """Return the range or mass at which a quantity takes its value.

    Args:
        question: Of the quantity, and of one range or one mass.
        recommended: The answer.
        by_law: Values of all laws.
    """
    target = printed_number(question.quantity, question.target, system=question.units)
    solutions = recommended.solutions or (recommended.value,)
    values = [
        printed_number(recommended.quantity, value, system=question.units)
        for value in solutions
    ]
    several = len(values) > 1
    value = f"{len(values)} solutions, {joined(values)}" if several else values[0]
    others = [
        line
        for name, found in by_law.items()
        if name != recommended.law
        for line in root_entries(question, name, found, law_column(by_law))
    ]
    first = f"{target}: {value}, {_sure(recommended, several=several)}"
    return _whole(
        first, others, question, recommended, by_law[recommended.law].law.range
    )


def _sure(recommended: Recommended, *, several: bool = False) -> str:
    """Return the law, whether it holds, and how far nature departs from it.

    Of several solutions each has a scatter of its own, and none is returned.
    """
    holds = "holds there" if recommended.valid else "outside its range"
    holds = "holds at each" if several else holds
    scatter = (
        f", scatter {100.0 * recommended.scatter:.2g} %"
        if recommended.scatter > 0.0 and not several
        else ""
    )
    return f"{recommended.law} ({holds}{scatter})"


def _whole(
    first: str,
    others: list[str],
    question: Question,
    recommended: Recommended,
    range_: str,
) -> str:
    lines = [first, "-" * LINE, *others]
    lines += [""] if others else []
    facts = [("by", f"{recommended.law}: {why_recommended(recommended) or range_}")]
    facts += [("asked", title(question))] if question.quantity else []
    facts += [fact for fact in header(question) if fact[0] in SAID]
    facts += [("note", note) for note in notes(question)]
    for name, text in facts:
        lines += behind(f"  {name}".ljust(10), scaled_in(text, question.units))
    return "\n".join(line.rstrip() for line in lines) + "\n"


def calculation_text(
    question: Question,
    answer: Calculation,
    other: Calculation | None = None,
    apart: Sequence[Disagreement] = (),
) -> str:
    """Return every quantity by every law, each beside its range.

    Args:
        question: What was asked.
        answer: Values of the laws.
        other: Values by the other curve set, for laws with two, if that is of use.
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
    """Return the line of one law: name, value, mark and range."""
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


def scaled_in(text: str, system: System) -> str:
    """Return words about scaled distances in a system of units.

    A kiloton stays one.

    Args:
        text: As the laws have them.
        system: "si" leaves them as they are.
    """
    if system == "si":
        return text
    foot, pound = (unit_for(name, 1.0, system=system).size for name in ("_m", "_kg"))

    def scaled(found: re.Match[str]) -> str:
        of, factor = found[2], 1.0 / foot
        if of == "kg":
            of, factor = "lb", pound ** (1 / 3) / foot
        numbers = re.sub(NUMBER, lambda n: _times(n[0], factor), found[1])
        return f"{numbers} ft/{of}^(1/3)"

    def of_root(found: re.Match[str]) -> str:
        return f"{_times(found[1], pound**0.5 / foot)} sqrt(Q in lb) ft"

    return OF_ROOT.sub(of_root, SCALED.sub(scaled, text))


def _times(number: str, factor: float) -> str:
    """Return a written number times a factor, to four digits."""
    text = significant(float(number) * factor, 4)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text
