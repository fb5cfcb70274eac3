"""Calculate a blast by every law, or the range or mass at which it takes a value.

Numbers outside a law's range are answered and marked. With --overpressure, --impulse,
... beside --range or --mass alone, the other of the two is what is asked for. One
question, that or --quantity, is answered in one line, by the law that we take, the
others below; --table prints them all alike. Numbers may carry a unit: 33lb, 1psi.
"""

import argparse
import sys
from typing import TYPE_CHECKING

from jblast.cli.arguments.calc.options import add_arguments as add_arguments
from jblast.cli.arguments.paths import check_figure, save_figure

if TYPE_CHECKING:  # --help needs neither
    from jblast.sensors.calculator.question import Question
    from jblast.sensors.calculator.recommended import Recommended


def run(asked: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.cli.arguments.calc.question import check_plot, question_of
    from jblast.cli.arguments.calc.wanted import wanted

    question = question_of(asked)
    quantity, law = wanted(asked)
    if asked.plot:
        check_figure("--plot", asked.plot, force=asked.force)
        check_plot(question)
    answer = _roots if question.quantity else _forward
    text, recommended = answer(asked, question, quantity, law)
    if asked.plot:
        from jblast.report.calculator.figures import calculator_figure, question_figure

        one = question.quantity or quantity
        draw = question_figure(question, one, recommended, law) if one else None
        save_figure(draw or calculator_figure(question, law), asked.plot)
        if not (asked.json or asked.csv):
            text += f"\nPlot: {asked.plot}\n"
    sys.stdout.write(text)
    return 0


def _roots(
    asked: argparse.Namespace, question: "Question", quantity: str, law: str
) -> "tuple[str, Recommended | None]":
    """Answer with the range or the mass at which a quantity takes a value."""
    from jblast.cli.arguments.calc.question import check_roots
    from jblast.report.calculator.terminal import (
        root_line,
        roots_csv,
        roots_json,
        roots_text,
    )
    from jblast.sensors.calculator.inverse import roots
    from jblast.sensors.calculator.recommended import recommended_root

    found = {name: one for name, one in roots(question).items() if law in ("", name)}
    check_roots(question, found)
    recommended = recommended_root(question, found)
    if asked.json:
        return roots_json(question, found, recommended), recommended
    if asked.csv or asked.table:
        return (roots_csv if asked.csv else roots_text)(question, found), recommended
    return root_line(question, recommended, found), recommended


def _forward(
    asked: argparse.Namespace, question: "Question", quantity: str, law: str
) -> "tuple[str, Recommended | None]":
    """Answer with quantities at ranges from masses."""
    from jblast.report.calculator.answer import between_limits
    from jblast.report.calculator.terminal import (
        calculation_csv,
        calculation_json,
        calculation_text,
        value_line,
    )
    from jblast.sensors.calculator.disagreement import disagreements
    from jblast.sensors.calculator.forward import calculate, only, with_other_burst
    from jblast.sensors.calculator.recommended import recommended_value

    rows = question.rows()
    answer = only(calculate(question.scene, *rows), quantity, law)
    recommended = None
    if quantity and len(rows[0]) == 1:
        recommended = recommended_value(question, quantity, answer[quantity])
        if not (asked.json or asked.csv or asked.table):
            return value_line(question, recommended, answer[quantity]), recommended
    other = None
    if between_limits(question):
        other = only(calculate(with_other_burst(question.scene), *rows), quantity, law)
    apart = disagreements(question, answer)
    if asked.csv:
        return calculation_csv(question, answer, apart), recommended
    if asked.json:
        return calculation_json(
            question, answer, other, apart, recommended
        ), recommended
    return calculation_text(question, answer, other, apart), recommended
