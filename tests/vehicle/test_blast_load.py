"""Loads of blasts: complete at any step, the momentum of a fine flight, gradients."""

import dataclasses
import functools
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import PositionHold, blast_load, named_gains, simulate
from jblast.vehicle.loads.blast_wave import (
    blast_passage,
    density_ratio,
    overpressure,
    wind_speed,
)
from tests.vehicle.hovering import (
    BODY,
    CRAZYFLIE,
    HEAVY,
    PLAIN,
    held,
    hovering,
    impulse,
    of_parts,
    scene,
    wave_at,
)

HIGH = Scene(Charge(1.0, (0.0, 0.0, 40.0), burst="free-air"))
BESIDE = (14.0, 0.0, 20.0)


@pytest.mark.parametrize("drag", [True, False])
@pytest.mark.parametrize(("made", "place"), [(scene(), (5.0, 0, 2)), (HIGH, BESIDE)])
def test_an_impulse_is_complete_however_steps_cut_it(made, place, drag):
    """Whole waves, both of a burst in free air, in one step and in random ones."""
    vehicle = of_parts(CRAZYFLIE, drag=drag, mass_kg=1e6)
    load, state = blast_load(made), hovering(vehicle, place)
    cuts = np.sort(np.random.default_rng(0).uniform(0.0, 0.4, 40))
    whole = held(state, vehicle, load, [0.0, 0.4])
    given = held(state, vehicle, load, [0.0, *cuts, 0.4])
    front = held(state, vehicle, load, [0.0, load.arrival_time_s(state.position_m)[0]])
    scale = float(np.linalg.norm(whole) + np.linalg.norm(front))
    # eight nodes a phase, in one of which the wind turns
    np.testing.assert_allclose(given, whole, atol=1e-3 * scale)


def test_within_a_step_a_vehicle_falls():
    """Its own fall is all of the air's vertical motion, in one step as in many."""
    load, place = blast_load(scene()), jnp.array([30.0, 0.0, 0.0])
    came = load.arrival_time_s(place)[0]
    state = dataclasses.replace(hovering(HEAVY, place), rotor_speed_rad_s=jnp.zeros(4))
    one = impulse(load, came - 1e-3, came + 0.02, state, HEAVY)[0][2]
    many, edges = 0.0, np.linspace(-1e-3, 0.02, 22)
    for begin, end in itertools.pairwise(edges):
        falls = jnp.array([0.0, 0.0, -9.81 * (begin - edges[0])])
        falling = dataclasses.replace(state, velocity_m_s=falls)
        many += impulse(load, came + begin, came + end, falling, HEAVY)[0][2]
    assert one > 0
    np.testing.assert_allclose(one, many, rtol=0.02)


def test_past_the_crossing_both_fronts_have_given_their_jumps():
    """Each is rho V (1 + C_m) u_s along its own way; the second comes from below."""
    vehicle = of_parts(CRAZYFLIE, drag=False, mass_kg=1e6)
    load, state = blast_load(HIGH), hovering(vehicle, BESIDE)
    begins, ends = load.span_s(state.position_m, vehicle)
    assert begins[1] > ends[0]
    air, place = load.air, state.position_m
    travels = jax.vmap(lambda blast: blast.travel_time_s(air, place))(load.waves)
    for number, up in ((0, -20.0), (1, 60.0)):
        way, came = np.array([14.0, 0.0, up]), travels[number]
        given = held(state, vehicle, load, [begins[number] - 1e-3, came + 1e-3])
        wind = wind_speed(wave_at(load, BESIDE, number), jnp.asarray(1e-3))
        jump = air_density(load) * BODY.volume_m3 * 1.5 * wind
        expected = float(jump) * way / np.linalg.norm(way)
        np.testing.assert_allclose(given, expected, rtol=3e-3)


def air_density(load):
    return 1.4 * load.pressure_pa / load.sound_speed_m_s**2


def test_drag_of_a_body_that_stays_is_the_integral_of_its_wind():
    vehicle = of_parts(CRAZYFLIE, front=False, mass_kg=1e6)
    load, state = blast_load(scene()), hovering(vehicle, (0.0, 5.0, 0.0))
    wave = wave_at(load, state.position_m)
    since = jnp.linspace(0, 0.02, 200001)
    wind = wind_speed(wave, since)
    density = air_density(load) * density_ratio(overpressure(wave, since))
    area = BODY.drag_coefficient * BODY.area_m2[1]
    force = 0.5 * density * area * wind * abs(wind)
    given = held(state, vehicle, load, [0.0, 0.1])
    np.testing.assert_allclose(given[1], jnp.trapezoid(force, since), rtol=1e-3)
    assert abs(given[0]) + abs(given[2]) < 1e-12


def test_the_wave_pushes_away_from_the_charge_and_turns_about_the_pressure_centre():
    vehicle = of_parts(CRAZYFLIE, mass_kg=1e6)
    arm = jnp.array([0.01, -0.02, 0.03])
    vehicle = eqx.tree_at(lambda v: v.body.pressure_centre_m, vehicle, arm)
    load = blast_load(scene(position_m=(1.0, 2.0, 0.5), burst="surface"))
    state = hovering(vehicle, (4.0, 6.0, 0.5))
    push, turn = impulse(load, 0.0, 0.012, state, vehicle)
    np.testing.assert_allclose(push[1] / push[0], 4 / 3, rtol=1e-3)
    np.testing.assert_allclose(turn, jnp.cross(arm, push), rtol=1e-9, atol=1e-15)


def test_rotors_before_the_wave_add_nothing_and_in_it_their_drag():
    vehicle = of_parts(CRAZYFLIE, drag=False, front=False, rotors=True, mass_kg=1e6)
    load = blast_load(scene())
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    assert not np.any(impulse(load, 0.0, 0.005, state, vehicle)[0])
    after, _ = impulse(load, 0.0, 0.1, state, vehicle)
    wave, time = wave_at(load, state.position_m), jnp.linspace(0, 0.02, 20001)
    way = jnp.trapezoid(wind_speed(wave, time), time)
    speed, k_d = state.rotor_speed_rad_s[0], CRAZYFLIE.rotor_drag[0]
    expected = 4 * speed * k_d * way * 5.0 / np.hypot(5.0, 2.0)
    np.testing.assert_allclose(after[0], expected, rtol=4e-3)


def test_the_wave_of_a_step_is_that_halfway_through_what_passes():
    """From where the front is met to the step's end, here before half of the phase."""
    load = blast_load(scene())
    blast, air = jax.tree.map(lambda x: x[0], load.blasts), load.air
    start, fast = jnp.array([30.0, 0.0, 0.0]), jnp.array([100.0, 0.0, 0.0])
    begin, step = blast.travel_time_s(air, start), jnp.asarray(2e-3)
    state = hovering(CRAZYFLIE, (30.0, 0.0, 0.0), (100.0, 0.0, 0.0))
    found = blast_passage(blast, air, begin, begin + step, state, jnp.zeros(3))
    assert float(wave_at(load, start).duration_s) / 2 > 2e-3
    expected = wave_at(load, start + step / 2 * fast).peak
    np.testing.assert_allclose(found.wave.peak, expected, rtol=3e-4)


@jax.jit
def quiet_until(load, start, state):
    return load.quiet_until(jnp.asarray(start), state, CRAZYFLIE)


@pytest.mark.parametrize("speed", [-250.0, 0.0, 60.0, 250.0])
def test_no_impulse_comes_while_a_load_says_it_is_quiet(speed):
    load, state = blast_load(scene()), hovering(CRAZYFLIE, (5, 0, 2.0), (speed, 0, 0))
    assert quiet_until(load, 0.0, state) > 1e-3
    assert quiet_until(load, 0.012, state) <= 0.012  # the wave is there
    # it has gone by; a vehicle slower than c/4.7 does not soon catch it again
    assert (quiet_until(load, 0.04, state) > 0.1) == (abs(speed) < 70)
    whole = np.linalg.norm(impulse(load, 0.0, 0.04, state, CRAZYFLIE)[0])
    for start in (0.0, 2e-3, 5e-3, 0.03, 0.04):
        until = jnp.minimum(quiet_until(load, start, state), start + 0.01)
        if until > start:  # roundings of the wind's end
            push = np.linalg.norm(impulse(load, start, until, state, CRAZYFLIE)[0])
            assert push < 1e-9 * whole


def test_between_two_waves_it_is_quiet_until_the_second():
    load, state = blast_load(HIGH), hovering(CRAZYFLIE, BESIDE)
    begins, ends = load.span_s(state.position_m, CRAZYFLIE)
    assert ends[0] < quiet_until(load, ends[0] + 1e-4, state) < begins[1]
    assert quiet_until(load, 60.0, state) > 60.0


REAL = Charge(mass_kg=2.0, time_s=0.01, name="real")
OTHER = Charge(5.0, position_m=(11.0, 2.0, 0.0), time_s=0.004, name="other")
NEVER = dataclasses.replace(OTHER, time_s=jnp.inf)
HERE = hovering(CRAZYFLIE, (5.0, 0.0, 4.0))


@jax.jit
@functools.partial(jax.value_and_grad, argnums=(0, 1, 2))
def pushed(first: Charge, second: Charge, place, end_s):
    """Return a number that depends on all of an impulse, and its slopes."""
    load = blast_load(Scene(charges=(first, second)))
    state = hovering(CRAZYFLIE, place)
    push, turn = load.impulse(jnp.asarray(0.0), end_s, state, CRAZYFLIE)
    return jnp.sum(push * jnp.array([1.0, 2.0, 3.0])) + jnp.sum(turn)


@pytest.mark.slow
def test_charges_add_up_and_one_that_never_happens_is_as_if_it_were_not_there():
    given = HERE.position_m, jnp.asarray(0.1)
    alone, (of_real, of_never, _) = pushed(REAL, NEVER, *given)
    other, _ = pushed(dataclasses.replace(REAL, time_s=jnp.inf), OTHER, *given)
    both, _ = pushed(REAL, OTHER, *given)
    np.testing.assert_allclose(both, alone + other, rtol=1e-12)
    assert [float(x) for x in jax.tree.leaves(of_never)] == [0.0] * 5
    h = 1e-5
    up, down = (
        pushed(dataclasses.replace(REAL, mass_kg=2.0 + s), NEVER, *given)[0]
        for s in (h, -h)
    )
    np.testing.assert_allclose(of_real.mass_kg, (up - down) / (2 * h), rtol=1e-6)


PLACES = np.array([[0.0, 0, 0], [0.1, 0, 0], [5.0, 0, 0], [39.0, 0, 0], [1e3, 0, 0]])
"""At the charge, within its table of ranges, and beyond [m]."""


@pytest.mark.slow
def test_outside_the_range_and_without_a_wave_load_and_slopes_are_finite():
    load = blast_load(scene())
    marked = np.asarray(load.in_range(jnp.asarray(PLACES)))[:, 0]
    np.testing.assert_array_equal(marked, [False, False, True, True, False])
    real = dataclasses.replace(REAL, mass_kg=1.0, time_s=0.0)
    for end in (5.0, 1e-4):
        found = [pushed(real, NEVER, p, jnp.asarray(end)) for p in PLACES]
        assert all(np.isfinite(x).all() for x in jax.tree.leaves(found))
    slopes = pushed(real, NEVER, PLACES[3], jnp.asarray(1e-4))[1]
    assert not np.any(slopes[2])


def deviation(mass, east, step=1e-3):
    load = blast_load(scene(mass, position_m=(east, 0.0, 0.0)))
    flight = simulate(
        PLAIN,
        hovering(PLAIN, (6.0, 0.0, 2.0)),
        duration_s=0.05,
        step_s=step,
        loads=(load,),
        control=PositionHold(np.array([6.0, 0.0, 2.0]), named_gains("crazyflie")),
        store_every=1000,
    )
    return flight.position_m[-1, 0]


@pytest.mark.slow
def test_gradients_in_mass_and_place_are_those_of_differences():
    at = (jnp.asarray(1.0), jnp.asarray(0.3))
    slopes, run, h = jax.jit(jax.grad(deviation, (0, 1)))(*at), jax.jit(deviation), 1e-5
    for n in range(2):
        up, down = (
            run(*(x + (s if i == n else 0) for i, x in enumerate(at))) for s in (h, -h)
        )
        # the difference's own rounding: 1e-16 of 6 m over 1e-5
        np.testing.assert_allclose(slopes[n], (up - down) / (2 * h), rtol=1e-4)


def test_the_ground_reflects_a_burst_in_free_air_and_no_other():
    def waves_of(up, burst):
        return blast_load(Scene(Charge(1.0, (0.0, 0.0, up), burst=burst))).waves

    assert waves_of(0.0, "free-air").time_s.size == 1
    assert waves_of(9.0, "surface").time_s.size == 1
    assert waves_of(12.0, "free-air").time_s.size == 2
    # a traced height decides in the data whether the image detonates
    traced = jax.jit(lambda up: waves_of(up, "free-air"))
    low, high = (traced(jnp.asarray(up)) for up in (0.0, 12.0))
    assert np.isinf(low.time_s[1])
    for found, expected in zip(
        jax.tree.leaves(high), jax.tree.leaves(waves_of(12.0, "free-air")), strict=True
    ):
        np.testing.assert_allclose(found, expected)


def test_on_the_ground_both_waves_are_one_of_twice_the_pressure_along_it():
    there, low = hovering(HEAVY, (14.0, 0.0, 0.0)), (14.0, 0.0, 0.0)
    both = blast_load(HIGH)
    direct = both.waves.time_s.at[1].set(jnp.inf)
    alone = dataclasses.replace(
        both, waves=dataclasses.replace(both.waves, time_s=direct)
    )
    come = both.span_s(there.position_m, CRAZYFLIE)[0]
    assert come[0] == come[1]
    given, half = (
        impulse(x, 0.0, come[0] + 1e-3, there, HEAVY)[0] for x in (both, alone)
    )
    assert abs(given[2]) < 1e-12 * given[0]
    np.testing.assert_allclose(given[0], 2 * half[0], rtol=1e-12)
    assert wave_at(both, low, 0).peak == wave_at(both, low, 1).peak


def test_charges_without_a_place_and_vehicles_of_unknown_body_are_refused():
    with pytest.raises(InputError, match=r"charge range: expected a position"):
        blast_load(scene(range_m=5.0))
    bare = eqx.tree_at(lambda v: v.body, CRAZYFLIE, None, is_leaf=lambda x: x is None)
    with pytest.raises(InputError, match="vehicle: expected body_area"):
        blast_load(scene()).impulse(jnp.asarray(0.0), jnp.asarray(1.0), HERE, bare)
