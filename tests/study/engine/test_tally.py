"""Blocks reduced where they are calculated: as the samples are on the host."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.study.engine.store import Variable
from jblast.study.engine.summary import (
    ANCHORS,
    COUNTERS,
    VALID,
    Anchor,
    reduce_of,
    states_of,
)
from jblast.study.statistics import ACCUMULATORS

BLOCKS, SAMPLES, SENSORS = 3, 256, 2
NAME = "peak_overpressure_pa"
OUTCOME = Variable(NAME, "outcome", "Pa", "a pressure", sensors=("a", "b"))


@pytest.mark.parametrize("counters", [1, COUNTERS])
def test_lost_infinite_and_missing_samples_count_as_on_the_host(counters):
    values = np.random.default_rng(0).lognormal(2.0, 0.3, (BLOCKS, SAMPLES, SENSORS))
    values[0, 5, 0], values[1, 7, 1], values[1, 8, 1] = np.nan, np.inf, -np.inf
    values[2, 180:] = np.nan  # of no sample: see below
    valid = np.ones((BLOCKS, SAMPLES), bool)
    valid[2, 180:] = False
    origin = np.array([[7.0, 0.0]])
    anchors = {NAME: Anchor(np.full((1, SENSORS), 7.4), origin)}
    shift, origins = anchors[NAME]
    shared = {ANCHORS: {NAME: (jnp.asarray(shift[0]), jnp.asarray(origins[0]))}}
    answers = {NAME: jnp.asarray(values), VALID: jnp.asarray(valid)}
    reduce = reduce_of([OUTCOME], counters)
    counts, kept = jax.jit(reduce.step)(shared, reduce.empty(shared), answers)
    kept, counts = jax.tree.map(np.asarray, (kept, reduce.end(counts)))
    state = states_of([OUTCOME], kept, counts, anchors)[NAME]
    number = ACCUMULATORS["number"]
    there = number.add(number.empty((SENSORS,), origin[0]), values[valid])
    for name in ("finite", "infinite", "lost", "minimum", "maximum"):
        ours = getattr(state.moments, name)[0]
        np.testing.assert_array_equal(ours, getattr(there.moments, name), name)
    np.testing.assert_allclose(state.moments.mean[0], there.moments.mean, rtol=1e-14)
    np.testing.assert_allclose(state.moments.squares[0], there.moments.squares)
    np.testing.assert_array_equal(state.sketch.counts[0], there.sketch.counts)
