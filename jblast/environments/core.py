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
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree

from jblast.environments.episode import (
    COMMANDS,
    Action,
    EnvironmentParams,
    EnvironmentState,
    Randomisation,
    commanded,
    default_world,
    draw_episode,
    load_of,
    may_push,
    simulator_of,
    vehicle_in,
    window_of,
)
from jblast.environments.tasks import TASKS, distance
from jblast.errors import InputError, nearest
from jblast.missions import Guidance
from jblast.scene import Air, ByCount, Uniform, WorldSpec
from jblast.scene.uncertain import Prior
from jblast.vehicle import named, named_gains, step_limit
from jblast.vehicle.controllers import gains_controller
from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.loads.load import pulse_wrench
from jblast.vehicle.quadrotor import in_precision
from jblast.vehicle.rollout import FlightState, tick_of
from jblast.world import Blasts

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
    spread_m: float = 0.0,
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
        world: Distribution of the blasts, with a fixed number; None: two of 5 to 15
            kg at 12 to 40 m.
        air: Ambient air.
        randomisation: Other random parameters of episodes; None: none.
        guidance: Guidance of the mission, for the task "Mission" only.
        controller: Name in `vehicle.CONTROLLERS` with the loops of the SE(3)
            controller, for the commands "velocity" and "hold".
        target_m: Hover target: east, north, up; None: the task's default.
        spread_m: Maximum initial distance from the target along each axis.
        far_m: Distance from the target at which an episode ends.
        rate_rad_s: Maximum commanded body rate.
        speed_m_s: Maximum commanded velocity.
        reach_m: Maximum displacement of the target by a command.
        episode_s: Duration of an episode; None: the task's default.
        step_s: Step of environment and integrator.

    Raises:
        InputError: A name is unknown, a number is out of range, a mission has no
            guidance, or the number of blasts is random.
    """
    for what, name, known in (
        ("task", task, TASKS),
        ("command", command or TASKS.get(task, TASKS["Hover"]).command, COMMANDS),
    ):
        if name not in known:
            raise InputError(
                f"{what} {name!r}: expected {', '.join(known)}{nearest(name, known)}"
            )
    kind = TASKS[task]
    command = command or kind.command
    if (guidance is None) == (task == "Mission"):
        raise InputError(
            "guidance: expected a guidance for the task Mission and none for others, "
            f"got {'none' if guidance is None else 'one'} for {task}"
        )
    world = default_world() if world is None else world
    if not isinstance(world.occurrence, ByCount) or world.occurrence.count < 1:
        raise InputError(
            "world occurrence: expected ByCount of 1 or more (all lanes have the same "
            f"number of blasts), got {world.occurrence}"
        )
    flies = named(vehicle)
    gains = named_gains(vehicle, integral=True)
    episode_s = kind.episode_s if episode_s is None else episode_s
    for name, value in (
        ("step_s", step_s),
        ("episode_s", episode_s),
        ("far_m", far_m),
        ("rate_rad_s", rate_rad_s),
        ("speed_m_s", speed_m_s),
    ):
        if not value > 0:
            raise InputError(f"{name}: expected a positive number, got {value:g}")
    limit = step_limit(float(flies.motor_lag_s), gains, 1)
    if step_s > limit:
        raise InputError(
            f"step_s: expected at most {limit:.4g} s, the stability limit of the "
            f"position controller with {vehicle}, got {step_s:g} s"
        )
    randomisation = Randomisation() if randomisation is None else randomisation
    target = jnp.asarray(kind.target_m if target_m is None else target_m, float)
    found = EnvironmentParams(
        vehicle=flies,
        hold=gains_controller(controller)(target, gains, 0.0),
        world=world,
        air=Air() if air is None else air,
        randomisation=randomisation,
        guidance=guidance,
        target_m=target,
        spread_m=spread_m,
        far_m=far_m,
        rate_rad_s=rate_rad_s,
        speed_m_s=speed_m_s,
        reach_m=reach_m,
        ground_up_m=0.0,
        step_s=step_s,
        episode_steps=round(episode_s / step_s),
        task=task,
        command=command,
        most_delay=_max_delay(randomisation.delay_s, step_s),
    )
    # One precision in the whole PyTree: a float64 leaf would promote float32 lanes.
    return in_precision(found, jnp.result_type(float))


class Step(NamedTuple):
    """Result of a step, in Gymnasium's order.

    Attributes:
        state: State after the step.
        observation: Observation of that state.
        reward: Reward of the step.
        terminated: True if the task, a NaN or an infinity ended the episode.
        truncated: True if its time is over.
        info: `bad_action` (the action was NaN or infinite, which ends the episode),
            `diverged`, `deviation_m` from the target and `peak_deviation_m` of the
            episode.
    """

    state: EnvironmentState
    observation: Float[Array, " seen"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    info: dict[str, Any]


def actions_of(params: EnvironmentParams) -> int:
    """Return the length of an action."""
    return COMMANDS[params.command]


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
    key: PRNGKeyArray, number: Array, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, " seen"]]:
    """Begin any episode of a lane."""
    # An episode has the key of its lane and number, so that it does not depend on the
    # number of lanes, nor on the length of earlier episodes.
    own = jax.random.fold_in(key, number)
    episode = draw_episode(own, params)
    motion, task = TASKS[params.task].start(jax.random.fold_in(own, 2**31), params)
    zero = jnp.zeros_like(params.step_s)
    none = (zero, zero, zero)
    # Only float32 has the compensated sums that `excess` carries.
    single = zero.dtype == jnp.float32
    now = FlightState(
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
        farthest_m=zero,
        ended=jnp.zeros((), bool),
        key=key,
        number=number,
    )
    return state, jnp.stack(TASKS[params.task].observe(params, state))


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
    zero = jnp.zeros_like(params.step_s)

    def add(total: Wrench, row: tuple[Array, Blasts]) -> tuple[Wrench, None]:
        pushes, blast = row
        # A branch: most steps have no blast, and a load costs more than the step
        # itself.
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
    """Return whether each blast may act on a lane in its next step."""
    tick, place = tick_of(state.steps, params.step_s), state.now.motion.position
    x, y, z = (a - b for a, b in zip(place, state.start_m, strict=True))
    # No gradient is taken of this distance: it only selects blasts, so that the root at
    # zero is harmless.
    off = jnp.sqrt(x * x + y * y + z * z)
    return may_push(state.windows, off, tick.start, tick.start + tick.length)


def pushed_by(
    state: EnvironmentState, blast: Blasts, params: EnvironmentParams
) -> Wrench:
    """Return mean force and moment of a blast on a lane in its next step.

    Args:
        state: State of the lane.
        blast: One blast of its episode.
        params: Parameters of the environment.
    """
    tick = tick_of(state.steps, params.step_s)
    wrench, _ = pulse_wrench(
        [load_of(params, state.episode.wind_m_s, blast)],
        tick.start,
        tick.length,
        state.now.motion,
        vehicle_in(params, state.episode),
        # No inactive interval is stored between steps: `in_blast` has tested this one.
        (jnp.full_like(tick.start, -jnp.inf),),
        None,
    )
    return wrench


class Moved(NamedTuple):
    """Parts of the state that change in a step, and its results, as scalars.

    Attributes:
        now: Vehicle, command and controller state after the step.
        steps: Number of steps in this episode.
        queue: Pending actions.
        task: State of the task.
        farthest_m: Maximum distance from the target so far.
        ended: True if the episode has ended.
        seen: Numbers of the observation.
        reward: Reward of the step; 0 for a diverged lane.
        terminated: True if the task, a NaN or an infinity ended the episode.
        truncated: True if its time is over.
        info: `bad_action`, `diverged`, `deviation_m`, `peak_deviation_m`.
    """

    now: FlightState
    steps: Array
    queue: tuple[Action, ...]
    task: PyTree[Array]
    farthest_m: Array
    ended: Array
    seen: tuple[Array, ...]
    reward: Array
    terminated: Array
    truncated: Array
    info: dict[str, Array]


def step_of(state: EnvironmentState, found: Moved) -> Step:
    """Return the result of a step, with the unchanged parts of the state.

    Args:
        state: State before the step, of one lane or of many.
        found: Changed parts.
    """
    after = state._replace(
        now=found.now,
        steps=found.steps,
        queue=found.queue,
        task=found.task,
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


def moved(
    state: EnvironmentState,
    action: Action,
    params: EnvironmentParams,
    wrench: Wrench,
) -> Moved:
    """Take a step with given force and moment of the blasts.

    Args:
        state: State before the step.
        action: Numbers of the action.
        params: Parameters of the environment.
        wrench: Mean force and moment of the blasts over the step.
    """
    task = TASKS[params.task]
    # Component by component: a stack of an action would be an array per lane.
    bad = ~reduce(jnp.logical_and, map(jnp.isfinite, action))
    dtype = params.step_s.dtype
    clipped: Action = tuple(
        jnp.clip(jnp.where(bad, 0.0, part.astype(dtype)), -1.0, 1.0) for part in action
    )
    queue = (clipped, *state.queue)
    late = _delayed(queue, state.episode.delay_steps)
    aim, memory = task.aim(params, state)
    command, integral = commanded(params, state, late, aim)
    now = state.now._replace(
        command=command,
        memory=integral,
        impulse_wrench=wrench,
    )
    simulator = simulator_of(params, state.episode)
    now = simulator.moved(now, tick_of(state.steps, params.step_s))
    off = distance(now.motion, aim)
    after = state._replace(
        now=now,
        steps=state.steps + 1,
        queue=queue[: params.most_delay],
        task=memory,
        farthest_m=jnp.maximum(state.farthest_m, off),
    )
    judged = task.judge(params, after, aim)
    diverged = ~jnp.isfinite(sum(jax.tree.leaves(now.motion)))
    lost = bad | diverged
    terminated = judged.terminated | lost
    # Gymnasium distinguishes an end by the task from one by time, for bootstrapping.
    truncated = (after.steps >= params.episode_steps) & ~terminated
    after = after._replace(task=judged.task, ended=terminated | truncated)
    return Moved(
        now=after.now,
        steps=after.steps,
        queue=after.queue,
        task=after.task,
        farthest_m=after.farthest_m,
        ended=after.ended,
        seen=task.observe(params, after),
        # A NaN reward would spoil the mean over a batch.
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
    # The negation also rejects NaN; an infinite bound fails the comparison.
    if not (low >= 0 and high / step_s < MAX_DELAY + 0.5):
        raise InputError(
            f"delay_s: expected 0 to {MAX_DELAY * step_s:g} s, {MAX_DELAY} steps, "
            f"got {low:g} to {high:g} s"
        )
    return round(high / step_s)
