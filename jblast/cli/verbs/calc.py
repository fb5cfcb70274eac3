"""Calculate a blast by every law, or the range or mass at which it takes a value.

Each quantity is answered by the recommended law; --all-laws prints all laws with their
ranges of validity, and marks values outside them. One of --overpressure, --impulse, ...
with --range or --mass gives the other of the two. Several ranges or masses are one
table.

Numbers may have a unit: 33lb, 1psi. Exit code 4: no law of the quantity (without
--quantity: of the peak overpressure) is valid at any range.

example:
  jblast calc --mass 15 --range 20

input:
  --mass KG...          several mass; mass of the explosive [kg], or with a unit (33lb):
                        one, several, or FROM:TO:COUNT, evenly spaced in ln
  --range M...          several length; slant range [m], or with a unit (100ft): one,
                        several, or FROM:TO:COUNT, evenly spaced in ln
  --overpressure PA     positive pressure; incident peak overpressure [Pa], or with a
                        unit (1psi), to find the range or the mass
  --impulse PA_S        positive impulse; incident positive impulse [Pa s], or with a
                        unit (10psi_ms), to find the range or the mass
  --arrival S           positive time; travel time of the air shock [s], or with a unit
                        (50ms), to find the range or the mass
  --duration S          positive time; duration of the positive phase [s], or with a
                        unit (50ms), to find the range or the mass
  --reflected-pressure PA  positive pressure; reflected peak pressure [Pa], or with a
                        unit (1psi), to find the range or the mass
  --reflected-impulse PA_S  positive impulse; reflected impulse [Pa s], or with a unit
                        (10psi_ms), to find the range or the mass
  --quantity QUANTITY   text; quantity to calculate (default: all): a name as in a log,
                        or overpressure, impulse, ...
model:
  --law NAME            text; law to calculate by (default: all)
  --burst surface|free-air  choice; hemispherical or spherical curves (default: from the
                        height)
  --explosive NAME      text; explosive (default: TNT)
  --height M            length; height of burst [m], negative if buried (default: 0)
  --temperature K       number; air temperature [K] (default: 288.15)
  --pressure PA         pressure; air pressure [Pa] (default: 101325)
  --altitude M          length; altitude in the standard atmosphere [m], in place of
                        temperature and pressure
output:
  --all-laws            all laws with their ranges of validity
  --units si|us         choice = si; printed units: SI, or ft, lb, psi, psi ms
  --plot FILE           path; figure of the laws against range, each within its range of
                        validity (.png, .svg or .pdf)
  --json                answer as JSON, instead of text
  --csv                 values of all laws as CSV, one a line
  --force               permission to overwrite an existing --plot
advanced:
  --humidity F          number; relative humidity, 0 to 1 (default: 0)
  --sound-speed M_S     speed; speed of sound in air [m/s] (default: from temperature
                        and humidity)
  --p-speed M_S         speed; P-wave speed of the ground [m/s] (default: granite, 5660)
"""

import argparse
import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

from jblast.cli.kinds import MOST_ROWS
from jblast.cli.options import check_figure
from jblast.errors import InputError, nearest, shown
from jblast.parameters import PARAMETERS
from jblast.quantities import QUANTITIES

if TYPE_CHECKING:  # --help needs none of them
    from jblast.scene import Air, Scene
    from jblast.sensors.calculator import Question, Roots

# Options have the words of handbooks; logs and laws have one name with a unit.
MEASURED = {
    "overpressure": "peak_overpressure_pa",
    "impulse": "positive_impulse_pa_s",
    "arrival": "air_arrival_s",
    "duration": "positive_duration_s",
    "reflected-pressure": "reflected_pressure_pa",
    "reflected-impulse": "reflected_impulse_pa_s",
}
"""Quantity of each option with a value to find."""
AIR = {
    "temperature": ("temperature", "air_temperature_k"),
    "pressure": ("pressure", "air_pressure_pa"),
    "altitude": ("altitude", "air_altitude_m"),
    "humidity": ("relative_humidity", "air_relative_humidity"),
    "sound_speed": ("sound_speed", "air_sound_speed_m_s"),
}
"""Field of the air and parameter of a scene file, by option."""


def run(options: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    from jblast.cli.jax_start import start_jax

    given, measured = _given(options)
    _check_options(options, given, measured)
    # a calculation compiles for longer than it computes
    start_jax(quick=True)
    from jblast.files import save
    from jblast.report.calc import Calc
    from jblast.report.output import Answer, deliver, figure_file
    from jblast.report.view import View

    question = question_of(options)
    quantity, law = selection(options)
    calculation = Calc(question, quantity, law)
    if measured:
        check_roots(question, calculation.roots)
    saved = {}
    if options.plot:
        saved[options.plot] = figure_file(calculation.figure, options.plot)
    if options.csv:
        sys.stdout.write(calculation.csv())
        for file, content in saved.items():
            save(file, content)
        return calculation.code
    is_text = not options.json
    view = calculation.view(all_laws=options.all_laws) if is_text else View("")
    answer = Answer(calculation.document(), view, saved=saved, code=calculation.code)
    return deliver(answer, options)


def _given(options: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """Return the given options, and those of them with a value to find."""
    given = {name: value for name, value in vars(options).items() if value is not None}
    return given, [name for name in MEASURED if name.replace("-", "_") in given]


def question_of(options: argparse.Namespace) -> "Question":
    """Return the question of the options.

    Raises:
        InputError: A number is out of bounds, or a range lies inside the charge.
    """
    from jblast.sensors.calculator import Question, charge_radius, with_burst

    given, measured = _given(options)
    ranges, masses = (tuple(chain(*(x or ()))) for x in (options.range, options.mass))
    related = {"air": AIR, "ground": ["p_speed"], "burst": ["burst"]}
    related |= {"explosive": ["explosive"]}
    question = Question(
        scene=_scene(options, given),
        slant_range=ranges,
        charge_mass=masses,
        quantity=MEASURED[measured[0]] if measured else "",
        target=given[measured[0].replace("-", "_")] if measured else math.nan,
        defaults=frozenset(
            name for name, of in related.items() if not {*of} & {*given}
        ),
        units=options.units,
    )
    if not measured:
        # the largest charge and the shortest range are the worst of all combinations
        radius = float(charge_radius(max(masses)))
        if min(ranges) <= radius:
            raise InputError(
                f"--range: expected a range outside the charge, whose radius is "
                f"{radius:.4g} m ({max(masses):g} kg as a sphere of TNT at 1630 "
                f"kg/m3); got {min(ranges):g} m"
            )
    return with_burst(question)


def check_roots(question: "Question", found: "Mapping[str, Roots]") -> None:
    """Check that a law has the value inside its validity range.

    Raises:
        InputError: No root is valid; the message has the values that laws have.
    """
    from jblast.report.numbers import printed_number

    # A root outside the validity range is printed only beside a valid one.
    if any(root.valid.any() for root in found.values()):
        return
    spans = [root.attained for root in found.values() if root.attained]
    # The message names the option that the user typed.
    option = next(name for name, of in MEASURED.items() if of == question.quantity)
    printed = partial(printed_number, question.quantity, system=question.units)
    target = printed(question.target)
    if not spans:
        raise InputError(
            f"--{option}: no law that is valid here gives it; got {target}"
        )
    low, high = min(low for low, _ in spans), max(high for _, high in spans)
    raise InputError(
        f"--{option}: expected a value of some law inside its validity range, "
        f"from {printed(low, 3)} to {printed(high, 3)}; got {target}"
    )


def _check_options(
    options: argparse.Namespace, given: Mapping, measured: list[str]
) -> None:
    """Check that options are complete and do not contradict one another."""
    choices = ", ".join(f"--{name}" for name in MEASURED)
    sides = [name for name in ("range", "mass") if name in given]
    ranges, masses = (sum(map(len, x or ())) for x in (options.range, options.mass))
    got = " and ".join(f"--{name}" for name in sides) or "neither"
    if len(measured) > 1:
        both = " and ".join(f"--{name}" for name in measured)
        raise InputError(f"expected one of {choices}; got {both}")
    if measured and len(sides) != 1:
        raise InputError(
            f"--{measured[0]}: expected --mass (to find the range) or --range (to find "
            f"the mass); got {'both' if sides else 'neither'}"
        )
    if measured and options.quantity:
        raise InputError(
            f"--quantity: expected --mass and --range, got --{measured[0]}, which "
            "finds the range or the mass"
        )
    if measured and ranges + masses > 1:
        raise InputError(
            f"--{measured[0]}: expected one --mass or one --range; "
            f"got {ranges + masses}"
        )
    if not measured and len(sides) < 2:
        raise InputError(
            f"expected --mass and --range, or one of them and one of {choices}; "
            f"got {got}{' alone' if sides else ''}"
        )
    if ranges * masses > MOST_ROWS:
        raise InputError(
            f"--range and --mass: expected at most {MOST_ROWS} combinations, got "
            f"{ranges} times {masses}"
        )
    if options.plot:
        check_figure("--plot", options.plot, force=options.force)
        # a figure against range has one curve a law, so that several masses do not fit
        if not measured and masses > 1:
            raise InputError(f"--plot: expected one --mass, got {masses}")
    outputs = [name for name in ("json", "csv", "all_laws") if given[name]]
    if len(outputs) > 1:
        words = " and ".join(f"--{name.replace('_', '-')}" for name in outputs)
        raise InputError(f"expected one of --json, --csv and --all-laws; got {words}")
    if options.units == "us" and (options.json or options.csv):
        raise InputError(
            f"--units: expected si with --{outputs[0]}, whose names end in SI units; "
            "got us"
        )
    rivals = [name for name in ("pressure", "temperature") if name in given]
    if "altitude" in given and rivals:
        raise InputError(
            "--altitude: expected --altitude, or --temperature and --pressure; "
            f"got --altitude and --{rivals[0]}"
        )


def _scene(options: argparse.Namespace, given: Mapping) -> "Scene":
    from jblast.scene import Air, Charge, Ground, Scene
    from jblast.scene.charge import explosive_named

    ground = Ground()
    if "p_speed" in given:
        ground = Ground(p_speed=_bounded("p_speed", given, "ground_p_speed_m_s"))
    # Masses without an explosive are those of TNT, as in the tables of handbooks.
    explosive = "TNT"
    if options.explosive is not None:
        explosive = explosive_named(options.explosive, "--explosive")
    height = (0.0, 0.0, options.height or 0.0)
    charge = Charge(position_m=height, burst=options.burst, explosive=explosive)
    fields = {
        of: _bounded(option, given, parameter)
        for option, (of, parameter) in AIR.items()
        if option in given
    }
    # dry air, as in the standard atmosphere of the tables; that of a scene is humid
    air = replace(Air(), **{"relative_humidity": 0.0} | fields)
    _check_vapour(air)
    return Scene(charge=charge, air=air, ground=ground)


def _check_vapour(air: "Air") -> None:
    """Check that the air is not steam, for which the sound speed has no meaning."""
    from jblast.waves.propagation import water_vapour_fraction

    kelvin, pascal, humidity = (
        x.item() for x in (air.temperature, air.pressure, air.relative_humidity)
    )
    # the standard atmosphere is never warm or thin enough to boil water
    if not humidity or air.altitude is not None:
        return
    # the fraction is linear in humidity: 1 is pure vapour
    most = 1.0 / water_vapour_fraction(kelvin, pascal, 1.0).item()
    if humidity >= most:
        raise InputError(
            f"--humidity: expected less than {most:.3g}, where water boils at "
            f"{kelvin:g} K and {pascal:g} Pa; got {humidity:g}"
        )


def _bounded(option: str, given: Mapping, parameter: str) -> float:
    """Return an option within the bounds of the same parameter of a scene file."""
    bounds, value = PARAMETERS[parameter].bounds, given[option]
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

    _, measured = _given(options)
    quantity, law = options.quantity or "", options.law or ""
    laws = calculated_laws()
    known = {one.quantity for one in laws} | set(COMBINATIONS)
    quantity = MEASURED.get(quantity, quantity)
    if quantity and quantity not in known:
        # In the order of the table: readings first, then quantities of laws only.
        names = [name for name in QUANTITIES if name in known]
        names += sorted(known - set(names))
        raise InputError(
            f"--quantity: expected one of {', '.join(names)}, or "
            f"{', '.join(MEASURED)}; got {shown(quantity)}{nearest(quantity, known)}"
        )
    # A reflected or other combined quantity has the laws of its parts.
    of = MEASURED[measured[0]] if measured else quantity
    parts = COMBINATIONS[of].parts if of in COMBINATIONS else (of,)
    names = sorted({one.name for one in laws if not of or one.quantity in parts})
    if law and law not in names:
        raise InputError(
            f"--law: expected one of {', '.join(names)}; got {shown(law)}"
            f"{nearest(law, names)}"
        )
    return quantity, law
