"""The parts of a task: start, target, observations and reward."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.episode import Action, Aim, EnvironmentParams, EnvironmentState
from jblast.missions.guidance import SetPoint
from jblast.vehicle import State
from jblast.vehicle.state import (
    Number,
    StateComponents,
    Vector,
    components,
    dot,
    rotation,
)

Seen = tuple[Number, ...]


class Judged(NamedTuple):
    """What a step earned.

    Attributes:
        reward: Of the step.
        terminated: Whether the episode is over by itself.
        task: Memory of the task afterwards.
    """

    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    task: PyTree[Array]


class Task(NamedTuple):
    """A task, as functions without memory of their own.

    Attributes:
        command: Its mode of command where nothing is said.
        target_m: Where it is flown.
        episode_s: How long an episode lasts.
        actions: Numbers of an action; None: as many as the mode of command has.
        start: Of a key and the params: motion and memory at the start.
        aim: Of params and state: where to be in this step, and its memory afterwards.
        observe: Of params and state: what it shows beside the motion.
        judge: Of params, the state after the step, the action and the aim.
    """

    command: str
    target_m: tuple[float, float, float]
    episode_s: float
    actions: int | None
    start: Callable[
        [PRNGKeyArray, EnvironmentParams], tuple[StateComponents, PyTree[Array]]
    ]
    aim: Callable[[EnvironmentParams, EnvironmentState], tuple[Aim, PyTree[Array]]]
    observe: Callable[[EnvironmentParams, EnvironmentState], Seen]
    judge: Callable[[EnvironmentParams, EnvironmentState, Action, Aim], Judged]


def at_rest(
    params: EnvironmentParams, place: Float[Array, "3"], *, stands: bool = False
) -> StateComponents:
    """Return a level vehicle at rest, whose rotors carry its weight, or stand.

    Args:
        params: Of the environment; the vehicle is as it is known.
        place: Where.
        stands: Whether its rotors stand.
    """
    vehicle = params.vehicle
    weight = vehicle.mass_kg * FLIGHT_GRAVITY / 4
    speed = jnp.sqrt(weight / vehicle.thrust_coefficient)
    still = jnp.zeros_like(place)
    level = jnp.asarray([0.0, 0.0, 0.0, 1.0], place.dtype)
    speeds = jnp.broadcast_to(0 * speed if stands else speed, (4,))
    return components(State(place, still, level, still, speeds))


def at_target(params: EnvironmentParams) -> Aim:
    """Return the aim of a vehicle that hovers at the target."""
    still = jnp.zeros_like(params.target_m)
    return Aim(SetPoint(params.target_m, still, still), jnp.zeros_like(params.step_s))


def attitude_and_rates(motion: StateComponents) -> Seen:
    """Return the matrix, body to world, row by row, and the body's rates [rad/s]."""
    x, y, z = rotation(motion.quaternion)
    return (*x, *y, *z, *motion.body_rate)


def error_from(motion: StateComponents, aim: Aim) -> tuple[Vector, Vector]:
    """Return how far a vehicle is from its aim [m], and how fast [m/s]."""
    place, speed = aim.point.position_m, aim.point.velocity_m_s
    x, y, z = (a - b for a, b in zip(motion.position, place, strict=True))
    u, v, w = (a - b for a, b in zip(motion.velocity, speed, strict=True))
    return (x, y, z), (u, v, w)


def distance(motion: StateComponents, aim: Aim) -> Float[Array, ""]:
    """Return how far a vehicle is from its aim [m], with a slope of 0 there."""
    return length(error_from(motion, aim)[0])


def length(vector: Vector) -> Float[Array, ""]:
    """Return the length of a vector, with a slope of 0 at 0."""
    square = dot(vector, vector)
    some = square > 0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)
