"""Blocks reduced on the device that calculated them, where a study has no cells.

Of blocks that go together the sums about a value near the mean are kept, a few numbers
for each outcome and sensor; bins are counted for a whole launch. So what leaves a
device does not grow with the samples that go through it.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jblast.study.engine.launch import Reduce
from jblast.study.engine.summary.states import (
    NUMBERS,
    Anchors,
    State,
    moments_from,
    share_from,
)
from jblast.study.engine.variable import Variable
from jblast.study.statistics.number import NumberState
from jblast.study.statistics.quantile_sketch import BINS, QuantileSketch, bin_of

VALID, ANCHORS = "_valid", "_anchors"
"""Which lanes of a block are samples; what numbers are counted from."""
SUMS = "samples", "infinite", "off", "squares off", "minimum", "maximum"
"""Of blocks; off from a value near the mean. What is lost bins do not count."""
COUNTERS = 256
"""Of a bin, of all lanes, among which a GPU shares samples: two that count at one place
wait for each other."""
ROWS = 64
"""Of a block that are summed side by side before they are summed up: a fixed order."""


def reduce_of(outcomes: Sequence[Variable], counters: int = 1) -> Reduce:
    """Return what reduces blocks of some outcomes.

    Args:
        outcomes: Of the study.
        counters: Of a bin, of all lanes of an outcome: see `COUNTERS`.
    """
    lanes = {v.name: max(1, len(v.sensors)) for v in outcomes}
    numbers = [v.name for v in outcomes if v.kind == "number"]
    each = {name: max(1, counters // lanes[name]) for name in numbers}

    def empty(_: Any) -> dict[str, Array]:
        # the last one is of what is no number
        return {
            name: jnp.zeros(BINS * each[name] * lanes[name] + 1, jnp.int32)
            for name in numbers
        }

    def step(
        shared: Mapping[str, Any], counts: dict[str, Array], answers: dict[str, Array]
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        valid, kept, counted = answers[VALID][..., None], {}, {}
        for v in outcomes:
            values = answers[v.name].reshape(*valid.shape[:-1], lanes[v.name])
            if v.kind == "yes_no":
                kept[v.name] = _shares(values, valid)
                continue
            shift, origin = (x[None, None] for x in shared[ANCHORS][v.name])
            kept[v.name] = _sums(values, valid, shift)
            several = counts[v.name]
            place = bin_of(values - origin).astype(jnp.int32)
            if each[v.name] > 1:
                turn = jnp.arange(valid.shape[1], dtype=jnp.int32)[None, :, None]
                place = place * each[v.name] + turn % each[v.name]
            lane = jnp.arange(lanes[v.name], dtype=jnp.int32)[None, None]
            place = place * lanes[v.name] + lane
            place = jnp.where(valid & ~jnp.isnan(values), place, several.size - 1)
            counted[v.name] = several.at[place.reshape(-1)].add(
                1, mode="promise_in_bounds", wrap_negative_indices=False
            )
        return counted, kept

    def end(counts: dict[str, Array]) -> dict[str, Array]:
        return {
            name: several[:-1].reshape(BINS, each[name], -1).sum(axis=1).T
            for name, several in counts.items()
        }

    return Reduce(empty, step, end)


def _shares(values: Array, valid: Array) -> Array:
    """Return of each lane how many are known, true, lost."""
    known, yes = valid & (values >= 0), valid & (values > 0)
    parts = known, yes, valid & (values < 0)
    counts = [jnp.sum(x, axis=(0, 1), dtype=jnp.int32) for x in parts]
    return jnp.stack(counts, -1)[None]


def _sums(values: Array, valid: Array, shift: Array) -> Array:
    """Return of each lane what makes its moments; see `SUMS`."""
    off = jnp.where(valid & jnp.isfinite(values), values - shift, 0.0)
    some = valid & ~jnp.isnan(values)
    low = _folded(jnp.where(some, values, jnp.inf), jnp.minimum, jnp.inf)
    high = _folded(jnp.where(some, values, -jnp.inf), jnp.maximum, -jnp.inf)

    def counted() -> Array:
        return jnp.sum(some & jnp.isinf(values), axis=(0, 1), dtype=values.dtype)

    odd = jnp.isinf(low) | jnp.isinf(high)
    infinite = jax.lax.cond(odd.any(), counted, lambda: jnp.zeros_like(low))
    samples = jnp.sum(valid, axis=(0, 1), dtype=values.dtype)
    parts = (
        jnp.broadcast_to(samples, low.shape),
        infinite,
        _folded(off, jnp.add, 0.0),
        _folded(jnp.square(off), jnp.add, 0.0),
        low,
        high,
    )
    return jnp.stack(parts, -1)[None]


def _folded(x: Array, join: Callable[[Any, Any], Array], none: float) -> Array:
    """Reduce samples, of a block a power of two, of each lane in one order.

    Rows are joined side by side first, which XLA does in one pass over the lanes; it
    writes a reduction out otherwise.
    """
    rows = min(ROWS, x.shape[1])
    whole = x[:, :rows]
    for begin in range(rows, x.shape[1], rows):
        whole = join(whole, x[:, begin : begin + rows])
    start = jnp.asarray(none, x.dtype)
    return jax.lax.reduce(jax.lax.reduce(whole, start, join, (1,)), start, join, (0,))


def states_of(
    outcomes: Sequence[Variable],
    kept: Mapping[str, np.ndarray],
    counts: Mapping[str, np.ndarray],
    anchors: Anchors,
) -> dict[str, State]:
    """Return the states of blocks that were reduced, of one variant.

    Args:
        outcomes: Of the study.
        kept: Of each group of blocks.
        counts: Of all blocks, by lane.
        anchors: Of this variant: a value a lane.
    """
    found: dict[str, State] = {}
    for v in outcomes:
        shape = v.shape(1)
        if v.kind == "yes_no":
            whole = kept[v.name].sum(axis=0, dtype=np.int64)
            found[v.name] = share_from(*(x.reshape(shape) for x in whole.T))
            continue
        parts = np.asarray(kept[v.name], float)
        samples, infinite, off, square = np.moveaxis(parts.sum(axis=0), -1, 0)[:4]
        low, high = parts[..., 4].min(axis=0), parts[..., 5].max(axis=0)
        whole = counts[v.name].astype(np.int64)
        known = whole.sum(axis=-1)
        finite, lost = known - infinite, samples - known
        shift = anchors[v.name].shift.reshape(-1)
        mean = np.where(finite > 0, shift + off / np.maximum(finite, 1.0), 0.0)
        squares = np.maximum(square - off**2 / np.maximum(finite, 1.0), 0.0)
        numbers = np.stack([finite, infinite, lost, mean, squares, low, high], -1)
        moments = moments_from(numbers.reshape(*shape, len(NUMBERS)))
        whole = whole.reshape(*shape, -1)
        origin = anchors[v.name].origin.reshape(shape)
        found[v.name] = NumberState(moments, QuantileSketch(whole, origin))
    return found
