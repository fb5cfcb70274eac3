"""Flights against the same equations integrated by SciPy, written here on their own."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import (
    Commands,
    Gust,
    State,
    friedlander,
    n_wave,
    named,
    simulate,
    steady,
)
from jblast.vehicle.quadrotor import in_precision
from tests.vehicle.flights import at_hover, by_scipy, hover_speed, tumbling

HELD = 2e-3
GUSTS = {
    "step": Gust([4.0, -3.0, 1.0], 0.05),
    "n-wave": Gust([20.0, 10.0, -5.0], 0.04, 0.02, n_wave),
    "friedlander": Gust([25.0, 0.0, 5.0], 0.03, 0.01, friedlander),
}


def plain(gust):
    """The gust as a NumPy function of time."""
    velocity = np.asarray(gust.velocity_m_s)
    start = float(gust.start_s)

    def wind(time):
        since = time - start
        if since < 0:
            return np.zeros(3)
        if gust.shape is steady:
            return velocity
        phase = since / float(gust.duration_s)
        if gust.shape is n_wave:
            return velocity * (1 - 2 * phase) * (phase <= 1)
        return velocity * (1 - phase) * np.exp(-phase)

    return wind


def commands_of(vehicle, duration):
    """Rotor speeds that wander about hover, with jumps by half now and then.

    Jumps set RK4's error here, (h/tau)^5 of each in the motors' lag: from hover to the
    Hummingbird's 1500 rad/s every 0.1 s they add up to 1e-5 m.
    """
    rng = np.random.default_rng(7)
    count = round(duration / HELD)
    wander = 1 + 0.05 * np.cumsum(rng.normal(size=(count, 4)), axis=0) / np.sqrt(50)
    spikes = np.where(rng.random((count, 4)) < 0.02, 1.5, 1.0)
    return hover_speed(vehicle) * wander * spikes


def flown_and_truth(name, gust, duration, dtype=None):
    vehicle, wind = named(name), GUSTS[gust]
    state, commands = tumbling(vehicle), commands_of(vehicle, duration)
    edges = [float(wind.start_s), float(wind.start_s + getattr(wind, "duration_s", 0))]
    truth = by_scipy(vehicle, state, commands, HELD, duration, plain(wind), edges)
    if dtype is not None:
        state = State(*(part.astype(dtype) for part in vars(state).values()))
        wind = in_precision(wind, np.dtype(dtype))
    flown = simulate(
        vehicle,
        state,
        duration_s=duration,
        control=Commands(commands, HELD),
        wind=wind,
        store_every=4,
    )
    return flown, truth


def farthest(flown, truth):
    return float(np.abs(np.asarray(flown.position_m) - truth[:, :3]).max())


@pytest.mark.slow
def test_a_flight_is_that_of_scipy():
    flown, truth = flown_and_truth("crazyflie", "friedlander", 0.3)
    assert flown.time_s[-1] == 0.3
    assert farthest(flown, truth) < 1e-6  # fourth order; 1e-5 over 2.5 s
    np.testing.assert_allclose(flown.quaternion, truth[:, 6:10], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crazyflie", "hummingbird", "iris"])
@pytest.mark.parametrize("gust", GUSTS)
def test_a_long_flight_is_that_of_scipy(name, gust):
    flown, truth = flown_and_truth(name, gust, 2.5)
    assert np.ptp(truth[:, :3], axis=0).max() > 2  # it goes somewhere
    assert farthest(flown, truth) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("gust", GUSTS)
def test_a_long_flight_in_single_precision_is_within_a_millimetre(gust):
    flown, truth = flown_and_truth("hummingbird", gust, 2.5, np.float32)
    assert flown.position_m.dtype == np.float32
    assert farthest(flown, truth) < 1e-3


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


@pytest.mark.slow
def test_a_wind_frozen_for_two_milliseconds_moves_it_forty_times_as_far():
    vehicle = named("crazyflie")
    gust = Gust([30.0, 0.0, 0.0], 0.1, 0.02, n_wave)

    def frozen(time_s, position_m):
        # an instant early, so that no rounding says which end of the wave is in it
        return gust(jnp.floor(time_s / 2e-3 + 1e-6) * 2e-3 - 1e-9, position_m)

    flown = simulate(
        vehicle, at_hover(vehicle), duration_s=2.0, wind=frozen, store_every=4000
    )
    # Its samples at 0, 2 ... 20 ms sum to zero, but the first comes before the wave:
    # the one at its very end, -30 m/s for 2 ms, is left over.
    assert abs(float(flown.position_m[-1, 0])) == pytest.approx(23e-3, rel=0.1)
