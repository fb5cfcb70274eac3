"""Numbers with a unit as options take them: `33lb`, `100ft`; a bare one is SI."""

import re
from argparse import ArgumentTypeError
from collections.abc import Callable

from jblast.cli.arguments.numbers import number
from jblast.errors import InputError, shown

NUMBER_AND_UNIT = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.+-].*)"
)


def measured(dimension: str, example: str) -> Callable[[str], float]:
    """Return a `type=` of argparse that takes a number, or one with a unit.

    Args:
        dimension: Of the unit, a key of `units.SUFFIXES`.
        example: What a message shows.
    """

    def in_si(text: str) -> float:
        if "," in text:
            raise ArgumentTypeError(f"expected a decimal point, got {shown(text)}")
        found = NUMBER_AND_UNIT.fullmatch(text.strip())
        if found is None or _is_number(text):
            return number(text)
        digits, unit = found.groups()
        return number(digits) * _factor(unit, dimension, example)

    return in_si


def measured_positive(dimension: str, example: str) -> Callable[[str], float]:
    """Return the same of positive numbers."""
    in_si = measured(dimension, example)

    def positive_in_si(text: str) -> float:
        value = in_si(text)
        if value <= 0:
            raise ArgumentTypeError(f"expected a positive number, got {value:g}")
        return value

    return positive_in_si


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _factor(unit: str, dimension: str, example: str) -> float:
    from jblast.units import si_factor, unit_spelt  # not for --help

    meant = unit_spelt(unit)
    if meant and all(one.dimension != dimension for one in meant):
        raise ArgumentTypeError(
            f"expected a unit of {dimension}, as in {example}; got {shown(unit)}"
        )
    try:
        return si_factor(unit)
    except InputError as error:
        raise ArgumentTypeError(
            f"expected a unit of {dimension}, as in {example}: {error}"
        ) from None
