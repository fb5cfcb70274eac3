import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.euler.state import area, swept_radius, volume_between


@pytest.mark.parametrize("geometry", ["planar", "spherical"])
def test_a_face_that_sweeps_a_shell_comes_to_its_outer_side(geometry):
    inner = jnp.array([0.1, 1.0, 100.0])
    thickness = jnp.array([1e-3, 0.02, 0.5])
    swept = volume_between(inner, thickness, geometry)
    # what is left of Newton's step is x^6, x at most 0.06
    np.testing.assert_allclose(
        swept_radius(inner, swept, geometry), inner + thickness, rtol=1e-9
    )
    np.testing.assert_allclose(
        swept_radius(inner + thickness, -swept, geometry), inner, rtol=1e-9
    )


def test_the_area_is_the_derivative_of_the_volume():
    radius, step = jnp.array([0.5, 3.0]), 1e-6
    for geometry in ("planar", "spherical"):
        volume = volume_between(radius, jnp.full(2, step), geometry)
        np.testing.assert_allclose(volume / step, area(radius, geometry), rtol=3e-6)


def test_the_centre_stays_where_it_is():
    assert float(swept_radius(jnp.zeros(1), jnp.zeros(1), "spherical")[0]) == 0.0
