"""Calculate a blast by every law, or the range or mass at which it takes a value.

Values outside the validity range of a law are printed and marked. One of
--overpressure, --impulse, ... with --range or --mass gives the other of the two. A
single question (such a value, or --quantity) has a one-line answer by the recommended
law, followed by the other laws; --all-laws prints all laws alike.

Numbers may have a unit: 33lb, 1psi.
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
from jblast.cli.arguments.options import (
    add_force,
    add_json,
    check_figure,
    path,
    save_figure,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, nearest, shown
from jblast.parameters import PARAMETERS
from jblast.quantities import QUANTITIES

if TYPE_CHECKING:  # --help needs none of them
    from jblast.scene import Air, Scene
    from jblast.sensors.calculator import Question, Recommended, Roots

# Options have the words of handbooks; logs and laws have one name with a unit.
MEASURED = {
    "overpressure": ("peak_overpressure_pa", "incident peak overpressure"),
    "impulse": ("positive_impulse_pa_s", "incident positive impulse"),
    "arrival": ("air_arrival_s", "travel time of the air shock"),
    "duration": ("positive_duration_s", "duration of the positive phase"),
    "reflected-pressure": ("reflected_pressure_pa", "reflected peak pressure"),
    "reflected-impulse": ("reflected_impulse_pa_s", "reflected impulse"),
}
"""Quantity of each option with a value to find, and its words in `--help`."""
UNITS = {
    "Pa": ("pressure", "1psi"),
    "Pa s": ("impulse", "10psi_ms"),
    "s": ("time", "50ms"),
}
"""Dimension of a unit, and an example of another unit of the same dimension."""
EXAMPLES = {"length": "ft", "pressure": "psi", "speed": "ft/s"}
DRY = {"relative_humidity": 0.0}
"""Dry air, as in the standard atmosphere of the tables; the air of a scene is humid."""


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    # The defaults of these options are None, and those in `--help` are set later,
    # because the answer lists which inputs were left to their defaults.
    rows = "one, several, or FROM:TO:COUNT, evenly spaced in ln"
    for name, unit, of, words in (
        ("mass", "KG", ("mass", "33lb"), "mass of the explosive [kg]"),
        ("range", "M", ("length", "100ft"), "slant range [m]"),
    ):
        verb.inputs.add_argument(
            f"--{name}",
            nargs="+",
            type=partial(several, one=measured_positive(*of)),
            metavar=unit,
            help=f"{words}, or with a unit ({of[1]}): {rows}",
        )
    for name, (quantity, words) in MEASURED.items():
        unit = QUANTITIES[quantity].unit
        verb.inputs.add_argument(
            f"--{name}",
            type=measured_positive(*UNITS[unit]),
            metavar=unit.upper().replace(" ", "_"),
            help=f"{words} [{unit}], or with a unit ({UNITS[unit][1]}), to find the "
            "range or the mass",
        )
    verb.inputs.add_argument(
        "--quantity",
        metavar="QUANTITY",
        help="quantity to calculate (default: all): a name as in a log, or "
        "overpressure, impulse, ...",
    )
    verb.model.add_argument(
        "--law", metavar="NAME", help="law to calculate by (default: all)"
    )
    verb.model.add_argument(
        "--burst",
        metavar="surface|free-air",
        help="hemispherical or spherical curves (default: from the height)",
    )
    verb.model.add_argument(
        "--explosive", metavar="NAME", help="explosive (default: TNT)"
    )
    kelvin, pascal, granite = (
        PARAMETERS[name].default
        for name in ("air_temperature_k", "air_pressure_pa", "ground_p_speed_m_s")
    )
    model, advanced = verb.model, verb.advanced
    for group, name, of, unit, words in (
        (
            model,
            "height",
            "length",
            "M",
            "height of burst [m], negative if buried (default: 0)",
        ),
        (model, "temperature", "", "K", f"air temperature [K] (default: {kelvin:g})"),
        (
            model,
            "pressure",
            "pressure",
            "PA",
            f"air pressure [Pa] (default: {pascal:g})",
        ),
        (
            model,
            "altitude",
            "length",
            "M",
            "altitude in the standard atmosphere [m], in place of temperature and "
            "pressure",
        ),
        (advanced, "humidity", "", "F", "relative humidity, 0 to 1 (default: 0)"),
        (
            advanced,
            "sound-speed",
            "speed",
            "M_S",
            "speed of sound in air [m/s] (default: from temperature and humidity)",
        ),
        (
            advanced,
            "p-speed",
            "speed",
            "M_S",
            f"P-wave speed of the ground [m/s] (default: granite, {granite:g})",
        ),
    ):
        kind = measured(of, f"1{EXAMPLES[of]}") if of else number
        group.add_argument(f"--{name}", type=kind, metavar=unit, help=words)
    verb.outputs.add_argument(
        "--all-laws",
        "--table",
        dest="table",
        action="store_true",
        help="table of all laws with their validity ranges, also for one question",
    )
    verb.outputs.add_argument(
        "--units",
        metavar="si|us",
        help="printed units: SI, or ft, lb, psi, psi ms (default: si)",
    )
    verb.outputs.add_argument(
        "--plot",
        metavar="FILE",
        type=path,
        help="figure of all laws against range, solid inside their validity ranges "
        "(.png, .svg or .pdf)",
    )
    add_json(verb)
    verb.outputs.add_argument(
        "--csv", action="store_true", help="answer as CSV, one value a line"
    )
    add_force(verb, "an existing --plot")


def run(options: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    from jblast.cli.jax_start import start_jax

    # a calculation compiles for longer than it computes
    start_jax(quick=True)
    question = question_of(options)
    quantity, law = selection(options)
    if options.plot:
        check_figure("--plot", options.plot, force=options.force)
        # a figure against range has one curve a law, so that several masses do not fit
        if not question.quantity and len(question.charge_mass) != 1:
            raise InputError(
                "--plot: expected one --mass and --range, got "
                f"{len(question.charge_mass)} masses; the figure has all laws against "
                "range"
            )
    answer = _roots if question.quantity else _forward
    text, recommended = answer(options, question, quantity, law)
    if options.plot:
        from jblast.report.calculator.figures import calculator_figure, question_figure

        one = question.quantity or quantity
        draw = question_figure(question, one, recommended, law) if one else None
        save_figure(draw or calculator_figure(question, law), options.plot)
        if not (options.json or options.csv):
            text += f"\nPlot: {options.plot}\n"
    sys.stdout.write(text)
    return 0


def _roots(
    options: argparse.Namespace, question: "Question", quantity: str, law: str
) -> "tuple[str, Recommended | None]":
    """Return the printed range or mass at which a quantity has a value."""
    from jblast.report.calculator.answer import inverse_answer
    from jblast.report.calculator.terminal import root_line, roots_csv, roots_text
    from jblast.sensors.calculator import recommended_root, roots

    found = {name: one for name, one in roots(question).items() if law in ("", name)}
    check_roots(question, found)
    recommended = recommended_root(question, found)
    if options.json:
        answer = inverse_answer(question, found, recommended)
        return answer.to_json(), recommended
    if options.csv or options.table:
        return (roots_csv if options.csv else roots_text)(question, found), recommended
    return root_line(question, recommended, found), recommended


def _forward(
    options: argparse.Namespace, question: "Question", quantity: str, law: str
) -> "tuple[str, Recommended | None]":
    """Return the printed quantities at ranges from masses."""
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
        recommended_values,
        with_other_burst,
    )

    rows = question.rows()
    answer = only(calculate(question.scene, *rows), quantity, law)
    recommended = None
    if quantity and len(rows[0]) == 1:
        # A single question gets one value; the other laws follow as a check.
        recommended = recommended_values(question, answer)[quantity]
        if not (options.json or options.csv or options.table):
            return value_line(question, recommended, answer[quantity]), recommended
    other = None
    # Between a surface and a free-air burst neither curve set holds: both are printed.
    if between_limits(question):
        other = only(calculate(with_other_burst(question.scene), *rows), quantity, law)
    apart = disagreements(question, answer)
    if options.csv:
        return calculation_csv(question, answer, apart), recommended
    if options.json:
        whole = calculator_answer(question, answer, other, apart, recommended)
        return whole.to_json(), recommended
    if len(rows[0]) == 1 and not options.table:
        return recommended_text(question, answer, apart), recommended
    return calculation_text(question, answer, other, apart), recommended


def question_of(options: argparse.Namespace) -> "Question":
    """Return the question of the options.

    Raises:
        InputError: A number is invalid or out of bounds, options are missing or
            contradict one another, or a range lies inside the charge.
    """
    from jblast.sensors.calculator import Question, with_burst

    measured = _measured(options)
    _check_options(options, measured)
    defaults = set()
    for field, related in {
        "air": ("temperature", "pressure", "altitude", "humidity", "sound_speed"),
        "ground": ("p_speed",),
        "burst": ("burst",),
        "explosive": ("explosive",),
    }.items():
        if all(_given(options, option) is None for option in related):
            defaults.add(field)
    quantity, target = "", math.nan
    if measured:
        quantity = MEASURED[measured[0]][0]
        target = _given(options, measured[0])
    question = Question(
        scene=_scene(options),
        slant_range=tuple(chain(*(options.range or ()))),
        charge_mass=tuple(chain(*(options.mass or ()))),
        quantity=quantity,
        target=target,
        defaults=frozenset(defaults),
        units=options.units or "si",
    )
    _check_rows(question, measured)
    return with_burst(question)


def check_roots(question: "Question", found: "dict[str, Roots]") -> None:
    """Check that a law has the value inside its validity range.

    Raises:
        InputError: No root is valid; the message has the values that laws have.
    """
    from jblast.report.words import printed_number

    # A root outside the validity range is printed only beside a valid one.
    if any(root.valid.any() for root in found.values()):
        return
    spans = [root.attained for root in found.values() if root.attained]
    # The message names the option that the user typed.
    option = next(name for name, (q, _) in MEASURED.items() if q == question.quantity)
    units = question.units
    target = printed_number(question.quantity, question.target, system=units)
    if not spans:
        raise InputError(
            f"--{option}: no law that is valid here gives it; got {target}"
        )
    low = printed_number(question.quantity, min(low for low, _ in spans), 3, units)
    high = printed_number(question.quantity, max(high for _, high in spans), 3, units)
    raise InputError(
        f"--{option}: expected a value of some law inside its validity range, "
        f"from {low} to {high}; got {target}"
    )


def _measured(options: argparse.Namespace) -> list[str]:
    """Return the given options of `MEASURED`."""
    return [name for name in MEASURED if _given(options, name) is not None]


def _given(options: argparse.Namespace, option: str) -> Any:
    return getattr(options, option.replace("-", "_"))


def _check_options(options: argparse.Namespace, measured: Sequence[str]) -> None:
    """Check that options are complete and do not contradict one another."""
    choices = ", ".join(f"--{name}" for name in MEASURED)
    if len(measured) > 1:
        both = " and ".join(f"--{name}" for name in measured)
        raise InputError(f"expected one of {choices}; got {both}")
    if measured and bool(options.range) == bool(options.mass):
        got = "both" if options.range else "neither"
        raise InputError(
            f"--{measured[0]}: expected --mass (to find the range) or --range (to find "
            f"the mass); got {got}"
        )
    if not measured and not (options.range and options.mass):
        got = "--range" if options.range else "--mass" if options.mass else "neither"
        raise InputError(
            f"expected --mass and --range, or one of them and one of {choices}; "
            f"got {got}{'' if got == 'neither' else ' alone'}"
        )
    if options.json and options.csv:
        raise InputError("expected --json or --csv, got both")
    if options.units not in (None, "si", "us"):
        raise InputError(f"--units: expected si or us; got {shown(options.units)}")
    for other in ("json", "csv"):
        if options.units == "us" and _given(options, other):
            raise InputError(
                f"--units: expected si with --{other}, whose names end in SI units; "
                "got us"
            )
        if options.table and _given(options, other):
            raise InputError(f"expected --table or --{other}, got both")
    for rival in ("pressure", "temperature"):
        if options.altitude is not None and _given(options, rival) is not None:
            raise InputError(
                f"--altitude: expected --altitude, or --temperature and --pressure; "
                f"got --altitude and --{rival}"
            )


def _check_rows(question: "Question", measured: Sequence[str]) -> None:
    """Check the number of rows, and that no range lies inside the charge."""
    from jblast.sensors.calculator import charge_radius

    ranges, masses = question.slant_range, question.charge_mass
    if measured:
        if len(ranges) + len(masses) > 1:
            raise InputError(
                f"--{measured[0]}: expected one --mass or one --range; got "
                f"{len(ranges) + len(masses)}"
            )
        return
    if len(ranges) * len(masses) > MOST_ROWS:
        raise InputError(
            f"--range and --mass: expected at most {MOST_ROWS} combinations, got "
            f"{len(ranges)} times {len(masses)}"
        )
    # The largest charge and the shortest range are the worst of all combinations.
    radius = float(charge_radius(max(masses)))
    if min(ranges) <= radius:
        raise InputError(
            f"--range: expected a range outside the charge, whose radius is "
            f"{radius:.4g} m ({max(masses):g} kg as a sphere of TNT at 1630 kg/m3); "
            f"got {min(ranges):g} m"
        )


def _scene(options: argparse.Namespace) -> "Scene":
    from jblast.scene import Air, Charge, Ground, Scene
    from jblast.scene.charge import BURSTS, explosive_named

    burst = options.burst
    if burst is not None and burst not in BURSTS:
        raise InputError(
            f"--burst: expected one of {', '.join(BURSTS)}; got {shown(burst)}"
            f"{nearest(burst, BURSTS)}"
        )
    air = {
        key: _bounded(options, option, f"air_{name}")
        for key, option, name in (
            ("temperature", "temperature", "temperature_k"),
            ("pressure", "pressure", "pressure_pa"),
            ("altitude", "altitude", "altitude_m"),
            ("relative_humidity", "humidity", "relative_humidity"),
            ("sound_speed", "sound_speed", "sound_speed_m_s"),
        )
        if _given(options, option) is not None
    }
    ground = Ground()
    if options.p_speed is not None:
        ground = Ground(p_speed=_bounded(options, "p_speed", "ground_p_speed_m_s"))
    height = 0.0 if options.height is None else options.height
    # Masses without an explosive are those of TNT, as in the tables of handbooks.
    explosive = "TNT"
    if options.explosive is not None:
        explosive = explosive_named(options.explosive, "--explosive")
    charge = Charge(position_m=(0.0, 0.0, height), burst=burst, explosive=explosive)
    mixed = replace(Air(), **DRY | air)
    _check_vapour(mixed)
    return Scene(charge=charge, air=mixed, ground=ground)


def _check_vapour(air: "Air") -> None:
    """Check that the air is not steam, for which the sound speed has no meaning."""
    from jblast.waves.propagation import water_vapour_fraction

    kelvin, pascal, humidity = (
        x.item() for x in (air.temperature, air.pressure, air.relative_humidity)
    )
    if (
        not humidity or air.altitude is not None
    ):  # the standard atmosphere is never warm or thin enough to boil water
        return
    # the fraction is linear in humidity: 1 is pure vapour
    most = 1.0 / water_vapour_fraction(kelvin, pascal, 1.0).item()
    if humidity >= most:
        raise InputError(
            f"--humidity: expected less than {most:.3g}, where water boils at "
            f"{kelvin:g} K and {pascal:g} Pa; got {humidity:g}"
        )


def _bounded(options: argparse.Namespace, option: str, parameter: str) -> float:
    """Return an option within the bounds of the same parameter of a scene file."""
    bounds = PARAMETERS[parameter].bounds
    value = _given(options, option)
    if not bounds.allows(value):
        raise InputError(
            f"--{option.replace('_', '-')}: expected a number that is "
            f"{bounds.words()}, got {value:g}{bounds.hint(value)}"
        )
    return value


def selection(options: argparse.Namespace) -> tuple[str, str]:
    """Return the requested quantity and law; "" stands for all.

    Raises:
        InputError: A name is unknown, or the law does not give the quantity.
    """
    from jblast.sensors.calculator import COMBINATIONS, calculated_laws

    measured = _measured(options)
    quantity, law = options.quantity or "", options.law or ""
    if quantity and measured:
        raise InputError(
            f"--quantity: expected --mass and --range, got --{measured[0]}, which "
            "finds the range or the mass"
        )
    laws = calculated_laws()
    known = {one.quantity for one in laws} | set(COMBINATIONS)
    quantity = MEASURED.get(quantity, (quantity, ""))[0]
    if quantity and quantity not in known:
        # In the order of the table: readings first, then quantities of laws only.
        names = [name for name in QUANTITIES if name in known]
        names += sorted(known - set(names))
        raise InputError(
            f"--quantity: expected one of {', '.join(names)}, or "
            f"{', '.join(MEASURED)}; got {shown(quantity)}{nearest(quantity, known)}"
        )
    # A reflected or other combined quantity has the laws of its parts.
    of = MEASURED[measured[0]][0] if measured else quantity
    parts = COMBINATIONS[of].parts if of in COMBINATIONS else (of,)
    names = sorted({one.name for one in laws if not of or one.quantity in parts})
    if law and law not in names:
        raise InputError(
            f"--law: expected one of {', '.join(names)}; got {shown(law)}"
            f"{nearest(law, names)}"
        )
    return quantity, law
