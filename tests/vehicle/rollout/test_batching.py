"""Lanes among chunks: every lane once, in its place, whatever is left over."""

import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle.rollout import over_lanes


@pytest.mark.parametrize("count", [1, 4, 5, 7, 8])
def test_lanes_that_do_not_fill_their_chunks_come_back_once_each(monkeypatch, count):
    batching = sys.modules[over_lanes.__module__]
    monkeypatch.setattr(batching, "CHUNK_BYTES", 3 * 8)  # three lanes of float64

    def one(lane):
        return {"square": lane["x"] ** 2, "pair": jnp.stack([lane["y"], lane["x"]])}

    x, y = jnp.arange(1.0, count + 1.0), jnp.arange(0.5, count)
    found = jax.jit(lambda lanes: over_lanes(one, lanes, 1))({"x": x, "y": y})
    np.testing.assert_array_equal(found["square"], x**2)
    np.testing.assert_array_equal(found["pair"], np.stack([y, x], axis=1))
