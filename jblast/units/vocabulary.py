"""The units that a name may end in, by dimension, and what pint calls them.

Endings are told apart in lower case, as names of columns are typed by hand, but for the
two that case alone tells apart, MPa and mPa.
"""

from itertools import product

PRESSURES = {
    "pa": "Pa", "upa": "uPa", "hpa": "hPa", "kpa": "kPa", "gpa": "GPa",
    "bar": "bar", "mbar": "mbar", "atm": "atm", "torr": "torr", "mmhg": "mmHg",
    "inhg": "inHg", "psi": "psi", "ksi": "ksi", "psf": "lbf/ft**2",
    # gauge readings are above ambient, which is what an overpressure is
    "psig": "psi", "kpag": "kPa", "barg": "bar",
}  # fmt: skip
TIMES = {
    "s": "s", "sec": "s", "ms": "ms", "msec": "ms", "us": "us", "usec": "us",
    "ns": "ns", "min": "min", "h": "hour", "hr": "hour",
}  # fmt: skip
LENGTHS = {
    "m": "m", "km": "km", "cm": "cm", "mm": "mm", "um": "um", "nm": "nm",
    "ft": "ft", "in": "inch", "yd": "yard", "mi": "mile", "nmi": "nautical_mile",
}  # fmt: skip
WRITTEN_OUT = {
    "second": "s", "secs": "s", "millisecond": "ms", "msecs": "ms", "microsecond": "us",
    "nanosecond": "ns", "minute": "min", "mins": "min", "hour": "h", "hrs": "h",
    "metre": "m", "meter": "m", "kilometre": "km", "kilometer": "km",
    "centimetre": "cm", "centimeter": "cm", "millimetre": "mm", "millimeter": "mm",
    "foot": "ft", "feet": "ft", "inch": "in", "inches": "in", "yard": "yd",
    "mile": "mi", "pascal": "pa", "hectopascal": "hpa", "kilopascal": "kpa",
    "megapascal": "MPa", "millipascal": "mPa", "millibar": "mbar", "bars": "bar",
    "degree": "deg", "radian": "rad", "milliradian": "mrad", "decibel": "db",
    "kilogram": "kg", "gram": "g", "tonne": "t", "pound": "lb", "lbs": "lb",
    "ounce": "oz", "knot": "kn", "pixel": "px",
}  # fmt: skip
"""Units by their full names, in the singular, and shortened otherwise."""
ABSOLUTE = ("psia", "kpaa", "bara", "mbara")
"""Endings of readings from vacuum, which are no overpressures."""
WEIGHTED = ("dba", "db_a", "dbb", "db_b", "dbc", "db_c", "laeq", "leq")
"""Endings of levels that are none of the unweighted peak."""
MILLI_OR_MEGA = {"mpa": ("MPa", "mPa")}
"""Endings that mean two units unless their case is right."""
SHARE, LEVEL = "share", "level"
"""Dimensions that have no unit of ours: per cent, and levels, which are logarithms."""

SUFFIXES: dict[str, dict[str, str]] = {
    "pressure": PRESSURES | {"MPa": "MPa", "mPa": "mPa"},
    "impulse": {
        f"{p}_{t}": f"({of}) * {during}"
        for (p, of), (t, during) in product(
            (PRESSURES | {"MPa": "MPa", "mPa": "mPa"}).items(), TIMES.items()
        )
    },
    "time": TIMES,
    "length": LENGTHS,
    "speed": {
        f"{length}{per}{time}": f"{of} / {during}"
        for (length, of), (time, during), per in product(
            LENGTHS.items(), TIMES.items(), ("_", "_per_")
        )
    }
    | {"mph": "mile / hour", "kmh": "km / hour", "kn": "knot"},
    "angle": {"rad": "rad", "mrad": "mrad", "deg": "degree"},
    "mass": {"kg": "kg", "g": "g", "mg": "mg", "t": "tonne", "lb": "lb", "oz": "oz"},
    "image": {"px": "px"},
    SHARE: {"percent": "percent"},
    LEVEL: {"db": "dB"},
}  # fmt: skip
"""Endings by dimension, and what each is to pint; levels are no factors (`levels`)."""

SI = {
    "pressure": "pa", "impulse": "pa_s", "time": "s", "length": "m", "speed": "m_s",
    "angle": "rad", "mass": "kg", "image": "px",
}  # fmt: skip
"""The ending of ours, by dimension."""

DIMENSIONS = tuple(SUFFIXES)
