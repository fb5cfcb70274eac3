"""From the words after `jblast calc` to a question, or one message."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from jblast.cli.arguments.calc.options import MEASURED
from jblast.cli.arguments.numbers import MOST_ROWS
from jblast.errors import InputError, nearest, shown
from jblast.parameter_table import PARAMETERS
from jblast.report.words import printed_number
from jblast.scene import Air, Charge, Ground, Scene
from jblast.scene.charge import BURSTS
from jblast.scene.explosives import explosive_named
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question, charge_radius, with_burst
from jblast.waves.propagation.atmosphere import water_vapour_fraction

DRY = {"relative_humidity": 0.0}
"""The standard atmosphere, which the tables are for, is dry; a scene's air is not."""


def question_of(asked: argparse.Namespace) -> Question:
    """Return what is asked.

    Raises:
        InputError: A number is no number or out of bounds, options contradict each
            other or are too few, or a range lies inside the charge.
    """
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


def check_plot(question: Question) -> None:
    """Refuse a question whose answer is no curve against range.

    Raises:
        InputError: It is.
    """
    if not question.quantity and len(question.charge_mass) != 1:
        raise InputError(
            "--plot: it draws all laws against range; expected one --mass, and --range"
        )


def check_roots(question: Question, found: dict[str, Roots]) -> None:
    """Refuse a value that no law takes where it holds, and say which ones they do.

    Raises:
        InputError: No root is valid.
    """
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


def _check_rows(question: Question, measured: Sequence[str]) -> None:
    """Refuse too many rows, and ranges inside the charge."""
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


def _scene(asked: argparse.Namespace) -> Scene:
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


def _check_vapour(air: Air) -> None:
    """Refuse steam: the sound speed of humid air means nothing for it."""
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
