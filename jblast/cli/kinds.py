"""Kinds of values of options, by name, each with the reader of its text.

A bare number is in SI; `mass`, `length` and other dimensions also accept a unit after
it: `33lb`, `100ft`. argparse adds the option's name to a message.
"""

import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from jblast.errors import InputError, shown, whole_number
from jblast.parameters import NUMBER_SIZES

MOST_ROWS = 100_000
"""Largest table of FROM:TO:COUNT, declared: a mistyped COUNT must not fill memory."""
EITHER = re.compile(r"\d+,\d+[^\d,:]*")
"""15,5 or 33,5lb: two numbers, or one with a decimal comma."""
# A unit begins neither with a digit nor with a sign or point, so that 1..2 and 1e3.5
# are no numbers with a unit; 5e3lb has its exponent in the number.
NUMBER_AND_UNIT = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.+-].*)"
)
UNITS = {
    "mass": "33lb",
    "length": "100ft",
    "time": "50ms",
    "pressure": "1psi",
    "impulse": "10psi_ms",
    "speed": "1ft/s",
    "temperature": "20C",
    "share": "50%",
}
"""Dimensions of options with a unit, each with an example."""


def text(word: str) -> str:
    """Return a text as it is."""
    return word


def path(word: str) -> str:
    """Return a path that is not empty, as from an unset variable of the shell."""
    # An empty path would be the current folder, which --force may overwrite.
    if not word.strip():
        raise ArgumentTypeError(f"expected a path, got {word!r}")
    return word


def names(word: str) -> list[str]:
    """Return the names in a list with commas."""
    return [name.strip() for name in word.split(",") if name.strip()]


def choice(word: str, words: Sequence[str]) -> str:
    """Return one of some words."""
    if word not in words:
        raise ArgumentTypeError(f"expected {' or '.join(words)}, got {shown(word)}")
    return word


def number(word: str) -> float:
    """Return a finite number, 0 or of a size within `NUMBER_SIZES`."""
    value = _number_or_nan(word)
    if not math.isfinite(value):
        raise ArgumentTypeError(f"expected a finite number, got {shown(word)}")
    # 0 is valid, although smaller than the bounds
    low, high = NUMBER_SIZES
    if value and not low <= abs(value) <= high:
        raise ArgumentTypeError(
            f"expected a number of a size between {low:g} and {high:g}, or 0; "
            f"got {shown(word)}"
        )
    return value


def positive(word: str, one: Callable[[str], float] = number) -> float:
    """Return a positive number of a size within `NUMBER_SIZES`."""
    value = one(word)
    if value <= 0:
        raise ArgumentTypeError(f"expected a positive number, got {value:g}")
    return value


def positive_of_any_size(word: str) -> float:
    """Return a positive, finite number of any size, of which no power is taken."""
    value = _number_or_nan(word)
    if not 0.0 < value < math.inf:
        raise ArgumentTypeError(f"expected a positive number, got {word!r}")
    return value


def pair(word: str) -> tuple[float, float]:
    """Return two positive numbers; a single one is both."""
    values = [positive_of_any_size(part.strip()) for part in word.split(",")]
    if len(values) > 2:
        raise ArgumentTypeError(f"expected one or two numbers, got {word!r}")
    return values[0], values[-1]


def share(word: str) -> float:
    """Return a number in [0, 1)."""
    value = measured(word, "share")
    if not 0.0 <= value < 1.0:
        raise ArgumentTypeError(
            f"expected a share, 0 or more and below 1, got {word!r}"
        )
    return value


def seed(word: str) -> int:
    """Return a seed of JAX."""
    try:
        value = int(word)
    except ValueError:
        value = -1
    # larger seeds do not fit into the 64-bit integer of a key
    if not 0 <= value < 2**63:
        raise ArgumentTypeError(
            f"expected a whole number from 0 to 2^63 - 1, got {word!r}"
        )
    return value


def span(word: str) -> tuple[float, float]:
    """Return START and STOP [s] of `START:STOP`."""
    start, stop = _numbers(word, ":", "START:STOP, two numbers of seconds", 2, 2)
    if stop <= start:
        raise ArgumentTypeError(f"expected START before STOP, got {word!r}")
    return start, stop


def several(word: str, one: Callable[[str], float] = positive) -> tuple[float, ...]:
    """Return the values of `1`, `1,2,5` or `1:100:20`, all positive.

    Two whole numbers that may be one number with a decimal comma are refused.
    """
    if EITHER.fullmatch(word):
        raise ArgumentTypeError(
            f"expected {word.replace(',', '.')} with a point, or "
            f"{word.replace(',', ' ')}; got {word!r}, which may be one number or two"
        )
    values: list[float] = []
    for part in word.split(","):
        values += _evenly_in_ln(part, one) if ":" in part else [one(part)]
    return tuple(values)


def measured(word: str, dimension: str) -> float:
    """Return a number in SI, or a number with a unit of a dimension of `UNITS`."""
    # a comma would be read as the start of a unit: 5 and ",5kPa"
    if "," in word:
        raise ArgumentTypeError(f"expected a decimal point, got {shown(word)}")
    found = NUMBER_AND_UNIT.fullmatch(word.strip())
    # `float` reads 1_000, which the pattern would split into 1 and a unit _000
    if found is None or not math.isnan(_number_or_nan(word)):
        return number(word)
    from jblast.units import to_si  # here, so that --help does not load NumPy

    digits, unit = found.groups()
    try:
        return to_si(number(digits), unit, dimension)
    except InputError as error:
        raise ArgumentTypeError(f"{error}, as in {UNITS[dimension]}") from None


KINDS: dict[str, Callable[[str], Any]] = {
    "text": text,
    "path": path,
    "names": names,
    "integer": int,
    "number": number,
    "positive": positive,
    "size": positive_of_any_size,
    "pair": pair,
    "seed": seed,
    "span": span,
    **{name: partial(measured, dimension=name) for name in UNITS},
    "percentage": partial(measured, dimension="share"),
    "share": share,
}
"""Readers by name; `kind` adds "positive NAME" and "several NAME"."""


def kind(name: str, metavar: str) -> Callable[[str], Any]:
    """Return the reader of a kind.

    Args:
        name: Name in `KINDS`; after "positive" or "several" its values are positive;
            "numbers" has as many as `metavar` names, and those in brackets are
            optional.
        metavar: Name of the value in the help, as "LAT,LON[,ALT]"; for "choice" the
            words, as "rgb|events".
    """
    first, _, rest = name.partition(" ")
    if name == "choice":
        return partial(choice, words=metavar.split("|"))
    if name == "numbers":
        least, most = metavar.split("[")[0].count(",") + 1, metavar.count(",") + 1
        return lambda word: _numbers(word, ",", metavar, least, most)
    if rest and first == "positive":
        return partial(positive, one=KINDS[rest])
    if first == "several":
        return partial(
            several, one=kind(f"positive {rest}" if rest else "positive", "")
        )
    return KINDS[name]


def _numbers(
    word: str, separator: str, names: str, least: int, most: int
) -> tuple[float, ...]:
    """Return between `least` and `most` finite numbers."""
    values = tuple(_number_or_nan(part) for part in word.split(separator))
    if not (least <= len(values) <= most and all(map(math.isfinite, values))):
        raise ArgumentTypeError(f"expected {names}, got {shown(word)}")
    return values


def _evenly_in_ln(word: str, one: Callable[[str], float]) -> list[float]:
    """Return the numbers of FROM:TO:COUNT, evenly spaced in ln."""
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
    import numpy as np  # here, so that --help does not load it

    # Peak, impulse and arrival are nearly powers of the range: equal ratios resolve
    # their curves evenly.
    return np.geomspace(low, high, count).tolist()


def _number_or_nan(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan
