r"""What an action asks the rotors for: the modes of command.

Every action lies within -1 and 1; what is beyond counts as its bound.

- `rotor_speeds` (4): from the least to the greatest speed of each rotor;
- `thrust_rates` (4): collective thrust $T = m g (1 + a_0)$ and body rates
  $\omega_d = a \omega_{max}$, followed by $M = J k_\omega (\omega_d - \omega) + \omega
  \times J \omega$ with $k_\omega$ of the hold;
- `velocity` (3): $a v_{max}$, east, north, up, followed by the position hold without
  its position;
- `hold` (3): the place to hold moves by $a$ times a reach, about where the task has it:
  no action is the SE(3) hold itself.

Mass, inertia and allocation are those of the vehicle as it is known, without what an
episode drew.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.environments.params import EnvironmentParams
from jblast.environments.state import EnvironmentState
from jblast.missions.control import as_if_at_rest
from jblast.missions.guidance import SetPoint
from jblast.vehicle.control.allocation import speeds_within
from jblast.vehicle.dynamics.components import (
    Four,
    Number,
    Vector,
    add,
    cross,
    four,
    joined,
    rows,
    three,
    times,
)

COMMANDS = {"rotor_speeds": 4, "thrust_rates": 4, "velocity": 3, "hold": 3}
"""Numbers of an action by the mode's name."""

Action = tuple[Number, ...]


class Aim(eqx.Module):
    """Where the vehicle should be in this step.

    Attributes:
        point: Place, velocity and acceleration.
        yaw_rad: Heading.
    """

    point: SetPoint
    yaw_rad: Float[Array, ""]


def asked_for(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> tuple[Four, Vector]:
    """Return rotor speeds to ask for [rad/s], and the hold's integral afterwards.

    Args:
        params: Of the environment.
        state: Of the lane.
        action: Within -1 and 1.
        aim: Where to be.
    """
    if params.command == "rotor_speeds":
        low = params.vehicle.rotor_speed_min_rad_s
        half = (params.vehicle.rotor_speed_max_rad_s - low) / 2
        a, b, c, d = (low + half * (1 + part) for part in action)
        return (a, b, c, d), state.now.memory
    if params.command == "thrust_rates":
        return _by_rates(params, state, action), state.now.memory
    return _by_hold(params, state, action, aim)


def _by_rates(
    params: EnvironmentParams, state: EnvironmentState, action: Action
) -> Four:
    vehicle, motion = params.vehicle, state.now.motion
    k_w = params.gains.body_rate * state.episode.gain_factor
    w, inertia = motion.body_rate, rows(vehicle.inertia_kg_m2)
    x, y, z = (
        k_w * (params.rate_rad_s * part - rate)
        for part, rate in zip(action[1:], w, strict=True)
    )
    moment = add(times(inertia, (x, y, z)), cross(w, times(inertia, w)))
    thrust = vehicle.mass_kg * FLIGHT_GRAVITY * (1 + action[0])
    return four(speeds_within(vehicle, params.inverse, (thrust, *moment)))


def _by_hold(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> tuple[Four, Vector]:
    flown = joined(state.now.motion)

    # number by number: a step of many lanes has no arrays but theirs
    def by_factor(gain: Array) -> Array:
        parts = [part * state.episode.gain_factor for part in jnp.ravel(gain)]
        return jnp.stack(parts).reshape(gain.shape)

    def with_action(start: Vector, scale: Array) -> Array:
        pairs = zip(start, action, strict=True)
        return jnp.stack([begun + scale * part for begun, part in pairs])

    gains = jax.tree.map(by_factor, params.gains)
    own = params.gains
    gains = replace(gains, integral_limit=own.integral_limit, motor_lead=own.motor_lead)
    if params.command == "velocity":
        place = flown.position_m
        velocity = with_action(state.now.motion.velocity, -params.speed_m_s)
        shown = replace(flown, velocity_m_s=velocity)
    else:
        place = with_action(three(aim.point.position_m), params.reach_m)
        shown = as_if_at_rest(params.vehicle, gains, flown, aim.point)
    hold = eqx.tree_at(
        lambda ready: (ready.hold.target_m, ready.hold.yaw_rad, ready.hold.gains),
        params.hold,
        (place, aim.yaw_rad, gains),
    )
    start = jnp.zeros_like(params.step_s)
    speeds, gained = hold(
        start, shown, params.vehicle, jnp.stack(state.now.memory), params.step_s
    )
    return four(speeds), three(gained)
