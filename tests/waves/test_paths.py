import jax
import jax.numpy as jnp
import numpy as np

from jblast.waves.laws.fireball_radius import fireball_law_radius_in_image
from jblast.waves.laws.line_of_sight import elevation
from jblast.waves.paths import slant_range


def test_slant_range_is_the_length_of_the_difference():
    assert slant_range(jnp.array([1.0, 2.0, 3.0]), jnp.array([3.0, 5.0, 9.0])) == 7.0


def test_gradient_is_the_unit_vector():
    gradient = jax.grad(slant_range, argnums=1)(
        jnp.zeros(3), jnp.array([2.0, 3.0, 6.0])
    )
    np.testing.assert_allclose(gradient, np.array([2.0, 3.0, 6.0]) / 7.0, rtol=1e-15)


def test_gradient_at_distance_zero_is_zero():
    place = jnp.array([4.0, 5.0, 6.0])
    assert slant_range(place, place) == 0.0
    for gradient in jax.grad(slant_range, argnums=(0, 1))(place, place):
        assert gradient.tolist() == [0.0, 0.0, 0.0]


def test_what_is_no_number_has_no_distance_direction_or_size_in_an_image():
    nowhere = jnp.array([jnp.nan, 0.0, 0.0])
    assert jnp.isnan(slant_range(nowhere, jnp.array([1.0, 2.0, 3.0])))
    assert jnp.isnan(jax.jit(elevation)(jnp.nan, 1.0, 2.0))
    seen_from = jax.jit(fireball_law_radius_in_image)
    assert jnp.isnan(seen_from(0.1, 10.0, jnp.nan, jnp.nan, 300.0))
    assert seen_from(0.1, 10.0, jnp.nan, 50.0, 300.0) > 0.0
