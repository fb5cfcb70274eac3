"""An environment: its parameters; reset and step of a lane, for jit, vmap and grad.

A step converts the action to a command, adds the load of blasts within the step, and
moves the vehicle by the step of every flight (`vehicle/rollout`): there is one physics.
A lane that did not end does not depend on the other lanes.

The state consists of separate numbers: in a batch each is an array without other axes.
"""

from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.episode import (
    COMMANDS,
    OF_IMU,
    Action,
    EnvironmentParams,
    EnvironmentState,
    Imu,
    Randomisation,
    asked_for,
    default_world,
    draw_episode,
    load_of,
    may_push,
    one_step,
    tick_of,
    vehicle_in,
    window_of,
)
from jblast.environments.tasks import TASKS, Seen, distance
from jblast.errors import InputError, nearest
from jblast.missions import Guidance
from jblast.scene import Air, ByCount, Uniform, WorldSpec
from jblast.scene.uncertain import Prior
from jblast.vehicle import allocation, named, named_gains, step_limit
from jblast.vehicle.controllers import gains_controller
from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.loads.load import pulse_wrench
from jblast.vehicle.quadrotor import in_precision
from jblast.vehicle.rollout import FlightState
from jblast.vehicle.state import Vector, turned_back
from jblast.world import Blasts

STEP_S = 0.01
"""Default of a step; declared: 100 actions a second."""
MOST_DELAY = 10
"""Steps that an action may be late."""


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
    imu: Imu | None = None,
    target_m: tuple[float, float, float] | None = None,
    spread_m: float = 0.0,
    far_m: float = 8.0,
    rate_rad_s: float = 6.0,
    speed_m_s: float = 5.0,
    reach_m: float = 2.0,
    episode_s: float | None = None,
    step_s: float = STEP_S,
) -> EnvironmentParams:
    """Return what lanes of an environment share.

    Args:
        task: "Hover", "Rates", "Mission" or "Detect".
        vehicle: A vehicle's name.
        command: What an action means, a name of `COMMANDS`; None: as the task has it.
        world: What blasts are drawn by, their number among it; None: two of 5 to 15 kg,
            12 to 40 m off.
        air: What their waves go through.
        randomisation: What else episodes draw; None: nothing.
        guidance: Of the mission that is flown; for no other task.
        controller: A name of `vehicle.CONTROLLERS` with the loops of the SE(3) hold; it
            follows the commands "velocity" and "hold".
        imu: Errors of an IMU that is observed; None: it is not.
        target_m: Where a vehicle hovers: east, north, up; None: as the task has it.
        spread_m: How far off it an episode may start, along each axis.
        far_m: How far off an episode ends.
        rate_rad_s: Most that a command or an aim asks for of body rates.
        speed_m_s: Most that a command asks for of velocity.
        reach_m: Farthest that a command moves the place to hold.
        episode_s: How long an episode lasts; None: as the task has it.
        step_s: Of environment and integrator.

    Raises:
        InputError: A name is unknown, a number out of its range, a mission has no
            guidance, or the number of blasts is left to chance.
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
    if kind.actions is not None and command != kind.command:
        raise InputError(
            f"command: expected {kind.command!r} of the task {task}, whose vehicle "
            f"holds its place by itself, got {command!r}"
        )
    if (guidance is None) == (task == "Mission"):
        raise InputError(
            "guidance: expected that of a mission for the task Mission, and none for "
            f"another; got {'none' if guidance is None else 'one'} for {task}"
        )
    world = default_world() if world is None else world
    if not isinstance(world.occurrence, ByCount) or world.occurrence.count < 1:
        raise InputError(
            "world occurrence: expected ByCount of 1 or more: how many blasts an "
            f"episode has is the same in all lanes, got {world.occurrence}"
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
    limit = step_limit("rk4", float(flies.motor_lag_s), gains, 1)
    if step_s > limit:
        raise InputError(
            f"step_s: a hold asked every step is stable up to {limit:.4g} s with "
            f"{vehicle}, got {step_s:g} s"
        )
    randomisation = Randomisation() if randomisation is None else randomisation
    target = jnp.asarray(kind.target_m if target_m is None else target_m, float)
    found = EnvironmentParams(
        vehicle=flies,
        hold=gains_controller(controller)(target, gains, 0.0).ready(flies),
        inverse=jnp.linalg.inv(allocation(flies)),
        world=world,
        air=Air() if air is None else air,
        randomisation=randomisation,
        guidance=guidance,
        imu=imu,
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
        most_delay=_most_delay(randomisation.delay_s, step_s),
    )
    return in_precision(found, jnp.result_type(float))


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

    now: FlightState
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

    def go_on() -> FlightState:
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


def observed(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    """Return the numbers that a lane shows.

    With an IMU six numbers follow those of the task: specific force, mean of the last
    step [m/s2], and body rates [rad/s], along the body's axes, with bias and noise.

    Args:
        params: Of the environment.
        state: Of the lane.
    """
    seen = TASKS[params.task].observe(params, state)
    if params.imu is None:
        return seen
    episode, imu, motion = state.episode, params.imu, state.now.motion
    key = jax.random.fold_in(jax.random.fold_in(state.key, state.number), OF_IMU)
    key = jax.random.fold_in(jax.random.fold_in(key, 1), state.steps)
    noise = jax.random.normal(key, (2, 3), params.step_s.dtype)
    forces = [
        force + bias + imu.force_noise_m_s2 * one
        for force, bias, one in zip(
            state.force_m_s2, episode.force_bias_m_s2, noise[0], strict=True
        )
    ]
    rates = [
        rate + bias + imu.rate_noise_rad_s * one
        for rate, bias, one in zip(
            motion.body_rate, episode.rate_bias_rad_s, noise[1], strict=True
        )
    ]
    return (*seen, *forces, *rates)


def _most_delay(delay: Float[Array, ""] | Prior, step_s: float) -> int:
    """Return the steps that the latest action comes late.

    Raises:
        InputError: There may be more than `MOST_DELAY`, or there is no most.
    """
    if isinstance(delay, Uniform):
        low, high = float(delay.lo), float(delay.hi)
    elif isinstance(delay, Prior):
        raise InputError(f"delay_s: expected a number or a Uniform, got {delay}")
    else:
        low = high = float(delay)
    # nan and inf are refused, too: of them there is no number of steps
    if not (low >= 0 and high / step_s < MOST_DELAY + 0.5):
        raise InputError(
            f"delay_s: expected 0 to {MOST_DELAY * step_s:g} s, {MOST_DELAY} steps, "
            f"got {low:g} to {high:g} s"
        )
    return round(high / step_s)
