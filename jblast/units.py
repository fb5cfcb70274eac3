r"""Units at the end of names, and the conversion of values to SI.

A name of a column or quantity from another tool ("Peak Overpressure (kPa)") is split
into words and a unit, and matched with jblast's names. Foreign names with one meaning
are in the tables of quantities and columns, and are converted. `SIMILAR_NAMES` lists
words with several meanings (an impulse may be reflected, a radius may be that of a
fireball). These are rejected, and the message names a quantity of jblast. Unit suffixes
are matched in lower case, because column names are typed by hand, except MPa and mPa,
which differ in case only.
Factors of units that are not SI come from pint, in fractions.

A value is multiplied by the numerator of its factor and divided by the denominator:
12.4 ms are 0.0124 s, where 12.4 times 0.001 is 0.012400000000000001.

Peak levels in decibels are not converted by a factor:

$$L = 20 \log_{10}(p / p_0), \qquad p_0 = 20\,\mathrm{\mu Pa}$$

so $\ln p = \ln p_0 + L \ln 10 / 20$. The logarithm of the pressure is linear in the
level, and a symmetric error of $\sigma$ dB is exactly, at any size, an error of $\sigma
\ln 10 / 20$ in $\ln p$. Errors of pressures count in the same way in a fit (in ln, as
sigma/value), so the sigma of the pressure is $p\,\sigma \ln 10 / 20$: 1 dB is 11.5 %.
In pascals the error is asymmetric (6 dB up is +100 %, 6 dB down -50 %), so it is never
converted to a symmetric error in pascals.

References:
    IEC 61672-1:2013, 3.2 (reference 20 µPa) and 3.3 (peak sound pressure level, of the
    largest magnitude of the pressure; here without frequency weighting, Z).
"""

import math
import re
from collections.abc import Collection, Iterator
from fractions import Fraction
from functools import cache
from itertools import chain, product
from typing import Any, NamedTuple

import numpy as np

from jblast.errors import InputError, closest, nearest, shown
from jblast.quantities import QUANTITIES, unit_suffix
from jblast.types import Float

ANY = ("value", "sigma")
"""Columns with the unit of the row's quantity."""
MAX_LISTED = 12
"""Maximum number of units that a message lists: about one line."""
REFERENCE_PA = 20e-6
"""Pressure of a level of 0 dB [Pa], IEC 61672-1."""
LN_PER_DB = math.log(10.0) / 20.0
"""One decibel in the logarithm of a pressure."""
SIGNS = {"µ": "u", "μ": "u", "°": " deg ", "%": " percent ", "/": " per ", "′": "'"}
REFERENCE = re.compile(r"(?<=db)[^a-z0-9]*re[^a-z0-9]*20[^a-z0-9]*upa", re.IGNORECASE)
"""The only reference of levels that is accepted: "dB re 20 uPa" is dB."""
MAX_ENDING_WORDS = 5
"""Number of words of the longest suffix: lbf_per_in_2_s."""
LEVELS = ("peak_level", "peak_spl", "pspl", "peak_sound_pressure_level")
"""Names of the overpressure as a level in decibels."""
COLUMNS = {
    **dict.fromkeys(("east_m", "north_m", "alt_m", "time_s"), ()),
    "up_m": ("height",),
    "range_m": ("slant range",),
}
"""Columns of logs with a unit and their other names; latitudes have one unit only."""
SIMILAR_NAMES = {
    "pressure": "peak_overpressure_pa",
    "impulse": "positive_impulse_pa_s", "duration": "positive_duration_s",
    "radius": "shock_radius_m", "displacement": "ground_displacement_m",
    "velocity": "ground_peak_velocity_m_s", "level": "peak_level_db",
    "distance": "range_m", "altitude": "alt_m", "latitude": "lat_deg",
    "longitude": "lon_deg", "azimuth": "bearing_rad",
}  # fmt: skip
"""Words of several meanings, and the names of jblast that may be meant."""
PRESSURES = {
    "pa": "Pa", "upa": "uPa", "hpa": "hPa", "kpa": "kPa", "gpa": "GPa",
    "bar": "bar", "mbar": "mbar", "atm": "atm", "torr": "torr", "mmhg": "mmHg",
    "inhg": "inHg", "psi": "psi", "ksi": "ksi", "psf": "lbf/ft**2",
    "poundspersquareinch": "psi",
    **{f"{force}_per_{area}{square}": unit for force, area, unit in (
        ("n", "m", "Pa"), ("n", "mm", "MPa"), ("lbf", "in", "psi"), ("lb", "in", "psi"),
        ("kgf", "cm", "kgf/cm**2"),
    ) for square in ("2", "_2")},
    # columns of water by ISO 80000-4: conventional, 1000 kg/m^3
    **{f"{length}h2o": f"centimeter_H2O * {of} / cm" for length, of in (
        ("mm", "mm"), ("cm", "cm"), ("in", "inch"))},
    # Gauge readings are relative to ambient pressure, like overpressures.
    "psig": "psi", "kpag": "kPa", "barg": "bar",
}  # fmt: skip
TIMES = {
    "s": "s", "sec": "s", "ms": "ms", "msec": "ms", "us": "us", "usec": "us",
    "ns": "ns", "min": "min", "h": "hour", "hr": "hour", "day": "day",
}  # fmt: skip
LENGTHS = {
    "m": "m", "km": "km", "cm": "cm", "mm": "mm", "um": "um", "nm": "nm",
    "ft": "ft", "in": "inch", "yd": "yard", "mi": "mile", "nmi": "nautical_mile",
}  # fmt: skip
WRITTEN_OUT = {
    "second": "s", "secs": "s", "millisecond": "ms", "msecs": "ms", "microsecond": "us",
    "nanosecond": "ns", "minute": "min", "mins": "min", "hour": "h", "hrs": "h",
    "day": "day",
    "metre": "m", "meter": "m", "kilometre": "km", "kilometer": "km",
    "centimetre": "cm", "centimeter": "cm", "millimetre": "mm", "millimeter": "mm",
    "foot": "ft", "feet": "ft", "inch": "in", "inches": "in", "yard": "yd",
    "mile": "mi", "pascal": "pa", "hectopascal": "hpa", "kilopascal": "kpa",
    "megapascal": "MPa", "millipascal": "mPa", "millibar": "mbar", "bars": "bar",
    "degree": "deg", "radian": "rad", "milliradian": "mrad", "decibel": "db",
    "kilogram": "kg", "gram": "g", "tonne": "t", "pound": "lb", "lbs": "lb",
    "ounce": "oz", "knot": "kn", "pixel": "px",
    "volt": "v", "millivolt": "mv", "microvolt": "uv",
}  # fmt: skip
"""Full names of units, in the singular, and other abbreviations."""
ABSOLUTE = {"psia": "psi", "kpaa": "kPa", "bara": "bar", "mbara": "mbar"}
"""Suffixes of absolute pressures, which are not overpressures, and their units."""
PEAK_LEVEL = "expected peak_level_db, of the unweighted peak, re 20 uPa"
REFUSED = {
    r"_(?:db_?[abc]|laeq|leq)$": "; it is a weighted or an equivalent level, not a "
    f"peak: {PEAK_LEVEL}",
    # `words_of` has removed the accepted reference, so that this is another one
    "_db_re_": f"; it is re another pressure: {PEAK_LEVEL}",
    # a log does not have the ambient pressure
    rf"_(?:{'|'.join(ABSOLUTE)})$": "; it is absolute: subtract the ambient pressure, "
    "and write gauge units",
}
"""Advice by the form of names whose units are not converted."""
MILLI_OR_MEGA = {"mpa": ("MPa", "mPa"), "mt": ("Mt", "mt")}
"""Suffixes with two meanings that differ in case only."""
COUNTS = ("1", "count", "counts", "dimensionless", "fs")
NO_UNITS = ("", "none", "unknown")
"""Units of samples in files: whole numbers without a scale, and none."""
LINEAR = ("l", "lin", "linear", "z")
"""Weightings behind a unit that leave the pressure as it is: pa.(L), dB(L), dBZ."""
SINCE = re.compile(r"\s*(\w+)\s+since\s+(.+?)\s*")
"""Unit of time with its zero in the CF conventions: "seconds since 2020-08-04"."""
CELSIUS = (1.0, 273.15, "add 273.15")
FAHRENHEIT = (5 / 9, 459.67 * 5 / 9, "subtract 32, multiply by 5/9 and add 273.15")
TEMPERATURES = {
    "k": (1.0, 0.0, "multiply by 1"),
    **dict.fromkeys(("c", "celsius", "degc", "deg_c", "deg_celsius"), CELSIUS),
    **dict.fromkeys(("f", "fahrenheit", "degf", "deg_f", "deg_fahrenheit"), FAHRENHEIT),
}
"""Units of temperature: factor, offset and their words. No column of a log has them."""
PER_CENT = ("percent", "pct")
SHARE, LEVEL = "share", "level"
"""Dimensions without an SI unit: per cent, and levels, which are logarithms."""
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
    "mass": {
        "kg": "kg", "g": "g", "mg": "mg", "lb": "lb", "oz": "oz",
        "t": "tonne", "mt": "tonne", "kt": "kilotonne", "Mt": "megatonne",
    },
    "image": {"px": "px"},
    "voltage": {"v": "V", "mv": "mV", "uv": "uV"},
    SHARE: {"percent": "percent"},
    LEVEL: {"db": "dB", **{f"db{_}{w}": "dB" for _ in ("", "_") for w in LINEAR}},
}  # fmt: skip
"""Suffixes by dimension with pint's units; levels have no factor (`overpressure`)."""
SI = {
    "pressure": "pa", "impulse": "pa_s", "time": "s", "length": "m", "speed": "m_s",
    "angle": "rad", "mass": "kg", "image": "px", "voltage": "v",
}  # fmt: skip
"""Suffix of jblast's names by dimension."""


class OurName(NamedTuple):
    """jblast's name and unit for a foreign name.

    Attributes:
        name: Column or quantity; `value` and `sigma` are columns of any dimension.
        factor: Factor from the foreign to the SI unit; NaN for a level in dB.
        dimension: Dimension of the unit, a key of `SUFFIXES`.
        unit: Suffix of a name in this unit: "psi_ms".
    """

    name: str
    factor: float
    dimension: str
    unit: str


class Unit(NamedTuple):
    """A unit as the suffix of a name.

    Attributes:
        dimension: A key of `SUFFIXES`.
        suffix: Suffix of a name: "kpa_ms".
        pint: Name in pint.
    """

    dimension: str
    suffix: str
    pint: str


def our_name(foreign: str) -> OurName | None:
    """Return the column or quantity of a foreign name, with its unit.

    Blanks, case, brackets and signs are ignored: "Peak Overpressure (kPa)" is
    `peak_overpressure_kpa`. An ambiguous name has no meaning: None is returned.

    Args:
        foreign: A name that ends in a unit.
    """
    # The longest unit first: psi_ms is no name that ends in ms.
    for word, meant in _taken_apart(foreign):
        if len(meant) > 1:
            return None
        for dimension, suffix, _ in meant:
            if name := _names(dimension).get(word):
                factor = math.nan if dimension == LEVEL else si_factor(suffix)
                return OurName(name, factor, dimension, suffix)
    return None


def what_to_write(foreign: str) -> str:
    """Return "; ..." with the nearest name and unit for a name that is not identified.

    Names are proposed in the unit of the foreign name.
    """
    whole = spelt(foreign)
    for form, advice in REFUSED.items():
        if re.search(form, whole):
            return advice
    for word, meant in _taken_apart(foreign):
        if len(meant) > 1:
            either = " or ".join(f"{word}_{unit.suffix}" for unit in meant)
            return (
                "; its unit may be MPa or mPa, which differ in case only: write "
                f"{either}"
            )
        if meant and not any(word in _names(of) for of in SUFFIXES):
            dimension, suffix, _ = meant[0]
            ours = _names(dimension)
            same = {name: name for name in ours} | SIMILAR_NAMES
            if near := closest(word, same):
                stem = same[near].removesuffix(f"_{SI.get(dimension)}")
                name = f"{stem}_{suffix}" if stem in ours else stem
                return f"; did you mean {name}?"
            own = (x for x, name in ours.items() if name.startswith(f"{x}_"))
            return f"; expected one of {', '.join(f'{x}_{suffix}' for x in own)}"
    for dimension, suffixes in SUFFIXES.items():
        for word, ours in _names(dimension).items():
            if whole == word and ours not in ANY:
                return f"; it has no unit: expected {ours}"
            if whole.startswith(f"{word}_"):
                unit, of, known = whole.removeprefix(f"{word}_"), "", [*suffixes]
                if ours in ANY:
                    known = [*chain(*SUFFIXES.values())]
                else:
                    of = f" of {dimension}"
                some = f"; expected one of {', '.join(known[:MAX_LISTED])}"
                return f"; {unit!r} is no unit{of}{nearest(unit, known) or some}"
    return ""


def si_factor(suffix: str) -> float:
    """Return the factor of `si_ratio` as a float."""
    return float(si_ratio(suffix))


@cache
def si_ratio(suffix: str) -> Fraction:
    """Return the exact factor from a unit to SI.

    Args:
        suffix: Suffix of a name: "psi_ms", "kPa", "percent".

    Raises:
        InputError: The unit is unknown, is one of several that differ in case only, or
            a level, which no factor converts.
    """
    found = {(unit.dimension, unit.pint) for unit in unit_spelt(suffix)}
    if len(found) != 1:
        either = " or ".join(sorted(pint for _, pint in found))
        expected = f"{either}, which differ in case only"
        if not either:
            expected = "a known unit"
        raise InputError(f"unit {shown(suffix)}: expected {expected}")
    ((dimension, pint),) = found
    if dimension == LEVEL:
        raise InputError(f"unit {shown(suffix)}: a level has no factor")
    if dimension == SHARE:
        return Fraction(1, 100)
    ours = SUFFIXES[dimension][SI[dimension]]
    if pint == ours:
        return Fraction(1)
    one: Any = _registry().Quantity(Fraction(1), pint)  # type: ignore
    return Fraction(one.to(ours).magnitude)


def in_other_unit(key: str, known: Collection[str]) -> str:
    """Return "; ours is mass_kg: multiply by ..." for a key in another known unit.

    Args:
        key: Unknown key of a table.
        known: Known keys of the table.

    Returns:
        The replacement; "" without a known unit or a key with the same stem.
    """
    words = key.split("_")
    # Longest suffix first: "speed_km_per_h" must not be read as a stem with the suffix
    # "h".
    for length in range(min(MAX_ENDING_WORDS, len(words) - 1), 0, -1):
        stem, suffix = "_".join(words[:-length]).lower(), "_".join(words[-length:])
        if suffix.lower() in TEMPERATURES and f"{stem}_k" in known:
            return f"; ours is {stem}_k: {TEMPERATURES[suffix.lower()][-1]}"
        if suffix.lower() in PER_CENT and stem in known:
            return f"; ours is {stem}, a share: multiply by 0.01"
        meant = unit_spelt(suffix)
        # Only units of the dimension of the known key: mass_s is no mass.
        either = [unit for unit in meant if f"{stem}_{SI.get(unit.dimension)}" in known]
        if len(meant) > 1 and either:
            names = " or ".join(unit.pint for unit in either)
            ours = f"{stem}_{SI[either[0].dimension]}"
            return f"; ours is {ours}, and {suffix!r} may be {names}"
        if either:
            ours = f"{stem}_{SI[either[0].dimension]}"
            return f"; ours is {ours}: multiply by {si_factor(suffix):.9g}"
    return ""


def to_si(value: float, unit: str, dimension: str) -> float:
    """Return a value in SI.

    Args:
        value: Value in the unit.
        unit: The unit as it is written: "kPa", "ft/s", "°C", "%"; a pressure may be a
            peak level, "dB".
        dimension: Dimension of the value: a key of `SI`, "temperature" or "share".

    Raises:
        InputError: The unit is no unit of the dimension, or one of several.
    """
    if dimension == "temperature":
        known = TEMPERATURES
        if (spelling := spelt(unit)) in TEMPERATURES:
            factor, offset, _ = TEMPERATURES[spelling]
            return value * factor + offset
    else:
        known = SUFFIXES[dimension]
        if dimension == "pressure" and spelt(unit) in SUFFIXES[LEVEL]:
            return float(overpressure(np.asarray(value)))
        if any(one.dimension == dimension for one in unit_spelt(unit)):
            ratio = si_ratio(unit)
            return value * float(ratio.numerator) / float(ratio.denominator)
    some = ", ".join([*known][:MAX_LISTED])
    raise InputError(f"unit {shown(unit)}: expected a unit of {dimension}: {some}")


class SampleUnit(NamedTuple):
    """The unit of samples or times in a file.

    Attributes:
        dimension: "pressure", "time", "voltage", "count", or "" for none or another.
        factor: Factor to pascals, seconds, volts or counts.
        zero: Time zero as written, for times since a date; "" without one.
    """

    dimension: str
    factor: float = 1.0
    zero: str = ""


@cache
def sample_unit(text: str) -> SampleUnit:
    """Return the unit of samples or times; absolute pressures count as others.

    Args:
        text: "kPa", "psia", "pa.(L)", "mV", "counts", "days since 2020-08-04".
    """
    if since := SINCE.fullmatch(text):
        dimension, factor, _ = sample_unit(since[1])
        return SampleUnit(dimension if dimension == "time" else "", factor, since[2])
    words = words_of(text)
    if len(words) > 1 and words[-1].lower() in LINEAR:
        words.pop()
    plain = "_".join(words)
    key = plain.lower()
    if key in COUNTS:
        return SampleUnit("count")
    # mpa may be MPa or mPa, nine orders of magnitude apart: two meanings are none
    meant = unit_spelt(ABSOLUTE.get(key, plain))
    if len(meant) == 1 and meant[0].dimension in ("pressure", "time", "voltage"):
        return SampleUnit(meant[0].dimension, si_factor(meant[0].suffix))
    return SampleUnit("")


def word_and_unit(name: str) -> tuple[str, str]:
    """Return word and unit of a name: `Pressure (kPa)` or `pressure_kpa`.

    The unit is "" if the name does not end in a known one; a name may be a unit alone.
    """
    unit = r"[(\[]\s*([^()\[\]]*(?:\([^()]*\))?)\s*[)\]]"
    bracketed = re.fullmatch(rf"\s*(.*?)[\s_]*{unit}\s*", name)
    if bracketed and bracketed[2].lower() not in LINEAR:
        return bracketed[1], bracketed[2].strip()
    parts = re.split(r"[\s_]+", name.strip())
    if sample_unit(parts[-1]).dimension not in ("", "count"):
        return " ".join(parts[:-1]), parts[-1]
    # a unit behind a channel's number, as of oscilloscopes: CH1V
    glued = re.fullmatch(r"(.*\d)([A-Za-z]+)", name.strip())
    if glued and sample_unit(glued[2]).dimension in ("pressure", "voltage"):
        return glued[1], glued[2]
    return " ".join(parts), ""


def in_si(values: Float[np.ndarray, " row"], suffix: str) -> Float[np.ndarray, " row"]:
    """Return values in SI; of peak levels in decibels, the overpressures.

    Args:
        values: Values in a unit.
        suffix: The unit, as for `si_factor`, or "db".
    """
    # too large a value overflows to infinity, which its row reports
    with np.errstate(over="ignore"):
        if suffix in SUFFIXES[LEVEL]:
            return overpressure(values)
        ratio = si_ratio(suffix)
        return values * float(ratio.numerator) / float(ratio.denominator)


def overpressure(level_db: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the pressure of a peak level.

    Args:
        level_db: Peak level [dB re 20 µPa], of the waveform without weighting.

    Returns:
        Peak overpressure [Pa].
    """
    return REFERENCE_PA * 10.0 ** (level_db / 20.0)


def words_of(name: str) -> list[str]:
    """Return the words of a name in their case: Peak, kPa, ms of "Peak (kPa·ms)"."""
    for sign, word in SIGNS.items():
        name = name.replace(sign, word)
    name = REFERENCE.sub(" ", name)
    return [word for word in re.split(r"[^A-Za-z0-9]+", name) if word]


def spelt(name: str) -> str:
    """Return a name in snake case."""
    return "_".join(words_of(name)).lower()


def unit_spelt(suffix: str) -> tuple[Unit, ...]:
    """Return the possible units of a suffix: none, one, or two that differ in case.

    Args:
        suffix: "kPa", "psi-ms", "mm/s", "m_s", "feet", "degrees".
    """
    words = words_of(suffix)
    if not words:
        return ()
    lower = [_short(word.lower()) for word in words]
    readings = [lower]
    if lower[0] in MILLI_OR_MEGA:
        both = MILLI_OR_MEGA[lower[0]]
        # MPa and mPa as written are distinct; any other case is ambiguous.
        kept = (words[0],) if words[0] in both else both
        readings = [[first, *lower[1:]] for first in kept]
    return tuple(
        Unit(dimension, "_".join(reading), suffixes["_".join(reading)])
        for reading in readings
        for dimension, suffixes in SUFFIXES.items()
        if "_".join(reading) in suffixes
    )


def _taken_apart(foreign: str) -> Iterator[tuple[str, tuple[Unit, ...]]]:
    """Yield all splits of a name into words and its possible units, longest first."""
    words = words_of(foreign)
    for length in range(min(MAX_ENDING_WORDS, len(words) - 1), 0, -1):
        unit = unit_spelt("_".join(words[-length:]))
        yield "_".join(words[:-length]).lower(), unit


@cache
def _names(dimension: str) -> dict[str, str]:
    """Return the names of a dimension by the words before the unit."""
    if dimension == LEVEL:
        return dict.fromkeys(LEVELS, "peak_overpressure_pa") | {x: x for x in ANY}
    names = {name: name for name in ANY}
    known = {name: one.other_names for name, one in QUANTITIES.items()} | COLUMNS
    for name, others in known.items():
        end = unit_suffix(name)
        if end == f"_{SI.get(dimension)}":
            words = name.removesuffix(end), *others
            names |= {spelt(word): name for word in words}
    return names


@cache
def _registry():
    import pint

    # In fractions a foot is 0.3048 m; in floats it would be 0.30479999999999996 m.
    exact: Any = Fraction  # documented by pint, but missing in its type annotations
    return pint.UnitRegistry(non_int_type=exact)


def _short(word: str) -> str:
    """Return the short name of a unit, or the word itself."""
    # Also "ms" becomes "m", which is no full name, so that the word is returned.
    singular = word.removesuffix("s")
    return WRITTEN_OUT.get(word) or WRITTEN_OUT.get(singular) or word
