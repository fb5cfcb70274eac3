r"""Detect: raise an alarm for a blast, from a microphone and an event camera on board.

A controller holds the vehicle's position; the action (1) is an alarm where it is
positive. Observations, of the last step:

- level of the greatest overpressure at the vehicle, with noise of the rotors, over
  20 µPa, in units of 100 dB;
- the natural logarithm of 1 plus the number of camera events. A flash gives five events
  for each pixel on the fireball's disc, $\frac{\pi}{4} (2 f r / R)^2$ pixels with $r =
  1.75\,m Q^{1/3}$ and $f = 260$ pixels, in the step of the detonation. The background
  adds ten events, and the sum has its square root as noise. This is a simple count:
  `jblast.sensors.camera` draws events in full;
- seconds since the last alarm, 1 at most.

An alarm within 0.5 s of an arrival without an earlier alarm earns 1; one without an
arrival costs 0.1; an arrival without an alarm in that time costs 1. All constants are
declared.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree

from jblast.environments.episode import (
    OF_READINGS,
    Action,
    Aim,
    EnvironmentParams,
    EnvironmentState,
    load_of,
)
from jblast.environments.tasks.task import (
    Judged,
    Seen,
    Task,
    at_rest,
    at_target,
)
from jblast.vehicle.loads.blast_wave import overpressure
from jblast.vehicle.state import StateComponents
from jblast.world import Blasts

IN_TIME_S, FALSE_ALARM = 0.5, 0.1
REFERENCE_PA, NOISE_PA, BACKGROUND = 20e-6, 2.0, 10.0
FIREBALL_M, FOCAL_PX, EVENTS_A_PIXEL = 1.75, 260.0, 5.0


class Answered(NamedTuple):
    """What was answered so far.

    Attributes:
        blasts: Which arrivals were alarmed of, or missed.
        since_s: Since the last alarm.
    """

    blasts: Bool[Array, " blast"]
    since_s: Float[Array, ""]


def _start(
    key: PRNGKeyArray, params: EnvironmentParams
) -> tuple[StateComponents, PyTree[Array]]:
    count = params.world.occurrence.count  # pyright: ignore[reportAttributeAccessIssue] (held by environment_params)
    answered = Answered(jnp.zeros(count, bool), jnp.ones_like(params.step_s))
    return at_rest(params, params.target_m), answered


def _aim(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    return at_target(params), state.task


def _observe(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    place, step = jnp.stack(state.now.motion.position), params.step_s
    end = state.steps.astype(step.dtype) * step
    key = jax.random.fold_in(jax.random.fold_in(state.key, state.number), OF_READINGS)
    noise = jax.random.normal(jax.random.fold_in(key, state.steps), (2,), step.dtype)

    def of(numbers: Blasts) -> tuple[Array, Array]:
        load = load_of(params, state.episode.wind_m_s, numbers)
        (blast,) = load.blasts
        since = end - load.arrival_time_s(place)[0]
        begins = jnp.where(since < step, 0.0, since - step)
        # the wave falls from its front on: the loudest of a step is at its beginning
        share = overpressure(
            load.wave_of(blast, place), jnp.where(since < 0, -1.0, begins)
        )
        away = jnp.sqrt(jnp.sum(jnp.square(place - blast.position_m)))
        disc = 2 * FOCAL_PX * FIREBALL_M * jnp.cbrt(blast.mass_kg) / away
        flash = (blast.time_s <= end) & (blast.time_s > end - step)
        lit = EVENTS_A_PIXEL * math.pi / 4 * jnp.square(disc)
        return load.pressure_pa * jnp.abs(share), jnp.where(flash, lit, 0.0)

    pressures, flashes = jax.vmap(of)(state.episode.blasts)
    heard = jnp.abs(NOISE_PA * noise[0]) + jnp.sum(pressures)
    events = BACKGROUND + jnp.sum(flashes)
    events = jnp.maximum(events + jnp.sqrt(events) * noise[1], 0.0)
    decibels = 20 * jnp.log10(heard / REFERENCE_PA + 1.0)
    return decibels / 100, jnp.log1p(events), state.task.since_s


def _judge(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> Judged:
    answered, step = state.task, params.step_s
    end = state.steps.astype(step.dtype) * step
    place = jnp.stack(state.now.motion.position)

    def arrival(blast: Blasts) -> Array:
        return load_of(params, state.episode.wind_m_s, blast).arrival_time_s(place)[0]

    since = end - jax.vmap(arrival)(state.episode.blasts)
    alarm = action[0] > 0
    open_now = (since >= 0) & (since <= IN_TIME_S) & ~answered.blasts
    missed = (since > IN_TIME_S) & ~answered.blasts
    hit = alarm & jnp.any(open_now)
    reward = jnp.where(hit, 1.0, jnp.where(alarm, -FALSE_ALARM, 0.0))
    reward = reward - jnp.sum(missed.astype(step.dtype))
    after = Answered(
        answered.blasts | missed | (open_now & alarm),
        jnp.where(alarm, 0.0, jnp.minimum(answered.since_s + step, 1.0)),
    )
    down = state.now.motion.position[2] <= params.ground_up_m
    return Judged(reward.astype(step.dtype), down, after)


DETECT = Task("hold", (0.0, 0.0, 10.0), 10.0, 1, _start, _aim, _observe, _judge)
