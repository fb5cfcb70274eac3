"""What `jblast calc` takes."""

import argparse

from jblast.cli.arguments.numbers import number, positive, several
from jblast.cli.arguments.paths import path

MEASURED = {
    "overpressure": ("peak_overpressure_pa", "PA", "incident peak overpressure"),
    "impulse": ("positive_impulse_pa_s", "PA_S", "incident positive impulse"),
    "arrival": ("air_arrival_s", "S", "travel time of the air shock"),
    "duration": ("positive_duration_s", "S", "duration of the positive phase"),
    "reflected-pressure": ("reflected_pressure_pa", "PA", "reflected peak pressure"),
    "reflected-impulse": ("reflected_impulse_pa_s", "PA_S", "reflected impulse"),
}
"""Options of what was measured: quantity, unit, words."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    rows = "one, several, or FROM:TO:COUNT, evenly spaced in ln"
    for name, unit, words in (
        ("mass", "KG", "explosive"),
        ("range", "M", "slant range"),
    ):
        verb.add_argument(
            f"--{name}", nargs="+", type=several, metavar=unit, help=f"{words}; {rows}"
        )
    for name, (_, unit, words) in MEASURED.items():
        verb.add_argument(
            f"--{name}",
            type=positive,
            metavar=unit,
            help=f"{words}: asks for the range or the mass",
        )
    verb.add_argument(
        "--burst",
        metavar="surface|free-air",
        help="hemispherical or spherical curves (default: as the height leaves it)",
    )
    verb.add_argument(
        "--explosive", metavar="NAME", help="what it is of (default: TNT)"
    )
    for name, unit, words in (
        ("height", "M", "of burst; negative is buried (default: 0)"),
        ("temperature", "K", "of the air (default: 288.15)"),
        ("pressure", "PA", "of the air (default: 101325)"),
        ("altitude", "M", "standard atmosphere there, instead of the two"),
        ("humidity", "F", "relative, 0 to 1 (default: 0)"),
        ("sound-speed", "M_S", "(default: from temperature and humidity)"),
        ("p-speed", "M_S", "of the ground (default: granite, 5660)"),
    ):
        verb.add_argument(f"--{name}", type=number, metavar=unit, help=words)
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
