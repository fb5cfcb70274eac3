"""A cascade as PX4's: its loops one by one, and what it flies."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.vehicle import Cascade, Gust, named, named_gains, simulate
from jblast.vehicle.control import cascade
from jblast.vehicle.control.cascade import YAW_WEIGHT, attitude_error
from tests.vehicle.flights import at_hover, hover_speed

IRIS = named("iris")
HOME = np.array([0.0, 0.0, 10.0])
PERIOD = jnp.asarray(0.004)
LOOPS = Cascade(HOME, named_gains("iris").body_rate)


@jax.jit
def pull_of(state, memory):
    return cascade._commanded_acceleration(LOOPS, state, IRIS, memory, PERIOD)


@jax.jit
def asked(state, memory):
    return LOOPS(jnp.asarray(0.0), state, IRIS, memory, PERIOD)


def test_at_rest_in_its_place_it_asks_for_what_carries_the_weight():
    speeds, after = asked(at_hover(IRIS, tuple(HOME)), LOOPS.start())
    np.testing.assert_allclose(speeds, hover_speed(IRIS), rtol=1e-9)
    np.testing.assert_array_equal(after.pull_m_s2, 0.0)
    assert float(after.begun) == 1.0


def test_near_its_place_the_pull_is_that_of_two_loops():
    off, velocity = np.array([0.2, -0.1, 0.3]), np.array([0.1, 0.2, -0.1])
    state = at_hover(IRIS, tuple(HOME + off), velocity_m_s=velocity)
    pull, sums, _ = pull_of(state, LOOPS.start())
    missed = -np.array([0.95, 0.95, 1.0]) * off - velocity
    expected = np.array([1.8, 1.8, 4.0]) * missed + [0, 0, 9.81]
    np.testing.assert_allclose(np.stack(pull), expected, rtol=1e-9)
    np.testing.assert_allclose(
        sums, np.array([0.4, 0.4, 2.0]) * 0.004 * missed, rtol=1e-9
    )


def test_far_from_its_place_it_goes_no_faster_than_it_may_and_gathers_nothing():
    state = at_hover(IRIS, (300.0, 400.0, 10.0))
    pull, sums, _ = pull_of(state, LOOPS.start())
    east, north, up = np.stack(pull)
    assert np.hypot(east, north) == pytest.approx(up)  # 45 degrees
    assert east / north == pytest.approx(0.75)
    np.testing.assert_array_equal(sums[:2], 0.0)
    # at 12 m/s there is nothing to ask for
    going = at_hover(IRIS, (300.0, 400.0, 10.0), velocity_m_s=np.array([-7.2, -9.6, 0]))
    pull, _, _ = pull_of(going, LOOPS.start())
    np.testing.assert_allclose(np.stack(pull)[:2], 0.0, atol=1e-9)


@pytest.mark.slow  # a flight of each is compiled
@pytest.mark.parametrize("name", ["crazyflie", "hummingbird", "iris"])
def test_it_comes_back_from_a_kick_and_leans_into_a_wind(name):
    vehicle = named(name)
    flown = simulate(
        vehicle,
        at_hover(vehicle, tuple(HOME), velocity_m_s=np.array([7.0, -7.0, 10.0])),
        duration_s=25.0,
        step_s=2e-3,
        control=Cascade(HOME, named_gains(name).body_rate),
        wind=Gust([3.0, 0.0, 0.0], 0.0),
        ground_up_m=0.0,
        store_every=500,
    )
    assert not bool(flown.lost)
    np.testing.assert_allclose(flown.position_m[-1], HOME, atol=0.05)
    assert flown.quaternion[-1, 1] < -0.03  # its top points upwind


@jax.jit
def found(quaternion, pull, yaw):
    return jnp.stack(attitude_error(tuple(quaternion), tuple(pull), yaw))


def by_quaternions(attitude: Rotation, pull: np.ndarray, yaw: float) -> np.ndarray:
    """As the source writes it: shortest turn of z, then a share of what is left."""
    b_3 = pull / np.linalg.norm(pull)
    b_2 = np.cross(b_3, [np.cos(yaw), np.sin(yaw), 0.0])
    b_2 /= np.linalg.norm(b_2)
    wanted = Rotation.from_matrix(np.stack([np.cross(b_2, b_3), b_2, b_3], axis=1))
    z = attitude.apply([0.0, 0.0, 1.0])
    axis = np.cross(z, b_3)
    angle = np.arctan2(np.linalg.norm(axis), z @ b_3)
    tilt = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * attitude
    x, y, z, w = (tilt.inv() * wanted).as_quat()
    assert abs(x) + abs(y) < 1e-9  # a turn about z alone is left
    left = 2 * np.arctan2(z, w)
    left = (left + np.pi) % (2 * np.pi) - np.pi
    goal = tilt * Rotation.from_rotvec([0.0, 0.0, YAW_WEIGHT * left])
    error = (attitude.inv() * goal).as_quat()
    error *= np.sign(error[3])
    return 2 * error[:3] / [1.0, 1.0, YAW_WEIGHT]


def test_it_is_that_of_quaternions_multiplied_out():
    rng = np.random.default_rng(1)
    for _ in range(50):
        attitude = Rotation.from_quat(rng.normal(size=4))
        pull = rng.normal((0.0, 0.0, 2.0))
        yaw = rng.uniform(-np.pi, np.pi)
        got = found(jnp.asarray(attitude.as_quat()), jnp.asarray(pull), yaw)
        expected = by_quaternions(attitude, pull, yaw)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-8)


def test_upside_down_it_is_finite_with_slopes_and_turns_over():
    upside_down = jnp.array([1.0, 0.0, 0.0, 0.0])
    pull = jnp.array([0.0, 0.0, 9.81])
    got = found(upside_down, pull, jnp.asarray(0.0))
    assert np.hypot(got[0], got[1]) == pytest.approx(2.0)
    slopes = jax.jacobian(found)(upside_down, pull, jnp.asarray(0.0))
    assert np.isfinite(slopes).all()
