"""Single steps: their times, and the pulses that they meet."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import named, simulate
from jblast.vehicle.rollout import tick_of
from tests.vehicle.flights import at_hover

VEHICLE = named("crazyflie")


def test_the_clock_of_a_flight_in_single_precision_does_not_drift():
    step, n = 5e-4, np.arange(120_000)
    ticks = jax.vmap(tick_of, (0, None))(jnp.asarray(n), jnp.float32(step))
    late = np.abs(np.asarray(ticks.start, float) - n * step)
    # two roundings below 64 s; a sum of steps would be 0.02 s off
    assert late.max() <= 1.5 * np.spacing(np.float32(59.0))
    # those at the ends are inside the true step, so that a jump there is on its side
    first, middle, last = (np.asarray(stage, float) for stage in ticks.stages)
    assert ((first < middle) & (middle < last)).all()
    assert (first >= n * step).all()
    assert (last <= (n + 1) * step).all()


class Kick:
    """A push at a time, which says that it is quiet before."""

    def __init__(self, at_s: float):
        self.at_s = at_s

    def quiet_until(self, start_s, state, vehicle):
        return jnp.where(start_s > self.at_s, jnp.inf, self.at_s)

    def impulse(self, start_s, end_s, state, vehicle):
        inside = (self.at_s >= start_s) & (self.at_s < end_s)
        give = jnp.where(inside, vehicle.mass_kg * jnp.array([0.1, 0, 0]), 0)
        return give, 0 * give


@pytest.mark.parametrize("at_s", [0.0, 0.02, 0.0207, 0.0499])
def test_a_pulse_is_met_in_whichever_step_it_is(at_s):
    state = at_hover(VEHICLE, rotor_speed_rad_s=np.zeros(4))
    flown = simulate(
        VEHICLE, state, duration_s=0.05, step_s=1e-3, loads=(Kick(at_s),), store_every=9
    )
    np.testing.assert_allclose(flown.velocity_m_s[-1, 0], 0.1, rtol=1e-9)
