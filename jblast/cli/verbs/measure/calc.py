"""Calculate a blast by every law, or the range or mass at which it takes a value.

Numbers outside a law's range are answered and marked. With --overpressure, --impulse,
... beside --range or --mass alone, the other of the two is what is asked for.
"""

import argparse
import sys

from jblast.cli.arguments.calculator import add_arguments as add_arguments
from jblast.cli.arguments.paths import check_figure, save_figure


def run(asked: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.cli.arguments.question import check_plot, check_roots, question_of
    from jblast.report.calculator.files import (
        calculation_csv,
        calculation_json,
        roots_csv,
        roots_json,
    )
    from jblast.report.calculator.notes import between_limits
    from jblast.report.calculator.terminal import calculation_text, roots_text
    from jblast.sensors.calculator.disagreement import disagreements
    from jblast.sensors.calculator.forward import calculate, with_other_burst
    from jblast.sensors.calculator.inverse import roots

    question = question_of(asked)
    if asked.plot:
        check_figure("--plot", asked.plot, force=asked.force)
        check_plot(question)
    if question.quantity:
        found = roots(question)
        check_roots(question, found)
        write = roots_json if asked.json else roots_csv if asked.csv else roots_text
        sys.stdout.write(write(question, found))
        return 0
    rows = question.rows()
    answer = calculate(question.scene, *rows)
    other = None
    if between_limits(question):
        other = calculate(with_other_burst(question.scene), *rows)
    if asked.plot:
        from jblast.report.calculator.figure import calculator_figure

        save_figure(calculator_figure(question), asked.plot)
    apart = disagreements(question, answer)
    if asked.csv:
        sys.stdout.write(calculation_csv(question, answer, apart))
    else:
        write = calculation_json if asked.json else calculation_text
        sys.stdout.write(write(question, answer, other, apart))
    if asked.plot and not (asked.json or asked.csv):
        sys.stdout.write(f"\nPlot: {asked.plot}\n")
    return 0
