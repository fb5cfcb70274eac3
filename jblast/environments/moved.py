"""What a lane's step changes: the action taken, the vehicle moved on, what it earned.

All in numbers that stand alone: a batch of them is an array each, without other axes.
"""

from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.commands import COMMANDS, Action, asked_for
from jblast.environments.episode import one_step, tick_of
from jblast.environments.observations import observed
from jblast.environments.params import EnvironmentParams
from jblast.environments.state import EnvironmentState
from jblast.environments.tasks.table import TASKS
from jblast.environments.tasks.task import distance
from jblast.vehicle.dynamics.components import Vector, turned_back
from jblast.vehicle.dynamics.equations import Wrench
from jblast.vehicle.rollout.step import Now


class Moved(NamedTuple):
    """What changes in a step, in numbers that stand alone.

    Attributes:
        now: The vehicle, its command and its hold's memory, afterwards.
        steps: Taken in this episode.
        queue: Actions that are still to take effect.
        task: Memory of the task.
        force_m_s2: Specific force along the body's axes, mean of the step.
        farthest_m: Greatest distance from the aim so far.
        ended: Whether the episode has.
        seen: Numbers of the observation.
        reward: Of the step; 0 of a lane that is lost.
        terminated: Whether the task ended the episode, or a number that is none.
        truncated: Whether its time did.
        info: `bad_action`, `diverged`, `deviation_m`, `peak_deviation_m`.
    """

    now: Now
    steps: Array
    queue: tuple[Action, ...]
    task: PyTree[Array]
    force_m_s2: Vector
    farthest_m: Array
    ended: Array
    seen: tuple[Array, ...]
    reward: Array
    terminated: Array
    truncated: Array
    info: dict[str, Array]


def moved(
    state: EnvironmentState,
    action: Action,
    params: EnvironmentParams,
    wrench: Wrench,
) -> Moved:
    """Take a step with the force and moment that the blasts give in it.

    Args:
        state: Before.
        action: Its numbers.
        params: Of the environment.
        wrench: Mean of the step.
    """
    task = TASKS[params.task]
    bad = ~reduce(jnp.logical_and, map(jnp.isfinite, action))
    dtype = params.step_s.dtype
    now_asked: Action = tuple(
        jnp.clip(jnp.where(bad, 0.0, part.astype(dtype)), -1.0, 1.0) for part in action
    )
    flown = now_asked
    if task.actions is not None:
        flown = (jnp.zeros_like(params.step_s),) * COMMANDS[params.command]
    queue = (flown, *state.queue)
    late = _late(queue, state.episode.delay_steps)
    aim, memory = task.aim(params, state)
    command, integral = asked_for(params, state, late, aim)
    before = state.now.motion
    now = state.now._replace(
        command=command,
        memory=integral,
        impulse_wrench=wrench,
    )
    tick = tick_of(params, state)

    def go_on() -> Now:
        return one_step(params, state.episode).moved(now, tick)

    # always taken; a program of its own, and what it calculates stays in it
    now = jax.lax.cond(tick.step > 0, go_on, lambda: now)
    gained = tuple(
        (b - a) / params.step_s
        for a, b in zip(before.velocity, now.motion.velocity, strict=True)
    )
    pulled = (gained[0], gained[1], gained[2] + FLIGHT_GRAVITY)
    off = distance(now.motion, aim)
    after = state._replace(
        now=now,
        steps=state.steps + 1,
        queue=queue[: params.most_delay],
        task=memory,
        force_m_s2=turned_back(now.motion.quaternion, pulled),
        farthest_m=jnp.maximum(state.farthest_m, off),
    )
    judged = task.judge(params, after, now_asked, aim)
    diverged = ~jnp.isfinite(sum(jax.tree.leaves(now.motion)))
    lost = bad | diverged
    terminated = judged.terminated | lost
    truncated = (after.steps >= params.episode_steps) & ~terminated
    after = after._replace(task=judged.task, ended=terminated | truncated)
    return Moved(
        now=after.now,
        steps=after.steps,
        queue=after.queue,
        task=after.task,
        force_m_s2=after.force_m_s2,
        farthest_m=after.farthest_m,
        ended=after.ended,
        seen=observed(params, after),
        reward=jnp.where(lost, 0.0, judged.reward),
        terminated=terminated,
        truncated=truncated,
        info={
            "bad_action": bad,
            "diverged": diverged,
            "deviation_m": off,
            "peak_deviation_m": after.farthest_m,
        },
    )


def _late(queue: tuple[Action, ...], delay: Array) -> Action:
    """Return the action that takes effect now."""
    found = queue[0]
    for steps, asked in enumerate(queue[1:], start=1):
        found = tuple(
            jnp.where(delay >= steps, old, new)
            for old, new in zip(asked, found, strict=True)
        )
    return found
