"""Loads of blasts on vehicles: impulse whatever the step, where and when it comes."""

import functools
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Scene
from jblast.vehicle import (
    BlastLoad,
    Each,
    Pulse,
    State,
    blast_load,
    named,
    simulate,
)
from jblast.vehicle.loads.blast.wave import density_ratio, overpressure, wind_speed

CRAZYFLIE = named("crazyflie")


def plain(vehicle):
    """A vehicle that no wind turns and whose rotors feel none: its body alone."""
    return eqx.tree_at(
        lambda v: (
            v.body.pressure_centre_m,
            v.frame_drag,
            v.rotor_drag,
            v.translational_lift,
        ),
        vehicle,
        (jnp.zeros(3), jnp.zeros(3), jnp.zeros(3), jnp.zeros(())),
    )


def hovering(vehicle, position, velocity=(0.0, 0.0, 0.0)) -> State:
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    return State(
        jnp.asarray(position, float),
        jnp.asarray(velocity, float),
        jnp.array([0.0, 0.0, 0.0, 1.0]),
        jnp.zeros(3),
        jnp.full(4, speed),
    )


def scene(mass=1.0, **charge) -> Scene:
    return Scene(charge=Charge(mass=mass, **charge))


def held(state, vehicle, load: BlastLoad, steps) -> np.ndarray:
    """Sum of the impulses between times, the vehicle held where it is."""
    sums = jax.jit(lambda a, b: load.impulse(a, b, state, vehicle)[0])
    return np.array([sums(a, b) for a, b in itertools.pairwise(steps)])


def test_the_load_is_a_pulse():
    assert isinstance(blast_load(scene()), Pulse)


@pytest.mark.parametrize("step", [0.5e-3, 2e-3, 10e-3])
@pytest.mark.parametrize(("mass", "distance"), [(1.0, 5.0), (1.0, 10.0), (15.0, 30.0)])
def test_a_flight_gains_the_same_velocity_at_any_step(mass, distance, step):
    """0.1 %, though the positive phase lasts 4, 5 and 13 ms."""
    expected, found = gained(mass, distance, 5e-5), gained(mass, distance, step)
    assert np.linalg.norm(found - expected) / np.linalg.norm(expected) < 1e-3


@functools.cache
def gained(mass: float, distance: float, step_s: float) -> np.ndarray:
    """Return the velocity after a flight of 0.12 s through a blast."""
    vehicle = plain(CRAZYFLIE)
    flight = simulate(
        vehicle,
        hovering(vehicle, (distance, 0.0, 2.0)),
        duration_s=0.12,
        step_s=step_s,
        loads=(blast_load(scene(mass)),),
        store_every=10000,
    )
    return np.asarray(flight.velocity_m_s[-1])


@pytest.mark.parametrize("step", [0.5e-3, 2e-3, 10e-3])
def test_the_front_gives_its_jump_whatever_the_step(step):
    """Summed until just past the crossing: rho V (1 + C_m) u_s, and to the end: 0."""
    load = blast_load(scene(), drag=False, rotors=False)
    heavy = eqx.tree_at(lambda v: v.mass_kg, CRAZYFLIE, jnp.asarray(1e6))
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    arrival = float(load.arrival_time_s(state.position_m)[0])
    fractions = np.append(np.arange(0.0, arrival, step), arrival + 1e-3)
    given = held(state, heavy, load, fractions).sum(axis=0)
    wave, body = load.wave(0, state.position_m), heavy.body
    density = 1.4 * load.pressure_pa / load.sound_speed_m_s**2
    expected = density * body.volume_m3 * 1.5 * wind_speed(wave, jnp.asarray(1e-3))
    # a vehicle of 1000 t stays; 1e-3 of g t in the way of the step
    np.testing.assert_allclose(np.linalg.norm(given), expected, rtol=2e-3)
    whole = held(state, heavy, load, np.arange(0.0, 0.1 + step, step)).sum(axis=0)
    assert np.linalg.norm(whole) < 1e-2 * np.linalg.norm(given)


def test_drag_of_a_body_that_stays_is_the_integral_of_its_wind():
    load = blast_load(scene(), front=False, rotors=False)
    heavy = plain(eqx.tree_at(lambda v: v.mass_kg, CRAZYFLIE, jnp.asarray(1e6)))
    thrust = 1e6 * 9.81 / 4 / CRAZYFLIE.thrust_coefficient
    state = eqx.tree_at(
        lambda s: s.rotor_speed_rad_s,
        hovering(CRAZYFLIE, (0.0, 5.0, 0.0)),
        jnp.full(4, jnp.sqrt(thrust)),
    )
    wave, body = load.wave(0, state.position_m), heavy.body
    since = jnp.linspace(0, 0.02, 200001)
    wind = wind_speed(wave, since)
    density = 1.4 * load.pressure_pa / load.sound_speed_m_s**2
    density = density * density_ratio(overpressure(wave, since))
    force = 0.5 * density * body.drag_coefficient * body.area_m2[1] * wind * abs(wind)
    given = held(state, heavy, load, np.array([0.0, 0.1])).sum(axis=0)
    # eight nodes a phase, in one of which the wind turns
    np.testing.assert_allclose(given[1], jnp.trapezoid(force, since), rtol=1e-3)
    assert abs(given[0]) + abs(given[2]) < 1e-12


def test_a_vehicle_that_flies_away_meets_the_front_later():
    load = blast_load(scene(), rotors=False)
    vehicle = plain(CRAZYFLIE)
    state = hovering(vehicle, (30.0, 0.0, 0.0), (20.0, 0.0, 0.0))
    flight = simulate(vehicle, state, duration_s=0.12, step_s=1e-4, loads=(load,))
    moved = np.asarray(flight.velocity_m_s[:, 0]) - 20.0
    first = float(flight.time_s[np.argmax(moved > 1e-6)])
    still = float(load.arrival_time_s(state.position_m)[0])
    place = np.asarray(flight.position_m[np.argmax(moved > 1e-6)])
    assert first - still > 20.0 * still / 345
    # the crossing, and a step
    own = float(load.arrival_time_s(jnp.asarray(place))[0])
    assert first == pytest.approx(own, abs=3e-4)


def test_the_wave_pushes_away_from_the_charge_and_turns_about_the_pressure_centre():
    vehicle = named("iris")
    load = blast_load(scene(east=1.0, north=2.0, up=0.5, burst="surface"), rotors=False)
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
    wave = load.wave(0, state.position_m)
    time = jnp.linspace(0, 0.02, 20001)
    way = jnp.trapezoid(wind_speed(wave, time), time)
    speed, k_d = state.rotor_speed_rad_s[0], CRAZYFLIE.rotor_drag[0]
    east = (5.0, 0.0, 2.0)[0] / np.hypot(5.0, 2.0)
    # 4e-3: within the step the gravity that the hover does not quite balance
    np.testing.assert_allclose(after[0], 4 * speed * k_d * way * east, rtol=4e-3)


def test_several_charges_add_up_each_at_its_own_time():
    first, second = Charge(mass=1.0, name="a"), Charge(2.0, north=9.0, name="b", time=1)
    together = blast_load(Scene(charge=first, others=(second,)))
    alone = [blast_load(Scene(charge=c)) for c in (first, second)]
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    when = together.arrival_time_s(state.position_m)
    expected = [load.arrival_time_s(state.position_m)[0] for load in alone]
    np.testing.assert_allclose(when, expected, rtol=1e-12)
    times = (jnp.asarray(0.0), jnp.asarray(2.0))
    total = together.impulse(*times, state, CRAZYFLIE)[0]
    parts = [load.impulse(*times, state, CRAZYFLIE)[0] for load in alone]
    np.testing.assert_allclose(total, parts[0] + parts[1], rtol=1e-12)


def test_tail_wind_brings_the_front_earlier():
    still = blast_load(scene())
    windy = blast_load(Scene(air=Air(wind_east=10.0)))
    place = jnp.array([100.0, 0.0, 0.0])
    gain = still.arrival_time_s(place) / windy.arrival_time_s(place)
    np.testing.assert_allclose(gain, 1 + 10 / still.sound_speed_m_s, rtol=1e-9)


def test_range_is_marked_and_outside_the_load_is_finite():
    load = blast_load(scene())
    places = jnp.array(
        [[0.0, 0, 0], [0.1, 0, 0], [5.0, 0, 0], [39.0, 0, 0], [1e3, 0, 0]]
    )
    marked = np.asarray(load.in_range(places))[:, 0]
    np.testing.assert_array_equal(marked, [False, False, True, True, False])

    @jax.jit
    def given(place):
        def push(place):
            state = hovering(CRAZYFLIE, place)
            times = jnp.asarray(0.0), jnp.asarray(5.0)
            return sum(map(jnp.sum, load.impulse(*times, state, CRAZYFLIE)))

        return jax.value_and_grad(push)(place)

    for place in places:
        assert all(np.all(np.isfinite(x)) for x in given(place))


def deviation(mass, east, step=1e-3):
    vehicle = plain(CRAZYFLIE)
    load = blast_load(scene(mass, east=east))
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


@pytest.mark.slow
def test_a_batch_of_scenes_is_its_own_loop():
    masses = jnp.array([0.5, 1.0, 4.0])
    loads = jax.vmap(lambda m: blast_load(scene(m)))(masses)
    one = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    many = jax.tree.map(lambda x: jnp.broadcast_to(x, (3, *x.shape)), one)
    options = {"duration_s": 0.03, "step_s": 1e-3, "store_every": 30}
    together = simulate(CRAZYFLIE, many, loads=(Each(loads),), **options)
    for n, mass in enumerate(masses):
        alone = simulate(CRAZYFLIE, one, loads=(blast_load(scene(mass)),), **options)
        np.testing.assert_allclose(
            together.velocity_m_s[n], alone.velocity_m_s, rtol=1e-9, atol=1e-12
        )


@pytest.mark.slow
def test_single_precision_flies_the_same():
    load = blast_load(scene())
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    small = jax.tree.map(lambda x: x.astype(jnp.float32), state)
    options = {"duration_s": 0.05, "step_s": 1e-3, "store_every": 50}
    fine, coarse = (
        simulate(CRAZYFLIE, s, loads=(load,), **options) for s in (state, small)
    )
    assert coarse.velocity_m_s.dtype == jnp.float32
    np.testing.assert_allclose(
        coarse.velocity_m_s[-1], fine.velocity_m_s[-1], atol=1e-4
    )


def test_a_charge_without_a_place_is_refused():
    with pytest.raises(InputError, match=r"charge range: expected a position"):
        blast_load(scene(range=5.0))


def test_a_vehicle_of_unknown_body_is_refused():
    bare = eqx.tree_at(lambda v: v.body, CRAZYFLIE, None, is_leaf=lambda x: x is None)
    with pytest.raises(InputError, match="vehicle: expected one with body_area"):
        blast_load(scene()).impulse(
            jnp.asarray(0.0), jnp.asarray(1.0), hovering(CRAZYFLIE, (5.0, 0, 0)), bare
        )


@pytest.mark.parametrize("speed", [-250.0, -60.0, 0.0, 60.0, 250.0])
def test_no_impulse_comes_while_a_load_says_it_is_quiet(speed):
    load = blast_load(scene())
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0), (speed, 0.0, 0.0))
    quiet = jax.jit(lambda t: load.quiet_until(t, state, CRAZYFLIE))
    given = jax.jit(lambda a, b: load.impulse(a, b, state, CRAZYFLIE)[0])
    assert float(quiet(jnp.asarray(0.0))) > 1e-3
    assert float(quiet(jnp.asarray(0.012))) <= 0.012  # the wave is there
    # it has gone by; a vehicle fast enough to catch it again is asked for ever
    assert (float(quiet(jnp.asarray(0.04))) > 0.04) == (abs(speed) < 68)
    whole = float(jnp.linalg.norm(given(jnp.asarray(0.0), jnp.asarray(0.04))))
    for start in (0.0, 2e-3, 5e-3, 0.03, 0.04):
        until = jnp.minimum(quiet(jnp.asarray(start)), start + 0.01)
        if until > start:
            # roundings of the wind's end
            push = float(jnp.linalg.norm(given(jnp.asarray(start), until)))
            assert push < 1e-9 * whole


def test_a_vehicle_that_gains_speed_does_not_meet_a_quiet_front():
    """It flies to meet it, ever faster; the front comes after the time that is told."""
    load, start = blast_load(scene()), jnp.asarray(0.0)
    for speed, gain in [(0.0, 0.0), (0.0, 900.0), (150.0, 500.0), (400.0, 0.0)]:
        state = hovering(CRAZYFLIE, (40.0, 0.0, 0.0), (-speed, 0.0, 0.0))
        until = float(load.quiet_until(start, state, CRAZYFLIE))
        east = 40.0 - speed * until - gain * until**2 / 2
        came = load.arrival_time_s(jnp.array([east, 0.0, 0.0]))[0]
        assert 0 < until < float(came)


@pytest.mark.slow
def test_no_half_of_the_front_is_lost_at_short_steps():
    """Its first half crosses before the arrival: many steps of 10 us, one of 100 us."""
    load = blast_load(scene(), drag=False, rotors=False)
    vehicle = plain(CRAZYFLIE)
    start = hovering(vehicle, (5.0, 0.0, 2.0))

    def gained(step_s):
        flight = simulate(
            vehicle,
            start,
            duration_s=0.0115,
            step_s=step_s,
            loads=(load,),
            store_every=10000,
        )
        return np.asarray(flight.velocity_m_s[-1, 0])

    assert gained(1e-4) > 1e-3
    np.testing.assert_allclose(gained(1e-5), gained(1e-4), rtol=1e-3)
