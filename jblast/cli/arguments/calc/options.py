"""What `jblast calc` takes."""

import argparse
from functools import partial

from jblast.cli.arguments.calc.measured import measured, measured_positive
from jblast.cli.arguments.numbers import number, several
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
UNITS = {
    "Pa": ("pressure", "1psi"),
    "Pa s": ("impulse", "10psi_ms"),
    "s": ("time", "50ms"),
}
"""What a value of a unit may end in: the dimension, and an example of another unit."""
EXAMPLES = {"length": "ft", "pressure": "psi", "speed": "ft/s"}


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    rows = "one, several, or FROM:TO:COUNT, evenly spaced in ln"
    for name, unit, of, words in (
        ("mass", "KG", ("mass", "33lb"), "explosive"),
        ("range", "M", ("length", "100ft"), "slant range"),
    ):
        verb.add_argument(
            f"--{name}",
            nargs="+",
            type=partial(several, one=measured_positive(*of)),
            metavar=unit,
            help=f"{words}, also as {of[1]}; {rows}",
        )
    for name, (quantity, words) in MEASURED.items():
        unit = QUANTITIES[quantity].unit
        verb.add_argument(
            f"--{name}",
            type=measured_positive(*UNITS[unit]),
            metavar=unit.upper().replace(" ", "_"),
            help=f"{words}, also as {UNITS[unit][1]}: asks for the range or the mass",
        )
    verb.add_argument(
        "--quantity",
        metavar="QUANTITY",
        help="answer for this one alone: a name as in a log, or overpressure, ...",
    )
    verb.add_argument("--law", metavar="NAME", help="answer by this law alone")
    verb.add_argument(
        "--table",
        action="store_true",
        help="every law beside its range, where one question has one answer, too",
    )
    verb.add_argument(
        "--units",
        metavar="si|us",
        help="what is printed: SI, or ft, lb, psi, psi ms (default: si)",
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
    for name, of, unit, words in (
        ("height", "length", "M", "of burst; negative is buried (default: 0)"),
        ("temperature", "", "K", f"of the air (default: {kelvin:g})"),
        ("pressure", "pressure", "PA", f"of the air (default: {pascal:g})"),
        ("altitude", "length", "M", "standard atmosphere there, instead of the two"),
        ("humidity", "", "F", "relative, 0 to 1 (default: 0)"),
        ("sound-speed", "speed", "M_S", "(default: from temperature and humidity)"),
        (
            "p-speed",
            "speed",
            "M_S",
            f"of the ground (default: granite, {granite:g})",
        ),
    ):
        kind = measured(of, f"1{EXAMPLES[of]}") if of else number
        verb.add_argument(f"--{name}", type=kind, metavar=unit, help=words)
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
