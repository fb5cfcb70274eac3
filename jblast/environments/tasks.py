r"""The tasks of environments: start, aim, observations and reward of each, by name.

**Hover**: hold a position through blasts. Observations: position and velocity relative
to the target (3, 3), attitude as a matrix (9), body rates (3). Reward of a step: $1 -
|e|$ with the distance $e$ in metres, less 0.02 times the body rate in rad/s. An episode
ends if the vehicle is farther away than `far_m`, or on the ground.

**Rates**: follow requested body rates, the task of GymFC. An episode draws body rates,
uniform within `rate_rad_s` about each axis; the position is free. Observations:
requested less actual rates (3), actual rates (3), both over `rate_rad_s`, and rotor
speeds over the maximum (4). Reward of a step: 1 less the mean of the absolute errors
over `rate_rad_s`.

**Mission**: follow the set point of a plan's legs (`jblast.missions`). An episode
begins on the ground at home, armed. Observations: position and velocity relative to the
set point (3, 3), attitude (9), body rates (3), and the vector from the set point to the
leg's goal (3). Reward of a step: $1 - |e|$. An episode ends where the vehicle is
farther off than `far_m`, or has landed at the mission's end.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.episode import (
    Aim,
    EnvironmentParams,
    EnvironmentState,
)
from jblast.missions import Guidance, Limits, Progress, grid_plan, mission_of
from jblast.missions.guidance import ENDED, FLYING, SetPoint
from jblast.scene import Place
from jblast.vehicle import State
from jblast.vehicle.state import (
    Number,
    StateComponents,
    Vector,
    components,
    dot,
    joined,
    rotation,
    three,
)

BODY_RATE_COST = 0.02
"""Cost of a body rate of 1 rad/s in a step; declared: small against the distance."""
Seen = tuple[Number, ...]
Started = tuple[StateComponents, PyTree[Array]]


class Judged(NamedTuple):
    """Result of a step.

    Attributes:
        reward: Reward of the step.
        terminated: True if the task has ended the episode.
        task: State of the task after the step.
    """

    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    task: PyTree[Array]


class Task(NamedTuple):
    """A task as pure functions.

    Attributes:
        command: Default mode of command.
        target_m: Target: east, north, up.
        episode_s: Duration of an episode.
        start: Function of key and params: initial motion and task state.
        aim: Function of params and state: target in this step and next task state.
        observe: Function of params and state: observations.
        judge: Function of params, state after the step and target.
    """

    command: str
    target_m: tuple[float, float, float]
    episode_s: float
    start: Callable[[PRNGKeyArray, EnvironmentParams], Started]
    aim: Callable[[EnvironmentParams, EnvironmentState], tuple[Aim, PyTree[Array]]]
    observe: Callable[[EnvironmentParams, EnvironmentState], Seen]
    judge: Callable[[EnvironmentParams, EnvironmentState, Aim], Judged]


def _start_hover(key: PRNGKeyArray, params: EnvironmentParams) -> Started:
    dtype = params.target_m.dtype
    off = jax.random.uniform(key, (3,), dtype, -1.0, 1.0)
    return _at_rest(params, params.target_m + params.spread_m * off), ()


def _observe_hover(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    motion = state.now.motion
    place, speed = _error_from(motion, _at_target(params, state)[0])
    return (*place, *speed, *_attitude_and_rates(motion))


def _judge_hover(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> Judged:
    motion = state.now.motion
    off = distance(motion, aim)
    reward = 1.0 - off - BODY_RATE_COST * _length(motion.body_rate)
    down = motion.position[2] <= params.ground_up_m
    return Judged(reward, (off > params.far_m) | down, ())


def _start_rates(key: PRNGKeyArray, params: EnvironmentParams) -> Started:
    dtype = params.target_m.dtype
    # Requested rates lie within the bounds of commanded ones.
    wanted = params.rate_rad_s * jax.random.uniform(key, (3,), dtype, -1.0, 1.0)
    return _at_rest(params, params.target_m), three(wanted)


def _rate_errors(params: EnvironmentParams, state: EnvironmentState) -> Vector:
    x, y, z = (
        (requested - actual) / params.rate_rad_s
        for requested, actual in zip(
            state.task, state.now.motion.body_rate, strict=True
        )
    )
    return x, y, z


def _observe_rates(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    motion, most = state.now.motion, params.vehicle.rotor_speed_max_rad_s
    rates = (rate / params.rate_rad_s for rate in motion.body_rate)
    speeds = (speed / most for speed in motion.rotor_speed)
    return (*_rate_errors(params, state), *rates, *speeds)


def _judge_rates(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> Judged:
    x, y, z = _rate_errors(params, state)
    reward = 1.0 - (jnp.abs(x) + jnp.abs(y) + jnp.abs(z)) / 3
    down = state.now.motion.position[2] <= params.ground_up_m
    return Judged(reward, down, state.task)


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
    progress: Progress = state.task
    point, after = _guidance(params)(joined(state.now.motion), progress, params.step_s)
    return Aim(point, progress.yaw_rad), after


def _observe_mission(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    # The set point of the next step: it depends on the state after this one.
    aim, motion = _aim_mission(params, state)[0], state.now.motion
    place, speed = _error_from(motion, aim)
    goal = _guidance(params).legs.goal_m[state.task.leg] - aim.point.position_m
    return (*place, *speed, *_attitude_and_rates(motion), *goal)


def _judge_mission(
    params: EnvironmentParams, state: EnvironmentState, aim: Aim
) -> Judged:
    off = distance(state.now.motion, aim)
    over = (off > params.far_m) | (state.task.phase == ENDED)
    return Judged(1.0 - off, over, state.task)


def _at_target(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    """Return the aim of a vehicle at the target, and the unchanged task state."""
    still = jnp.zeros_like(params.target_m)
    point = SetPoint(params.target_m, still, still)
    return Aim(point, jnp.zeros_like(params.step_s)), state.task


def _at_rest(
    params: EnvironmentParams, place: Float[Array, "3"], *, stands: bool = False
) -> StateComponents:
    """Return a level vehicle at rest, with rotors at hover speed or at rest."""
    vehicle = params.vehicle
    weight = vehicle.mass_kg * FLIGHT_GRAVITY / 4
    speed = jnp.sqrt(weight / vehicle.thrust_coefficient)
    still = jnp.zeros_like(place)
    level = jnp.asarray([0.0, 0.0, 0.0, 1.0], place.dtype)
    speeds = jnp.broadcast_to(0 * speed if stands else speed, (4,))
    return components(State(place, still, level, still, speeds))


def _attitude_and_rates(motion: StateComponents) -> Seen:
    """Return the attitude matrix by rows (body to world) and body rates [rad/s]."""
    x, y, z = rotation(motion.quaternion)
    return (*x, *y, *z, *motion.body_rate)


def _error_from(motion: StateComponents, aim: Aim) -> tuple[Vector, Vector]:
    """Return the position and velocity of a vehicle relative to its aim [m, m/s]."""
    place, speed = aim.point.position_m, aim.point.velocity_m_s
    x, y, z = (a - b for a, b in zip(motion.position, place, strict=True))
    u, v, w = (a - b for a, b in zip(motion.velocity, speed, strict=True))
    return (x, y, z), (u, v, w)


def distance(motion: StateComponents, aim: Aim) -> Float[Array, ""]:
    """Return the distance of a vehicle from its aim [m], with a gradient of 0 at 0."""
    return _length(_error_from(motion, aim)[0])


def _length(vector: Vector) -> Float[Array, ""]:
    """Return the length of a vector, with a gradient of 0 at 0."""
    square = dot(vector, vector)
    some = square > 0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


TASKS: dict[str, Task] = {
    "Hover": Task(
        "thrust_rates",
        (0.0, 0.0, 10.0),
        10.0,
        _start_hover,
        _at_target,
        _observe_hover,
        _judge_hover,
    ),
    "Rates": Task(
        "rotor_speeds",
        (0.0, 0.0, 60.0),
        2.0,
        _start_rates,
        _at_target,
        _observe_rates,
        _judge_rates,
    ),
    "Mission": Task(
        "hold",
        (0.0, 0.0, 0.0),
        60.0,
        _start_mission,
        _aim_mission,
        _observe_mission,
        _judge_mission,
    ),
}
"""Tasks by name."""
