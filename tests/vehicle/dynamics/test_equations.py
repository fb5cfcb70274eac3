"""What can be said of a flight without integrating it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import (
    Commands,
    Gust,
    from_parameters,
    n_wave,
    named,
    simulate,
)
from jblast.vehicle.quadrotor import PARAMETERS
from jblast.vehicle.rollout import STROKE_M
from tests.vehicle.flights import GRAVITY, at_hover, hover_speed, tumbling

STILL = np.zeros(4)


def flown(vehicle, state, **options):
    """One program for most of the tests here."""
    return simulate(
        vehicle, state, **{"duration_s": 1.0, "store_every": 100, **options}
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


def test_a_vehicle_without_rotors_falls_freely():
    vehicle = named("crazyflie")
    answer = flown(vehicle, at_hover(vehicle, rotor_speed_rad_s=STILL))
    fallen = 5 - GRAVITY * answer.time_s**2 / 2
    np.testing.assert_allclose(answer.position_m[:, 2], fallen, atol=1e-12)
    weight = GRAVITY * float(vehicle.mass_kg)
    np.testing.assert_allclose(
        answer.force_n, np.tile([0, 0, -weight], (21, 1)), atol=1e-12
    )


@pytest.mark.parametrize("name", ["crazyflie", "hummingbird", "iris"])
def test_it_hovers_where_four_thrusts_are_the_weight(name):
    vehicle = named(name)
    answer = flown(vehicle, at_hover(vehicle))
    assert hover_speed(vehicle) < float(vehicle.rotor_speed_max_rad_s)
    np.testing.assert_allclose(answer.position_m[-1], [0, 0, 5], atol=1e-9)
    np.testing.assert_allclose(answer.quaternion[-1], [0, 0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(answer.force_n, 0, atol=1e-9)


def test_the_motors_follow_a_command_exponentially_and_no_faster_than_they_can():
    vehicle = named("iris")
    commands = np.tile([500.0, 5000.0, -100.0, 793.0], (2, 1))
    answer = flown(vehicle, at_hover(vehicle), control=Commands(commands, 0.5))
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
    turn = jax.vmap(matrix)(answer.quaternion)
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


def matrix(quaternion):
    """Body to world, by Rodrigues' formula; scalar last."""
    v, w = quaternion[:3], quaternion[3]
    cross = jnp.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return jnp.eye(3) + 2 * (w * cross + cross @ cross)


def test_a_spin_about_an_axis_is_an_angle_that_grows():
    vehicle = named("crazyflie")
    state = at_hover(
        vehicle, body_rate_rad_s=np.array([0, 0, 4.0]), rotor_speed_rad_s=STILL
    )
    answer = flown(vehicle, state)
    half = 2 * answer.time_s
    expected = jnp.stack([0 * half, 0 * half, jnp.sin(half), jnp.cos(half)], axis=1)
    # RK4's phase: (w h/2)^5/120 a step, 3e-14 of 4000 steps
    np.testing.assert_allclose(answer.quaternion, expected, atol=1e-10)


def test_a_fall_ends_at_the_speed_at_which_drag_is_the_weight():
    vehicle = named("hummingbird")
    state = at_hover(vehicle, position=(0, 0, 500.0), rotor_speed_rad_s=STILL)
    # the frame falls flat and the still rotors are not felt, but for their lift
    vehicle = dataclasses.replace(vehicle, translational_lift=jnp.zeros(()))
    answer = simulate(vehicle, state, duration_s=20.0, step_s=1e-2, store_every=2000)
    end = np.sqrt(float(vehicle.mass_kg) * GRAVITY / float(vehicle.frame_drag[2]))
    np.testing.assert_allclose(answer.velocity_m_s[-1], [0, 0, -end], atol=1e-6)


@pytest.mark.slow
def test_force_and_moment_are_the_rates_of_momentum():
    vehicle = named("iris")
    answer = flown(
        vehicle,
        tumbling(vehicle),
        wind=Gust([8.0, 2.0, 0], 0.0),
        duration_s=0.05,
        store_every=1,
    )
    middle = slice(1, -1)
    width = (answer.time_s[2:] - answer.time_s[:-2])[:, None]
    momentum = float(vehicle.mass_kg) * answer.velocity_m_s
    change = (momentum[2:] - momentum[:-2]) / width
    # central differences: h^2/6 of a third derivative, here 1e3 N/s2 of some 10 N
    np.testing.assert_allclose(answer.force_n[middle], change, atol=1e-2)
    spin = answer.body_rate_rad_s @ vehicle.inertia_kg_m2
    turned = (spin[2:] - spin[:-2]) / width + jnp.cross(answer.body_rate_rad_s, spin)[
        middle
    ]
    np.testing.assert_allclose(answer.moment_n_m[middle], turned, atol=1e-3)


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
    state = at_hover(vehicle, position=(0, 0, 1.0), rotor_speed_rad_s=STILL)
    speed = hover_speed(vehicle)
    commands = np.repeat([[0.0] * 4, [1.2 * speed] * 4], 2, axis=0)
    answer = flown(
        vehicle,
        state,
        control=Commands(commands, 0.5),
        duration_s=2.0,
        ground_up_m=0.25,
    )
    up = answer.position_m[:, 2]
    assert float(up.min()) == 0.25
    lying = (answer.time_s > 0.5) & (answer.time_s <= 1)
    np.testing.assert_array_equal(up[lying], 0.25)
    np.testing.assert_array_equal(answer.velocity_m_s[lying], 0)
    assert float(up[-1]) > 1


def test_an_n_wave_moves_a_crazyflie_by_half_a_millimetre():
    vehicle = named("crazyflie")
    speed = 1900.0  # a little above hover; at hover it is 0.49 mm
    state = at_hover(vehicle, rotor_speed_rad_s=np.full(4, speed))
    gust = Gust([30.0, 0.0, 0.0], 0.1, 0.02, n_wave)
    flown = simulate(vehicle, state, duration_s=1.5, wind=gust, store_every=20)
    moved = float(jnp.max(flown.position_m[:, 0]))
    # x'' = -k (x' - wind), k T << 1: a T^2/6
    slope = 4 * float(vehicle.rotor_drag[0]) * speed / float(vehicle.mass_kg)
    assert moved == pytest.approx(slope * 30 * 0.02**2 / 6, rel=5e-3)
    assert moved == pytest.approx(0.52e-3, rel=0.05)


@pytest.mark.parametrize("backend", ["jax", "warp:cpu"])
@pytest.mark.parametrize("step", [5e-4, 4e-3])
def test_a_landing_brakes_along_the_stroke_and_takes_no_energy_back(step, backend):
    """At 0.7 m/s, as PX4 lands: constant v^2/2s, then rest on the ground."""
    vehicle = named("iris")
    state = at_hover(
        vehicle,
        position=(0.0, 0.0, 0.3),
        velocity_m_s=np.array([0.2, 0.0, -0.7]),
        body_rate_rad_s=np.array([0.0, 0.0, 0.3]),
        rotor_speed_rad_s=np.full(4, 0.99 * hover_speed(vehicle)),
    )
    landed = flown(
        vehicle, state, step_s=step, store_every=1, ground_up_m=0.0, backend=backend
    )
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
