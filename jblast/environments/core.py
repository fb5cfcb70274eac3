"""One lane: reset and step, pure functions for jit, vmap and grad.

A step asks the command of the action, takes in what the blasts give within it, and
moves the vehicle on by the step of every flight (`vehicle/rollout`): there is one
physics. A lane that did not end goes the same way whatever other lanes there are.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.commands import COMMANDS
from jblast.environments.episode import (
    draw_episode,
    load_of,
    tick_of,
    vehicle_in,
)
from jblast.environments.moved import Moved, moved
from jblast.environments.observations import observed
from jblast.environments.params import EnvironmentParams
from jblast.environments.state import EnvironmentState
from jblast.environments.tasks.table import TASKS
from jblast.environments.windows import may_push, window_of
from jblast.vehicle.dynamics.equations import Wrench
from jblast.vehicle.loads.load import pulse_wrench
from jblast.vehicle.rollout.step import Now
from jblast.world import Blasts


class Step(NamedTuple):
    """What a step returns, in the order of Gymnasium.

    Attributes:
        state: Afterwards.
        observation: Of that.
        reward: Of the step.
        terminated: Whether the task ended the episode, or a number that is none did.
        truncated: Whether its time is over.
        info: Of each lane `bad_action`, whether an action was no number, which ends
            the episode; `diverged`; `deviation_m` from where it should be;
            `peak_deviation_m` of the episode.
    """

    state: EnvironmentState
    observation: Float[Array, " seen"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    info: dict[str, Any]


def actions_of(params: EnvironmentParams) -> int:
    """Return the numbers of an action."""
    return TASKS[params.task].actions or COMMANDS[params.command]


def reset(
    key: PRNGKeyArray, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, " seen"]]:
    """Begin the first episode of a lane.

    Args:
        key: Of the lane; `fold_in(key(seed), lane)` in a batch.
        params: Of the environment.
    """
    return begin(key, jnp.zeros((), jnp.int32), params)


def begin(
    key: PRNGKeyArray, number: Array, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, " seen"]]:
    """Begin any episode of a lane."""
    own = jax.random.fold_in(key, number)
    episode = draw_episode(own, params)
    motion, task = TASKS[params.task].start(jax.random.fold_in(own, 2**31), params)
    zero = jnp.zeros_like(params.step_s)
    none = (zero, zero, zero)
    single = zero.dtype == jnp.float32
    now = Now(
        motion=motion,
        excess=(zero, zero, zero, zero) if single else None,
        command=motion.rotor_speed,
        memory=none,
        impulse_wrench=(none, none),
        inactive_until_s=(),
    )
    windows = jax.vmap(
        lambda blast: window_of(
            load_of(params, episode.wind_m_s, blast), params, motion.position
        )
    )(episode.blasts)
    idle = (zero,) * COMMANDS[params.command]
    state = EnvironmentState(
        now=now,
        steps=jnp.zeros((), jnp.int32),
        queue=(idle,) * params.most_delay,
        episode=episode,
        windows=windows,
        start_m=motion.position,
        task=task,
        force_m_s2=(zero, zero, zero + FLIGHT_GRAVITY),
        farthest_m=zero,
        ended=jnp.zeros((), bool),
        key=key,
        number=number,
    )
    return state, jnp.stack(observed(params, state))


def step(
    state: EnvironmentState, action: Float[Array, " action"], params: EnvironmentParams
) -> Step:
    """Take a step.

    What stays as it is in an episode that has ended is the caller's: `step_lanes`
    begins another.

    Args:
        state: Before.
        action: Within -1 and 1; what is beyond counts as its bound. One that is no
            number ends the episode.
        params: Of the environment.
    """
    zero = jnp.zeros_like(params.step_s)

    def add(total: Wrench, row: tuple[Array, Blasts]) -> tuple[Wrench, None]:
        pushes, blast = row
        wrench = jax.lax.cond(
            pushes,
            lambda: pushed_by(state, blast, params),
            lambda: ((zero, zero, zero), (zero, zero, zero)),
        )
        return jax.tree.map(jnp.add, total, wrench), None

    none: Wrench = ((zero, zero, zero), (zero, zero, zero))
    rows = (in_blast(state, params), state.episode.blasts)
    wrench, _ = jax.lax.scan(add, none, rows)
    return step_of(state, moved(state, tuple(action), params, wrench))


def in_blast(
    state: EnvironmentState, params: EnvironmentParams
) -> Bool[Array, " blast"]:
    """Return whether each blast may push a lane in its next step."""
    tick, place = tick_of(params, state), state.now.motion.position
    x, y, z = (a - b for a, b in zip(place, state.start_m, strict=True))
    off = jnp.sqrt(x * x + y * y + z * z)
    return may_push(state.windows, off, tick.start, tick.start + tick.step)


def pushed_by(
    state: EnvironmentState, blast: Blasts, params: EnvironmentParams
) -> Wrench:
    """Return mean force and moment that a blast gives a lane in its next step.

    Args:
        state: Of the lane.
        blast: One of its episode.
        params: Of the environment.
    """
    tick = tick_of(params, state)
    wrench, _ = pulse_wrench(
        [load_of(params, state.episode.wind_m_s, blast)],
        tick.start,
        tick.step,
        state.now.motion,
        vehicle_in(params, state.episode),
        (jnp.full_like(tick.start, -jnp.inf),),
        None,
    )
    return wrench


def step_of(state: EnvironmentState, found: Moved) -> Step:
    """Return what a step returns, with what stays as it was before.

    Args:
        state: Before; of one lane or of many.
        found: What changed.
    """
    after = state._replace(
        now=found.now,
        steps=found.steps,
        queue=found.queue,
        task=found.task,
        force_m_s2=found.force_m_s2,
        farthest_m=found.farthest_m,
        ended=found.ended,
    )
    return Step(
        after,
        jnp.stack(found.seen, axis=-1),
        found.reward,
        found.terminated,
        found.truncated,
        found.info,
    )
