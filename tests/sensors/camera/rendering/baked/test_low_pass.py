"""Pictures without what is finer than a pixel."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.camera.baked_explosion import low_passed


@pytest.mark.parametrize("pitch", [0.3, 1.0, 1.5, 2.0, 3.3, 8.0])
def test_a_point_is_spread_to_the_variance_of_a_tent(pitch):
    size = 65
    point = jnp.zeros((size, size, 1)).at[32, 32, 0].set(1.0)
    spread = np.asarray(low_passed(point, jnp.asarray(pitch)))[..., 0]
    assert spread.sum() == pytest.approx(1.0)
    x = np.arange(size) - 32.0
    for axis in (0, 1):
        along = spread.sum(axis)
        assert along @ x == pytest.approx(0.0, abs=1e-5)
        expected = max(pitch**2 - 1.0, 0.0) / 6.0
        assert along @ x**2 == pytest.approx(expected, abs=1e-4)
