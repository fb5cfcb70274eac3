"""A disturbance observer: what it sees of a steady push, of a kick, and of a wind."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import (
    CONTROLLERS,
    Gust,
    PositionHold,
    named,
    named_gains,
    simulate,
)
from tests.vehicle.flights import at_hover

with pytest.MonkeyPatch.context() as patch:
    # other tests know the controllers of the package alone
    patch.setattr(CONTROLLERS, "_records", dict(CONTROLLERS._records))
    from tests.extensions.observer import OBSERVER_RATE, ObservedHold

IRIS = named("iris")
HOME = np.array([0.0, 0.0, 10.0])
PERIOD = 0.01
HOLD = ObservedHold(PositionHold(HOME, named_gains("iris")))


@jax.jit
def turn(velocity, memory):
    """Ask the hold once; the state is that of hover with another velocity."""
    state = at_hover(IRIS, tuple(HOME), velocity_m_s=velocity)
    answer, memory = HOLD(jnp.asarray(0.0), state, IRIS, memory, jnp.asarray(PERIOD))
    return answer, memory


def seen(velocities):
    """Return the estimates after each turn, of rotors that carry the weight."""
    memory, found = HOLD.start(), []
    for velocity in velocities:
        _, memory = turn(jnp.asarray(velocity), memory)
        found.append(np.asarray(memory.push_m_s2))
    return np.array(found)


def test_a_steady_push_is_seen_as_an_exponential():
    push = np.array([0.5, -0.2, 0.1])
    times = PERIOD * np.arange(100)
    expected = push * (1 - np.exp(-OBSERVER_RATE * times))[:, None]
    np.testing.assert_allclose(seen(np.outer(times, push)), expected, atol=1e-9)


def test_of_a_kick_is_seen_just_what_it_gave():
    kick = np.array([2.0, 0.0, -1.0])
    velocities = np.array([0 * kick] * 3 + [kick] * 400)
    found = seen(velocities)
    np.testing.assert_allclose(found[:3], 0.0, atol=1e-12)  # but for rounding
    # a rate over a turn of 10 ms, of which the observer takes 1 - exp(-0.04)
    np.testing.assert_allclose(
        found[3], -np.expm1(-OBSERVER_RATE * PERIOD) * kick / PERIOD, atol=1e-9
    )
    # all of it, but what is left after 4 s: exp(-16)
    np.testing.assert_allclose(PERIOD * found.sum(axis=0), kick, rtol=1e-6)


def test_a_vehicle_that_moves_at_the_start_was_not_pushed():
    found = seen(np.array([[3.0, 0.0, 0.0]] * 5))
    np.testing.assert_allclose(found, 0.0, atol=1e-12)  # but for rounding


@pytest.mark.slow  # a flight of each is compiled
@pytest.mark.parametrize("name", ["crazyflie", "hummingbird", "iris"])
def test_it_is_back_long_before_an_integral_is(name):
    vehicle, peaks, back = named(name), [], []
    for control in (
        ObservedHold(PositionHold(HOME, named_gains(name))),
        PositionHold(HOME, named_gains(name, integral=True)),
    ):
        flown = simulate(
            vehicle,
            at_hover(vehicle, tuple(HOME), velocity_m_s=np.array([1.0, 0.0, 0.0])),
            duration_s=10.0,
            step_s=2e-3,
            control=control,
            wind=Gust([3.0, 0.0, 0.0], 0.0),
            store_every=10,
        )
        error = np.linalg.norm(np.asarray(flown.position_m) - HOME, axis=-1)
        peaks.append(error.max())
        back.append(float(flown.time_s[np.nonzero(error > 0.05)[0][-1]]))
    assert peaks[0] < peaks[1]
    assert back[0] < 0.6 * back[1]
