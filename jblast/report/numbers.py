"""Numbers and names in print: units by magnitude, digits by uncertainty."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from jblast.constants import FOOT, PSI
from jblast.parameters import described
from jblast.quantities import UNITS, quantity_named, unit_suffix

POUND = 0.45359237
System = Literal["si", "us"]
"""System of printed units: SI, or feet, pounds and pounds per square inch."""


@dataclass(frozen=True)
class Unit:
    """A printed unit.

    Attributes:
        symbol: Its symbol.
        size: Its size in SI.
        least: Least number in SI that is printed in it.
    """

    symbol: str
    size: float = 1.0
    least: float = 0.0


LADDERS = {
    "_kg": (Unit("g", 1e-3), Unit("kg", 1.0, 0.1), Unit("kt", 1e6, 1e6)),
    "_m": (
        Unit("nm", 1e-9),
        Unit("µm", 1e-6, 1e-7),
        Unit("mm", 1e-3, 1e-4),
        Unit("m", 1.0, 0.1),
        Unit("km", 1e3, 1e4),
    ),
    "_s": (Unit("µs", 1e-6), Unit("ms", 1e-3, 1e-3), Unit("s", 1.0, 1.0)),
    "_m_s": (Unit("µm/s", 1e-6), Unit("mm/s", 1e-3, 1e-4), Unit("m/s", 1.0, 0.1)),
    "_pa": (Unit("Pa"), Unit("kPa", 1e3, 1e3), Unit("MPa", 1e6, 1e6)),
    "_pa_s": (Unit("Pa s"), Unit("kPa s", 1e3, 1e4)),
    "_j": (
        Unit("J"),
        Unit("kJ", 1e3, 1e3),
        Unit("MJ", 1e6, 1e6),
        Unit("GJ", 1e9, 1e9),
        Unit("TJ", 1e12, 1e12),
    ),
    "_rad": (Unit("mrad", 1e-3), Unit("rad", 1.0, 0.1)),
}
"""Units of a suffix; other suffixes have the SI unit alone."""
CUSTOMARY = {
    "_kg": (Unit("lb", POUND),),
    "_m": (Unit("in", 0.0254), Unit("ft", FOOT, 0.1)),
    "_m_kg13": (Unit("ft/lb^(1/3)", FOOT / POUND ** (1 / 3)),),
    "_m_s": (Unit("in/s", 0.0254), Unit("ft/s", FOOT, 0.3)),
    "_pa": (Unit("psi", PSI),),
    "_pa_s": (Unit("psi ms", PSI * 1e-3),),
}
"""As `LADDERS`, for US customary units. Other units are the same in both systems."""


def finite(number: Any) -> float | None:
    """Return a number as a float, None where it is null, NaN or infinite."""
    return None if number is None or not math.isfinite(number) else float(number)


def unit_for(name: str, *numbers: float | None, system: System = "si") -> Unit:
    """Return the unit for numbers of one parameter or quantity, by the largest."""
    suffix = split_name(name)[1]
    ladder = CUSTOMARY.get(suffix) if system == "us" else None
    ladder = ladder or LADDERS.get(suffix) or (Unit(UNITS[suffix]),)
    largest = max((abs(n) for n in numbers if n is not None), default=0.0)
    # 0 has no magnitude to choose a unit by: SI
    if largest == 0.0:
        return next((unit for unit in ladder if unit.size == 1.0), ladder[-1])
    return [unit for unit in ladder if largest >= unit.least][-1]


def rounded(number: float, sd: float) -> str:
    """Return a number rounded to two digits of its standard deviation."""
    # rounded first, as 0.0996 is printed as 0.10 and so needs one decimal fewer
    two_digits = float(f"{sd:.1e}")
    decimals = 1 - math.floor(math.log10(two_digits)) if sd > 0.0 else 12
    decimals = min(decimals, 12)
    # zeros in place of the rounded digits would make it hard to read
    if decimals < 0 and abs(number) >= 1e7:
        digits = math.floor(math.log10(abs(number))) + decimals
        return scientific(number, max(digits, 1))
    text = f"{round(number, decimals):.{max(decimals, 0)}f}"
    # a small negative number rounds to -0
    return text.lstrip("-") if float(text) == 0.0 else text


def significant(number: float, digits: int = 2) -> str:
    """Return a number with some significant digits."""
    if number == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(number)))
    if not -4 <= exponent < 7:
        return scientific(number, digits - 1)
    decimals = digits - 1 - exponent
    # round also rounds to tens and hundreds, which a format does not
    return f"{round(number, decimals):.{max(decimals, 0)}f}"


def scientific(number: float, decimals: int) -> str:
    """Return a number as 2.1e7 rather than 2.1e+07."""
    mantissa, _, exponent = f"{number:.{decimals}e}".partition("e")
    # int drops the plus sign and the leading zero
    return f"{mantissa}e{int(exponent)}"


def printed_number(
    name: str, value: float | int, digits: int = 4, system: System = "si"
) -> str:
    """Return a number of unknown uncertainty with its unit."""
    value = float(value)
    unit = unit_for(name, value, system=system)
    text = significant(value / unit.size, digits)
    # trailing zeros would claim an accuracy that is not known
    if "." in text and "e" not in text:
        text = text.rstrip("0").rstrip(".")
    return f"{text} {unit.symbol}".rstrip()


def split_name(name: str) -> tuple[str, str, str]:
    """Split a parameter's name: `clock_offset_s.B` is ("clock_offset", "_s", "B")."""
    stem, _, label = name.partition(".")
    suffix = unit_suffix(stem)
    return stem.removesuffix(suffix), suffix, label


def parameter_words(name: str) -> str:
    """Return a parameter's name as words; an unknown one loses unit and underscores."""
    known, (stem, _, label) = described(name), split_name(name)
    words = known.words if known else stem.replace("_", " ")
    return f"{words} of {label}" if label else words


def quantity_words(quantity: str) -> str:
    """Return a quantity's name as words."""
    known = quantity_named(quantity)
    return known.words if known else split_name(quantity)[0].replace("_", " ")


def joined(parts: Sequence[str]) -> str:
    """Join words as a sentence does: "a, b and c"."""
    if len(parts) < 2:
        return "".join(parts)
    return ", ".join(parts[:-1]) + " and " + parts[-1]


def capitalised(sentence: str) -> str:
    """Return a sentence with its first letter large and the rest untouched."""
    return sentence[:1].upper() + sentence[1:]
