"""What `jblast calc` takes."""

import argparse

from jblast.cli.arguments.numbers import number, positive, several
from jblast.cli.arguments.paths import path
from jblast.parameter_table import PARAMETERS
from jblast.quantity_table import QUANTITIES

MEASURED = {
    "overpressure": ("peak_overpressure_pa", "incident peak overpressure"),
    "impulse": ("positive_impulse_pa_s", "incident positive impulse"),
    "arrival": ("air_arrival_s", "travel time of the air shock"),
    "duration": ("positive_duration_s", "duration of the positive phase"),
    "reflected-pressure": ("reflected_pressure_pa", "reflected peak pressure"),
    "reflected-impulse": ("reflected_impulse_pa_s", "reflected impulse"),
}
"""Options of what was measured: the quantity, and its words in `--help`."""


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
    for name, (quantity, words) in MEASURED.items():
        unit = QUANTITIES[quantity].unit.upper().replace(" ", "_")
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
    kelvin, pascal, granite = (
        PARAMETERS[name].default
        for name in ("air_temperature_k", "air_pressure_pa", "ground_p_speed_m_s")
    )
    for name, unit, words in (
        ("height", "M", "of burst; negative is buried (default: 0)"),
        ("temperature", "K", f"of the air (default: {kelvin:g})"),
        ("pressure", "PA", f"of the air (default: {pascal:g})"),
        ("altitude", "M", "standard atmosphere there, instead of the two"),
        ("humidity", "F", "relative, 0 to 1 (default: 0)"),
        ("sound-speed", "M_S", "(default: from temperature and humidity)"),
        (
            "p-speed",
            "M_S",
            f"of the ground (default: granite, {granite:g})",
        ),
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
