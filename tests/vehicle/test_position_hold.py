"""The position controller: its law, its flights, its limits, and the allocation."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle import (
    Gust,
    PositionHold,
    allocation,
    named,
    named_gains,
    rotor_speeds,
    simulate,
    step_limit,
)
from jblast.vehicle.control.allocation import hover_in_wind, speeds_within
from jblast.vehicle.control.position_hold import pull_within
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.state import components, three, turned
from tests.vehicle.flights import GRAVITY, at_hover, hover_speed, stacked


@pytest.mark.parametrize("name", ["crazyflie", "hummingbird", "iris"])
def test_rotor_speeds_make_the_thrust_and_the_moment_asked_for(name):
    vehicle = named(name)
    wanted = jnp.array([float(vehicle.mass_kg) * GRAVITY, 1e-3, -2e-3, 1e-4])
    speeds = rotor_speeds(vehicle, tuple(wanted))
    thrusts = vehicle.thrust_coefficient * jnp.abs(speeds) * speeds
    np.testing.assert_allclose(allocation(vehicle) @ thrusts, wanted, atol=1e-12)
    arms = np.asarray(vehicle.rotor_position_m)
    by_hand = np.cross(arms, np.outer(thrusts, [0, 0, 1])).sum(axis=0)
    np.testing.assert_allclose(wanted[1:3], by_hand[:2], atol=1e-12)


@pytest.mark.slow
def test_the_hold_comes_to_its_target_and_heading():
    vehicle, gains = named("crazyflie"), named_gains("crazyflie")
    hold = PositionHold(np.array([1.0, -1.0, 6.0]), gains, 0.7)
    answer = simulate(
        vehicle,
        at_hover(vehicle),
        duration_s=8.0,
        step_s=2e-3,
        control=hold,
        store_every=4000,
    )
    np.testing.assert_allclose(answer.position_m[-1], [1, -1, 6], atol=2e-3)
    level = [0, 0, np.sin(0.35), np.cos(0.35)]
    np.testing.assert_allclose(answer.quaternion[-1], level, atol=1e-3)


@pytest.mark.slow
def test_a_wind_leaves_an_offset_that_only_the_integral_takes_out():
    vehicle = named("hummingbird")

    def end(integral):
        gains = named_gains("hummingbird", integral=integral)
        answer = simulate(
            vehicle,
            at_hover(vehicle),
            duration_s=30.0,
            step_s=5e-3,
            control=PositionHold(np.array([0, 0, 5.0]), gains),
            wind=Gust([5.0, 0.0, 0.0], 0.0),
            store_every=6000,
        )
        return float(answer.position_m[-1, 0])

    # The spring k_p m x holds what the air drags with: rotors and frame, about level.
    speed = 4 * hover_speed(vehicle)
    drag = speed * float(vehicle.rotor_drag[0]) * 5 + 0.005 * 25
    assert end(False) == pytest.approx(drag / (0.5 * 6.5), rel=0.05)
    assert abs(end(True)) < 2e-3


def test_the_motors_limit_is_where_a_step_stops_shrinking():
    factor = step_limit(1.0)
    z = -factor
    assert 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24 == pytest.approx(1, abs=1e-9)
    assert factor == pytest.approx(2.785, abs=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("held", [1, 3])
def test_the_hold_is_stable_just_below_its_limit_and_not_above(held):
    vehicle = named("crazyflie")
    gains = named_gains("crazyflie", integral=True)
    limit = step_limit(float(vehicle.motor_lag_s), gains, held)
    assert limit < step_limit(float(vehicle.motor_lag_s))
    hold = PositionHold(np.array([0, 0, 5.0]), gains)
    spins = {}
    for share in (0.93, 1.07):
        step = share * limit
        # inside jit the step is not looked at: the gains are not known
        answer = jax.jit(
            lambda hold, step=step: simulate(
                vehicle,
                at_hover(vehicle, body_rate_rad_s=np.array([1e-6, 2e-6, 1e-6])),
                duration_s=6000 * step,
                step_s=step,
                control_period_s=held * step,
                control=hold,
                store_every=100,
            )
        )(hold)
        spin = np.linalg.norm(answer.body_rate_rad_s, axis=1)
        spins[share] = [spin[15:30].max(), spin[45:].max()]
    assert spins[0.93][1] < spins[0.93][0]
    # 7 % above, a turn lengthens the slowest part by a part in a thousand or so
    assert spins[1.07][1] > 1.3 * spins[1.07][0]


HOME = np.array([0.0, 0.0, 10.0])
KICKS = {
    "iris up, turning": ("iris", (0, 0, 5), (1, 2, 0)),
    "iris aside and up": ("iris", (7, -7, 10), (0, 0, 0)),
    "iris rolls and turns": ("iris", (0, 0, 0), (10, 0, 10)),
    "iris pitches and turns round": ("iris", (0, 0, 5), (0, 7, 7)),
    "crazyflie aside and up": ("crazyflie", (7, 7, 10), (0, 0, 0)),
    "hummingbird rolls and turns": ("hummingbird", (0, 0, 0), (10, 0, 10)),
}
"""Vehicle, velocity [m/s] and body rate [rad/s] of each thrown from `HOME`."""


@pytest.fixture
def flown():
    """Fly them all side by side, with integral action."""
    vehicles, starts, holds = [], [], []
    for name, velocity, rate in KICKS.values():
        vehicle = dataclasses.replace(named(name), name="", body=None)
        moving = {
            "velocity_m_s": np.array(velocity, float),
            "body_rate_rad_s": np.array(rate, float),
        }
        vehicles.append(vehicle)
        starts.append(at_hover(vehicle, tuple(HOME), **moving))
        holds.append(PositionHold(HOME, named_gains(name, integral=True)))
    return simulate(
        stacked(vehicles),
        stacked(starts),
        duration_s=16.0,
        step_s=4e-3,
        control=stacked(holds),
        ground_up_m=0.0,
        store_every=5,
    )


@pytest.mark.slow  # 16 s of six vehicles
def test_who_is_thrown_or_spun_stays_upright_and_comes_back(flown):
    i, j, _, _ = np.moveaxis(np.asarray(flown.quaternion), -1, 0)
    over = (2 * (i**2 + j**2) > 1).any(axis=1)
    down = (np.asarray(flown.position_m)[..., 2] <= 0).any(axis=1)
    assert not [name for name, bad in zip(KICKS, over | down, strict=True) if bad]
    error = np.linalg.norm(np.asarray(flown.position_m) - HOME, axis=-1)
    # the integral's slowest pole is at -0.29/s: 10 s leave 5 % of what it has gathered
    away = error[:, flown.time_s > 15.0].max(axis=1)
    assert not {name: far for name, far in zip(KICKS, away, strict=True) if far > 0.05}


IRIS = named("iris")
GAINS = named_gains("iris", integral=True)
PERIOD = 0.01


@jax.jit
def asked(away, velocity, memory):
    return pull_within(
        IRIS, GAINS, three(away), three(velocity), memory, jnp.asarray(PERIOD)
    )


def pull_of(away=(0, 0, 0), velocity=(0, 0, 0), memory=(0, 0, 0)) -> np.ndarray:
    """Return the pull, and the integral afterwards."""
    parts = (jnp.array(x, float) for x in (away, velocity, memory))
    return np.array(asked(*parts))


def by_lee(state, memory) -> np.ndarray:
    """Rotor speeds by the equations of Lee and others, without any limit."""
    away = np.asarray(state.position_m)
    total = np.asarray(memory) - np.asarray(GAINS.integral) * PERIOD * away
    pull = total - np.asarray(GAINS.position) * away
    pull += -np.asarray(GAINS.velocity) * np.asarray(state.velocity_m_s)
    pull += [0, 0, 9.81]
    attitude = Rotation.from_quat(state.quaternion).as_matrix()
    b_3 = pull / np.linalg.norm(pull)
    b_2 = np.cross(b_3, [1.0, 0.0, 0.0])
    b_2 /= np.linalg.norm(b_2)
    wanted = np.stack([np.cross(b_2, b_3), b_2, b_3], axis=1)
    skew = (wanted.T @ attitude - attitude.T @ wanted) / 2
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    w, inertia = np.asarray(state.body_rate_rad_s), np.asarray(IRIS.inertia_kg_m2)
    moment = inertia @ (-float(GAINS.attitude) * error - float(GAINS.body_rate) * w)
    moment += np.cross(w, inertia @ w)
    thrust = float(IRIS.mass_kg) * pull @ attitude[:, 2]
    return np.asarray(rotor_speeds(IRIS, tuple(jnp.array([thrust, *moment]))))


def test_near_hover_the_hold_is_the_law_as_printed():
    state = at_hover(
        IRIS,
        (0.05, -0.03, 0.04),
        velocity_m_s=np.array([0.1, 0.05, -0.1]),
        quaternion=np.array([0.01, -0.02, 0.01, 1.0]),
        body_rate_rad_s=np.array([0.02, 0.05, -0.03]),
    )
    memory = jnp.array([0.1, -0.2, 0.3])
    hold = PositionHold(np.zeros(3), GAINS)
    speeds, _ = hold(jnp.zeros(()), state, IRIS, memory, jnp.asarray(PERIOD))
    np.testing.assert_allclose(speeds, by_lee(state, memory), rtol=1e-10)


def test_the_pull_never_points_down_however_fast_it_climbs():
    for climb in (0.5, 1.0, 5.0, 10.0):
        up = pull_of(velocity=(0, 0, climb))[0, 2]
        assert up == pytest.approx(max(9.81 - 9 * climb, 0.24 * 9.81))


@pytest.mark.parametrize("speed", [1.0, 3.0, 10.0])
def test_the_tilt_is_at_most_45_degrees_and_keeps_its_direction(speed):
    east, north, up = pull_of(velocity=(0.6 * speed, -0.8 * speed, 0))[0]
    assert np.hypot(east, north) == pytest.approx(min(4 * speed, 9.81))
    assert up == pytest.approx(9.81)
    assert north == pytest.approx(-0.8 / 0.6 * east)


def test_an_axis_that_is_cut_gathers_no_more_of_the_same():
    near = pull_of(away=(0.1, 0, 0.1))[1]
    np.testing.assert_allclose(near, [-0.0016, 0, -0.00375])
    far = pull_of(away=(20, 0, 20), memory=(1.0, 0.0, 1.0))[1]
    np.testing.assert_array_equal(far, [1.0, 0.0, 1.0])
    # cut eastwards by its speed, it still gathers towards the west
    braking = pull_of(away=(0.5, 0, 0), velocity=(-10, 0, 0))[1]
    assert braking[0] == pytest.approx(-1.6 * PERIOD * 0.5)


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
