import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.euler import IdealGas, Primitives, star_state
from jblast.waves.euler.step import face_flux

GAS = IdealGas()


def side(density, velocity, pressure):
    return Primitives(*(jnp.array([float(q)]) for q in (density, velocity, pressure)))


def test_between_equal_states_the_flux_is_that_of_the_state():
    state, overtaking = side(1.3, 0.4, 2.0), jnp.array([0.5])
    flux = face_flux(state, state, overtaking, jnp.ones(1), GAS, GAS)
    energy = 2.0 / (0.4 * 1.3) + 0.5 * 0.4**2
    np.testing.assert_allclose(flux.volume, 0.4 + 0.5 / 1.3, rtol=1e-14)
    np.testing.assert_allclose(flux.momentum, 0.5 * 0.4 - 2.0, rtol=1e-14)
    np.testing.assert_allclose(flux.energy, 0.5 * energy - 2.0 * 0.4, rtol=1e-14)


def test_a_face_faster_than_every_wave_takes_the_gas_as_it_is():
    left, right = side(1.0, 0.3, 5.0), side(0.7, -0.2, 1.0)
    m = jnp.array([50.0])
    flux = face_flux(left, right, m, jnp.ones(1), GAS, GAS)
    energy = 1.0 / (0.4 * 0.7) + 0.5 * 0.2**2
    np.testing.assert_allclose(flux.volume, -0.2 + 50.0 / 0.7, rtol=1e-14)
    np.testing.assert_allclose(flux.momentum, 50.0 * -0.2 - 1.0, rtol=1e-14)
    np.testing.assert_allclose(flux.energy, 50.0 * energy + 0.2, rtol=1e-14)


def test_a_contact_that_stands_in_the_gas_lets_nothing_through():
    left, right = side(1.0, 0.2, 3.0), side(0.01, 0.2, 3.0)
    flux = face_flux(left, right, jnp.zeros(1), jnp.ones(1), GAS, GAS)
    np.testing.assert_allclose(flux.volume, 0.2, rtol=1e-14)
    np.testing.assert_allclose(flux.momentum, -3.0, rtol=1e-14)
    np.testing.assert_allclose(flux.energy, -3.0 * 0.2, rtol=1e-14)


def test_weak_waves_meet_at_the_exact_star_state():
    left, right = side(1.0, 0.01, 1.01), side(1.0, 0.0, 1.0)
    flux = face_flux(left, right, jnp.zeros(1), jnp.ones(1), GAS, GAS)
    first, second = (Primitives(*(q[0] for q in s)) for s in (left, right))
    p, u = star_state(first, second, GAS)
    # of second order in the jumps of 1 %
    assert float(flux.volume[0]) == pytest.approx(float(u), abs=1e-4)
    assert float(-flux.momentum[0]) == pytest.approx(float(p), abs=1e-4)
