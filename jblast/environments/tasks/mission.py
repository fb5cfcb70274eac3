"""Mission: follow the set point of a plan's legs (`jblast.missions`).

An episode begins on the ground at home, armed. Observations: position and velocity
relative to the set point (3, 3), attitude (9), body rates (3), and the vector from the
set point to the leg's goal (3). Reward of a step: $1 - |e|$. An episode ends where the
vehicle is farther off than `far_m`, or has landed at the mission's end.
"""

from jaxtyping import Array, PRNGKeyArray, PyTree

from jblast.environments.episode import Action, Aim, EnvironmentParams, EnvironmentState
from jblast.environments.tasks.task import (
    Judged,
    Seen,
    Task,
    at_rest,
    attitude_and_rates,
    distance,
    error_from,
)
from jblast.missions import Guidance, Limits, Progress, grid_plan, mission_of
from jblast.missions.guidance import ENDED, FLYING
from jblast.scene import Place
from jblast.vehicle.state import StateComponents, joined


def _guidance(params: EnvironmentParams) -> Guidance:
    guidance = params.guidance
    assert guidance is not None, "environment_params gives a mission its guidance"
    return guidance


def _start(
    key: PRNGKeyArray, params: EnvironmentParams
) -> tuple[StateComponents, PyTree[Array]]:
    guidance = _guidance(params)
    begun = guidance.start()
    begun = begun._replace(phase=begun.phase + FLYING)
    return at_rest(params, guidance.legs.start_m[0], stands=True), begun


def _aim(
    params: EnvironmentParams, state: EnvironmentState
) -> tuple[Aim, PyTree[Array]]:
    progress: Progress = state.task
    point, after = _guidance(params)(joined(state.now.motion), progress, params.step_s)
    return Aim(point, progress.yaw_rad), after


def _observe(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    aim, motion = _aim(params, state)[0], state.now.motion
    place, speed = error_from(motion, aim)
    goal = _guidance(params).legs.goal_m[state.task.leg] - aim.point.position_m
    return (*place, *speed, *attitude_and_rates(motion), *goal)


def _judge(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> Judged:
    off = distance(state.now.motion, aim)
    over = (off > params.far_m) | (state.task.phase == ENDED)
    return Judged(1.0 - off, over, state.task)


def default_guidance() -> Guidance:
    """Return the guidance of a small flight: two lanes of 12 m, 6 m up, and back."""
    home = Place(0.0, 0.0, 0.0)
    plan = grid_plan(home, width_m=12.0, depth_m=6.0, spacing_m=6.0, up_m=6.0)
    return mission_of(plan, limits=Limits(return_m=6.0)).guidance


MISSION = Task("hold", (0.0, 0.0, 0.0), 60.0, None, _start, _aim, _observe, _judge)
