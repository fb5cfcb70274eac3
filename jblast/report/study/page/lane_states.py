"""What a lane amounts to that is known by its statistics alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.study.statistics import YES_NO
from jblast.study.statistics.moments import Moments, finish_moments, merge_moments
from jblast.study.statistics.quantile_sketch import bin_edges, sketch_quantiles
from jblast.study.statistics.share import ShareState

QUANTILES = (0.05, 0.5, 0.95)
NAMES = ("q05", "q50", "q95")


def found_in(
    kind: str, state: Any, which: Any, quantiles: Sequence[float] = QUANTILES
) -> dict[str, Any]:
    """Return what some cells of a lane amount to together.

    Args:
        kind: "number" or "yes_no".
        state: Of each variant and cell.
        which: Cells, as an index of an array.
        quantiles: That are wanted.

    Returns:
        As `statistics` finishes it, of a number with `q05`, `q50`, `q95`.
    """
    if kind == "yes_no":
        return YES_NO.finish(ShareState(*(np.sum(x[which], axis=0) for x in state)))
    parts = [np.asarray(x)[which] for x in state.moments]
    whole = Moments(*(x[0] for x in parts))
    for n in range(1, len(parts[0])):
        whole = merge_moments(whole, Moments(*(x[n] for x in parts)))
    found: dict[str, Any] = finish_moments(whole)
    if not quantiles:
        return found
    sketch = type(state.sketch)(*(np.asarray(x)[which] for x in state.sketch))
    low, high = found["minimum"], found["maximum"]
    if len(sketch.origin) == 1:
        one = type(sketch)(sketch.counts[0], sketch.origin[0])
        at = sketch_quantiles(one, np.asarray(quantiles), low, high)
    else:
        values, counts = pooled(sketch, float(low), float(high))
        at = np.full(len(quantiles), np.nan)
        if len(values):
            upto = np.cumsum(counts)
            rank = np.asarray(quantiles) * upto[-1]
            at = values[np.minimum(np.searchsorted(upto, rank), len(values) - 1)]
    return found | dict(zip(NAMES, at, strict=True))


def pooled(
    sketch: Any, low: float, high: float
) -> tuple[Float[np.ndarray, " value"], np.ndarray]:
    """Return the middles of bins of several cells, in order, and what is in each."""
    edges = bin_edges()
    middle = 0.5 * (np.clip(edges[:-1], -1e300, None) + np.clip(edges[1:], None, 1e300))
    group, place = np.nonzero(sketch.counts)
    values = np.clip(np.asarray(sketch.origin)[group] + middle[place], low, high)
    order = np.argsort(values, kind="stable")
    return values[order], np.asarray(sketch.counts)[group, place][order]
