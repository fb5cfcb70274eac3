r"""Rotor speeds for a thrust and a moment, within the limits of the rotors.

Rotor thrusts $f$ follow from the inverse $B$ of the allocation, $f = B (T, M)$, and lie
between those of the lowest and the highest speed. Where they would not, axes are
reduced in the order of PX4's airmode for roll and pitch (MC_AIRMODE 1; commit 1bbd116,
ControlAllocationSequentialDesaturation.cpp, mixAirmodeRP and mixYaw): yaw first, then
the thrust, lowered or raised, and roll and pitch last. PX4 takes the worst rotor and
its opposite twice and allows yaw 15 % past the highest thrust; here each factor is the
largest possible one, and no rotor passes its limits.

A motor lags, $\dot\Omega = (\Omega_{cmd} - \Omega) / \tau_m$. With a lead $\lambda$
(`led`) the command is

$$\Omega_{cmd} = \Omega + \lambda\,(\Omega_{wanted} - \Omega),$$

with the motor's own speed as its speed controller reports it. The lag is then
$\tau_m / \lambda$ as long as the command is within the limits; outside it is cut, and
the motor lags as before. Errors of the reported speed are amplified by $\lambda - 1$.

In a steady wind a vehicle hovers tilted against it, at rest over ground
(`hover_in_wind`): thrust and the wind's drag and lift carry its weight. Moments of the
wind are left out there.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.quadrotor import Vehicle
from jblast.vehicle.state import Four, Number, State, components, three, turned

SLOWEST = 1e-6
"""Of the greatest speed: what is slower stands, or its root would have no slope."""
ROUNDS = 8
"""Of a fixed point: each is off by a tenth of the one before, or less, up to 10 m/s."""


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


def led(
    vehicle: Vehicle,
    lead: Float[Array, ""],
    speeds: Float[Array, "4"],
    wanted: Float[Array, "4"],
) -> Float[Array, "4"]:
    r"""Return the rotor speeds to ask for [rad/s], within their limits.

    Args:
        vehicle: The vehicle.
        lead: $\lambda$, 1 and more.
        speeds: Of the rotors as they turn [rad/s].
        wanted: Of them [rad/s].
    """
    asked = speeds + lead * (wanted - speeds)
    slow, fast = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    return jnp.minimum(jnp.maximum(asked, slow), fast)


def hover_in_wind(
    vehicle: Vehicle,
    position_m: Float[Array, "3"],
    yaw_rad: Float[Array, ""],
    wind_m_s: Float[Array, "3"],
) -> State:
    """Return the state in which a vehicle stays where it is.

    Thrust and the wind's drag and lift carry its weight; moments of the wind, which
    speeds of single rotors balance, are left out.

    Args:
        vehicle: The vehicle.
        position_m: Where.
        yaw_rad: Heading, from east to north.
        wind_m_s: Of the air.
    """
    still, wind = three(jnp.zeros(3)), three(wind_m_s)
    weight = vehicle.mass_kg * FLIGHT_GRAVITY * jnp.array([0.0, 0.0, 1.0])

    def balance(pull: Float[Array, "3"], _: None) -> tuple[Float[Array, "3"], None]:
        motion = components(_state(vehicle, position_m, yaw_rad, pull))
        blown, quiet = (
            jnp.stack(turned(motion.quaternion, air_wrench(vehicle, motion, air)[0]))
            for air in (wind, still)
        )
        return weight - (blown - quiet), None

    # one program for all rounds
    pull, _ = jax.lax.scan(balance, weight + 0 * wind_m_s, None, length=ROUNDS)
    return _state(vehicle, position_m, yaw_rad, pull)


def _state(
    vehicle: Vehicle,
    position_m: Float[Array, "3"],
    yaw_rad: Float[Array, ""],
    pull: Float[Array, "3"],
) -> State:
    """Return the state whose rotors pull so, at rest."""
    size = jnp.sqrt(jnp.sum(jnp.square(pull)))
    x, y, z = pull / size
    # the least turn from up to the pull, after the turn of the heading
    tilt = jnp.stack([-y, x, jnp.zeros_like(x), 1 + z])
    tilt = tilt / jnp.sqrt(jnp.sum(jnp.square(tilt)))
    sine, cosine = jnp.sin(yaw_rad / 2), jnp.cos(yaw_rad / 2)
    a, b, _, w = tilt
    quaternion = jnp.stack(
        [a * cosine + b * sine, b * cosine - a * sine, w * sine, w * cosine]
    )
    still, none = jnp.zeros(3), jnp.zeros_like(size)
    speeds = rotor_speeds(vehicle, (size, none, none, none))
    return State(position_m, still, quaternion, still, speeds)
