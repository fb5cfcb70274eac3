r"""Which rotor speeds make a thrust and a moment, and what gives way where none do.

Rotor thrusts $f$ are asked for by the inverse $B$ of the allocation, $f = B (T, M)$,
and lie between those of the least and the greatest speed. Where they would not, the
axes give way in the order of PX4's airmode for roll and pitch (MC_AIRMODE 1; commit
1bbd116, ControlAllocationSequentialDesaturation.cpp, mixAirmodeRP and mixYaw): yaw
first, then the thrust, lowered or raised, and roll and pitch last. PX4 takes the worst
rotor and its opposite twice and lets yaw have 15 % past the greatest thrust; here each
factor is the greatest that is possible, and no rotor passes its limits.
"""

import functools

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.kept_programs import kept
from jblast.vehicle.dynamics.components import Four, Number
from jblast.vehicle.quadrotor.parameters import Vehicle

SLOWEST = 1e-6
"""Of the greatest speed: what is slower stands, or its root would have no slope."""


def allocation(vehicle: Vehicle) -> Float[Array, "4 4"]:
    """Matrix that takes the four rotors' thrusts to total thrust and moment.

    Returns:
        Rows: thrust [N], moment about body x, y, z [N m], per newton of each rotor.
    """
    x, y, _ = vehicle.rotor_position_m.T
    reach = vehicle.moment_coefficient / vehicle.thrust_coefficient
    return jnp.stack([jnp.ones_like(x), y, -x, reach * vehicle.rotor_direction])


@kept
def rotor_speeds(vehicle: Vehicle, wanted: Four) -> Float[Array, "4"]:
    """Rotor speeds that make a thrust [N] and a moment [N m], whatever their limits.

    Args:
        vehicle: The vehicle, at rest in still air.
        wanted: Thrust and moments about body x, y and z.

    Returns:
        Speeds [rad/s]; negative for a pull down.
    """
    thrusts = jnp.linalg.inv(allocation(vehicle)) @ jnp.stack(wanted)
    square = jnp.abs(thrusts) / vehicle.thrust_coefficient
    turns = square > 0
    speeds = jnp.sign(thrusts) * jnp.sqrt(jnp.where(turns, square, 1))
    return jnp.where(turns, speeds, 0)


def speeds_within(
    vehicle: Vehicle, inverse: Float[Array, "4 4"], wanted: Four
) -> Float[Array, "4"]:
    """Rotor speeds within their limits that come nearest to a thrust and a moment.

    Args:
        vehicle: The vehicle; at hover each of its rotors carries a share.
        inverse: Of its allocation.
        wanted: Thrust [N] and moments about body x, y and z [N m].
    """
    thrust, roll, pitch, yaw = wanted
    slow, fast = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    least, most = (vehicle.thrust_coefficient * x * x for x in (slow, fast))
    shares, lows, highs, tilts, turns = [], [], [], [], []
    for share, by_roll, by_pitch, by_yaw in inverse:
        shares.append(share)
        lows.append(least / share)
        highs.append(most / share)
        tilts.append((by_roll * roll + by_pitch * pitch) / share)
        turns.append(by_yaw * yaw / share)
    room = _least(highs) - _greatest(lows)
    spread = _greatest(tilts) - _least(tilts)
    kept = _kept(jnp.maximum(room, 0), spread)
    tilts = [kept * tilt for tilt in tilts]
    given = [low - tilt for low, tilt in zip(lows, tilts, strict=True)]
    thrust = jnp.maximum(thrust, _greatest(given))
    given = [high - tilt for high, tilt in zip(highs, tilts, strict=True)]
    thrust = jnp.minimum(thrust, _least(given))
    level = [tilt + thrust for tilt in tilts]
    left = [
        _kept(jnp.where(turn > 0, high - x, x - low), jnp.abs(turn))
        for turn, low, high, x in zip(turns, lows, highs, level, strict=True)
    ]
    kept = _least(left)
    standing = SLOWEST * SLOWEST * fast * fast
    speeds = []
    for share, x, turn in zip(shares, level, turns, strict=True):
        square = share * (x + kept * turn) / vehicle.thrust_coefficient
        rotates = square > standing
        speeds.append(jnp.where(rotates, jnp.sqrt(jnp.where(rotates, square, 1)), 0))
    return jnp.stack(speeds)


def _kept(room: Number, asked: Number) -> Number:
    """Share of what is asked for that there is room for."""
    short = asked > room
    return jnp.where(short, room / jnp.where(short, asked, 1), 1)


def _least(numbers: list[Number]) -> Number:
    return functools.reduce(jnp.minimum, numbers)


def _greatest(numbers: list[Number]) -> Number:
    return functools.reduce(jnp.maximum, numbers)
