"""A vehicle that hovers in a wind: its forces balance, its heading is kept."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle import named
from jblast.vehicle.control.allocation import hover_in_wind
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.state import components, three, turned

PLACE = jnp.array([1.0, 2.0, 3.0])


@pytest.mark.parametrize("model", ["hummingbird", "iris"])
def test_thrust_and_wind_carry_the_weight(model):
    vehicle, wind = named(model), jnp.array([6.0, -3.0, 0.0])
    state = hover_in_wind(vehicle, PLACE, jnp.asarray(0.7), wind)
    motion = components(state)
    force = jnp.stack(
        turned(motion.quaternion, air_wrench(vehicle, motion, three(wind))[0])
    )
    weight = float(vehicle.mass_kg) * FLIGHT_GRAVITY
    # what eight rounds of the fixed point leave
    np.testing.assert_allclose(force, [0.0, 0.0, weight], atol=1e-3 * weight)


def test_in_calm_air_it_is_level_and_has_its_heading():
    vehicle, yaw = named("hummingbird"), jnp.asarray(0.7)
    state = hover_in_wind(vehicle, PLACE, yaw, jnp.zeros(3))
    turn = [0.0, 0.0, np.sin(0.35), np.cos(0.35)]
    np.testing.assert_allclose(state.quaternion, turn, atol=1e-12)
    square = jnp.sum(jnp.square(state.rotor_speed_rad_s))
    lift = float(vehicle.thrust_coefficient * square)
    assert lift == pytest.approx(float(vehicle.mass_kg) * FLIGHT_GRAVITY)
