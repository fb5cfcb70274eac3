"""Bloom keeps all light, and is even where light is even."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.sensors.camera.image import WIDTHS, bloom


@settings(max_examples=20, deadline=None)
@given(
    st.integers(1, 40),
    st.integers(1, 40),
    st.floats(0.0, 1.0),
    st.integers(0, 2**32 - 1),
)
def test_no_light_is_lost(height, width, part, seed):
    light = np.random.default_rng(seed).lognormal(0.0, 4.0, (2, height, width, 3))
    spread = bloom(light, part)
    # rounding: some thousand sums
    np.testing.assert_allclose(spread.sum((1, 2)), light.sum((1, 2)), rtol=1e-12)
    assert spread.min() >= 0.0


def test_even_light_stays_even():
    np.testing.assert_allclose(bloom(np.full((30, 50, 3), 0.3), 0.7), 0.3, rtol=1e-12)


def test_a_point_spreads_by_the_variance_of_its_gaussians():
    point = np.zeros((400, 400, 3))
    point[200, 200] = 1.0
    spread = bloom(point, 1.0)[..., 0]
    place = np.arange(400) - 200
    variance = np.mean(np.square(400 * np.array(WIDTHS)))
    # Gaussians end at four of their deviations, where 0.1 % of the variance is left
    assert np.sum(spread.sum(0) * place**2) == pytest.approx(variance, rel=3e-3)


@pytest.mark.parametrize("part", [-0.1, 1.1, np.nan])
def test_a_part_is_one(part):
    with pytest.raises(InputError, match="bloom: expected a share"):
        bloom(np.zeros((2, 2, 3)), part)
