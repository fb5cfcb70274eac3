"""The answer of `jblast calc` on the terminal and as CSV.

With `--units us`, ranges of validity and notes of laws are printed in ft/lb^(1/3). They
are text from the sources: numbers in front of a scaled distance are converted, to four
digits, and the rest of the text is unchanged.
"""

import math
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
    recommended_by_row,
    recommended_values,
)

RULE_WIDTH = 60
"""Length of the rule above the other laws [characters]; the layout needs no other."""
ASSUMPTIONS = ("as TNT", "burst", "air")
"""Labels of the inputs that are repeated below a one-line answer."""
OUTSIDE = "outside"
"""Mark of a value outside its law's range of validity."""
ROW_WIDTHS, LAW_WIDTH = (12, 9), 11
"""Least widths of the columns range, mass and law [characters]: "1.234e-05*" fits."""
MAX_RECOMMENDED = 50
"""Largest table with recommended values: the choice of laws takes about 20 ms a row."""
Columns = list[list[str]]
Lines = list[str]
NUMBER = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"
SCALED = re.compile(rf"((?:{NUMBER}|free-air|to|[() ])+) m/(kg|kt)\^\(1/3\)")
"""Numbers with their unit, for one or two curve sets:
"0.0674 (free-air 0.0531) to 40 m/kg^(1/3)"."""
ROOT_OF_MASS = re.compile(rf"({NUMBER}) sqrt\(Q\) m\b")
"""A distance proportional to the square root of the charge mass Q [kg]."""


def calculation_csv(
    question: Question, answer: Calculation, apart: Sequence[Disagreement] = ()
) -> str:
    """Return one value a line; the inputs precede the table as comments."""
    ranges, masses = question.rows()
    lines = [("range_m", "mass_kg", "quantity", "law", "value", "valid")]
    for quantity, by_law in answer.items():
        for name, of_law in by_law.items():
            for i, (r, m) in enumerate(zip(ranges, masses, strict=True)):
                # all digits: programs read this table
                value, valid = repr(float(of_law.value[i])), bool(of_law.valid[i])
                row = (repr(float(r)), repr(float(m)), quantity, name, value)
                lines.append((*row, str(valid).lower()))
    warnings = "".join(
        f"# {one.quantity}: {disagreement_words(one, question)}\n" for one in apart
    )
    return _comments(question) + warnings + comma_separated(lines)


def roots_csv(question: Question, answer: dict[str, Roots]) -> str:
    """Return one root a line; the inputs precede the table as comments."""
    lines = [(str(inputs(question).unknown), "law", "valid")]
    for name, found in answer.items():
        for value, valid in zip(found.value, found.valid, strict=True):
            lines.append((repr(float(value)), name, str(bool(valid)).lower()))
    return _comments(question) + comma_separated(lines)


def _comments(question: Question) -> str:
    lines = [title(question), *(f"{name}: {text}" for name, text in header(question))]
    lines += notes(question, has_other_set=False)
    return "".join(f"# {line}\n" for line in lines)


def recommended_text(
    question: Question, answer: Calculation, apart: Sequence[Disagreement] = ()
) -> str:
    """Return one table: the recommended value of each quantity, its law and scatter.

    Args:
        question: One range and one mass.
        answer: Values of the laws.
        apart: Quantities whose valid laws disagree.
    """
    rows = [("quantity", "value", "", "law", "scatter", "")]
    disagree = {one.quantity for one in apart}
    for quantity, best in recommended_values(question, answer).items():
        unit = unit_for(quantity, best.value, system=question.units)
        notes_ = [] if best.valid else ["extrapolated"]
        notes_ += ["laws disagree"] if quantity in disagree else []
        rows.append(
            (
                quantity_words(quantity),
                significant(best.value / unit.size, 4),
                unit.symbol,
                best.law,
                _scatter(best.scatter),
                ", ".join(notes_),
            )
        )
    lines = [title(question), ""]
    lines += [f"  {line}" for line in aligned(rows, right=(1, 4))]
    lines += ["", "Assumptions", *_inputs(question)]
    lines += [
        "",
        *behind(
            "",
            "scatter: standard deviation of real blasts about the law. extrapolated: "
            "outside the law's range of validity. All laws with their ranges: "
            "--all-laws.",
        ),
    ]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _scatter(sd: float) -> str:
    """Return a scatter [sd of ln] in per cent, or as a factor from 1 on; or "-"."""
    if not sd > 0.0:
        return "-"
    # exp(sd) is the factor of one standard deviation; below 1 per cent is read faster
    return f"{100.0 * sd:.2g} %" if sd < 1.0 else f"x {math.exp(sd):.2g}"


def value_line(
    question: Question, recommended: Recommended, by_law: Mapping[str, Calculated]
) -> str:
    """Return one quantity at one range from one charge by the recommended law.

    Args:
        question: One range and one mass.
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
        question: The quantity, with one range or one mass.
        recommended: The answer.
        by_law: Values of all laws.
    """
    target = printed_number(question.quantity, question.target, system=question.units)
    # a curve that is not monotonic takes the value at several ranges
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
    """Return the law, its validity, and the scatter of real blasts about it.

    Several solutions have different scatters, so none is printed for them.
    """
    holds = "valid here" if recommended.valid else "outside its range"
    holds = "valid at each" if several else holds
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
    lines = [first, "-" * RULE_WIDTH, *others]
    lines += [""] if others else []
    facts = [("law", f"{recommended.law}: {why_recommended(recommended) or range_}")]
    facts += [("for", title(question))] if question.quantity else []
    facts += [fact for fact in header(question) if fact[0] in ASSUMPTIONS]
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
    """Return every quantity by every law, each with its range of validity.

    Args:
        question: The question.
        answer: Values of the laws.
        other: Values by the other curve set, for laws with two sets, if relevant.
        apart: Quantities whose valid laws disagree.
    """
    lines = [title(question), "", *_inputs(question)]
    words = {one.quantity: one for one in apart}
    one_row = len(question.rows()[0]) == 1
    column = law_column(name for by_law in answer.values() for name in by_law)
    best = []
    if 1 < len(question.rows()[0]) <= MAX_RECOMMENDED:
        best = recommended_by_row(question, answer)
    for quantity, by_law in answer.items():
        lines.append("")
        if one_row:
            lines.append(capitalised(quantity_words(quantity)))
            beside = {} if other is None else other[quantity]
            lines += _list(question, quantity, by_law, beside, column)
        else:
            rows = [of_row[quantity] for of_row in best] if len(by_law) > 1 else []
            lines += _table(question, quantity, by_law, rows)
        if quantity in words:
            warning = disagreement_words(words[quantity], question)
            lines += behind("  ! ", scaled_in(warning, question.units))
    return "\n".join(line.rstrip() for line in lines) + "\n"


def roots_text(question: Question, answer: Mapping[str, Roots]) -> str:
    """Return the ranges or masses at which each law gives the value."""
    lines = [title(question), "", *_inputs(question)]
    lines += ["", "Range" if question.charge_mass else "Mass"]
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


def _inputs(question: Question) -> Lines:
    """Return the inputs and defaults, one a line, and the notes."""
    facts = header(question)
    label = max(len(name) for name, _ in facts) + 4
    lines = []
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
    """Return a line a law: value, mark, range; `other` is by the other curve set."""
    lines = []
    burst = question.scene.charge.burst
    other_burst = "surface" if burst == "free-air" else "free-air"
    unit = one_unit(question, quantity, by_law)
    for name, of_law in by_law.items():
        value, mark = printed_value(of_law, unit)
        where = scaled_in(of_law.range, question.units)
        lines += entry(name, value, mark, where, column)
        # laws with one curve set would repeat their value
        if name in other and of_law.two_sets:
            value, mark = printed_value(other[name], unit)
            lines += entry(f"  ({other_burst})", value, mark, "", column)
    return lines


def one_unit(
    question: Question, quantity: str, by_law: Mapping[str, Calculated]
) -> Unit:
    """Return one unit for the values of all laws, by their median."""
    values = np.concatenate([of_law.value for of_law in by_law.values()])
    # the median: one extrapolated law far off would decide the unit of all
    middle = float(np.nanmedian(np.abs(values)))
    return unit_for(quantity, middle, system=question.units)


def printed_value(of_law: Calculated, unit: Unit) -> tuple[str, str]:
    """Return the value of the only row in a unit, and its mark."""
    value = f"{significant(of_law.value[0] / unit.size, 4):>8} {unit.symbol:<6}"
    return value, "" if of_law.valid[0] else OUTSIDE


def entry(name: str, value: str, mark: str, text: str, column: int) -> Lines:
    """Return the line of one law: name, value, mark and range."""
    gap = "" if value.endswith(" ") else " "  # after "psi ms"
    return behind(f"  {name:<{column}}{value:>15}{gap}{mark:<9}", text)


def law_column(names: Iterable[str]) -> int:
    """Return the width of the column of law names [characters]."""
    # 17 keeps the columns of most quantities below each other: "kingery_bulmash" has 15
    return max(17, *(len(name) + 1 for name in names))


def _table(
    question: Question,
    quantity: str,
    by_law: Mapping[str, Calculated],
    best: Sequence[Recommended] = (),
) -> Lines:
    """Return one row per range and mass, one column per law, then the laws' ranges.

    A table of the recommended values comes first, if there are any.
    """
    ranges, masses = question.rows()
    system = question.units
    unit = one_unit(question, quantity, by_law)
    symbol = f" [{unit.symbol}]" if unit.symbol else ""
    lines = [capitalised(quantity_words(quantity)) + symbol]
    # the inputs are repeated with each group of columns
    heads = [["range", *(printed_number("_m", r, system=system) for r in ranges)]]
    # a single mass stands in the title
    if len(question.charge_mass) > 1:
        heads.append(
            ["mass", *(printed_number("_kg", m, system=system) for m in masses)]
        )
    if best:
        whole = [
            *heads,
            [
                "recommended",
                *(
                    significant(one.value / unit.size, 4) + (" " if one.valid else "*")
                    for one in best
                ),
            ],
            ["scatter", *(_scatter(one.scatter) for one in best)],
            ["law", *(one.law for one in best)],
        ]
        lines += aligned(
            list(zip(*whole, strict=True)),
            right=range(len(whole) - 1),
            least=(*ROW_WIDTHS[: len(heads)], LAW_WIDTH),
        )
        lines.append("")
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
        while (
            shown < len(columns) and len(_rows(heads, columns[: shown + 1])[0]) < WIDTH
        ):
            shown += 1
        lines += _rows(heads, columns[:shown])
        columns = columns[shown:]
        lines += [""] if columns else []
    for name, of_law in by_law.items():
        left = "" if of_law.valid.all() else "* outside: "
        lines += behind(f"  {name}: ", left + scaled_in(of_law.range, system))
    return lines


def _rows(heads: Columns, columns: Columns) -> Lines:
    """Return the lines of a table of range, mass and some laws."""
    whole = [*heads, *columns]
    least = (*ROW_WIDTHS[: len(heads)], *[LAW_WIDTH] * len(columns))
    rows = list(zip(*whole, strict=True))
    return aligned(rows, right=range(len(whole)), least=least)


def scaled_in(text: str, system: System) -> str:
    """Return a text with its scaled distances in a system of units.

    Kilotons are not converted.

    Args:
        text: Range of validity or note of a law.
        system: System of units; "si" returns the text unchanged.
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

    return ROOT_OF_MASS.sub(of_root, SCALED.sub(scaled, text))


def _times(number: str, factor: float) -> str:
    """Return a printed number times a factor, to four digits."""
    text = significant(float(number) * factor, 4)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text
