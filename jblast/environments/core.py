"""Environment: parameters, reset and step of a lane, for jit, vmap and grad.

A step converts the action to a command, adds the load of blasts within the step, and
advances the vehicle with the step of flights (`vehicle/rollout`), so the physics is the
same. Lanes are independent.

The state consists of scalars: in a batch each is an array with the axis of lanes only.
"""

from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from jblast.environments.episode import (
    COMMANDS,
    Action,
    EnvironmentParams,
    EnvironmentState,
    Randomisation,
    commanded,
    default_world,
    draw_episode,
    episode_key,
    simulator_of,
)
from jblast.environments.tasks import TASKS, default_guidance, distance
from jblast.errors import InputError, nearest, require
from jblast.missions import Guidance
from jblast.scene import Air, ByCount, Uniform, WorldSpec
from jblast.scene.uncertain import Prior
from jblast.vehicle import named, named_gains, step_limit
from jblast.vehicle.controllers import gains_controller
from jblast.vehicle.quadrotor import in_precision
from jblast.vehicle.rollout import tick_of

STEP_S = 0.01
"""Default step; declared: 100 actions per second."""
MAX_DELAY = 10
"""Maximum delay of an action in steps; declared, bounds the queue in the state."""


def environment_params(
    task: str = "Hover",
    *,
    vehicle: str = "iris",
    command: str | None = None,
    world: WorldSpec | None = None,
    air: Air | None = None,
    randomisation: Randomisation | None = None,
    guidance: Guidance | None = None,
    controller: str = "with_integral",
    target_m: tuple[float, float, float] | None = None,
    scale: float | None = None,
    spread_m: float = 0.5,
    far_m: float = 8.0,
    rate_rad_s: float = 6.0,
    speed_m_s: float = 5.0,
    reach_m: float = 2.0,
    episode_s: float | None = None,
    step_s: float = STEP_S,
) -> EnvironmentParams:
    """Return the common parameters of an environment's lanes.

    Args:
        task: "Hover", "Rates" or "Mission".
        vehicle: Name of the vehicle.
        command: Meaning of an action, a name of `COMMANDS`; None: the task's default.
        world: Distribution of the blasts, with a fixed number; None: three of 10 to 40
            kg, 5 to 15 m from the target along the ground.
        air: Ambient air.
        randomisation: Other random parameters of episodes; None: none.
        guidance: Guidance of the mission, for the task "Mission" only; None: that of
            `default_guidance`.
        controller: Name in `vehicle.CONTROLLERS` with the loops of the SE(3)
            controller, for the commands "velocity" and "hold".
        target_m: Hover target: east, north, up; None: the task's default.
        scale: Error at which the reward of a step is 1/e, in the task's unit (m or
            rad/s); None: the task's default.
        spread_m: Maximum initial distance from the hover target along each axis.
        far_m: Distance from the target at which an episode ends.
        rate_rad_s: Maximum commanded body rate.
        speed_m_s: Maximum commanded velocity.
        reach_m: Maximum displacement of the target by a command.
        episode_s: Duration of an episode; None: the task's default.
        step_s: Step of environment and integrator.

    Raises:
        InputError: A name is unknown, a number is out of range, a task other than
            "Mission" has a guidance, or the number of blasts is random.
    """
    for what, name, known in (
        ("task", task, TASKS),
        ("command", command or TASKS.get(task, TASKS["Hover"]).command, COMMANDS),
    ):
        words = f"{', '.join(known)}{nearest(name, known)}"
        require(name in known, f"{what} {name!r}", words)
    kind = TASKS[task]
    command = command or kind.command
    if task == "Mission":
        guidance = default_guidance() if guidance is None else guidance
    else:
        none = guidance is None
        require(none, "guidance", "none but for Mission", f"one for {task}")
    world = default_world() if world is None else world
    fixed = isinstance(world.occurrence, ByCount) and world.occurrence.count > 0
    words = "ByCount of 1 or more (all lanes have the same number of blasts)"
    require(fixed, "world occurrence", words, f"{world.occurrence}")
    flies = named(vehicle)
    gains = named_gains(vehicle, integral=True)
    gains_controller(controller)  # an unknown one is an error here
    numbers = {
        "scale": kind.scale if scale is None else scale,
        "far_m": far_m,
        "rate_rad_s": rate_rad_s,
        "speed_m_s": speed_m_s,
        "reach_m": reach_m,
        "step_s": step_s,
    }
    episode_s = kind.episode_s if episode_s is None else episode_s
    for name, value in {**numbers, "episode_s": episode_s}.items():
        require(value > 0, name, "a positive number", f"{value:g}")
    limit = step_limit(float(flies.motor_lag_s), gains, 1)
    words = f"at most {limit:.4g} s, the stability limit of the position controller "
    require(step_s <= limit, "step_s", f"{words}with {vehicle}", f"{step_s:g} s")
    randomisation = Randomisation() if randomisation is None else randomisation
    target = jnp.asarray(kind.target_m if target_m is None else target_m, float)
    found = EnvironmentParams(
        vehicle=flies,
        gains=gains,
        world=world,
        air=Air() if air is None else air,
        randomisation=randomisation,
        guidance=guidance,
        target_m=target,
        spread_m=spread_m,
        episode_steps=round(episode_s / step_s),
        task=task,
        command=command,
        controller=controller,
        most_delay=_max_delay(randomisation.delay_s, step_s),
        **numbers,
    )
    # One precision in the whole PyTree: a float64 leaf would promote float32 lanes.
    return in_precision(found, jnp.result_type(float))


class Step(NamedTuple):
    """Result of a step, in Gymnasium's order.

    Attributes:
        state: State after the step.
        observation: Observation of that state; a tuple of its numbers in `moved`.
        reward: Reward of the step.
        terminated: True if the task, a NaN or an infinity ended the episode.
        truncated: True if its time is over.
        info: `bad_action` (the action was NaN or infinite, which ends the episode),
            `diverged`, `deviation_m` from the target and `peak_deviation_m` of the
            episode.
    """

    state: EnvironmentState
    observation: Any
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    info: dict[str, Any]


def reset(
    key: PRNGKeyArray, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, " seen"]]:
    """Begin the first episode of a lane.

    Args:
        key: Key of the lane; `fold_in(key(seed), lane)` in a batch.
        params: Parameters of the environment.
    """
    return begin(key, jnp.zeros((), jnp.int32), params)


def begin(
    lane: PRNGKeyArray, number: Array, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, " seen"]]:
    """Begin any episode of a lane."""
    kind = TASKS[params.task]
    key = jax.random.fold_in(episode_key(lane, number), 2**31)
    start, task = kind.start(key, params)
    episode = draw_episode(lane, number, start.position_m, params)
    now = simulator_of(params, episode).start(start)
    zero = jnp.zeros_like(params.step_s)
    idle = (zero,) * COMMANDS[params.command]
    state = EnvironmentState(
        episode=episode,
        now=now._replace(memory=(zero, zero, zero)),
        steps=jnp.zeros((), jnp.int32),
        queue=(idle,) * params.most_delay,
        task=task,
        farthest_m=zero,
        ended=jnp.zeros((), bool),
    )
    aim, _ = kind.aim(params, state)
    return state, jnp.stack(kind.observe(params, state, aim))


def step(
    state: EnvironmentState, action: Float[Array, " action"], params: EnvironmentParams
) -> Step:
    """Take a step.

    The caller has to begin another episode after an end, as `step_lanes` does.

    Args:
        state: State before the step.
        action: Numbers within -1 and 1, to which they are clipped; NaN or infinity
            ends the episode.
        params: Parameters of the environment.
    """
    tick = tick_of(state.steps, params.step_s)
    now = simulator_of(params, state.episode).pushed(state.now, tick)
    found = moved(state._replace(now=now), tuple(action), params)
    return found._replace(observation=jnp.stack(found.observation))


def moved(state: EnvironmentState, action: Action, params: EnvironmentParams) -> Step:
    """Take a step with the blasts' force and moment in the state.

    Args:
        state: State before the step, with `now.impulse_wrench` of the step.
        action: Numbers of the action.
        params: Parameters of the environment.

    Returns:
        The step; its observation is a tuple of numbers. A stack would be an array per
        lane.
    """
    task = TASKS[params.task]
    bad = ~reduce(jnp.logical_and, map(jnp.isfinite, action))
    dtype = params.step_s.dtype
    clipped: Action = tuple(
        jnp.clip(jnp.where(bad, 0.0, part.astype(dtype)), -1.0, 1.0) for part in action
    )
    queue = (clipped, *state.queue)
    late = _delayed(queue, state.episode.delay_steps)
    aim, memory = task.aim(params, state)
    command, integral = commanded(params, state, late, aim)
    now = state.now._replace(command=command, memory=integral)
    tick = tick_of(state.steps, params.step_s)
    now = simulator_of(params, state.episode).moved(now, tick)
    off = distance(now.motion, aim)
    after = state._replace(
        now=now,
        steps=state.steps + 1,
        queue=queue[: params.most_delay],
        task=memory,
        farthest_m=jnp.maximum(state.farthest_m, off),
    )
    error, over = task.judge(params, after, aim)
    diverged = ~jnp.isfinite(sum(jax.tree.leaves(now.motion)))
    lost = bad | diverged
    terminated = over | lost
    # Gymnasium distinguishes an end by the task from one by time, for bootstrapping.
    truncated = (after.steps >= params.episode_steps) & ~terminated
    return Step(
        state=after._replace(ended=terminated | truncated),
        # With the aim of the next step, which depends on the state after this one.
        observation=task.observe(params, after, task.aim(params, after)[0]),
        # A NaN reward would spoil the mean over a batch.
        reward=jnp.where(lost, 0.0, jnp.exp(-error / params.scale)),
        terminated=terminated,
        truncated=truncated,
        info={
            "bad_action": bad,
            "diverged": diverged,
            "deviation_m": off,
            "peak_deviation_m": after.farthest_m,
        },
    )


def _delayed(queue: tuple[Action, ...], delay: Array) -> Action:
    """Return the action that takes effect in this step."""
    found = queue[0]
    # Selections instead of an index: the delay differs from lane to lane.
    for steps, earlier in enumerate(queue[1:], start=1):
        found = tuple(
            jnp.where(delay >= steps, old, new)
            for old, new in zip(earlier, found, strict=True)
        )
    return found


def _max_delay(delay: Float[Array, ""] | Prior, step_s: float) -> int:
    """Return the maximum delay of an action in steps.

    Raises:
        InputError: It exceeds `MAX_DELAY`, or the prior has no upper bound.
    """
    if isinstance(delay, Uniform):
        low, high = float(delay.lo), float(delay.hi)
    elif isinstance(delay, Prior):
        raise InputError(f"delay_s: expected a number or a Uniform, got {delay}")
    else:
        low = high = float(delay)
    # NaN and an infinite bound fail the comparisons.
    fits = low >= 0 and high / step_s < MAX_DELAY + 0.5
    words = f"0 to {MAX_DELAY * step_s:g} s, {MAX_DELAY} steps"
    require(fits, "delay_s", words, f"{low:g} to {high:g} s")
    return round(high / step_s)
