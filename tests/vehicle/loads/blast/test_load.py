"""Loads of blasts on vehicles: impulse whatever the step, where and when it comes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import blast_load, named, simulate
from jblast.vehicle.loads.blast_wave import density_ratio, overpressure, wind_speed
from tests.vehicle.loads.blast.hovering import (
    CRAZYFLIE,
    gained,
    held,
    hovering,
    plain,
    scene,
)

STEPS = [2e-3, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.5e-3, 10e-3))]
"""Of a flight [s]; each is a program of its own."""


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize(("mass", "distance"), [(1.0, 5.0), (1.0, 10.0), (15.0, 30.0)])
def test_a_flight_gains_the_same_velocity_at_any_step(mass, distance, step):
    """0.1 %, though the positive phase lasts 4, 5 and 13 ms."""
    expected, found = (gained(mass, distance, s) for s in (5e-5, step))
    assert np.linalg.norm(found - expected) / np.linalg.norm(expected) < 1e-3


def test_drag_of_a_body_that_stays_is_the_integral_of_its_wind():
    load = blast_load(scene(), front=False, rotors=False)
    heavy = plain(eqx.tree_at(lambda v: v.mass_kg, CRAZYFLIE, jnp.asarray(1e6)))
    thrust = 1e6 * 9.81 / 4 / CRAZYFLIE.thrust_coefficient
    state = eqx.tree_at(
        lambda s: s.rotor_speed_rad_s,
        hovering(CRAZYFLIE, (0.0, 5.0, 0.0)),
        jnp.full(4, jnp.sqrt(thrust)),
    )
    wave, body = load.wave_of(load.blasts[0], state.position_m), heavy.body
    since = jnp.linspace(0, 0.02, 200001)
    wind = wind_speed(wave, since)
    density = 1.4 * load.pressure_pa / load.sound_speed_m_s**2
    density = density * density_ratio(overpressure(wave, since))
    force = 0.5 * density * body.drag_coefficient * body.area_m2[1] * wind * abs(wind)
    given = held(state, heavy, load, np.array([0.0, 0.1])).sum(axis=0)
    # eight nodes a phase, in one of which the wind turns
    np.testing.assert_allclose(given[1], jnp.trapezoid(force, since), rtol=1e-3)
    assert abs(given[0]) + abs(given[2]) < 1e-12


def test_the_wave_pushes_away_from_the_charge_and_turns_about_the_pressure_centre():
    vehicle = named("iris")
    load = blast_load(scene(position_m=(1.0, 2.0, 0.5), burst="surface"), rotors=False)
    state = hovering(vehicle, (4.0, 6.0, 0.5))
    push, turn = load.impulse(jnp.asarray(0.0), jnp.asarray(0.012), state, vehicle)
    np.testing.assert_allclose(push[1] / push[0], 4 / 3, rtol=1e-3)
    assert vehicle.body is not None
    arm = vehicle.body.pressure_centre_m
    np.testing.assert_allclose(turn, jnp.cross(arm, push), rtol=1e-9, atol=1e-15)


def test_rotors_in_a_still_wave_add_nothing_and_in_a_wind_their_drag():
    load = blast_load(scene(), drag=False, front=False)
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    before = load.impulse(jnp.asarray(0.0), jnp.asarray(0.005), state, CRAZYFLIE)
    assert not np.any(np.asarray(before[0]))
    after, _ = load.impulse(jnp.asarray(0.0), jnp.asarray(0.1), state, CRAZYFLIE)
    wave = load.wave_of(load.blasts[0], state.position_m)
    time = jnp.linspace(0, 0.02, 20001)
    way = jnp.trapezoid(wind_speed(wave, time), time)
    speed, k_d = state.rotor_speed_rad_s[0], CRAZYFLIE.rotor_drag[0]
    east = (5.0, 0.0, 2.0)[0] / np.hypot(5.0, 2.0)
    # 4e-3: within the step the gravity that the hover does not quite balance
    np.testing.assert_allclose(after[0], 4 * speed * k_d * way * east, rtol=4e-3)


@pytest.mark.slow  # a program of two charges; test_never.py flies two
def test_several_charges_add_up_each_at_its_own_time():
    first, second = (
        Charge(mass_kg=1.0, name="a"),
        Charge(2.0, position_m=(0.0, 9.0, 0.0), name="b", time_s=1),
    )
    together = blast_load(Scene(charges=(first, second)))
    alone = [blast_load(Scene(c)) for c in (first, second)]
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    when = together.arrival_time_s(state.position_m)
    expected = [load.arrival_time_s(state.position_m)[0] for load in alone]
    np.testing.assert_allclose(when, expected, rtol=1e-12)
    times = (jnp.asarray(0.0), jnp.asarray(2.0))
    total = together.impulse(*times, state, CRAZYFLIE)[0]
    parts = [load.impulse(*times, state, CRAZYFLIE)[0] for load in alone]
    np.testing.assert_allclose(total, parts[0] + parts[1], rtol=1e-12)


PLACES = np.array([[0.0, 0, 0], [0.1, 0, 0], [5.0, 0, 0], [39.0, 0, 0], [1e3, 0, 0]])
"""At the charge, within its table of ranges, and beyond [m]."""


def push_at(place):
    """Sum what comes to a hovering vehicle until all has passed."""
    state = hovering(CRAZYFLIE, place)
    times = jnp.asarray(0.0), jnp.asarray(5.0)
    given = blast_load(scene()).impulse(*times, state, CRAZYFLIE)
    return sum(map(jnp.sum, given))


def test_range_is_marked_and_outside_the_load_is_finite():
    marked = np.asarray(blast_load(scene()).in_range(jnp.asarray(PLACES)))[:, 0]
    np.testing.assert_array_equal(marked, [False, False, True, True, False])
    given = jax.jit(push_at)
    assert all(np.isfinite(given(place)) for place in PLACES)


@pytest.mark.slow
def test_outside_its_range_the_load_has_finite_slopes():
    slopes = jax.jit(jax.grad(push_at))
    assert all(np.isfinite(slopes(place)).all() for place in PLACES)


def deviation(mass, east, step=1e-3):
    vehicle = plain(CRAZYFLIE)
    load = blast_load(scene(mass, position_m=(east, 0.0, 0.0)))
    flight = simulate(
        vehicle,
        hovering(vehicle, (6.0, 0.0, 2.0)),
        duration_s=0.05,
        step_s=step,
        loads=(load,),
        store_every=1000,
    )
    return flight.position_m[-1, 0]


@pytest.mark.slow
def test_gradients_in_mass_and_place_are_those_of_differences():
    at = (jnp.asarray(1.0), jnp.asarray(0.3))
    slopes = jax.jit(jax.grad(deviation, (0, 1)))(*at)
    run = jax.jit(deviation)
    for n, h in enumerate((1e-5, 1e-5)):
        up, down = (
            [x + (s if i == n else 0) for i, x in enumerate(at)] for s in (h, -h)
        )
        difference = (run(*up) - run(*down)) / (2 * h)
        # the difference's own rounding: 1e-16 of 6 m over 1e-5
        np.testing.assert_allclose(slopes[n], difference, rtol=1e-4)


def test_a_charge_without_a_place_is_refused():
    with pytest.raises(InputError, match=r"charge range: expected a position"):
        blast_load(scene(range_m=5.0))


def test_a_vehicle_of_unknown_body_is_refused():
    bare = eqx.tree_at(lambda v: v.body, CRAZYFLIE, None, is_leaf=lambda x: x is None)
    with pytest.raises(InputError, match="vehicle: expected body_area"):
        blast_load(scene()).impulse(
            jnp.asarray(0.0), jnp.asarray(1.0), hovering(CRAZYFLIE, (5.0, 0, 0)), bare
        )
