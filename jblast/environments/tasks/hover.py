"""Hover: hold a position through blasts.

Observations: position and velocity relative to the target (3, 3), attitude as a matrix
(9), body rates (3). Reward of a step: $1 - |e|$ with the distance $e$ in metres, less
0.02 times the body rate in rad/s. An episode ends where the vehicle is farther off than
`far_m`, or on the ground.
"""

import jax
from jaxtyping import Array, PRNGKeyArray, PyTree

from jblast.environments.episode import Action, Aim, EnvironmentParams, EnvironmentState
from jblast.environments.tasks.task import (
    Judged,
    Seen,
    Task,
    at_rest,
    at_target,
    attitude_and_rates,
    distance,
    error_from,
    length,
)
from jblast.vehicle.state import StateComponents

TURNING = 0.02
"""What a body rate of 1 rad/s costs a step; declared."""


def _start(
    key: PRNGKeyArray, params: EnvironmentParams
) -> tuple[StateComponents, PyTree[Array]]:
    dtype = params.target_m.dtype
    off = jax.random.uniform(key, (3,), dtype, -1.0, 1.0)
    return at_rest(params, params.target_m + params.spread_m * off), ()


def _aim(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    return at_target(params), ()


def _observe(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    motion = state.now.motion
    place, speed = error_from(motion, at_target(params))
    return (*place, *speed, *attitude_and_rates(motion))


def _judge(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> Judged:
    motion = state.now.motion
    off = distance(motion, aim)
    reward = 1.0 - off - TURNING * length(motion.body_rate)
    down = motion.position[2] <= params.ground_up_m
    return Judged(reward, (off > params.far_m) | down, ())


HOVER = Task(
    "thrust_rates", (0.0, 0.0, 10.0), 10.0, None, _start, _aim, _observe, _judge
)
