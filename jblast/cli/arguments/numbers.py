"""Numbers as values of options, bare or with a unit, each read by an argparse `type`.

A bare number is in SI; `measured` also accepts a unit after it: `33lb`, `100ft`.
argparse names the option of an error, and `VerbParser` makes one message of it.
"""

import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable

from jblast.errors import InputError, shown, whole_number

MOST_ROWS = 100_000
"""Largest table of FROM:TO:COUNT, declared: a mistyped COUNT must not fill memory."""
EITHER = re.compile(r"\d+,\d+[^\d,:]*")
"""15,5 or 33,5lb: two numbers, or one with a decimal comma."""
SIZES = (1e-30, 1e30)
"""Bounds of a number other than 0: beyond them its powers overflow, or are 0."""
# A unit begins neither with a digit nor with a sign or point, so that 1..2 and 1e3.5
# are no numbers with a unit; 5e3lb has its exponent in the number.
NUMBER_AND_UNIT = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.+-].*)"
)


def number(text: str) -> float:
    """Return a finite number, 0 or of a size within `SIZES`.

    Raises:
        ArgumentTypeError: The text is no such number.
    """
    value = _number_or_nan(text)
    if not math.isfinite(value):
        raise ArgumentTypeError(f"expected a finite number, got {shown(text)}")
    # 0 is valid, although smaller than the bounds
    if value and not SIZES[0] <= abs(value) <= SIZES[1]:
        raise ArgumentTypeError(
            f"expected a number of a size between {SIZES[0]:g} and {SIZES[1]:g}, or 0; "
            f"got {shown(text)}"
        )
    return value


def positive(text: str) -> float:
    """Return a positive number of a size within `SIZES`.

    Raises:
        ArgumentTypeError: The text is no such number.
    """
    value = number(text)
    if value <= 0:
        raise ArgumentTypeError(f"expected a positive number, got {value:g}")
    return value


def positive_of_any_size(text: str) -> float:
    """Return a positive, finite number of any size, of which no power is taken.

    Raises:
        ArgumentTypeError: The text is no such number.
    """
    value = _number_or_nan(text)
    if not 0.0 < value < math.inf:
        raise ArgumentTypeError(f"expected a positive number, got {text!r}")
    return value


def several(text: str, one: Callable[[str], float] = positive) -> tuple[float, ...]:
    """Return the values of `1`, `1,2,5` or `1:100:20`, all positive.

    Args:
        text: Value of the option.
        one: Reader of one number.

    Raises:
        ArgumentTypeError: The text has another form, or two whole numbers that may be
            one number with a decimal comma.
    """
    if EITHER.fullmatch(text):
        raise ArgumentTypeError(
            f"expected {text.replace(',', '.')} with a point, or "
            f"{text.replace(',', ' ')}; got {text!r}, which may be one number or two"
        )
    values: list[float] = []
    for word in text.split(","):
        if ":" in word:
            values += _evenly_in_ln(word, one)
        else:
            values.append(one(word))
    return tuple(values)


def share(text: str) -> float:
    """Return a number in [0, 1).

    Raises:
        ArgumentTypeError: The text is no such number.
    """
    value = _number_or_nan(text)
    if not 0.0 <= value < 1.0:
        raise ArgumentTypeError(
            f"expected a share, 0 or more and below 1, got {text!r}"
        )
    return value


def time_span(text: str) -> tuple[float, float]:
    """Return START and STOP [s] of `START:STOP`.

    Raises:
        ArgumentTypeError: The text has another form, or STOP is not after START.
    """
    try:
        start, stop = (float(word) for word in text.split(":"))
    except ValueError:
        # NaN fails the test below, which has the message for any wrong text.
        start = stop = math.nan
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise ArgumentTypeError(
            f"expected START:STOP, two numbers of seconds, got {text!r}"
        )
    if stop <= start:
        raise ArgumentTypeError(f"expected START before STOP, got {text!r}")
    return start, stop


def threshold_pair(text: str) -> tuple[float, float]:
    """Return the thresholds of ln(light), brighter and darker; one number is for both.

    Raises:
        ArgumentTypeError: The text is not one or two positive numbers.
    """
    words = text.split(",")
    if len(words) > 2:
        raise ArgumentTypeError(f"expected one or two numbers, got {text!r}")
    values = [positive_of_any_size(word.strip()) for word in words]
    return values[0], values[-1]


def vector(text: str) -> tuple[float, ...]:
    """Return the three numbers of `X,Y,Z` [m].

    Raises:
        ArgumentTypeError: The text has another form.
    """
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise ArgumentTypeError(f"expected three numbers X,Y,Z [m], got {shown(text)}")
    return values


def seed(text: str) -> int:
    """Return a seed of JAX.

    Raises:
        ArgumentTypeError: The text is no whole number from 0 to 2^63 - 1.
    """
    try:
        value = int(text)
    except ValueError:
        value = -1
    # larger seeds do not fit into the 64-bit integer of a key
    if not 0 <= value < 2**63:
        raise ArgumentTypeError(
            f"expected a whole number from 0 to 2^63 - 1, got {text!r}"
        )
    return value


def _evenly_in_ln(word: str, one: Callable[[str], float]) -> list[float]:
    """Return the numbers of FROM:TO:COUNT, evenly spaced in ln."""
    import numpy as np  # here, so that --help does not load it

    parts = word.split(":")
    count = whole_number(parts[2]) if len(parts) == 3 else None
    if count is None or not 2 <= count <= MOST_ROWS:
        raise ArgumentTypeError(
            f"expected FROM:TO:COUNT with a COUNT of 2 to {MOST_ROWS}, "
            f"got {shown(word)}"
        )
    low, high = (one(part) for part in parts[:2])
    if not low < high:
        turned = f"; write {parts[1]}:{parts[0]}:{parts[2]}" if high < low else ""
        raise ArgumentTypeError(
            f"expected FROM:TO:COUNT with FROM below TO, got {shown(word)}{turned}"
        )
    # Peak, impulse and arrival are nearly powers of the range: equal ratios resolve
    # their curves evenly.
    return np.geomspace(low, high, count).tolist()


def _number_or_nan(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def measured(dimension: str, example: str) -> Callable[[str], float]:
    """Return an argparse `type` that reads a number, or a number with a unit.

    Args:
        dimension: Dimension of the unit, a key of `units.SUFFIXES`.
        example: Value with a unit, for messages.
    """

    def in_si(text: str) -> float:
        # a comma would be read as the start of a unit: 5 and ",5kPa"
        if "," in text:
            raise ArgumentTypeError(f"expected a decimal point, got {shown(text)}")
        found = NUMBER_AND_UNIT.fullmatch(text.strip())
        # `float` reads 1_000, which the pattern would split into 1 and a unit _000
        if found is None or not math.isnan(_number_or_nan(text)):
            return number(text)
        digits, unit = found.groups()
        return number(digits) * _factor(unit, dimension, example)

    return in_si


def measured_positive(dimension: str, example: str) -> Callable[[str], float]:
    """Return an argparse `type` as `measured`, for positive numbers."""
    in_si = measured(dimension, example)

    def positive_in_si(text: str) -> float:
        value = in_si(text)
        if value <= 0:
            raise ArgumentTypeError(f"expected a positive number, got {value:g}")
        return value

    return positive_in_si


def _factor(unit: str, dimension: str, example: str) -> float:
    from jblast.units import si_factor, unit_spelt  # here, as NumPy above

    meant = unit_spelt(unit)
    # An unknown unit is left to `si_factor`, whose message names the nearest one.
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
