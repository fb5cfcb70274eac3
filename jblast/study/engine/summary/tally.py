"""Blocks reduced on the device that calculated them, where a study has no cells.

Of each block the sums about a value near the mean are kept, a few numbers for each
outcome and sensor; bins are counted for a whole launch. So what leaves a device does
not grow with the samples that go through it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

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


def reduce_of(outcomes: Sequence[Variable]) -> Reduce:
    """Return what reduces blocks of some outcomes."""
    lanes = {v.name: max(1, len(v.sensors)) for v in outcomes}
    numbers = [v.name for v in outcomes if v.kind == "number"]

    def empty(_: Any) -> dict[str, Array]:
        return {name: jnp.zeros(lanes[name] * BINS, jnp.int32) for name in numbers}

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
            bins = bin_of(values - origin).astype(jnp.int32)
            bins += BINS * jnp.arange(lanes[v.name], dtype=jnp.int32)[None, None]
            known = (valid & ~jnp.isnan(values)).astype(jnp.int32)
            counted[v.name] = (
                counts[v.name]
                .at[bins.reshape(-1)]
                .add(known.reshape(-1), mode="promise_in_bounds")
            )
        return counted, kept

    return Reduce(empty, step)


def _shares(values: Array, valid: Array) -> Array:
    """Return of each block and lane how many are known, true, lost."""
    known, yes = valid & (values >= 0), valid & (values > 0)
    parts = known, yes, valid & (values < 0)
    return jnp.stack([jnp.sum(x, axis=1, dtype=jnp.int32) for x in parts], -1)


def _sums(values: Array, valid: Array, shift: Array) -> Array:
    """Return of each block and lane the seven numbers that make its moments."""
    finite = valid & jnp.isfinite(values)
    off = jnp.where(finite, values - shift, 0.0)
    nan = jnp.isnan(values)
    some = valid & ~nan
    parts = (
        jnp.sum(finite.astype(values.dtype), axis=1),
        jnp.sum((some & ~finite).astype(values.dtype), axis=1),
        jnp.sum((valid & nan).astype(values.dtype), axis=1),
        jnp.sum(off, axis=1),
        jnp.sum(jnp.square(off), axis=1),
        jnp.min(jnp.where(some, values, jnp.inf), axis=1),
        jnp.max(jnp.where(some, values, -jnp.inf), axis=1),
    )
    return jnp.stack(parts, -1)


def states_of(
    outcomes: Sequence[Variable],
    kept: Mapping[str, np.ndarray],
    counts: Mapping[str, np.ndarray],
    anchors: Anchors,
) -> dict[str, State]:
    """Return the states of blocks that were reduced, of one variant.

    Args:
        outcomes: Of the study.
        kept: Of each block.
        counts: Of all of them.
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
        low, high = parts[..., 5].min(axis=0), parts[..., 6].max(axis=0)
        finite, infinite, lost, off, square = np.moveaxis(parts.sum(axis=0), -1, 0)[:5]
        shift = anchors[v.name].shift.reshape(-1)
        mean = np.where(finite > 0, shift + off / np.maximum(finite, 1.0), 0.0)
        squares = np.maximum(square - off**2 / np.maximum(finite, 1.0), 0.0)
        numbers = np.stack([finite, infinite, lost, mean, squares, low, high], -1)
        moments = moments_from(numbers.reshape(*shape, len(NUMBERS)))
        whole = counts[v.name].astype(np.int64).reshape(*shape, -1)
        origin = anchors[v.name].origin.reshape(shape)
        found[v.name] = NumberState(moments, QuantileSketch(whole, origin))
    return found
