r"""The tasks of environments: start, aim, observations and error of each, by name.

The reward of a step is $e^{-E/s}$ with the task's error $E$ and the scale $s$ of the
disturbance: 1 without an error, 1/e at the scale, and never negative, so that an early
end of an episode never pays.

The axes of the world are east, north, up; those of the body ahead, left, up.

**Hover**: hold a position through blasts. Observations: position and velocity relative
to the target (3, 3), attitude as a matrix (9), body rates (3). Error: distance from the
target [m]. An episode ends if the vehicle is farther away than `far_m`, or on the
ground.

**Rates**: follow requested body rates, the task of GymFC. An episode draws body rates,
uniform within `rate_rad_s` about each axis; the position is free. Observations:
requested less actual rates (3), actual rates (3), both over `rate_rad_s`, and rotor
speeds over the maximum (4). Error: mean of the absolute errors about the three axes
[rad/s].

**Mission**: follow the set point of a plan's legs (`jblast.missions`). An episode
begins on the ground at home, armed. Observations: those of Hover relative to the set
point, and the vector from the set point to the leg's goal (3). Error: distance from the
set point [m]. An episode ends where the vehicle is farther off than `far_m`, or has
landed at the mission's end.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.episode import (
    GROUND_UP_M,
    Aim,
    EnvironmentParams,
    EnvironmentState,
)
from jblast.missions import Guidance, Limits, grid_plan, mission_of
from jblast.missions.guidance import ENDED, FLYING, SetPoint
from jblast.scene import Place
from jblast.vehicle import State
from jblast.vehicle.state import (
    Number,
    StateComponents,
    Vector,
    dot,
    joined,
    root,
    rotation,
    three,
)

Seen = tuple[Number, ...]
Started = tuple[State, PyTree[Array]]


class Task(NamedTuple):
    """A task as pure functions.

    Attributes:
        command: Default mode of command.
        target_m: Target: east, north, up.
        episode_s: Duration of an episode.
        scale: Error at which the reward of a step is 1/e [m or rad/s].
        start: Function of key and params: initial state and task state.
        aim: Function of params and state: target in this step and next task state.
        observe: Function of params, state and its target: observations.
        judge: Function of params, state after the step and its target: error, and
            whether the task has ended the episode.
    """

    command: str
    target_m: tuple[float, float, float]
    episode_s: float
    scale: float
    start: Callable[[PRNGKeyArray, EnvironmentParams], Started]
    aim: Callable[[EnvironmentParams, EnvironmentState], tuple[Aim, PyTree[Array]]]
    observe: Callable[[EnvironmentParams, EnvironmentState, Aim], Seen]
    judge: Callable[[EnvironmentParams, EnvironmentState, Aim], tuple[Array, Array]]


def _start_hover(key: PRNGKeyArray, params: EnvironmentParams) -> Started:
    dtype = params.target_m.dtype
    off = jax.random.uniform(key, (3,), dtype, -1.0, 1.0)
    return _at_rest(params, params.target_m + params.spread_m * off), ()


def _observe_motion(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> Seen:
    motion = state.now.motion
    x, y, z = rotation(motion.quaternion)
    speed = _minus(motion.velocity, aim.point.velocity_m_s)
    return (*_away(motion, aim), *speed, *x, *y, *z, *motion.body_rate)


def _judge_hover(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> tuple[Array, Array]:
    off, down = distance(state.now.motion, aim), _down(state)
    return off, (off > params.far_m) | down


def _down(state: EnvironmentState) -> Array:
    return state.now.motion.position[2] <= GROUND_UP_M


def _start_rates(key: PRNGKeyArray, params: EnvironmentParams) -> Started:
    dtype = params.target_m.dtype
    # Requested rates lie within the bounds of commanded ones.
    wanted = params.rate_rad_s * jax.random.uniform(key, (3,), dtype, -1.0, 1.0)
    return _at_rest(params, params.target_m), three(wanted)


def _observe_rates(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> Seen:
    motion, most = state.now.motion, params.vehicle.rotor_speed_max_rad_s
    errors = _minus(state.task, motion.body_rate)
    rates = (rate / params.rate_rad_s for rate in (*errors, *motion.body_rate))
    return (*rates, *(speed / most for speed in motion.rotor_speed))


def _judge_rates(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> tuple[Array, Array]:
    x, y, z = map(jnp.abs, _minus(state.task, state.now.motion.body_rate))
    return (x + y + z) / 3, _down(state)


def default_guidance() -> Guidance:
    """Return the guidance of a small flight: two lanes of 12 m, 6 m up, and back."""
    home = Place(0.0, 0.0, 0.0)
    plan = grid_plan(home, width_m=12.0, depth_m=6.0, spacing_m=6.0, up_m=6.0)
    return mission_of(plan, limits=Limits(return_m=6.0)).guidance


def _guidance(params: EnvironmentParams) -> Guidance:
    guidance = params.guidance
    assert guidance is not None, "checked by environment_params"
    return guidance


def _start_mission(key: PRNGKeyArray, params: EnvironmentParams) -> Started:
    guidance = _guidance(params)
    begun = guidance.start()
    # Calibration and idling are skipped: an agent has nothing to learn in them.
    begun = begun._replace(phase=begun.phase + FLYING)
    return _at_rest(params, guidance.legs.start_m[0], stands=True), begun


def _aim_mission(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    motion = joined(state.now.motion)
    point, after = _guidance(params)(motion, state.task, params.step_s)
    return Aim(point, state.task.yaw_rad), after


def _observe_mission(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> Seen:
    goal = _guidance(params).legs.goal_m[state.task.leg] - aim.point.position_m
    return (*_observe_motion(params, state, aim), *goal)


def _judge_mission(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> tuple[Array, Array]:
    off = distance(state.now.motion, aim)
    return off, (off > params.far_m) | (state.task.phase == ENDED)


def _at_target(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    """Return the aim of a vehicle at the target, and the unchanged task state."""
    still = jnp.zeros_like(params.target_m)
    point = SetPoint(params.target_m, still, still)
    return Aim(point, jnp.zeros_like(params.step_s)), state.task


def _at_rest(
    params: EnvironmentParams, place: Float[Array, "3"], *, stands: bool = False
) -> State:
    """Return a level vehicle at rest, with rotors at hover speed or at rest."""
    vehicle = params.vehicle
    weight = vehicle.mass_kg * FLIGHT_GRAVITY / 4
    speed = jnp.sqrt(weight / vehicle.thrust_coefficient)
    still = jnp.zeros_like(place)
    level = jnp.asarray([0.0, 0.0, 0.0, 1.0], place.dtype)
    speeds = jnp.broadcast_to(0 * speed if stands else speed, (4,))
    return State(place, still, level, still, speeds)


def _minus(vector: Vector, other: Vector | Float[Array, "3"]) -> Vector:
    x, y, z = (a - b for a, b in zip(vector, other, strict=True))
    return x, y, z


def _away(motion: StateComponents, aim: Aim) -> Vector:
    """Return the position of a vehicle relative to its aim [m]."""
    return _minus(motion.position, aim.point.position_m)


def distance(motion: StateComponents, aim: Aim) -> Float[Array, ""]:
    """Return the distance of a vehicle from its aim [m], with a gradient of 0 at 0."""
    away = _away(motion, aim)
    return root(dot(away, away))


TASKS: dict[str, Task] = {
    "Hover": Task(
        "thrust_rates",
        (0.0, 0.0, 10.0),
        10.0,
        0.2,
        _start_hover,
        _at_target,
        _observe_motion,
        _judge_hover,
    ),
    "Rates": Task(
        "rotor_speeds",
        (0.0, 0.0, 60.0),
        2.0,
        1.0,
        _start_rates,
        _at_target,
        _observe_rates,
        _judge_rates,
    ),
    "Mission": Task(
        "hold",
        (0.0, 0.0, 0.0),
        60.0,
        0.2,
        _start_mission,
        _aim_mission,
        _observe_mission,
        _judge_mission,
    ),
}
"""Tasks by name."""
