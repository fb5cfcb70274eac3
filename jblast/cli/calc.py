"""Calculate a blast by every law, or the range or mass at which it takes a value.

Numbers outside a law's range are answered and marked. With --overpressure, --impulse,
... beside --range or --mass alone, the other of the two is what is asked for.
"""

import argparse
import sys

from jblast.cli.files import path

HELP = "calculate a blast by every law, or the range or mass for a value"

MEASURED = {
    "overpressure": ("peak_overpressure_pa", "PA", "incident peak overpressure"),
    "impulse": ("positive_impulse_pa_s", "PA_S", "incident positive impulse"),
    "arrival": ("air_arrival_s", "S", "travel time of the air shock"),
    "duration": ("positive_duration_s", "S", "duration of the positive phase"),
    "reflected-pressure": ("reflected_pressure_pa", "PA", "reflected peak pressure"),
    "reflected-impulse": ("reflected_impulse_pa_s", "PA_S", "reflected impulse"),
}
"""Options of what was measured: quantity, unit, words."""

PLOTS = (".png", ".svg", ".pdf")


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes. Numbers stay text: `question` says what is wrong."""
    several = "one, several, or FROM:TO:COUNT, evenly spaced in ln"
    verb.add_argument("--mass", nargs="+", metavar="KG", help=f"explosive; {several}")
    verb.add_argument("--range", nargs="+", metavar="M", help=f"slant range; {several}")
    for name, (_, unit, words) in MEASURED.items():
        verb.add_argument(
            f"--{name}", metavar=unit, help=f"{words}: asks for the range or the mass"
        )
    verb.add_argument(
        "--burst",
        metavar="surface|free-air",
        help="hemispherical or spherical curves (default: as the height leaves it)",
    )
    verb.add_argument(
        "--height", metavar="M", help="of burst; negative is buried (default: 0)"
    )
    verb.add_argument(
        "--explosive", metavar="NAME", help="what it is of (default: TNT)"
    )
    verb.add_argument("--temperature", metavar="K", help="of the air (default: 288.15)")
    verb.add_argument("--pressure", metavar="PA", help="of the air (default: 101325)")
    verb.add_argument(
        "--altitude", metavar="M", help="standard atmosphere there, instead of the two"
    )
    verb.add_argument("--humidity", metavar="F", help="relative, 0 to 1 (default: 0)")
    verb.add_argument(
        "--sound-speed", metavar="M_S", help="(default: from temperature and humidity)"
    )
    verb.add_argument(
        "--p-speed", metavar="M_S", help="of the ground (default: granite, 5660)"
    )
    verb.add_argument(
        "--plot",
        metavar="FILE",
        type=path,
        help="draw all laws against range, solid where they hold (.png, .svg or .pdf)",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument("--csv", action="store_true", help="print CSV, one value a line")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --plot"
    )


def run(asked: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    from jblast.cli.start import start_jax

    start_jax(quick=True)
    from jblast.cli.calc_input import check_plot, check_roots, question_of
    from jblast.report.calculator import calculation_text, roots_text
    from jblast.report.calculator_files import (
        calculation_csv,
        calculation_json,
        roots_csv,
        roots_json,
    )
    from jblast.report.calculator_notes import between_limits
    from jblast.sensors.calculate import calculate, with_other_burst
    from jblast.sensors.disagreement import disagreements
    from jblast.sensors.inverse import roots

    question = question_of(asked)
    if asked.plot:
        check_plot(asked.plot, question, force=asked.force)
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
        _draw(asked.plot, question)
    apart = disagreements(question, answer)
    if asked.csv:
        sys.stdout.write(calculation_csv(question, answer, apart))
    else:
        write = calculation_json if asked.json else calculation_text
        sys.stdout.write(write(question, answer, other, apart))
    if asked.plot and not (asked.json or asked.csv):
        sys.stdout.write(f"\nPlot: {asked.plot}\n")
    return 0


def _draw(file: str, question) -> None:
    from jblast.cli.files import unwritable
    from jblast.report.calculator_plot import calculator_figure

    figure = calculator_figure(question)
    try:
        figure.savefig(file)
    except OSError as error:
        raise unwritable(file, error) from None
