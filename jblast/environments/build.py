"""The builder of an environment: names and numbers, each checked."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.environments.episode import (
    COMMANDS,
    EnvironmentParams,
    Imu,
    Randomisation,
    default_world,
)
from jblast.environments.tasks import TASKS
from jblast.errors import InputError, nearest
from jblast.missions import Guidance
from jblast.scene import Air, ByCount, Uniform, WorldSpec
from jblast.scene.uncertain import Prior
from jblast.vehicle import allocation, named, named_gains, step_limit
from jblast.vehicle.controllers import gains_controller
from jblast.vehicle.quadrotor import in_precision

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
