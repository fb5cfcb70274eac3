import math

import jax.numpy as jnp
import pytest
from hypothesis import given, settings, strategies as st

from jblast.constants import DRY_AIR_GAS_CONSTANT, STANDARD_PRESSURE
from jblast.waves.scaling import (
    LOG_NUCLEAR_SCALED_METRES,
    NUCLEAR_SCALED_METRES,
    log_scaled_distance,
    sachs_distance_factor,
    sachs_impulse_factor,
    sachs_time_factor,
    scaled_distance,
)

positive = st.floats(1e-3, 1e9)
pressure = st.floats(1e3, 2e5)


def test_eight_kilograms_halve_the_distance():
    # Hopkinson and Cranz: the cube root of 8 is 2; rounding only.
    assert scaled_distance(10.0, 8.0) == pytest.approx(5.0, rel=1e-15)


def test_an_eighth_of_the_pressure_doubles_the_distance_factor():
    assert sachs_distance_factor(1.0, STANDARD_PRESSURE / 8) == pytest.approx(
        2.0, rel=1e-15
    )


@settings(deadline=None)  # the first call compiles
@given(mass=positive, ambient=pressure, temperature=st.floats(200.0, 330.0))
def test_the_factors_have_the_exponents_of_the_temperature_form(
    mass, ambient, temperature
):
    # formulas.md 8: S_t = S_d (288.15/T)^1/2, S_i = W^1/3 S_p^2/3 (288.15/T)^1/2.
    # The tabulated 340.29 m/s has five digits, sqrt(1.4 287.05 288.15) = 340.292.
    sound_speed = (1.4 * DRY_AIR_GAS_CONSTANT * temperature) ** 0.5
    relative = ambient / STANDARD_PRESSURE
    warmth = (288.15 / temperature) ** 0.5
    assert sachs_time_factor(mass, ambient, sound_speed) == pytest.approx(
        (mass / relative) ** (1 / 3) * warmth, rel=1e-5
    )
    assert sachs_impulse_factor(mass, ambient, sound_speed) == pytest.approx(
        mass ** (1 / 3) * relative ** (2 / 3) * warmth, rel=1e-5
    )


@settings(deadline=None)  # the first call compiles
@given(distance=positive, mass=positive, ambient=pressure)
def test_the_logarithm_is_that_of_the_scaled_distance(distance, mass, ambient):
    # Absolute error of a logarithm up to 30: a few times 30 * 1.1e-16.
    assert log_scaled_distance(distance, mass, ambient) == pytest.approx(
        float(jnp.log(scaled_distance(distance, mass, ambient))), abs=2e-14
    )


def test_half_a_kiloton_of_tnt_at_its_scaled_metre_is_one_nuclear_kiloton_at_79_37():
    mass = 0.5e6
    assert 1.0 * mass ** (1 / 3) == pytest.approx(NUCLEAR_SCALED_METRES, rel=1e-14)
    assert pytest.approx(79.37, abs=0.005) == NUCLEAR_SCALED_METRES
    assert math.exp(LOG_NUCLEAR_SCALED_METRES) == pytest.approx(NUCLEAR_SCALED_METRES)
