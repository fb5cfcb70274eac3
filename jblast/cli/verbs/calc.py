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
                        unit (1psi, 140dB), to find the range or the mass
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
  --temperature K       temperature; air temperature [K], or with a unit (20C)
                        (default: 288.15)
  --pressure PA         pressure; air pressure [Pa], or with a unit (1013hPa)
                        (default: 101325)
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
  --humidity F          percentage; relative humidity, 0 to 1, or with a unit (50%)
                        (default: 0)
  --sound-speed M_S     speed; speed of sound in air [m/s] (default: from temperature
                        and humidity)
  --p-speed M_S         speed; P-wave speed of the ground [m/s] (default: granite, 5660)
"""

import argparse
import math
import sys
from collections.abc import Collection
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
    from collections.abc import Mapping

    from jblast.scene import Scene
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
EXCLUSIVE = (
    *(("json", "csv"), ("json", "all-laws"), ("csv", "all-laws")),
    *(("altitude", "pressure"), ("altitude", "temperature")),
    *(("quantity", name) for name in MEASURED),
)
"""Pairs of options of which one is expected."""
AIR = {
    "temperature": ("temperature", "air_temperature_k"),
    "pressure": ("pressure", "air_pressure_pa"),
    "altitude": ("altitude", "air_altitude_m"),
    "humidity": ("relative_humidity", "air_relative_humidity"),
    "sound-speed": ("sound_speed", "air_sound_speed_m_s"),
}
"""Field of the air and parameter of a scene file, by option."""


def run(options: argparse.Namespace) -> int:
    """Calculate, print, and return the exit code."""
    _check_options(options)
    from jblast.files import save
    from jblast.report.calc import Calc
    from jblast.report.output import Answer, deliver, figure_file
    from jblast.report.view import View

    calculation = Calc(question_of(options), *selection(options))
    if calculation.question.quantity:
        check_roots(calculation.question, calculation.roots)
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


def _given(options: argparse.Namespace) -> dict[str, Any]:
    """Return the given options by name."""
    found = {name.replace("_", "-"): value for name, value in vars(options).items()}
    return {name: value for name, value in found.items() if value not in (None, False)}


def question_of(options: argparse.Namespace) -> "Question":
    """Return the question of the options.

    Raises:
        InputError: A number is out of bounds, or a range lies inside the charge.
    """
    from jblast.sensors.calculator import Question, charge_radius

    given = _given(options)
    measured = next((name for name in MEASURED if name in given), "")
    ranges, masses = (tuple(chain(*(x or ()))) for x in (options.range, options.mass))
    related = {"air": AIR, "ground": ["p-speed"], "burst": ["burst"]}
    related |= {"explosive": ["explosive"]}
    if not measured:
        # the largest charge and the shortest range are the worst of all combinations
        radius = float(charge_radius(max(masses)))
        if min(ranges) <= radius:
            raise InputError(
                f"--range: expected a range outside the charge, whose radius is "
                f"{radius:.4g} m ({max(masses):g} kg as a sphere of TNT at 1630 "
                f"kg/m3); got {min(ranges):g} m"
            )
    return Question(
        scene=_scene(options, given),
        slant_range=ranges,
        charge_mass=masses,
        quantity=MEASURED.get(measured, ""),
        target=given.get(measured, math.nan),
        defaults=frozenset(
            name for name, of in related.items() if not {*of} & {*given}
        ),
        units=options.units,
    )


def check_roots(question: "Question", found: "Mapping[str, Roots]") -> None:
    """Check that a law has the value inside its validity range.

    Raises:
        InputError: No root is valid; the message has the values that laws have.
    """
    from jblast.report.numbers import printed_number

    # A root outside the validity range is printed only beside a valid one.
    if any(root.valid.any() for root in found.values()):
        return
    # The message names the option that the user typed.
    option = next(name for name, of in MEASURED.items() if of == question.quantity)
    printed = partial(printed_number, question.quantity, system=question.units)
    ends = [end for root in found.values() for end in root.attained or ()]
    span = f", from {printed(min(ends), 3)} to {printed(max(ends), 3)}" if ends else ""
    raise InputError(
        f"--{option}: expected a value of some law inside its validity range{span}; "
        f"got {printed(question.target)}"
    )


def _check_options(options: argparse.Namespace) -> None:
    """Check that options are complete and do not contradict one another."""
    given = _given(options)
    measured = [name for name in MEASURED if name in given]
    stated = [name for name in ("range", "mass") if name in given] + measured
    if len(stated) != 2 or len(measured) > 1:
        raise InputError(
            "expected --mass and --range, or one of them and one of "
            f"{', '.join(f'--{name}' for name in MEASURED)}; got "
            f"{' and '.join(f'--{name}' for name in stated) or 'neither'}"
        )
    for one, other in EXCLUSIVE:
        if one in given and other in given:
            raise InputError(f"--{one}: expected it or --{other}, got both")
    if options.units == "us" and (options.json or options.csv):
        raise InputError("--units: expected si with --json and --csv, got us")
    ranges, masses = (sum(map(len, x or ())) for x in (options.range, options.mass))
    if measured and ranges + masses > 1:
        raise InputError(
            f"--{measured[0]}: expected one --mass or one --range, "
            f"got {ranges + masses}"
        )
    if ranges * masses > MOST_ROWS:
        raise InputError(
            f"--range and --mass: expected at most {MOST_ROWS} combinations, got "
            f"{ranges} times {masses}"
        )
    if options.plot:
        check_figure("--plot", options.plot, force=options.force)
        # a figure against range has one curve a law, so that several masses do not fit
        if masses > 1:
            raise InputError(f"--plot: expected one --mass, got {masses}")


def _scene(options: argparse.Namespace, given: "Mapping[str, Any]") -> "Scene":
    from jblast.scene import Air, Charge, Ground, Scene
    from jblast.scene.charge import explosive_named
    from jblast.waves.propagation import water_vapour_fraction

    ground = Ground()
    if "p-speed" in given:
        ground = Ground(p_speed=_bounded("p-speed", given, "ground_p_speed_m_s"))
    # Masses without an explosive are those of TNT, as in the tables of handbooks.
    explosive = "TNT"
    if options.explosive is not None:
        explosive = explosive_named(options.explosive, "--explosive")
    height = (0.0, 0.0, options.height or 0.0)
    charge = Charge(position_m=height, burst=options.burst, explosive=explosive)
    fields: dict[str, Any] = {
        of: _bounded(option, given, parameter)
        for option, (of, parameter) in AIR.items()
        if option in given
    }
    # dry air, as in the standard atmosphere of the tables; that of a scene is humid
    air = replace(Air(), **dict[str, Any](relative_humidity=0.0) | fields)
    # the standard atmosphere is never warm or thin enough to boil water
    most = 1.0 / water_vapour_fraction(air.temperature, air.pressure, 1.0).item()
    if air.altitude is None and air.relative_humidity.item() >= most:
        raise InputError(
            f"--humidity: expected less than {most:.3g}, where water boils at "
            f"{air.temperature.item():g} K and {air.pressure.item():g} Pa; "
            f"got {options.humidity:g}"
        )
    return Scene(charge, air=air, ground=ground)


def _bounded(option: str, given: "Mapping[str, Any]", parameter: str) -> float:
    """Return an option within the bounds of the same parameter of a scene file."""
    return PARAMETERS[parameter].bounds.checked(given[option], f"--{option}")


def selection(options: argparse.Namespace) -> tuple[str, str]:
    """Return the requested quantity and law; "" stands for all.

    Raises:
        InputError: A name is unknown, or the law does not give the quantity.
    """
    from jblast.sensors.calculator import COMBINATIONS, calculated_laws

    laws = calculated_laws()
    known = {one.quantity for one in laws} | set(COMBINATIONS)
    quantity = MEASURED.get(options.quantity, options.quantity or "")
    # in the order of the table: readings first, then quantities of laws only
    _check_name(
        "quantity",
        quantity,
        [
            *filter(known.__contains__, QUANTITIES),
            *MEASURED,
            *sorted(known - {*QUANTITIES}),
        ],
    )
    # A reflected or other combined quantity has the laws of its parts.
    of = next((MEASURED[one] for one in MEASURED if one in _given(options)), quantity)
    parts = COMBINATIONS[of].parts if of in COMBINATIONS else (of,)
    names = sorted({one.name for one in laws if not of or one.quantity in parts})
    _check_name("law", options.law or "", names)
    return quantity, options.law or ""


def _check_name(option: str, name: str, known: Collection[str]) -> None:
    if name and name not in known:
        raise InputError(
            f"--{option}: expected one of {', '.join(known)}; got {shown(name)}"
            f"{nearest(name, known)}"
        )
