"""Fewer rows for tables and viewers, without the loss of peaks."""

import numpy as np
from jaxtyping import Float, Int, Num

Rows = Int[np.ndarray, " kept"]


def largest(score: Float[np.ndarray, " row"], group: Num[np.ndarray, " row"]) -> Rows:
    """Return the row of the largest score in each group, in order of the groups."""
    order = np.lexsort((-score, group))
    return order[np.unique(group[order], return_index=True)[1]]


def largest_since(score: Float[np.ndarray, " row"], every: int) -> Rows:
    """Return for each row of a stride the row of the largest score since the last."""
    kept = 1 + (score.size - 1) // every * every
    return largest(score[:kept], np.arange(every - 1, every - 1 + kept) // every)


def first_of_each(time_s: Float[np.ndarray, " row"], rate_hz: float) -> Rows:
    """Return the first row of each interval of a rate; times increase."""
    # 1 us, so that a time is in the interval that it begins
    return np.unique(np.floor((time_s + 1e-6) * rate_hz), return_index=True)[1]


def extremes(values: Float[np.ndarray, " row"], columns: int) -> Rows:
    """Return the rows of the least and the greatest value of each column, in order.

    Args:
        values: Values in order of time.
        columns: Largest number of columns; each has at most two rows.
    """
    group = np.arange(values.size) // max(1, -(-values.size // columns))
    return np.union1d(largest(values, group), largest(-values, group))
