"""The fireball as a law: before the explosion, in an image, and the camera inside."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves import fireball_law_radius, fireball_law_radius_in_image
from jblast.waves.fireball import fireball_growth_time, fireball_radius
from jblast.waves.laws.fireball_radius import (
    NEAREST_RATIO,
    fireball_law_valid,
    fireball_law_valid_in_image,
)

MASS, GROWTH = 20.0, 3e-3


def test_after_the_explosion_it_is_the_fireball():
    time = jnp.array([1e-4, 3e-3, 0.1])
    expected = fireball_radius(MASS, time, GROWTH)
    got = fireball_law_radius(time, MASS, GROWTH)
    np.testing.assert_allclose(got, expected, rtol=1e-14)
    own = fireball_radius(MASS, time, fireball_growth_time(MASS))
    got = fireball_law_radius(time, MASS, jnp.nan)
    np.testing.assert_allclose(got, own, rtol=1e-14)


@pytest.mark.parametrize("growth", [1e-12, 3e-3, 1e3])
def test_before_it_the_logarithm_is_finite_rises_and_is_small(growth):
    time = jnp.array([-1.0, -1e-3, 0.0])
    value, slope = jax.vmap(
        jax.value_and_grad(lambda t: jnp.log(fireball_law_radius(t, MASS, growth)))
    )(time)
    assert np.isfinite(value).all()
    assert (slope > 0).all()
    # however fast it grows: else a fit would have it grow before the explosion
    assert (value[:2] < np.log(1e-3 * 1.81 * np.cbrt(MASS))).all()
    assert not fireball_law_valid(time, MASS).any()


def test_a_missing_time_spoils_no_other():
    def total(mass):
        radius = fireball_law_radius(jnp.array([1e-3, jnp.nan]), mass, GROWTH)
        return radius[0]

    assert np.isfinite(jax.grad(total)(MASS))


def test_the_outline_in_an_image_is_that_of_the_touching_cone():
    focal, distance = 1500.0, 40.0
    radius = fireball_law_radius(0.01, MASS, GROWTH)
    # points of the sphere, seen by a pinhole camera at the origin that looks along x
    angle = jnp.linspace(0, jnp.pi, 200_001)
    away, aside = distance - radius * jnp.cos(angle), radius * jnp.sin(angle)
    seen = fireball_law_radius_in_image(0.01, MASS, GROWTH, distance, focal)
    # the largest of points 1.6e-5 rad apart is the outline to the square of that
    assert seen == pytest.approx(float(jnp.max(focal * aside / away)), rel=1e-8)


def test_a_camera_inside_has_finite_numbers_and_a_mark():
    radius = float(fireball_law_radius(0.1, MASS, GROWTH))
    distance = jnp.array([0.0, 0.5, 0.99, 1.10, 1.12, 100.0]) * radius
    value, slope = jax.vmap(
        jax.value_and_grad(
            lambda d: jnp.log(fireball_law_radius_in_image(0.1, MASS, GROWTH, d, 1e3))
        )
    )(distance[1:])
    assert np.isfinite(value).all()
    assert (slope < 0).all()
    at_the_charge = jax.jit(jax.grad(fireball_law_radius_in_image, argnums=3))
    assert np.isfinite(at_the_charge(0.1, MASS, GROWTH, 0.0, 1e3))
    valid = fireball_law_valid_in_image(0.1, MASS, GROWTH, distance)
    np.testing.assert_array_equal(valid, distance > radius / NEAREST_RATIO)
