import jax
import jax.numpy as jnp
import numpy as np
import pytest

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
from tests.vehicle.flights import GRAVITY, at_hover, hover_speed


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
