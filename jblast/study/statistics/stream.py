"""Streams: cut into blocks of the sample index, merged in its order."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

BLOCK = 8192
"""Samples that are reduced at once. Streams cut at multiples of it, however, end in the
same state to the last bit."""
State = TypeVar("State")


def blocks(count: int, size: int = BLOCK) -> list[slice]:
    """Return the slices of so many samples each that make up a count."""
    return [slice(at, min(at + size, count)) for at in range(0, count, size)]


def checked_weights(weights: np.ndarray, count: int) -> np.ndarray:
    """Return weights of so many samples.

    Raises:
        ValueError: There are more or fewer, or one is negative, infinite or NaN.
    """
    found = np.asarray(weights, float)
    if found.shape != (count,):
        raise ValueError(
            f"weights: expected one for each of {count} samples, got the shape "
            f"{found.shape}"
        )
    bad = np.flatnonzero(~np.isfinite(found) | (found < 0))
    if bad.size:
        raise ValueError(
            f"weights: expected finite ones of zero or more, got {found[bad[0]]} of "
            f"sample {bad[0]}" + (f" and {bad.size - 1} more" if bad.size > 1 else "")
        )
    return found


def fold(
    state: State, others: list[State], merge: Callable[[State, State], State]
) -> State:
    """Merge states one after another, in the order in which they stand."""
    for other in others:
        state = merge(state, other)
    return state
