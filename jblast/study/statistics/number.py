"""A number of each sample: moments and a sketch of quantiles, as one state."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from jblast.study.statistics.moments import (
    Moments,
    empty_moments,
    finish_moments,
    merge_moments,
    moments_of,
)
from jblast.study.statistics.quantile_sketch import (
    QuantileSketch,
    empty_sketch,
    merge_sketches,
    sketch_of,
    sketch_quantiles,
)
from jblast.study.statistics.stream import BLOCK, blocks

SLAB = 16 * BLOCK
"""Values counted at once: counts are whole, so that any number will do."""
QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)


class NumberState(NamedTuple):
    """What a stream of numbers is reduced to."""

    moments: Moments
    sketch: QuantileSketch


def empty_number(
    shape: tuple[int, ...] = (),
    origin: Float[np.ndarray, "..."] | float = 0.0,
    weighted: bool = False,
) -> NumberState:
    """Return the state of no samples; `origin` as `origin_of` finds it."""
    return NumberState(empty_moments(shape), empty_sketch(shape, origin, weighted))


def number_of(
    values: Float[Array | np.ndarray, "sample ..."],
    weights: Float[Array | np.ndarray, " sample"] | None = None,
    like: NumberState | None = None,
) -> NumberState:
    """Reduce one block; `like` has the origin of its bins."""
    origin = 0.0 if like is None else like.sketch.origin
    return NumberState(moments_of(values, weights), sketch_of(values, weights, origin))


def merge_numbers(a: NumberState, b: NumberState) -> NumberState:
    """Merge two states; `a` stands before `b` in the order of the samples."""
    return NumberState(
        merge_moments(a.moments, b.moments), merge_sketches(a.sketch, b.sketch)
    )


def numbers_in_slabs(
    state: NumberState, values: Float[np.ndarray, "sample ..."]
) -> NumberState:
    """Add samples without weights: moments by blocks, counts by slabs of them."""
    moments, sketch = state
    for part in blocks(len(values)):
        moments = merge_moments(moments, moments_of(values[part]))
    for part in blocks(len(values), SLAB):
        sketch = merge_sketches(sketch, sketch_of(values[part], None, sketch.origin))
    return NumberState(moments, sketch)


def finish_number(
    state: NumberState, quantiles: tuple[float, ...] = QUANTILES
) -> dict[str, np.ndarray]:
    """Return `moments.finish_moments` and `quantiles`, by `quantile` first."""
    found = finish_moments(state.moments)
    found["quantiles"] = sketch_quantiles(
        state.sketch, np.asarray(quantiles), found["minimum"], found["maximum"]
    )
    return found
