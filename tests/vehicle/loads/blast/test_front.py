"""A front gives its jump to a vehicle once, wherever it falls among the steps."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Scene
from jblast.vehicle import blast_load
from jblast.vehicle.loads.blast_wave import blast_passage, wind_speed
from tests.vehicle.loads.blast.hovering import CRAZYFLIE, held, hovering, scene


@pytest.mark.parametrize("step", [0.5e-3, 2e-3, 10e-3])
def test_the_front_gives_its_jump_whatever_the_step(step):
    """Summed until just past the crossing: rho V (1 + C_m) u_s, and to the end: 0."""
    load = blast_load(scene(), drag=False, rotors=False)
    heavy = eqx.tree_at(lambda v: v.mass_kg, CRAZYFLIE, jnp.asarray(1e6))
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0))
    arrival = float(load.arrival_time_s(state.position_m)[0])
    fractions = np.append(np.arange(0.0, arrival, step), arrival + 1e-3)
    given = held(state, heavy, load, fractions).sum(axis=0)
    wave, body = load.wave_of(load.blasts[0], state.position_m), heavy.body
    density = 1.4 * load.pressure_pa / load.sound_speed_m_s**2
    expected = density * body.volume_m3 * 1.5 * wind_speed(wave, jnp.asarray(1e-3))
    # a vehicle of 1000 t stays; 1e-3 of g t in the way of the step
    np.testing.assert_allclose(np.linalg.norm(given), expected, rtol=2e-3)
    whole = held(state, heavy, load, np.arange(0.0, 0.1 + step, step)).sum(axis=0)
    assert np.linalg.norm(whole) < 1e-2 * np.linalg.norm(given)


@pytest.mark.parametrize("late_s", [0.0, 5e-3])
def test_the_wave_of_a_step_is_that_halfway_through_what_passes(
    late_s,
):
    """From where the front is met to the step's end, here before half of the phase."""
    load = blast_load(scene())
    blast, air = load.blasts[0], load.surroundings()
    start, fast = jnp.array([30.0, 0.0, 0.0]), jnp.array([100.0, 0.0, 0.0])
    arrival = blast.time_s + blast.travel_time_s(air, start)
    begin, step = arrival - late_s, jnp.asarray(2e-3 + late_s)
    state = hovering(CRAZYFLIE, (30.0, 0.0, 0.0), (100.0, 0.0, 0.0))
    found = blast_passage(blast, air, begin, begin + step, state, jnp.zeros(3))
    # it runs from the front, which is 1/(1 - v/U) later where it meets it
    met, meets = 0.0, 0.0
    for _ in range(50):
        meets = blast.time_s + blast.travel_time_s(air, start + met * fast) - begin
        met = float(meets)
    half = float(blast.wave(air, start + met * fast).duration_s) / 2
    assert half > 2e-3  # so that the step's end comes first
    middle = (met + float(step)) / 2
    expected = blast.wave(air, start + middle * fast).peak
    # within a step the front is taken to come nearer at one speed: 6e-5 here
    np.testing.assert_allclose(found.wave.peak, expected, rtol=3e-4)


def test_tail_wind_brings_the_front_earlier():
    still = blast_load(scene())
    windy = blast_load(Scene(air=Air(wind_east=10.0)))
    place = jnp.array([100.0, 0.0, 0.0])
    gain = still.arrival_time_s(place) / windy.arrival_time_s(place)
    np.testing.assert_allclose(gain, 1 + 10 / still.sound_speed_m_s, rtol=1e-9)


@jax.jit
def quiet_until(start, state):
    return blast_load(scene()).quiet_until(start, state, CRAZYFLIE)


@jax.jit
def impulse(start, end, state):
    return blast_load(scene()).impulse(start, end, state, CRAZYFLIE)[0]


@pytest.mark.parametrize("speed", [-250.0, -60.0, 0.0, 60.0, 250.0])
def test_no_impulse_comes_while_a_load_says_it_is_quiet(speed):
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2.0), (speed, 0.0, 0.0))
    quiet = functools.partial(quiet_until, state=state)

    def given(start, end):
        return impulse(jnp.asarray(start, float), jnp.asarray(end, float), state)

    assert float(quiet(jnp.asarray(0.0))) > 1e-3
    assert float(quiet(jnp.asarray(0.012))) <= 0.012  # the wave is there
    # it has gone by; a vehicle fast enough to catch it again is asked for ever
    assert (float(quiet(jnp.asarray(0.04))) > 0.04) == (abs(speed) < 68)
    whole = float(jnp.linalg.norm(given(0.0, 0.04)))
    for start in (0.0, 2e-3, 5e-3, 0.03, 0.04):
        until = jnp.minimum(quiet(jnp.asarray(start)), start + 0.01)
        if until > start:
            # roundings of the wind's end
            push = float(jnp.linalg.norm(given(start, until)))
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
