import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.euler import History, front_pressure_at

RADII = jnp.array([0.5, 0.52, 0.55, 0.57, 0.6, 0.65, 0.65])


def history(pressure):
    none = jnp.zeros((7, 0))
    still = jnp.zeros(7)
    alive = jnp.ones(7, bool)
    return History(RADII, still, jnp.asarray(pressure), still, still, none, none, alive)


@pytest.mark.parametrize("radius", [0.52, 0.53, 0.56, 0.57])
def test_a_cubic_in_the_logarithms_is_read_exactly(radius):
    def pressure(r):
        x = np.log(r)
        return np.exp(2.0 - 3.0 * x + 0.5 * x**2 - 4.0 * x**3)

    read = front_pressure_at(history(pressure(RADII)), jnp.asarray(radius))
    assert float(read) == pytest.approx(float(pressure(radius)), rel=1e-12)


@pytest.mark.parametrize("radius", [0.4, 0.51, 0.64, 0.7])
def test_where_records_do_not_lie_on_both_sides_it_is_nan(radius):
    read = front_pressure_at(history(RADII**-3), jnp.asarray(radius))
    assert np.isnan(float(read))
