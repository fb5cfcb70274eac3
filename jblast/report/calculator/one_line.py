"""One question, one line: the answer by the law we take; what else there is below."""

from collections.abc import Mapping

from jblast.report.calculator.customary import scaled_in
from jblast.report.calculator.header import header, title
from jblast.report.calculator.notes import notes
from jblast.report.calculator.reasons import why_recommended
from jblast.report.calculator.terminal import (
    entry,
    law_column,
    one_unit,
    printed_value,
    root_entries,
)
from jblast.report.lines import behind
from jblast.report.numbers import printed_number
from jblast.report.words import joined, quantity_words
from jblast.sensors.calculator.forward import Calculated
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question
from jblast.sensors.calculator.recommended import Recommended

LINE = 60
"""How long the line is that other laws stand below."""
SAID = ("as TNT", "burst", "air")
"""Of what it was answered with, what one answer says again."""


def value_line(
    question: Question, recommended: Recommended, by_law: Mapping[str, Calculated]
) -> str:
    """Return one quantity at one range from one charge by the law we take.

    Args:
        question: Of one range and one mass.
        recommended: The answer.
        by_law: What all laws say.
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
        by_law: What all laws say.
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
