"""Which axis gives way where the rotors cannot make what is asked for."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle import allocation, named, rotor_speeds
from jblast.vehicle.control.allocation import hover_in_wind, speeds_within
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.state import components, three, turned

IRIS = named("iris")
MATRIX = np.asarray(allocation(IRIS))
COEFFICIENT = float(IRIS.thrust_coefficient)
MOST = COEFFICIENT * float(IRIS.rotor_speed_max_rad_s) ** 2
WEIGHT = float(IRIS.mass_kg) * 9.81

speeds = jax.jit(lambda wanted: speeds_within(IRIS, tuple(wanted)))


def made(wanted) -> np.ndarray:
    """Return thrust and moments that the rotors make."""
    return MATRIX @ (COEFFICIENT * np.square(np.asarray(speeds(jnp.asarray(wanted)))))


def test_what_the_rotors_can_make_is_made():
    wanted = jnp.array([WEIGHT, 0.3, -0.2, 0.02])
    expected = rotor_speeds(IRIS, tuple(wanted))
    np.testing.assert_allclose(speeds(wanted), expected, rtol=1e-12)


def largest_tilt(roll: float, pitch: float) -> float:
    """Return the greatest share of a moment that any thrust lets the rotors make."""
    inverse = np.linalg.inv(MATRIX)
    by_tilt = inverse[:, 1] * roll + inverse[:, 2] * pitch
    sides = np.stack([by_tilt, inverse[:, 0]], axis=1)
    found = linprog(
        [-1.0, 0.0],
        A_ub=np.vstack([sides, -sides]),
        b_ub=np.concatenate([np.full(4, MOST), np.zeros(4)]),
        bounds=[(0.0, 1.0), (None, None)],
    )
    return -found.fun


@pytest.mark.parametrize("thrust", [-20.0, 0.0, 14.0, 60.0])
@pytest.mark.parametrize("turn", [(3.0, 0.0), (0.4, -0.3), (-5.0, 4.0)])
def test_roll_and_pitch_are_made_as_far_as_any_thrust_allows(thrust, turn):
    found = made([thrust, *turn, 0.5])
    expected = largest_tilt(*turn) * np.array(turn)
    np.testing.assert_allclose(found[1:3], expected, rtol=1e-7, atol=1e-9)


def test_yaw_gives_way_to_thrust_and_thrust_to_roll():
    most_yaw = MATRIX[3] @ (MOST * (MATRIX[3] > 0))
    full = made([4 * MOST, 0.0, 0.0, most_yaw])
    np.testing.assert_allclose(full, [4 * MOST, 0.0, 0.0, 0.0], atol=1e-9)
    # a roll needs two rotors faster than the others, which cannot pull downwards
    rolls = made([0.0, 1.0, 0.0, 0.0])
    np.testing.assert_allclose(rolls[1], 1.0)
    assert rolls[0] > 1.0 / 0.22  # of the longest arm


def test_slopes_are_finite_where_rotors_stand_or_are_at_their_greatest():
    jacobian = jax.jit(jax.jacrev(speeds))
    for wanted in ([-5.0, 0.0, 0.0, 0.0], [0.0, 9.0, 0.0, 1.0], [99.0, 0.0, 0.0, 1.0]):
        slopes = np.asarray(jacobian(jnp.array(wanted)))
        assert np.isfinite(slopes).all()
        assert np.abs(slopes).max() < 1e6


PLACE = jnp.array([1.0, 2.0, 3.0])


def test_thrust_and_wind_carry_the_weight():
    vehicle, wind = IRIS, jnp.array([6.0, -3.0, 0.0])
    state = hover_in_wind(vehicle, PLACE, jnp.asarray(0.7), wind)
    motion = components(state)
    force = jnp.stack(
        turned(motion.quaternion, air_wrench(vehicle, motion, three(wind))[0])
    )
    weight = float(vehicle.mass_kg) * FLIGHT_GRAVITY
    # what eight rounds of the fixed point leave
    np.testing.assert_allclose(force, [0.0, 0.0, weight], atol=1e-3 * weight)


def test_in_calm_air_it_is_level_and_has_its_heading():
    vehicle, yaw = IRIS, jnp.asarray(0.7)
    state = hover_in_wind(vehicle, PLACE, yaw, jnp.zeros(3))
    turn = [0.0, 0.0, np.sin(0.35), np.cos(0.35)]
    np.testing.assert_allclose(state.quaternion, turn, atol=1e-12)
    square = jnp.sum(jnp.square(state.rotor_speed_rad_s))
    lift = float(vehicle.thrust_coefficient * square)
    assert lift == pytest.approx(float(vehicle.mass_kg) * FLIGHT_GRAVITY)
