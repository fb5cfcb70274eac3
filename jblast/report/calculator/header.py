"""The question and what it was answered with, defaults named, for a terminal."""

import numpy as np

from jblast.report.calculator.inputs import inputs
from jblast.report.numbers import printed_number
from jblast.report.words import quantity_words
from jblast.sensors.calculator.question import Question


def header(question: Question) -> list[tuple[str, str]]:
    """Return the inputs as labels and words, for a terminal."""
    given = inputs(question)
    charge, defaults = question.scene.charge, question.defaults
    lines = []
    if charge.explosive != "TNT":
        factors = given["tnt_factor"]
        text = f"{factors['pressure']:g} for pressure and time, "
        text += f"{factors['impulse']:g} for impulse and duration, times the mass"
        lines.append(("as TNT", text))
    if question.charge_mass and question.slant_range:
        z = np.atleast_1d(given["scaled_distance_m_kg13"])
        radius = np.atleast_1d(given["charge_radius_m"])
        lines.append(("scaled distance", f"{_span(z)} m/kg^(1/3)"))
        lines.append(("charge radius", f"{_span(radius)} m (TNT at 1630 kg/m3)"))
        if charge.burst == "surface":
            factor = np.atleast_1d(given["ground_factor"])
            text = f"{_span(factor)} times the mass makes the same in free air"
            lines.append(("ground factor", text))
    height = given["height_m"]
    place = "" if not height else f", {printed_number('_m', abs(height))} "
    place += "" if not height else "above ground" if height > 0 else "deep"
    burst = charge.burst or "each range by its height"
    lines.append(("burst", f"{burst}{_default('burst', defaults)}{place}"))
    air = [
        f"{given['temperature_k']:.2f} K",
        f"{given['pressure_pa'] / 1e3:.3f} kPa",
        f"humidity {given['relative_humidity']:g}"
        if given["relative_humidity"]
        else "dry",
        f"sound {given['sound_speed_m_s']:.2f} m/s",
    ]
    if given["altitude_m"] is not None:
        air.insert(0, f"standard atmosphere at {given['altitude_m']:g} m")
    lines.append(("air", ", ".join(air) + _default("air", defaults, "at sea level")))
    rock = f"P wave {given['p_speed_m_s']:g} m/s"
    lines.append(("ground", rock + _default("ground", defaults, "granite")))
    return lines


def title(question: Question) -> str:
    """Return the question in words."""
    ranges, masses = (
        _values(name, x)
        for name, x in (("_m", question.slant_range), ("_kg", question.charge_mass))
    )
    explosive = question.scene.charge.explosive
    if not question.quantity:
        return f"{masses} of {explosive} at {ranges}"
    target = printed_number(question.quantity, question.target)
    words = quantity_words(question.quantity)
    what = f"{'an' if words[0] in 'aeiou' else 'a'} {words} of {target}"
    if masses:
        return f"Range at which {masses} of {explosive} makes {what}"
    return f"Mass of {explosive} that makes {what} at {ranges}"


def _values(name: str, values: tuple[float, ...]) -> str:
    if len(values) < 4:
        return ", ".join(printed_number(name, v) for v in values)
    first, last = (printed_number(name, v) for v in (min(values), max(values)))
    return f"{first} to {last} ({len(values)} values)"


def _span(values: np.ndarray) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return low if low == high else f"{low} to {high}"


def _default(field: str, defaults: frozenset[str], what: str = "") -> str:
    if field not in defaults:
        return ""
    return f" (default{': ' if what else ''}{what})"
