"""How many of ours a unit is, by pint, which is asked only where it is not SI."""

from fractions import Fraction
from functools import cache
from typing import Any

from jblast.errors import InputError, nearest, shown
from jblast.units.spelling import unit_spelt
from jblast.units.vocabulary import LEVEL, SHARE, SI, SUFFIXES


def si_factor(suffix: str) -> float:
    """Return what values in a unit are multiplied by to be SI, as `si_ratio` does."""
    return float(si_ratio(suffix))


def si_ratio(suffix: str) -> Fraction:
    """Return what values in a unit are multiplied by to be SI, to the last digit.

    Args:
        suffix: An ending of a name: "psi_ms", "kPa", "percent".

    Raises:
        InputError: It is no unit we know, one of several that case alone tells apart,
            or a level, which no factor converts.
    """
    found = {(unit.dimension, unit.pint) for unit in unit_spelt(suffix)}
    if len(found) != 1:
        known = [ending for endings in SUFFIXES.values() for ending in endings]
        either = " or ".join(sorted(pint for _, pint in found))
        raise InputError(
            f"unit {shown(suffix)}: "
            + (f"expected {either}, which case tells apart" if either else "")
            + ("" if either else f"expected a known unit{nearest(suffix, known)}")
        )
    ((dimension, pint),) = found
    if dimension == LEVEL:
        raise InputError(f"unit {shown(suffix)}: a level has no factor")
    return _ratio(dimension, pint)


@cache
def _ratio(dimension: str, unit: str) -> Fraction:
    if dimension == SHARE:
        return Fraction(1, 100)
    ours = SUFFIXES[dimension][SI[dimension]]
    if unit == ours:
        return Fraction(1)
    return Fraction(_registry().Quantity(Fraction(1), unit).to(ours).magnitude)


@cache
def _registry():
    import pint

    # in fractions a foot is 0.3048 m; in floats it is 0.30479999999999996 m
    exact: Any = Fraction  # which pint's types do not name, though its manual does
    return pint.UnitRegistry(non_int_type=exact)
