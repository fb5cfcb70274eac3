"""How a number is printed: its unit, and no more digits than it deserves."""

import math
from dataclasses import dataclass
from typing import Any, Literal

from jblast.report.words import split_name
from jblast.units import si_factor

System = Literal["si", "us"]
"""Which units a reader wants: ours, or feet, pounds and pounds per square inch."""


@dataclass(frozen=True)
class Unit:
    """A unit as printed, and what one of it is in SI."""

    symbol: str
    size: float


LADDERS = {
    "_kg": ((0.0, Unit("g", 1e-3)), (0.1, Unit("kg", 1.0)), (1e6, Unit("kt", 1e6))),
    "_m": (
        (0.0, Unit("nm", 1e-9)),
        (1e-7, Unit("µm", 1e-6)),
        (1e-4, Unit("mm", 1e-3)),
        (0.1, Unit("m", 1.0)),
        (1e4, Unit("km", 1e3)),
    ),
    "_s": ((0.0, Unit("µs", 1e-6)), (1e-3, Unit("ms", 1e-3)), (1.0, Unit("s", 1.0))),
    "_m_s": (
        (0.0, Unit("µm/s", 1e-6)),
        (1e-4, Unit("mm/s", 1e-3)),
        (0.1, Unit("m/s", 1.0)),
    ),
    "_m_s2": ((0.0, Unit("m/s²", 1.0)),),
    "_pa": ((0.0, Unit("Pa", 1.0)), (1e3, Unit("kPa", 1e3)), (1e6, Unit("MPa", 1e6))),
    "_pa_s": ((0.0, Unit("Pa s", 1.0)), (1e4, Unit("kPa s", 1e3))),
    "_j": (
        (0.0, Unit("J", 1.0)),
        (1e3, Unit("kJ", 1e3)),
        (1e6, Unit("MJ", 1e6)),
        (1e9, Unit("GJ", 1e9)),
        (1e12, Unit("TJ", 1e12)),
    ),
    "_rad": ((0.0, Unit("mrad", 1e-3)), (0.1, Unit("rad", 1.0))),
    "_deg": ((0.0, Unit("degrees", 1.0)),),
    "_px": ((0.0, Unit("px", 1.0)),),
    "_k": ((0.0, Unit("K", 1.0)),),
    "": ((0.0, Unit("", 1.0)),),
}
"""Units of each suffix, each with the SI value from which a reader wants it."""


def finite(number: Any) -> float | None:
    """Return a number as a float, None where it is null, NaN or infinite."""
    return None if number is None or not math.isfinite(number) else float(number)


CUSTOMARY = {
    "_kg": ((0.0, "lb"),),
    "_m": ((0.0, "in"), (0.1, "ft")),
    "_m_s": ((0.0, "in_s"), (0.3, "ft_s")),
    "_pa": ((0.0, "psi"),),
    "_pa_s": ((0.0, "psi_ms"),),
}
"""The same of what Americans have units of their own for, by the endings of names."""
SYMBOLS: dict[str, str] = {"in_s": "in/s", "ft_s": "ft/s", "psi_ms": "psi ms"}


def unit_for(name: str, *numbers: float | None, system: System = "si") -> Unit:
    """Choose the unit for numbers of one parameter or quantity, by the largest."""
    ladder = _ladder(split_name(name)[1], system)
    largest = max((abs(n) for n in numbers if n is not None), default=0.0)
    if largest == 0.0:
        return next((u for _, u in ladder if u.size == 1.0), ladder[-1][1])
    return [unit for start, unit in ladder if largest >= start][-1]


def _ladder(suffix: str, system: System) -> tuple[tuple[float, Unit], ...]:
    if system == "si" or suffix not in CUSTOMARY:
        return LADDERS[suffix]
    return tuple(
        (start, Unit(SYMBOLS.get(ending) or ending, si_factor(ending)))
        for start, ending in CUSTOMARY[suffix]
    )


def rounded(number: float, sd: float) -> str:
    """Print a number to two digits of its standard deviation."""
    two_digits = float(f"{sd:.1e}")  # 0.0996 is 0.10, so it decides as 0.10 does
    decimals = 1 - math.floor(math.log10(two_digits)) if sd > 0.0 else 12
    decimals = min(decimals, 12)
    if decimals < 0 and abs(number) >= 1e7:
        digits = math.floor(math.log10(abs(number))) + decimals
        return scientific(number, max(digits, 1))
    text = f"{round(number, decimals):.{max(decimals, 0)}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def significant(number: float, digits: int = 2) -> str:
    """Print a number to so many significant digits."""
    if number == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(number)))
    if not -4 <= exponent < 7:
        return scientific(number, digits - 1)
    decimals = digits - 1 - exponent
    return f"{round(number, decimals):.{max(decimals, 0)}f}"


def scientific(number: float, decimals: int) -> str:
    """Print 2.1e7 rather than 2.1e+07."""
    mantissa, _, exponent = f"{number:.{decimals}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def printed_number(
    name: str, value: float | int, digits: int = 4, system: System = "si"
) -> str:
    """Print a number with its unit where no uncertainty is known."""
    value = float(value)
    unit = unit_for(name, value, system=system)
    text = significant(value / unit.size, digits)
    if "." in text and "e" not in text:
        text = text.rstrip("0").rstrip(".")
    return f"{text} {unit.symbol}".rstrip()
