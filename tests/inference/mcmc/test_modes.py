import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.mcmc.modes import POINTS, crest, modes, ridge
from tests.inference.mcmc.densities_by_hand import (
    Banana,
    Gaussian,
    Two,
    banana,
    gaussian,
)


def of(density, draws):
    return np.array([float(density.log_density(jnp.asarray(w))) for w in draws])


def bent(count):
    rng = np.random.default_rng(0)
    x = rng.standard_normal(count)
    return np.column_stack([x, 0.5 * x**2 + rng.standard_normal(count)])


def test_one_mode_is_found_in_a_normal_and_along_a_banana():
    rng = np.random.default_rng(0)
    w = rng.multivariate_normal(np.zeros(3), np.linalg.inv(gaussian().precision), 600)
    assert len(modes(gaussian(), w, of(gaussian(), w), np.eye(3))) == 1
    w = bent(600)
    assert len(modes(banana(), w, of(banana(), w), np.eye(2))) == 1


def test_a_thin_bent_ridge_with_few_draws_along_it_is_one_mode():
    rng = np.random.default_rng(0)
    x = rng.uniform(-4, 4, 300)
    x = x[(x < -3) | (x > -1)]  # and none in a gap
    w = np.column_stack([x, 0.5 * x**2 + 0.1 * rng.standard_normal(len(x))])
    long = Banana(jnp.array(0.5), jnp.array(100.0))
    assert len(modes(long, w, of(long, w), np.eye(2))) == 1


@pytest.mark.parametrize("long", [1.0, 10.0])
def test_the_way_between_two_places_keeps_to_the_crest(long):
    # between two places as high the planes across are those of equal x, in which the
    # most probable place of a banana is on its bend
    density = Banana(jnp.array(0.5), jnp.array(long))
    ends = jnp.array([-4.0, 8.0]), jnp.array([4.0, 8.0])
    x = -4.0 + 8.0 * np.arange(1, POINTS + 1) / POINTS
    # along the chord it would fall by 32; a Newton step of a quadratic is exact
    np.testing.assert_allclose(
        crest(density, *ends), -0.5 * (x / long) ** 2, rtol=0, atol=1e-9
    )


def test_one_mode_is_found_in_a_normal_of_many_unknowns():
    w = np.random.default_rng(1).standard_normal((1000, 10))
    density = Gaussian(jnp.eye(10))
    assert len(modes(density, w, -0.5 * np.sum(w**2, axis=1), np.eye(10))) == 1


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


@pytest.mark.parametrize("long", [1.0, -1.0])
def test_a_ridge_without_end_on_either_side_is_told(long):
    rng = np.random.default_rng(0)
    w = rng.standard_normal((1000, 2))
    w[:, 0] = np.where(w[:, 0] < 0, w[:, 0], rng.uniform(0, 100, 1000))
    value = -0.5 * w[:, 1] ** 2 - 0.5 * np.minimum(w[:, 0], 0) ** 2
    found = ridge(w * np.array([long, 1.0]), value)
    assert found is not None
    assert found.endless
