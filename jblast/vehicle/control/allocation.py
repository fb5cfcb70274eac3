r"""Rotor speeds for a thrust and a moment, within the limits of the rotors.

Rotor thrusts $f$ follow from the inverse $B$ of the allocation, $f = B (T, M)$. They
are limited to the thrusts at the lowest and the highest speed. If a thrust exceeds its
limits, axes are reduced in the order of PX4's airmode for roll and pitch (MC_AIRMODE 1;
commit 1bbd116, ControlAllocationSequentialDesaturation.cpp, mixAirmodeRP and mixYaw):
yaw first, then the thrust, lowered or raised, and roll and pitch last. PX4 corrects the
worst rotor and its opposite twice and allows yaw 15 % past the highest thrust. Here
each factor is the largest possible one, and no rotor passes its limits.

A motor lags, $\dot\Omega = (\Omega_{cmd} - \Omega) / \tau_m$. With a lead $\lambda$
(`lead_compensated`) the command is

$$\Omega_{cmd} = \Omega + \lambda\,(\Omega_{wanted} - \Omega),$$

where $\Omega$ is the speed reported by the motor's speed controller. The lag is then
$\tau_m / \lambda$ as long as the command is within the limits. Outside them the command
is clipped and the motor lags as before. Errors of the reported speed are amplified by
$\lambda - 1$.

In a steady wind a vehicle hovers tilted against the wind, at rest over ground
(`hover_in_wind`): thrust and the wind's drag and lift balance its weight. Moments of
the wind are neglected.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.quadrotor import Vehicle
from jblast.vehicle.state import (
    Four,
    Number,
    State,
    Vector,
    add,
    components,
    cross,
    dot,
    root,
    rows,
    three,
    times,
    turned,
)

STANDSTILL_SHARE = 1e-6
"""Rotor speed below which a rotor stands still, as a share of the maximum speed.

The square root of the thrust has an infinite gradient at zero. The thrust at this speed
is 1e-12 of the maximum thrust, below the rounding of float32.
"""
HOVER_ITERATIONS = 8
"""Fixed-point iterations of `hover_in_wind`.

Each iteration reduces the error to a tenth or less in winds up to 10 m/s, so eight
leave 1e-8 of the wind's force.
"""


def allocation(vehicle: Vehicle) -> Float[Array, "4 4"]:
    """Matrix that takes the four rotors' thrusts to total thrust and moment.

    Returns:
        Rows: thrust [N], moment about body x, y, z [N m], per newton of each rotor.
    """
    x, y, _ = vehicle.rotor_position_m.T
    reach = vehicle.moment_coefficient / vehicle.thrust_coefficient
    return jnp.stack([jnp.ones_like(x), y, -x, reach * vehicle.rotor_direction])


def mixer(vehicle: Vehicle) -> tuple[Four, Four, Four, Four]:
    """Inverse of `allocation`: one row per rotor, its thrust per newton and moment.

    The first rotor provides the thrust that the other three do not. Their thrusts solve
    the three equations of the moments, which is cheap enough for every sample of a
    controller.
    """
    reach = vehicle.moment_coefficient / vehicle.thrust_coefficient
    arms = [
        (y, -x, reach * direction)
        for (x, y, _), direction in zip(
            map(three, vehicle.rotor_position_m), vehicle.rotor_direction, strict=True
        )
    ]
    (i, j, k), *others = arms
    a, b, c = ((x - i, y - j, z - k) for x, y, z in others)
    across = cross(b, c), cross(c, a), cross(a, b)
    whole = dot(a, across[0])
    second, third, fourth = (
        (-(x * i + y * j + z * k) / whole, x / whole, y / whole, z / whole)
        for x, y, z in across
    )
    share, roll, pitch, yaw = (
        x + y + z for x, y, z in zip(second, third, fourth, strict=True)
    )
    return (1 - share, -roll, -pitch, -yaw), second, third, fourth


@kept
def rotor_speeds(vehicle: Vehicle, wanted: Four) -> Float[Array, "4"]:
    """Rotor speeds for a thrust [N] and a moment [N m], without the rotors' limits.

    Args:
        vehicle: The vehicle, at rest in still air.
        wanted: Thrust and moments about body x, y and z.

    Returns:
        Speeds [rad/s]; negative for a downward thrust.
    """
    thrusts = jnp.stack([jnp.stack(row) for row in mixer(vehicle)]) @ jnp.stack(wanted)
    return jnp.sign(thrusts) * root(jnp.abs(thrusts) / vehicle.thrust_coefficient)


def speeds_within(vehicle: Vehicle, wanted: Four) -> Float[Array, "4"]:
    """Rotor speeds within their limits, closest to a thrust and a moment.

    Args:
        vehicle: The vehicle; each rotor contributes to the thrust at hover.
        wanted: Thrust [N] and moments about body x, y and z [N m].
    """
    thrust, roll, pitch, yaw = wanted
    slow, fast = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    least, most = (vehicle.thrust_coefficient * x * x for x in (slow, fast))
    # Divided by the rotor's share of the thrust, so that a change of the total thrust
    # shifts all rotors by the same number.
    shares, lows, highs, tilts, turns = [], [], [], [], []
    for share, by_roll, by_pitch, by_yaw in mixer(vehicle):
        shares.append(share)
        lows.append(least / share)
        highs.append(most / share)
        tilts.append((by_roll * roll + by_pitch * pitch) / share)
        turns.append(by_yaw * yaw / share)
    room = _least(highs) - _greatest(lows)
    spread = _greatest(tilts) - _least(tilts)
    # Roll and pitch are scaled until some thrust accommodates both the highest and the
    # lowest rotor; the thrust then moves into that interval.
    kept = _feasible_share(jnp.maximum(room, 0), spread)
    tilts = [kept * tilt for tilt in tilts]
    given = [low - tilt for low, tilt in zip(lows, tilts, strict=True)]
    thrust = jnp.maximum(thrust, _greatest(given))
    given = [high - tilt for high, tilt in zip(highs, tilts, strict=True)]
    thrust = jnp.minimum(thrust, _least(given))
    level = [tilt + thrust for tilt in tilts]
    left = [
        _feasible_share(jnp.where(turn > 0, high - x, x - low), jnp.abs(turn))
        for turn, low, high, x in zip(turns, lows, highs, level, strict=True)
    ]
    # Yaw uses the margin that remains, the last priority as in PX4.
    kept = _least(left)
    standing = STANDSTILL_SHARE * STANDSTILL_SHARE * fast * fast
    speeds = []
    for share, x, turn in zip(shares, level, turns, strict=True):
        square = share * (x + kept * turn) / vehicle.thrust_coefficient
        rotates = square > standing
        speeds.append(jnp.where(rotates, jnp.sqrt(jnp.where(rotates, square, 1)), 0))
    return jnp.stack(speeds)


def speeds_turning(
    vehicle: Vehicle, thrust: Number, turn: Vector, body_rate: Vector
) -> Float[Array, "4"]:
    """Rotor speeds for a thrust and an angular acceleration, as `speeds_within`.

    Args:
        vehicle: The vehicle.
        thrust: Thrust [N].
        turn: Angular acceleration about the body's axes [rad/s2].
        body_rate: Body rate, whose gyroscopic moment is cancelled [rad/s].
    """
    inertia = rows(vehicle.inertia_kg_m2)
    gyroscopic = cross(body_rate, times(inertia, body_rate))
    return speeds_within(vehicle, (thrust, *add(times(inertia, turn), gyroscopic)))


def _feasible_share(room: Number, requested: Number) -> Number:
    """Share of a requested range that fits into the available range, at most 1."""
    short = requested > room
    # Both branches of a `where` are differentiated: the quotient must be finite in each
    return jnp.where(short, room / jnp.where(short, requested, 1), 1)


def _least(numbers: list[Number]) -> Number:
    return functools.reduce(jnp.minimum, numbers)


def _greatest(numbers: list[Number]) -> Number:
    return functools.reduce(jnp.maximum, numbers)


def lead_compensated(
    vehicle: Vehicle,
    lead: Float[Array, ""],
    speeds: Float[Array, "4"],
    wanted: Float[Array, "4"],
) -> Float[Array, "4"]:
    r"""Return lead-compensated speed commands [rad/s], within the rotors' limits.

    Args:
        vehicle: The vehicle.
        lead: $\lambda$, at least 1.
        speeds: Measured rotor speeds [rad/s].
        wanted: Desired rotor speeds [rad/s].
    """
    command = speeds + lead * (wanted - speeds)
    slow, fast = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    return jnp.minimum(jnp.maximum(command, slow), fast)


def hover_in_wind(
    vehicle: Vehicle,
    position_m: Float[Array, "3"],
    yaw_rad: Float[Array, ""],
    wind_m_s: Float[Array, "3"],
) -> State:
    """Return the state of a vehicle that hovers at rest in a steady wind.

    Thrust and the wind's drag and lift balance its weight. Moments of the wind, which
    speed differences between rotors balance, are neglected.

    Args:
        vehicle: The vehicle.
        position_m: Position of the vehicle: east, north, up, shape (3,).
        yaw_rad: Heading, from east to north.
        wind_m_s: Velocity of the air: east, north, up, shape (3,).
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

    # A scan compiles the iteration once; unrolled, the program would be eight times as
    # long.
    pull, _ = jax.lax.scan(
        balance, weight + 0 * wind_m_s, None, length=HOVER_ITERATIONS
    )
    return _state(vehicle, position_m, yaw_rad, pull)


def _state(
    vehicle: Vehicle,
    position_m: Float[Array, "3"],
    yaw_rad: Float[Array, ""],
    pull: Float[Array, "3"],
) -> State:
    """Return the state at rest whose rotors give a force `pull` [N], shape (3,)."""
    size = jnp.sqrt(jnp.sum(jnp.square(pull)))
    x, y, z = pull / size
    # The shortest rotation from up to the force, applied after the heading.
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
