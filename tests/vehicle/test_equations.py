"""What can be said of a flight without integrating it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.vehicle import (
    Commands,
    Gust,
    from_parameters,
    n_wave,
    named,
    simulate,
)
from jblast.vehicle.dynamics import rates
from jblast.vehicle.quadrotor import PARAMETERS
from jblast.vehicle.rollout import STROKE_M
from jblast.vehicle.state import components, four, three
from tests.vehicle.flights import GRAVITY, at_hover, hover_speed, tumbling

STILL = np.zeros(4)


CALM = Gust([0.0, 0.0, 0.0], 0.0, 1.0, n_wave)


def flown(vehicle, state, commands=None, wind=CALM, ground_up_m=-1e6):
    """Fly for a second, each quarter by a row of commands; the same program for all."""
    if commands is None:
        commands = np.tile(state.rotor_speed_rad_s, (4, 1))
    return simulate(
        vehicle,
        state,
        duration_s=1.0,
        store_every=100,
        control=Commands(commands, 0.25),
        wind=wind,
        ground_up_m=ground_up_m,
    )


def without_air(vehicle):
    return dataclasses.replace(
        vehicle,
        rotor_drag=jnp.zeros(3),
        frame_drag=jnp.zeros(3),
        translational_lift=jnp.zeros(()),
    )


def asymmetric():
    """A Hummingbird with three different principal moments and products, no air."""
    skew = {"Ixx": 0.003, "Iyy": 0.005, "Izz": 0.007, "Ixy": 4e-4, "Iyz": -3e-4}
    return without_air(from_parameters({**PARAMETERS["hummingbird"], **skew}))


def test_without_rotors_it_falls_freely_and_a_spin_about_an_axis_grows_evenly():
    vehicle = named("crazyflie")
    spin = np.array([0, 0, 4.0])
    start = at_hover(vehicle, body_rate_rad_s=spin, rotor_speed_rad_s=STILL)
    answer = flown(vehicle, start)
    fallen = 5 - GRAVITY * answer.time_s**2 / 2
    np.testing.assert_allclose(answer.position_m[:, 2], fallen, atol=1e-12)
    weight = GRAVITY * float(vehicle.mass_kg)
    np.testing.assert_allclose(
        answer.force_n, np.tile([0, 0, -weight], (21, 1)), atol=1e-12
    )
    half = 2 * answer.time_s
    expected = jnp.stack([0 * half, 0 * half, jnp.sin(half), jnp.cos(half)], axis=1)
    # RK4's phase: (w h/2)^5/120 a step, 3e-14 of 4000 steps
    np.testing.assert_allclose(answer.quaternion, expected, atol=1e-10)


def rates_by_numpy(vehicle, state, command, wind, push, twist):
    """The equations of a quadrotor once more."""
    at = {k: np.asarray(v) for k, v in vars(vehicle).items() if hasattr(v, "shape")}
    v, w, speed = (
        np.asarray(x)
        for x in (state.velocity_m_s, state.body_rate_rad_s, state.rotor_speed_rad_s)
    )
    turn = Rotation.from_quat(state.quaternion).as_matrix()
    u = turn.T @ (v - wind)
    force, moment = -np.linalg.norm(u) * at["frame_drag"] * u, twist
    for n in range(4):
        arm = at["rotor_position_m"][n]
        u_n = u + np.cross(w, arm)
        thrust = at["thrust_coefficient"] * speed[n] ** 2
        thrust += at["translational_lift"] * (u_n[0] ** 2 + u_n[1] ** 2)
        pull = np.array([0, 0, thrust]) - speed[n] * at["rotor_drag"] * u_n
        force = force + pull
        torque = at["rotor_direction"][n] * at["moment_coefficient"] * speed[n] ** 2
        moment = moment + np.cross(arm, pull) + [0, 0, torque]
    x, y, z, s = np.asarray(state.quaternion)
    matrix = np.array([[s, -z, y], [z, s, -x], [-y, x, s], [-x, -y, -z]])
    moment = moment - np.cross(w, at["inertia_kg_m2"] @ w)
    asked = np.clip(command, at["rotor_speed_min_rad_s"], at["rotor_speed_max_rad_s"])
    return (
        v,
        (turn @ force + push) / at["mass_kg"] - [0, 0, GRAVITY],
        matrix @ w / 2,
        np.linalg.solve(at["inertia_kg_m2"], moment),
        (asked - speed) / at["motor_lag_s"],
    )


@pytest.mark.parametrize("vehicle", [named("crazyflie"), named("iris"), asymmetric()])
def test_rates_are_those_of_the_equations_in_numpy(vehicle):
    state, hover = tumbling(vehicle), hover_speed(vehicle)
    command = hover * np.array([0.7, 1.1, 9.0, -1.0])
    wind, push, twist = np.array([[8.0, 2, -3], [0.1, -0.2, 0.3], [1e-3, 2e-3, -3e-3]])
    found = rates(
        vehicle,
        components(state),
        four(jnp.asarray(command)),
        three(jnp.asarray(wind)),
        (three(jnp.asarray(push)), three(jnp.asarray(twist))),
    )
    expected = rates_by_numpy(vehicle, state, command, wind, push, twist)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(np.array(ours), theirs, rtol=1e-12, atol=1e-12)


def test_the_motors_follow_a_command_exponentially_and_no_faster_than_they_can():
    vehicle = named("iris")
    commands = np.tile([500.0, 5000.0, -100.0, 793.0], (4, 1))
    answer = flown(vehicle, at_hover(vehicle), commands)
    asked = np.clip(commands[0], 0, float(vehicle.rotor_speed_max_rad_s))
    left = np.exp(-answer.time_s / float(vehicle.motor_lag_s))[:, None]
    start = hover_speed(vehicle)
    # RK4 errs by (h/tau)^5/120 a step, here up to 1e-7 of what is left after 80
    np.testing.assert_allclose(
        answer.rotor_speed_rad_s, asked + (start - asked) * left, rtol=1e-8, atol=2e-5
    )


def test_a_free_tumble_keeps_energy_and_angular_momentum():
    vehicle = asymmetric()
    rate = np.array([6.0, 5.0, -6.0])  # 9.8 rad/s
    state = at_hover(
        vehicle, body_rate_rad_s=rate, velocity_m_s=np.ones(3), rotor_speed_rad_s=STILL
    )
    answer = flown(vehicle, state)
    turn = Rotation.from_quat(answer.quaternion).as_matrix()
    body = answer.body_rate_rad_s @ vehicle.inertia_kg_m2
    momentum = jnp.einsum("tij,tj->ti", turn, body)
    energy = jnp.sum(body * answer.body_rate_rad_s, axis=1) / 2
    size = float(jnp.linalg.norm(momentum[0]))
    assert float(jnp.abs(energy[-1] / energy[0] - 1)) < 1e-9
    assert abs(float(jnp.linalg.norm(momentum[-1])) / size - 1) < 1e-9
    # its direction turns with the attitude's own error, of fourth order
    np.testing.assert_allclose(momentum, momentum[:1].repeat(21, 0), atol=1e-8 * size)
    assert not np.allclose(answer.body_rate_rad_s[-1], rate, atol=1)
    np.testing.assert_allclose(
        jnp.linalg.norm(answer.quaternion, axis=1), 1, atol=1e-15
    )


@pytest.mark.slow
def test_the_order_of_convergence_on_a_smooth_wind():
    vehicle, order = named("hummingbird"), 4

    def wind(time_s, position_m):
        blow = jnp.sin(40 * time_s + position_m[0])
        return jnp.stack([10 * blow, 5 * blow**2, 2 * blow])

    def end(step):
        answer = simulate(
            vehicle,
            tumbling(vehicle),
            duration_s=0.2,
            step_s=step,
            wind=wind,
            store_every=10**6,
        )
        return np.concatenate([answer.position_m[-1], answer.quaternion[-1]])

    # well inside the motors' lag of 5 ms, above rounding
    steps = (1e-3, 5e-4, 2.5e-4)
    coarse, middle, fine = (end(step) for step in steps)
    truth = fine + (fine - middle) / (2**order - 1)
    errors = [np.linalg.norm(x - truth) for x in (coarse, middle)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)
    # lasting differences between successive halvings fall as steeply
    ratio = np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine)
    assert np.log2(ratio) == pytest.approx(order, abs=0.35)


def test_the_ground_holds_what_falls_and_lets_go_what_lifts():
    vehicle = named("crazyflie")
    state = at_hover(vehicle, position=(0, 0, 0.8), rotor_speed_rad_s=STILL)
    speed = hover_speed(vehicle)
    commands = np.repeat([[0.0] * 4, [1.2 * speed] * 4], 2, axis=0)
    answer = flown(vehicle, state, commands, ground_up_m=0.25)
    up = answer.position_m[:, 2]
    assert float(up.min()) == 0.25
    lying = (answer.time_s > 0.36) & (answer.time_s <= 0.5)  # it falls for 0.34 s
    assert lying.any()
    np.testing.assert_array_equal(up[lying], 0.25)
    np.testing.assert_array_equal(answer.velocity_m_s[lying], 0)
    assert float(up[-1]) > 0.4


def test_an_n_wave_moves_a_crazyflie_by_half_a_millimetre():
    vehicle = named("crazyflie")
    speed = 1900.0  # a little above hover; at hover it is 0.49 mm
    state = at_hover(vehicle, rotor_speed_rad_s=np.full(4, speed))
    gust = Gust([30.0, 0.0, 0.0], 0.08, 0.02, n_wave)  # a row is at its end
    moved = float(jnp.max(flown(vehicle, state, wind=gust).position_m[:, 0]))
    # x'' = -k (x' - wind), k T << 1: a T^2/6
    slope = 4 * float(vehicle.rotor_drag[0]) * speed / float(vehicle.mass_kg)
    assert moved == pytest.approx(slope * 30 * 0.02**2 / 6, rel=5e-3)
    assert moved == pytest.approx(0.52e-3, rel=0.05)


@pytest.mark.parametrize("step", [4e-3])
def test_a_landing_brakes_along_the_stroke_and_takes_no_energy_back(step):
    """At 0.7 m/s, as PX4 lands: constant v^2/2s, then rest on the ground."""
    vehicle = named("iris")
    state = at_hover(
        vehicle,
        position=(0.0, 0.0, 75 * step),
        velocity_m_s=np.array([0.2, 0.0, -0.7]),
        body_rate_rad_s=np.array([0.0, 0.0, 0.3]),
        rotor_speed_rad_s=np.full(4, 0.99 * hover_speed(vehicle)),
    )
    lasts = 250 * step  # as many steps of either length: one program
    landed = simulate(vehicle, state, duration_s=lasts, step_s=step, ground_up_m=0.0)
    velocity, up = (
        np.asarray(x) for x in (landed.velocity_m_s, landed.position_m[:, 2])
    )
    slows = np.diff(velocity[:, 2]) / step
    fast = -velocity[up > STROKE_M, 2][-1]
    # braking begins in the step that would enter the stroke
    assert slows.max() <= fast**2 / (2 * STROKE_M) * (1 + 1e-9)
    assert slows.max() > fast**2 / (2 * (STROKE_M + fast * step)) * (1 - 1e-9)
    energy = np.square(velocity).sum(axis=1) / 2 + GRAVITY * up
    assert np.diff(energy).max() < 1e-9
    np.testing.assert_array_equal(up[-5:], 0.0)
    np.testing.assert_array_equal(velocity[-5:], 0.0)
    np.testing.assert_array_equal(landed.body_rate_rad_s[-5:], 0.0)
