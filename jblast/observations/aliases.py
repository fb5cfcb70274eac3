"""Names other tools give to what we call by another name, with the factor between.

Ours are SI with the unit as suffix. Theirs (`impulse_kPa_ms`, `range_km`,
`Overpressure (psi)`) are taken apart into a unit, which says the dimension, and a word,
which says which of our names of that dimension is meant.
"""

import re

UNITS: dict[str, dict[str, float]] = {
    "pressure": {
        "pa": 1.0, "hpa": 1e2, "kpa": 1e3, "mpa": 1e6, "mbar": 1e2, "bar": 1e5,
        "psi": 6894.757, "atm": 101325.0,
    },
    "impulse": {
        "pa_s": 1.0, "kpa_s": 1e3, "mpa_s": 1e6, "bar_s": 1e5, "psi_s": 6894.757,
        "pa_ms": 1e-3, "kpa_ms": 1.0, "mpa_ms": 1e3, "mbar_ms": 0.1, "bar_ms": 1e2,
        "psi_ms": 6.894757,
    },
    "time": {
        "s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "ns": 1e-9,
        "min": 60.0, "h": 3600.0,
    },
    "length": {
        "m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9,
        "ft": 0.3048, "in": 0.0254, "mi": 1609.344,
    },
    "velocity": {
        "m_s": 1.0, "km_s": 1e3, "cm_s": 1e-2, "mm_s": 1e-3, "um_s": 1e-6,
        "in_s": 0.0254,
    },
}  # fmt: skip
"""SI values of the units, in lower case, by dimension."""

WORDS: dict[str, tuple[tuple[str, str], ...]] = {
    "pressure": (("refl", "reflected_pressure_pa"), ("", "peak_overpressure_pa")),
    "impulse": (("refl", "reflected_impulse_pa_s"), ("", "positive_impulse_pa_s")),
    "time": (
        ("duration", "positive_duration_s"),
        ("diff", "arrival_difference_s"),
        ("flash", "flash_time_s"),
        ("ground", "ground_arrival_s"),
        ("seismic", "ground_arrival_s"),
        ("arriv", "air_arrival_s"),
        ("toa", "air_arrival_s"),
        ("time", "time_s"),
    ),
    "length": (
        ("radius", "shock_radius_m"),
        ("displ", "ground_displacement_m"),
        ("range", "range_m"),
        ("dist", "range_m"),
        ("slant", "range_m"),
        ("east", "east_m"),
        ("north", "north_m"),
        ("height", "up_m"),
        ("up", "up_m"),
    ),
    "velocity": (("", "ground_peak_velocity_m_s"),),
}
"""By dimension: what a foreign name contains, and which of our names that makes it."""


def our_name(foreign: str) -> tuple[str, float] | None:
    """Return our name for a foreign one, and what to multiply its values by.

    None if the name does not end in a unit, or ends in one and says nothing more.
    """
    name = re.sub(r"[^a-z0-9]+", "_", foreign.replace("µ", "u").lower()).strip("_")
    parts = name.split("_")
    for length in (2, 1):
        word, unit = "_".join(parts[:-length]), "_".join(parts[-length:])
        for dimension, units in UNITS.items():
            if word in ("value", "sigma") and unit in units:
                return word, units[unit]  # in the unit its quantity ends in
            if word and unit in units:
                for contained, ours in WORDS[dimension]:
                    if contained in word:
                        return ours, units[unit]
                return None
    return None
