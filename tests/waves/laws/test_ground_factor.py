import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.laws.kingery_bulmash import ground_factor, kingery_bulmash_pressure


@pytest.mark.parametrize(
    ("z", "factor"),
    [
        (0.2, 1.38),
        (0.5, 1.46),
        (1.0, 1.66),
        (2.0, 1.65),
        (5.0, 1.73),
        (10.0, 1.88),
        (20.0, 2.01),
    ],
)
def test_the_factors_are_the_printed_ones(z, factor):
    # half of the last printed digit
    assert float(ground_factor(z, 1.0)) == pytest.approx(factor, abs=5e-3)


def test_free_air_charged_with_it_gives_the_pressure_on_the_ground():
    mass, ambient = 50.0, 8e4
    r = jnp.geomspace(0.2, 20.0, 500) * (mass * 101_325.0 / ambient) ** (1 / 3)
    factor = ground_factor(r, mass, ambient)
    np.testing.assert_allclose(
        kingery_bulmash_pressure(r, factor * mass, ambient, burst="free-air"),
        kingery_bulmash_pressure(r, mass, ambient),
        rtol=1e-8,  # the table leaves 2e-9
    )


def test_it_is_constant_outside_its_table():
    factor = ground_factor(np.array([0.01, 0.2, 20.0, 1e5]), 1.0)
    assert float(factor[0]) == float(factor[1])
    np.testing.assert_allclose(factor[2], factor[3], rtol=1e-14)
    slope = jax.vmap(jax.grad(lambda z: ground_factor(z, 1.0)))
    assert slope(jnp.array([0.01, 1e5])).tolist() == [0.0, 0.0]
