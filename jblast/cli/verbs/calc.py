"""Calculate a blast by every law, or the range or mass at which it takes a value.

Numbers outside a law's range are answered and marked. With --overpressure, --impulse,
... beside --range or --mass alone, the other of the two is what is asked for. One
question, that or --quantity, is answered in one line, by the law that we take, the
others below; --table prints them all alike. Numbers may carry a unit: 33lb, 1psi.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.numbers import (
    MOST_ROWS,
    measured,
    measured_positive,
    number,
    several,
)
from jblast.cli.arguments.options import check_figure, path, save_figure
from jblast.errors import InputError, nearest, shown
from jblast.parameters import PARAMETERS
from jblast.quantities import QUANTITIES

if TYPE_CHECKING:  # --help needs none of them
    from jblast.scene import Air, Scene
    from jblast.sensors.calculator import Question, Recommended, Roots

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
DRY = {"relative_humidity": 0.0}
"""The standard atmosphere, which the tables are for, is dry; a scene's air is not."""


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
        "--all-laws",
        "--table",
        dest="table",
        action="store_true",
        help="print all laws with their ranges, not only the recommended one",
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


def run(asked: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
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
    from jblast.report.calculator.answer import inverse_answer
    from jblast.report.calculator.terminal import root_line, roots_csv, roots_text
    from jblast.sensors.calculator import recommended_root, roots

    found = {name: one for name, one in roots(question).items() if law in ("", name)}
    check_roots(question, found)
    recommended = recommended_root(question, found)
    if asked.json:
        answer = inverse_answer(question, found, recommended)
        return answer.to_json(), recommended
    if asked.csv or asked.table:
        return (roots_csv if asked.csv else roots_text)(question, found), recommended
    return root_line(question, recommended, found), recommended


def _forward(
    asked: argparse.Namespace, question: "Question", quantity: str, law: str
) -> "tuple[str, Recommended | None]":
    """Answer with quantities at ranges from masses."""
    from jblast.report.calculator.answer import between_limits, calculator_answer
    from jblast.report.calculator.terminal import (
        calculation_csv,
        calculation_text,
        recommended_text,
        value_line,
    )
    from jblast.sensors.calculator import (
        calculate,
        disagreements,
        only,
        recommended_value,
        with_other_burst,
    )

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
        whole = calculator_answer(question, answer, other, apart, recommended)
        return whole.to_json(), recommended
    if len(rows[0]) == 1 and not asked.table:
        return recommended_text(question, answer, apart), recommended
    return calculation_text(question, answer, other, apart), recommended


def question_of(asked: argparse.Namespace) -> "Question":
    """Return what is asked.

    Raises:
        InputError: A number is no number or out of bounds, options contradict each
            other or are too few, or a range lies inside the charge.
    """
    from jblast.sensors.calculator import Question, with_burst

    measured = [name for name in MEASURED if _given(asked, name) is not None]
    _check_options(asked, measured)
    defaults = set()
    for field, options in {
        "air": ("temperature", "pressure", "altitude", "humidity", "sound_speed"),
        "ground": ("p_speed",),
        "burst": ("burst",),
        "explosive": ("explosive",),
    }.items():
        if all(_given(asked, option) is None for option in options):
            defaults.add(field)
    quantity, target = "", math.nan
    if measured:
        quantity = MEASURED[measured[0]][0]
        target = _given(asked, measured[0])
    question = Question(
        scene=_scene(asked),
        slant_range=tuple(chain(*(asked.range or ()))),
        charge_mass=tuple(chain(*(asked.mass or ()))),
        quantity=quantity,
        target=target,
        defaults=frozenset(defaults),
        units=asked.units or "si",
    )
    _check_rows(question, measured)
    return with_burst(question)


def check_plot(question: "Question") -> None:
    """Refuse a question whose answer is no curve against range.

    Raises:
        InputError: It is.
    """
    if not question.quantity and len(question.charge_mass) != 1:
        raise InputError(
            "--plot: it draws all laws against range; expected one --mass, and --range"
        )


def check_roots(question: "Question", found: "dict[str, Roots]") -> None:
    """Refuse a value that no law takes where it holds, and say which ones they do.

    Raises:
        InputError: No root is valid.
    """
    from jblast.report.words import printed_number

    if any(root.valid.any() for root in found.values()):
        return
    spans = [root.attained for root in found.values() if root.attained]
    option = next(name for name, (q, _) in MEASURED.items() if q == question.quantity)
    units = question.units
    target = printed_number(question.quantity, question.target, system=units)
    if not spans:
        raise InputError(f"--{option}: no law that holds here gives it; got {target}")
    low = printed_number(question.quantity, min(low for low, _ in spans), 3, units)
    high = printed_number(question.quantity, max(high for _, high in spans), 3, units)
    raise InputError(
        f"--{option}: expected a value that some law takes inside its range, "
        f"from {low} to {high}; got {target}"
    )


def _given(asked: argparse.Namespace, option: str) -> Any:
    return getattr(asked, option.replace("-", "_"))


def _check_options(asked: argparse.Namespace, measured: Sequence[str]) -> None:
    """Refuse options that contradict each other, or too few."""
    options = ", ".join(f"--{name}" for name in MEASURED)
    if len(measured) > 1:
        both = " and ".join(f"--{name}" for name in measured)
        raise InputError(f"expected one of {options}; got {both}")
    if measured and bool(asked.range) == bool(asked.mass):
        got = "both" if asked.range else "neither"
        raise InputError(
            f"--{measured[0]}: expected --mass (which asks for the range) or --range "
            f"(which asks for the mass) beside it; got {got}"
        )
    if not measured and not (asked.range and asked.mass):
        got = "--range" if asked.range else "--mass" if asked.mass else "neither"
        raise InputError(
            f"expected --mass and --range, or one of them and one of {options}; "
            f"got {got}{'' if got == 'neither' else ' alone'}"
        )
    if asked.json and asked.csv:
        raise InputError("expected --json or --csv, got both")
    if asked.units not in (None, "si", "us"):
        raise InputError(f"--units: expected si or us; got {shown(asked.units)}")
    for other in ("json", "csv"):
        if asked.units == "us" and _given(asked, other):
            raise InputError(
                f"--units: expected si beside --{other}, whose names end in SI units"
            )
        if asked.table and _given(asked, other):
            raise InputError(f"expected --table or --{other}, got both")
    for rival in ("pressure", "temperature"):
        if asked.altitude is not None and _given(asked, rival) is not None:
            raise InputError(
                f"--altitude: expected it alone or --temperature and --pressure; got "
                f"it beside --{rival}"
            )


def _check_rows(question: "Question", measured: Sequence[str]) -> None:
    """Refuse too many rows, and ranges inside the charge."""
    from jblast.sensors.calculator import charge_radius

    ranges, masses = question.slant_range, question.charge_mass
    if measured:
        if len(ranges) + len(masses) > 1:
            raise InputError(
                f"--{measured[0]}: expected one --mass or one --range beside it; got "
                f"{len(ranges) + len(masses)}"
            )
        return
    if len(ranges) * len(masses) > MOST_ROWS:
        raise InputError(
            f"--range and --mass: expected at most {MOST_ROWS} combinations, got "
            f"{len(ranges)} times {len(masses)}"
        )
    radius = float(charge_radius(max(masses)))
    if min(ranges) <= radius:
        raise InputError(
            f"--range: expected a range outside the charge, whose radius is "
            f"{radius:.4g} m ({max(masses):g} kg as a sphere of TNT at 1630 kg/m3); "
            f"got {min(ranges):g} m"
        )


def _scene(asked: argparse.Namespace) -> "Scene":
    from jblast.scene import Air, Charge, Ground, Scene
    from jblast.scene.charge import BURSTS, explosive_named

    burst = asked.burst
    if burst is not None and burst not in BURSTS:
        raise InputError(
            f"--burst: expected one of {', '.join(BURSTS)}; got {shown(burst)}"
            f"{nearest(burst, BURSTS)}"
        )
    air = {
        key: _bounded(asked, option, f"air_{name}")
        for key, option, name in (
            ("temperature", "temperature", "temperature_k"),
            ("pressure", "pressure", "pressure_pa"),
            ("altitude", "altitude", "altitude_m"),
            ("relative_humidity", "humidity", "relative_humidity"),
            ("sound_speed", "sound_speed", "sound_speed_m_s"),
        )
        if _given(asked, option) is not None
    }
    ground = Ground()
    if asked.p_speed is not None:
        ground = Ground(p_speed=_bounded(asked, "p_speed", "ground_p_speed_m_s"))
    height = 0.0 if asked.height is None else asked.height
    explosive = "TNT"
    if asked.explosive is not None:
        explosive = explosive_named(asked.explosive, "--explosive")
    charge = Charge(position_m=(0.0, 0.0, height), burst=burst, explosive=explosive)
    mixed = replace(Air(), **DRY | air)
    _check_vapour(mixed)
    return Scene(charge=charge, air=mixed, ground=ground)


def _check_vapour(air: "Air") -> None:
    """Refuse steam: the sound speed of humid air means nothing for it."""
    from jblast.waves.propagation import water_vapour_fraction

    kelvin, pascal, humidity = (
        x.item() for x in (air.temperature, air.pressure, air.relative_humidity)
    )
    if not humidity or air.altitude is not None:  # never so warm or thin
        return
    most = 1.0 / water_vapour_fraction(kelvin, pascal, 1.0).item()
    if humidity >= most:
        raise InputError(
            f"--humidity: expected less than {most:.3g}, where water boils at "
            f"{kelvin:g} K and {pascal:g} Pa; got {humidity:g}"
        )


def _bounded(asked: argparse.Namespace, option: str, parameter: str) -> float:
    """Return an option that a scene file may hold too, within its bounds there."""
    bounds = PARAMETERS[parameter].bounds
    where = f"--{option.replace('_', '-')}"
    value = _given(asked, option)
    if not bounds.allows(value):
        raise InputError(
            f"{where}: expected a number that is {bounds.words()}, got {value:g}"
        )
    return value


def wanted(asked: argparse.Namespace) -> tuple[str, str]:
    """Return the quantity and the law that alone are asked for; "" leaves it open.

    Raises:
        InputError: One is unknown, or they do not go together.
    """
    from jblast.sensors.calculator import COMBINATIONS, calculated_laws

    measured = [
        name for name in MEASURED if getattr(asked, name.replace("-", "_")) is not None
    ]
    quantity, law = asked.quantity or "", asked.law or ""
    if quantity and measured:
        raise InputError(
            f"--quantity: expected it beside --mass and --range; with --{measured[0]} "
            "it is the range or the mass that is asked for"
        )
    laws = calculated_laws()
    known = {one.quantity for one in laws} | set(COMBINATIONS)
    quantity = MEASURED.get(quantity, (quantity, ""))[0]
    if quantity and quantity not in known:
        names = [name for name in QUANTITIES if name in known]
        names += sorted(known - set(names))
        raise InputError(
            f"--quantity: expected one of {', '.join(names)}, or "
            f"{', '.join(MEASURED)}; got {shown(quantity)}{nearest(quantity, known)}"
        )
    of = MEASURED[measured[0]][0] if measured else quantity
    parts = COMBINATIONS[of].parts if of in COMBINATIONS else (of,)
    names = sorted({one.name for one in laws if not of or one.quantity in parts})
    if law and law not in names:
        raise InputError(
            f"--law: expected one of {', '.join(names)}; got {shown(law)}"
            f"{nearest(law, names)}"
        )
    return quantity, law
