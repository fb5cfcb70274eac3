"""The question and what it was answered with, defaults named, for a terminal."""

import numpy as np

from jblast.report.calculator.inputs import Inputs, inputs
from jblast.report.numbers import System, printed_number, unit_for
from jblast.report.words import quantity_words
from jblast.sensors.calculator.question import Question


def header(question: Question) -> list[tuple[str, str]]:
    """Return the inputs as labels and words, for a terminal."""
    given = inputs(question)
    charge, defaults = question.scene.charge, question.defaults
    system = question.units
    lines = []
    if charge.explosive != "TNT":
        factors = given.tnt_factor
        text = f"{factors.pressure:g} for pressure and time, "
        text += f"{factors.impulse:g} for impulse and duration, times the mass"
        lines.append(("as TNT", text))
    if given.scaled:
        z = np.atleast_1d(given.scaled.scaled_distance_m_kg13)
        radius = np.atleast_1d(given.scaled.charge_radius_m)
        text = f"{_span(z)} m/kg^(1/3)"
        if system == "us":
            foot, pound = (unit_for(name, 1.0, system=system) for name in ("_m", "_kg"))
            text = f"{_span(z * pound.size ** (1 / 3) / foot.size)} ft/lb^(1/3)"
        lines.append(("scaled distance", text))
        unit = unit_for("_m", 1.0, system=system)
        text = f"{_span(radius / unit.size)} {unit.symbol} (TNT at 1630 kg/m3)"
        lines.append(("charge radius", text))
        if charge.burst == "surface":
            factor = np.atleast_1d(given.scaled.ground_factor)
            text = f"{_span(factor)} times the mass makes the same in free air"
            lines.append(("ground factor", text))
    height = given.height_m
    place = (
        "" if not height else f", {printed_number('_m', abs(height), system=system)} "
    )
    place += "" if not height else "above ground" if height > 0 else "deep"
    burst = charge.burst or "each range by its height"
    lines.append(("burst", f"{burst}{_default('burst', defaults)}{place}"))
    lines.append(
        ("air", _air(given, system) + _default("air", defaults, "at sea level"))
    )
    rock = f"P wave {_speed(given.p_speed_m_s, system, 'g')}"
    lines.append(("ground", rock + _default("ground", defaults, "granite")))
    return lines


def title(question: Question) -> str:
    """Return the question in words."""
    ranges, masses = (
        _values(name, x, question.units)
        for name, x in (("_m", question.slant_range), ("_kg", question.charge_mass))
    )
    explosive = question.scene.charge.explosive
    if not question.quantity:
        return f"{masses} of {explosive} at {ranges}"
    target = printed_number(question.quantity, question.target, system=question.units)
    words = quantity_words(question.quantity)
    what = f"{'an' if words[0] in 'aeiou' else 'a'} {words} of {target}"
    if masses:
        return f"Range at which {masses} of {explosive} makes {what}"
    return f"Mass of {explosive} that makes {what} at {ranges}"


def _air(given: Inputs, system: System) -> str:
    pressure = f"{given.pressure_pa / 1e3:.3f} kPa"
    temperature = f"{given.temperature_k:.2f} K"
    if system == "us":
        temperature = f"{given.temperature_k * 1.8 - 459.67:.2f} °F"
        pressure = printed_number("_pa", given.pressure_pa, system=system)
    words = [
        temperature,
        pressure,
        f"humidity {given.relative_humidity:g}" if given.relative_humidity else "dry",
        f"sound {_speed(given.sound_speed_m_s, system, '.2f')}",
    ]
    if given.altitude_m is not None:
        altitude = given.altitude_m
        shown = f"{altitude:g} m"
        if system == "us":
            shown = printed_number("_m", altitude, system=system)
        words.insert(0, f"standard atmosphere at {shown}")
    return ", ".join(words)


def _speed(value: float, system: System, digits: str) -> str:
    if system == "us":
        return printed_number("_m_s", value, system=system)
    return f"{value:{digits}} m/s"


def _values(name: str, values: tuple[float, ...], system: System) -> str:
    if len(values) < 4:
        return ", ".join(printed_number(name, v, system=system) for v in values)
    first, last = (
        printed_number(name, v, system=system) for v in (min(values), max(values))
    )
    return f"{first} to {last} ({len(values)} values)"


def _span(values: np.ndarray) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return low if low == high else f"{low} to {high}"


def _default(field: str, defaults: frozenset[str], what: str = "") -> str:
    if field not in defaults:
        return ""
    return f" (default{': ' if what else ''}{what})"
