"""Rates: follow requested body rates, the task of GymFC.

An episode draws body rates to follow, uniform within `rate_rad_s` about each axis; the
vehicle flies freely. Observations: requested less actual rates (3), actual rates (3),
both over `rate_rad_s`, and rotor speeds over the greatest (4). Reward of a step: 1 less
the mean of the absolute errors over `rate_rad_s`.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray, PyTree

from jblast.environments.episode import Action, Aim, EnvironmentParams, EnvironmentState
from jblast.environments.tasks.task import Judged, Seen, Task, at_rest, at_target
from jblast.vehicle.state import StateComponents, Vector, three


def _start(
    key: PRNGKeyArray, params: EnvironmentParams
) -> tuple[StateComponents, PyTree[Array]]:
    dtype = params.target_m.dtype
    wanted = params.rate_rad_s * jax.random.uniform(key, (3,), dtype, -1.0, 1.0)
    return at_rest(params, params.target_m), three(wanted)


def _aim(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    return at_target(params), state.task


def _missing(params: EnvironmentParams, state: EnvironmentState) -> Vector:
    x, y, z = (
        (asked - there) / params.rate_rad_s
        for asked, there in zip(state.task, state.now.motion.body_rate, strict=True)
    )
    return x, y, z


def _observe(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    motion, most = state.now.motion, params.vehicle.rotor_speed_max_rad_s
    rates = (rate / params.rate_rad_s for rate in motion.body_rate)
    speeds = (speed / most for speed in motion.rotor_speed)
    return (*_missing(params, state), *rates, *speeds)


def _judge(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> Judged:
    x, y, z = _missing(params, state)
    reward = 1.0 - (jnp.abs(x) + jnp.abs(y) + jnp.abs(z)) / 3
    down = state.now.motion.position[2] <= params.ground_up_m
    return Judged(reward, down, state.task)


RATES = Task(
    "rotor_speeds", (0.0, 0.0, 60.0), 2.0, None, _start, _aim, _observe, _judge
)
