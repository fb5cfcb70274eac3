"""Blocks of steps: those that a pulse reaches are flown with it."""

import sys
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle.rollout import FlightState, OneStep, Ticks, fly, timetable

few = sys.modules[fly.__module__]._advance_block


class Counting(OneStep):
    """Counts its steps: those without pulses as motion, those with them as command."""

    def __init__(self):
        pass

    def advance(self, now: Any, tick: Ticks) -> FlightState:
        return now._replace(motion=now.motion + 1)

    def advance_pushed(self, now: Any, tick: Ticks) -> FlightState:
        return now._replace(command=now.command + 1)


@pytest.mark.parametrize(
    ("front_s", "reached"), [(0.5, True), (1.0, True), (1.2, False)]
)
def test_a_front_within_the_last_step_of_a_block_is_met(front_s, reached):
    start, step = jnp.array([0.0, 0.1]), jnp.array([0.1, 1.0])
    ticks = Ticks(
        stages=jnp.stack([start, start + step / 2, start + step], axis=1),
        start=start,
        step=step,
        command=jnp.zeros((2, 3), int),
        sample=jnp.ones(2, bool),
    )
    none: Any = jnp.zeros(())
    fronts = (jnp.asarray(7.0), jnp.asarray(front_s))
    after = few(Counting(), FlightState(none, None, none, (), none, fronts), ticks)
    assert (after.motion, after.command) == ((0, 2) if reached else (2, 0))


def test_the_clock_of_a_flight_in_single_precision_does_not_drift():
    step, until = 5e-4, 60.0
    start = timetable(until, step, step, np.dtype(np.float32)).start
    exact = np.arange(round(until / step) + 1) * step
    late = np.abs(np.asarray(start, float) - exact[: start.size])
    # half a spacing of float32 below 64 s; a sum of steps would be 0.02 s off
    assert late.max() <= np.spacing(np.float32(59.0)) / 2
