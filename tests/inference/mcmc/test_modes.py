import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.mcmc.modes import modes, ridge
from tests.inference.mcmc.densities_by_hand import Two


def of(density, draws):
    return np.array([float(density.log_density(jnp.asarray(w))) for w in draws])


@pytest.mark.slow
@pytest.mark.parametrize(("apart", "count"), [(4.0, 2), (1.0, 1)])
def test_two_modes_are_told_where_there_is_a_valley(apart, count):
    rng = np.random.default_rng(0)
    w = rng.standard_normal((600, 2))
    w[:, 0] += np.where(np.arange(600) % 3 < 2, apart, -apart)
    density = Two(jnp.array(apart))
    found = modes(density, w, of(density, w), 2 * np.eye(2))
    assert len(found) == count
    if count == 2:
        assert [mode.share for mode in found] == pytest.approx([2 / 3, 1 / 3], abs=0.02)
        # in the coordinates told, which are twice as large: to the sd of a peak
        np.testing.assert_allclose(found[0].peak, [8.0, 0.0], atol=2.0)
        np.testing.assert_allclose(found[1].peak, [-8.0, 0.0], atol=2.0)
        # 5 and 95 % quantiles of a normal with sd 2
        np.testing.assert_allclose(found[0].low, [4.7, -3.3], atol=0.7)
        np.testing.assert_allclose(found[0].high, [11.3, 3.3], atol=0.7)


def test_a_ridge_is_told_with_its_length_and_ends():
    rng = np.random.default_rng(0)
    w = rng.standard_normal((1000, 2))
    value = -0.5 * np.sum(w**2, axis=1)
    assert ridge(w, value) is None
    found = ridge(w * np.array([10.0, 1.0]), value)
    assert found is not None
    assert found.longer == pytest.approx(10.0, rel=0.1)
    # the middle of a normal's outer 5 %: its 2.5 % quantile
    np.testing.assert_allclose(np.sort(found.ends[:, 0]), [-19.6, 19.6], rtol=0.15)
    assert not found.endless
