r"""Position control on SE(3), within the limits of a vehicle.

Lee, Leok and McClamroch (2010), with a target at rest:

- pull $F/m = -k_p e_x - k_d e_v - k_i \int e_x\,dt + g z$, within the limits below;
  thrust $F \cdot R z$, at least its floor;
- $b_3 = F/|F|$, $b_2 = b_3 \times c/|b_3 \times c|$ with the heading
  $c = (\cos\psi, \sin\psi, 0)$, or 45 degrees from the vehicle's towards it,
  $b_1 = b_2 \times b_3$, $R_d = (b_1, b_2, b_3)$;
- $e_R = \frac12 (R_d^T R - R^T R_d)^\vee$;
- $M = J(-k_R e_R - k_\omega \omega) + \omega \times J\omega$;
- rotor speeds from thrust and moment by `allocation`, within their limits; roll and
  pitch have priority over thrust and thrust over yaw; with a lead if the gains have
  one.

The pull $F/m$ is the commanded force of the rotors per kilogram, $g$ upwards at rest.
Its limits are those of PX4 (PX4-Autopilot, PositionControl.cpp, commit 02c4e03;
defaults of its parameters, commit 1e9f3a0, in brackets):

- above the target, the commanded descent is at most 1.5 m/s [MPC_Z_VEL_MAX_DN];
- the upward pull is at least 0.24 g [MPC_THR_MIN, 0.12 of the full thrust; hover is
  MPC_THR_HOVER, 0.5], because rotors at rest make no moment; at most it is the pull of
  all rotors at their highest speed;
- its tilt is at most 45 degrees [MPC_TILTMAX_AIR]: a larger horizontal part is reduced;
- the integral of a limited axis does not grow further in that direction.

No limit is reached near hover. Without them the law requires less than zero thrust when
it climbs faster than $g/k_d$, 1.1 m/s: the rotors stop, and the vehicle can neither
right itself nor brake. Without the integral a steady wind leaves a permanent offset;
each axis of the integral is limited.
"""

import math
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.allocation import lead_compensated, speeds_turning
from jblast.vehicle.quadrotor import (
    INTEGRAL_LIMIT_M_S2,
    Vehicle,
    floats,
    parameters_of,
    read,
)
from jblast.vehicle.state import (
    MatrixRows,
    State,
    Vector,
    cross,
    dot,
    four,
    rotation,
    three,
)

Flag = Bool[Array, ""]
DESCENT_M_S = 1.5
"""Maximum commanded descent speed: MPC_Z_VEL_MAX_DN of PX4."""
THRUST_FLOOR = 0.24
"""Minimum thrust as a share of the weight: MPC_THR_MIN over MPC_THR_HOVER of PX4."""
TILT_SLOPE = math.tan(math.radians(45.0))
"""Maximum horizontal over vertical acceleration: MPC_TILTMAX_AIR of PX4."""


@runtime_checkable
class Controller(Protocol):
    """A controller of the rotors, sampled at fixed times.

    Its command is constant between two samples.
    """

    def start(self) -> PyTree[Array]:
        """Return the controller's state at the start."""
        ...

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: PyTree[Array],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], PyTree[Array]]:
        """Return rotor speed commands [rad/s], shape (4,), and the next state."""
        ...


class Commands(eqx.Module):
    """Commands given in advance; the last one is kept.

    Attributes:
        speeds_rad_s: Rotor speeds, one row per command.
        period_s: Duration of a command; it changes at the steps next to its ends.
    """

    speeds_rad_s: Float[Array, "*batch command 4"] = eqx.field(converter=floats)
    period_s: Float[Array, "*batch"] = eqx.field(converter=floats)

    def start(self) -> PyTree[Array]:
        """Return the empty state."""
        return ()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: PyTree[Array],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], PyTree[Array]]:
        """Return the command in the middle of a period."""
        n = jnp.floor((time_s + period_s / 2) / self.period_s).astype(jnp.int32)
        last = self.speeds_rad_s.shape[0] - 1
        return self.speeds_rad_s[jnp.minimum(n, last)], memory


class Gains(eqx.Module):
    r"""Gains of the SE(3) position controller.

    Attributes:
        position: Position gain $k_p$, east, north, up [1/s2], shape (3,).
        velocity: Velocity gain $k_d$ [1/s], shape (3,).
        attitude: Attitude gain $k_R$ [1/s2].
        body_rate: Body-rate gain $k_\omega$ [1/s].
        integral: Integral gain $k_i$ [1/s3], shape (3,); zero: no integral action.
        integral_limit: Limit of the integral along each axis [m/s2].
        motor_lead: Factor that shortens the motors' lag
            (`allocation.lead_compensated`) [-], at least 1; None: no compensation.
    """

    position: Float[Array, "3"] = eqx.field(converter=floats)
    velocity: Float[Array, "3"] = eqx.field(converter=floats)
    attitude: Float[Array, ""] = eqx.field(converter=floats)
    body_rate: Float[Array, ""] = eqx.field(converter=floats)
    integral: Float[Array, "3"] = eqx.field(
        converter=floats, default_factory=lambda: jnp.zeros(3)
    )
    integral_limit: Float[Array, ""] = eqx.field(
        converter=floats, default=INTEGRAL_LIMIT_M_S2
    )
    motor_lead: Float[Array, ""] | None = eqx.field(
        converter=lambda x: None if x is None else floats(x), default=None
    )

    @property
    def lead(self) -> Float[Array, ""] | float:
        """Motor lead [-]; 1 without compensation."""
        return 1.0 if self.motor_lead is None else self.motor_lead


class PositionHold(eqx.Module):
    """SE(3) controller of a position and a heading.

    Attributes:
        target_m: East, north, up [m].
        gains: Controller gains.
        yaw_rad: Heading of body x, from east to north [rad].
    """

    target_m: Float[Array, "3"] = eqx.field(converter=floats)
    gains: Gains
    yaw_rad: Float[Array, ""] = eqx.field(converter=floats, default=0.0)

    def start(self) -> Float[Array, "3"]:
        """Return the integral at the start, an acceleration [m/s2], shape (3,)."""
        return jnp.zeros_like(self.target_m)

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Float[Array, "3"],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
        """Return rotor speed commands [rad/s], shape (4,), and the next integral."""
        gains = self.gains
        here, there = three(state.position_m), three(self.target_m)
        away = (here[0] - there[0], here[1] - there[1], here[2] - there[2])
        pull, integral = pull_within(
            vehicle, gains, away, three(state.velocity_m_s), memory, period_s
        )
        attitude = rotation(four(state.quaternion))
        upward = (attitude[0][2], attitude[1][2], attitude[2][2])
        along = jnp.maximum(dot(pull, upward), THRUST_FLOOR * FLIGHT_GRAVITY)
        thrust = vehicle.mass_kg * along
        heading = _heading((jnp.cos(self.yaw_rad), jnp.sin(self.yaw_rad)), attitude)
        b_3 = _unit(pull)
        b_2 = _unit(cross(b_3, (*heading, jnp.zeros_like(heading[0]))))
        wanted = cross(b_2, b_3), b_2, b_3
        error, w = _error(wanted, attitude), three(state.body_rate_rad_s)
        turn = (
            -gains.attitude * error[0] - gains.body_rate * w[0],
            -gains.attitude * error[1] - gains.body_rate * w[1],
            -gains.attitude * error[2] - gains.body_rate * w[2],
        )
        speeds = speeds_turning(vehicle, thrust, turn, w)
        if gains.motor_lead is not None:
            speeds = lead_compensated(
                vehicle, gains.motor_lead, state.rotor_speed_rad_s, speeds
            )
        return speeds, jnp.stack(integral)


def _heading(aim: tuple[Array, Array], attitude: MatrixRows) -> tuple[Array, Array]:
    """Return the desired heading, limited to 45 degrees from the vehicle's.

    The larger the heading error, the less $e_R$ depends on the tilt. At half a turn it
    does not depend on it at all, and a spinning vehicle would overturn.
    """
    x, y = attitude[0][0], attitude[1][0]
    along, across = aim[0] * x + aim[1] * y, aim[1] * x - aim[0] * y
    far, side = along < jnp.abs(across), jnp.where(across < 0, -1, 1)
    return jnp.where(far, x - side * y, aim[0]), jnp.where(far, y + side * x, aim[1])


def _error(wanted: MatrixRows, attitude: MatrixRows) -> Vector:
    """Attitude error from the desired columns and the rows of the attitude."""
    x, y, z = zip(*attitude, strict=True)
    b_1, b_2, b_3 = wanted
    return (
        (dot(b_3, y) - dot(b_2, z)) / 2,
        (dot(b_1, z) - dot(b_3, x)) / 2,
        (dot(b_2, x) - dot(b_1, y)) / 2,
    )


def _unit(v: Vector) -> Vector:
    """Vector of length 1; zero has no direction and gives NaN."""
    # One division and three products: cheaper than three divisions in a flight's inner
    # loop.
    scale = 1 / jnp.sqrt(dot(v, v))
    return v[0] * scale, v[1] * scale, v[2] * scale


def named_gains(name: str, *, integral: bool = False) -> Gains:
    """Return the gains of a named vehicle.

    Args:
        name: "crazyflie", "hummingbird" or "iris".
        integral: Whether the controller has integral action.

    Raises:
        InputError: The name is unknown.
    """
    return gains_from_parameters(parameters_of(name), integral=integral)


def gains_from_parameters(
    parameters: Mapping[str, Any], *, integral: bool = True
) -> Gains:
    """Read gains by RotorPy's names: kp_pos, kd_pos, kp_att, kd_att.

    `ki_pos` (3), `integral_limit` and `motor_lead` are optional. Other names belong to
    the vehicle and are ignored.

    Args:
        parameters: Numbers by name.
        integral: Whether the controller has integral action; False: `ki_pos` is 0.

    Raises:
        InputError: A gain is missing, not a number or negative, or the lead is below 1.
    """
    given = parameters if integral else {**parameters, "ki_pos": (0.0, 0.0, 0.0)}
    return Gains(
        position=read(given, "kp_pos"),
        velocity=read(given, "kd_pos"),
        attitude=read(given, "kp_att"),
        body_rate=read(given, "kd_att"),
        integral=read(given, "ki_pos"),
        integral_limit=read(given, "integral_limit"),
        motor_lead=read(given, "motor_lead") if "motor_lead" in given else None,
    )


def pull_within(
    vehicle: Vehicle,
    gains: Gains,
    away: Vector,
    velocity: Vector,
    memory: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> tuple[Vector, Vector]:
    """Return the commanded acceleration and the updated integral [m/s2].

    Args:
        vehicle: The vehicle.
        gains: Controller gains.
        away: Position relative to the target [m].
        velocity: World axes [m/s].
        memory: The integral before this sample [m/s2].
        period_s: Time since the previous sample.
    """
    k_p, k_d, k_i = map(three, (gains.position, gains.velocity, gains.integral))
    limit = gains.integral_limit
    gained = [-k * period_s * x for k, x in zip(k_i, away, strict=True)]
    sums = [
        jnp.clip(total + gain, -limit, limit)
        for total, gain in zip(memory, gained, strict=True)
    ]
    # The position term alone is limited, so that the commanded descent stays at most
    # 1.5 m/s however far below the target is.
    back, dive = -k_p[2] * away[2], -k_d[2] * DESCENT_M_S
    east, north = (sums[n] - k_p[n] * away[n] - k_d[n] * velocity[n] for n in (0, 1))
    up = sums[2] + jnp.maximum(back, dive) - k_d[2] * velocity[2] + FLIGHT_GRAVITY
    pull, leans, low, high = limited_pull(vehicle, (east, north, up))
    low = (back < dive) | low
    # Conditional integration: an axis at a limit does not wind up further.
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


def limited_pull(vehicle: Vehicle, command: Vector) -> tuple[Vector, Flag, Flag, Flag]:
    """Return a limited acceleration and flags: horizontal, lower and upper limit.

    Args:
        vehicle: The vehicle.
        command: Acceleration, east, north, up [m/s2], weight included.
    """
    east, north, up = command
    speed = vehicle.rotor_speed_max_rad_s
    most = 4 * vehicle.thrust_coefficient * speed * speed / vehicle.mass_kg
    floor = THRUST_FLOOR * FLIGHT_GRAVITY
    limited = jnp.minimum(jnp.maximum(up, floor), most)
    across = TILT_SLOPE * limited
    square = east * east + north * north
    leans = square > across * across
    share = jnp.where(leans, across / jnp.sqrt(jnp.where(leans, square, 1)), 1)
    return (share * east, share * north, limited), leans, up < floor, up > most
