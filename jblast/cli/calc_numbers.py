"""Numbers as `jblast calc` takes them: one, several, or a span."""

import math
from collections.abc import Sequence

import numpy as np

from jblast.errors import InputError, shown

MOST_ROWS = 100_000
SIZES = (1e-30, 1e30)
"""What a number other than 0 may be: past them powers of it overflow."""


def several(words: Sequence[str], where: str) -> tuple[float, ...]:
    """Return the values of `1 2 5`, `1,2,5` or `1:100:20`, all positive.

    Raises:
        InputError: The words are none of these.
    """
    values: list[float] = []
    for word in (part for text in words for part in text.split(",")):
        if ":" not in word:
            values.append(positive(word, where))
            continue
        ends = word.split(":")
        count = ends[2] if len(ends) == 3 else ""
        if not (count.isascii() and count.isdigit() and 2 <= int(count) <= MOST_ROWS):
            raise InputError(
                f"{where}: expected FROM:TO:COUNT with a COUNT of 2 to {MOST_ROWS}, "
                f"got {shown(word)}"
            )
        low, high = (positive(end, where) for end in ends[:2])
        values += np.geomspace(low, high, int(count)).tolist()
    return tuple(values)


def positive(word: str | None, where: str) -> float:
    """Return a number that has to be positive.

    Raises:
        InputError: It is not.
    """
    value = number(word, where)
    if value <= 0:
        raise InputError(f"{where}: expected a positive number, got {value:g}")
    return value


def number(word: str | None, where: str) -> float:
    """Return a number that is finite, and neither huge nor tiny.

    Raises:
        InputError: It is not.
    """
    try:
        value = float(word or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {shown(word)}")
    if value and not SIZES[0] <= abs(value) <= SIZES[1]:
        raise InputError(
            f"{where}: expected a number of a size between {SIZES[0]:g} and "
            f"{SIZES[1]:g}, or 0; got {shown(word)}"
        )
    return value
