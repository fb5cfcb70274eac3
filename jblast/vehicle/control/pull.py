r"""What a hold may ask of a vehicle: the pull of its rotors within limits.

The pull $F/m$ is what is asked for per kilogram, $g$ upwards at rest. As in PX4
(PX4-Autopilot, PositionControl.cpp, commit 02c4e03; defaults of its parameters, commit
1e9f3a0, in brackets):

- the descent that a place above the target asks for is at most 1.5 m/s
  [MPC_Z_VEL_MAX_DN];
- upwards it is at least 0.24 g [MPC_THR_MIN 0.12 of the full thrust, of which a vehicle
  that hovers has MPC_THR_HOVER 0.5]: rotors that stand make no moment; at most it is
  what all rotors give at their greatest speed;
- its tilt is at most 45 degrees [MPC_TILTMAX_AIR]: what is more across is cut;
- an axis that is cut does not gather integral that would ask for more of the same.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.gains import Gains
from jblast.vehicle.dynamics.components import Vector, three
from jblast.vehicle.quadrotor.parameters import Vehicle

Flag = Bool[Array, ""]

DESCENT_M_S = 1.5
THRUST_FLOOR = 0.24
"""Least thrust, of the weight."""
TILT_SLOPE = math.tan(math.radians(45.0))
"""Most pull across, of the pull upwards."""


def pull_within(
    vehicle: Vehicle,
    gains: Gains,
    away: Vector,
    velocity: Vector,
    memory: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> tuple[Vector, Vector]:
    """Return the pull to ask for [m/s2], and the integral afterwards [m/s2].

    Args:
        vehicle: The vehicle.
        gains: Of the hold.
        away: From the target to the vehicle [m].
        velocity: World [m/s].
        memory: The integral so far.
        period_s: Since the turn before.
    """
    k_p, k_d, k_i = map(three, (gains.position, gains.velocity, gains.integral))
    limit = gains.integral_limit
    gained = [-k * period_s * x for k, x in zip(k_i, away, strict=True)]
    sums = [
        jnp.clip(total + gain, -limit, limit)
        for total, gain in zip(memory, gained, strict=True)
    ]
    back, dive = -k_p[2] * away[2], -k_d[2] * DESCENT_M_S
    east, north = (sums[n] - k_p[n] * away[n] - k_d[n] * velocity[n] for n in (0, 1))
    up = sums[2] + jnp.maximum(back, dive) - k_d[2] * velocity[2] + FLIGHT_GRAVITY
    pull, leans, low, high = limited_pull(vehicle, (east, north, up))
    low = (back < dive) | low
    winds = (
        leans & (gained[0] * east > 0),
        leans & (gained[1] * north > 0),
        (low & (gained[2] < 0)) | (high & (gained[2] > 0)),
    )
    first, second, third = (
        jnp.where(stays, before, after)
        for stays, before, after in zip(winds, memory, sums, strict=True)
    )
    return pull, (first, second, third)


def limited_pull(vehicle: Vehicle, asked: Vector) -> tuple[Vector, Flag, Flag, Flag]:
    """Return a pull within limits, and whether it was cut across, below and above.

    Args:
        vehicle: The vehicle.
        asked: East, north, up [m/s2], weight included.
    """
    east, north, up = asked
    speed = vehicle.rotor_speed_max_rad_s
    most = 4 * vehicle.thrust_coefficient * speed * speed / vehicle.mass_kg
    floor = THRUST_FLOOR * FLIGHT_GRAVITY
    held = jnp.minimum(jnp.maximum(up, floor), most)
    across = TILT_SLOPE * held
    square = east * east + north * north
    leans = square > across * across
    share = jnp.where(leans, across / jnp.sqrt(jnp.where(leans, square, 1)), 1)
    return (share * east, share * north, held), leans, up < floor, up > most
