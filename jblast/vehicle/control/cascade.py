r"""Cascaded control as in PX4: position, velocity, attitude, body rates.

- velocity set point $v_{sp} = k_p (r_{sp} - r)$, within its limits;
- pull $F/m = k_v (v_{sp} - v) + \int k_i (v_{sp} - v) dt - k_a \dot v + g z$, within
  the limits of `position_hold`, with $\dot v$ from earlier samples, low-passed at 5
  Hz; the integral of a limited axis does not grow further in that direction;
- attitude error $e_q$, below;
- body rates $\omega_{sp} = k_q e_q$, within their limits;
- $M = J (k_\omega (\omega_{sp} - \omega) + \int k_j (\omega_{sp} - \omega) dt) +
  \omega \times J \omega$, and rotor speeds by `allocation`.

The attitude error rights a vehicle before it turns it: Brescianini, Hehn and D'Andrea
(2013), "Nonlinear quadrocopter attitude control", section 3, as in PX4
(AttitudeControl.cpp, commit 129a2ae). The shortest rotation aligns body z with the
pull, by an angle $\alpha$ about $n$ in the body's own plane. A rotation about z follows
by the share $w$ of the remaining heading error $\psi$,

$$ e_q = 2 \left( n \sin\tfrac{\alpha}{2} \cos\tfrac{w \psi}{2} + \ldots, \;
\tfrac1w \cos\tfrac{\alpha}{2} \sin\tfrac{w \psi}{2} \right), $$

twice the vector part of the quaternion of both rotations, its z divided by $w$.

Gains are the defaults of PX4-Autopilot: multicopter_position_control_gain_params.c
(commit 900e472), mc_att_control_params.c (03e7435), mc_rate_control_params.c (00ba1d7).
There, those of body rates are shares of the largest moment, which differs between
airframes: here $k_\omega$ is that of the vehicle's SE(3) controller, and the integral
keeps PX4's ratio to it. The derivative of body rates, for sensors that lag, is omitted.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.allocation import speeds_turning
from jblast.vehicle.control.position_hold import (
    DESCENT_M_S,
    THRUST_FLOOR,
    limited_pull,
)
from jblast.vehicle.quadrotor import Vehicle, floats
from jblast.vehicle.state import (
    Four,
    State,
    Vector,
    dot,
    four,
    rotation,
    three,
    turned_back,
)

# Defaults of PX4, by parameter; the module's docstring names files and commits.
POSITION = (0.95, 0.95, 1.0)  # k_p [1/s]: MPC_XY_P, MPC_Z_P
VELOCITY = (1.8, 1.8, 4.0)  # k_v [1/s]: MPC_XY_VEL_P_ACC, MPC_Z_VEL_P_ACC
VELOCITY_INTEGRAL = (0.4, 0.4, 2.0)  # k_i [1/s2]: MPC_XY_VEL_I_ACC, MPC_Z_VEL_I_ACC
ACCELERATION = (0.2, 0.2, 0.0)  # k_a [1]: MPC_XY_VEL_D_ACC, MPC_Z_VEL_D_ACC
ATTITUDE = (6.5, 6.5, 2.8)  # k_q [1/s]: MC_ROLL_P, MC_PITCH_P, MC_YAW_P
# k_j / k_omega [1/s]: MC_ROLLRATE_I / _P, MC_YAWRATE_I / _P
RATE_INTEGRAL = (4 / 3, 4 / 3, 1 / 2)
# MC_ROLLRATE_MAX, MC_PITCHRATE_MAX and MC_YAWRATE_MAX of PX4, there in degrees per
# second.
MAX_BODY_RATE = (math.radians(220), math.radians(220), math.radians(200))
MAX_RATE_INTEGRAL = (2.0, 2.0, 1.5)  # MC_RR_INT_LIM / MC_ROLLRATE_P
MAX_HORIZONTAL_SPEED, MAX_CLIMB_SPEED = 12.0, 3.0  # MPC_XY_VEL_MAX, MPC_Z_VEL_MAX_UP
ACCELERATION_CUTOFF = 2 * math.pi * 5.0  # MPC_VELD_LP
MAX_VELOCITY_INTEGRAL = FLIGHT_GRAVITY  # of PX4's velocity controller
YAW_WEIGHT = 0.4
"""MC_YAW_WEIGHT of PX4."""
OPPOSITE_DIRECTION = 1e-9
"""Limit of 1 + cos(angle) below which body z points opposite to the pull [-].

All rotations by half a turn are then equally short; the one about x is used. The limit
corresponds to 0.003 degrees from opposite.
"""


class CascadeState(eqx.Module):
    """State of a cascade between two samples.

    Attributes:
        pull_m_s2: Integral of the velocity error, as an acceleration command.
        velocity_m_s: Velocity at the previous sample.
        gained_m_s2: Low-passed rate of the velocity.
        rate_rad_s2: Integral of the body-rate error, as an angular acceleration.
        begun: 1 from the first sample on, 0 before.
    """

    pull_m_s2: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    gained_m_s2: Float[Array, "3"]
    rate_rad_s2: Float[Array, "3"]
    begun: Float[Array, ""]


class Cascade(eqx.Module):
    r"""Cascaded controller of a position and a heading.

    Attributes:
        target_m: East, north, up [m].
        body_rate: $k_\omega$, gain of the innermost loop [1/s].
        yaw_rad: Heading of body x, from east to north [rad].
    """

    target_m: Float[Array, "3"] = eqx.field(converter=floats)
    body_rate: Float[Array, ""] = eqx.field(converter=floats)
    yaw_rad: Float[Array, ""] = eqx.field(converter=floats, default=0.0)

    def start(self) -> CascadeState:
        """Return the controller's state at the start: zeros."""
        none = jnp.zeros_like(self.target_m)
        return CascadeState(none, none, none, none, jnp.zeros_like(none[0]))

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: CascadeState,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], CascadeState]:
        """Return rotor speed commands [rad/s], shape (4,), and the next state."""
        quaternion = four(state.quaternion)
        pull, sums, gained = _commanded_acceleration(
            self, state, vehicle, memory, period_s
        )
        attitude = rotation(quaternion)
        upward = (attitude[0][2], attitude[1][2], attitude[2][2])
        # Rotors at rest exert no moment, so the thrust never falls below its floor.
        along = jnp.maximum(dot(pull, upward), THRUST_FLOOR * FLIGHT_GRAVITY)
        error = attitude_error(quaternion, pull, self.yaw_rad)
        wanted = jnp.clip(
            jnp.asarray(ATTITUDE) * jnp.stack(error),
            -jnp.asarray(MAX_BODY_RATE),
            jnp.asarray(MAX_BODY_RATE),
        )
        missed = wanted - state.body_rate_rad_s
        # The clip is PX4's protection against integrator windup.
        most = self.body_rate * jnp.asarray(MAX_RATE_INTEGRAL)
        turned = memory.rate_rad_s2 + (
            self.body_rate * jnp.asarray(RATE_INTEGRAL) * period_s * missed
        )
        turned = jnp.clip(turned, -most, most)
        turn = three(self.body_rate * missed + turned)
        w = three(state.body_rate_rad_s)
        speeds = speeds_turning(vehicle, vehicle.mass_kg * along, turn, w)
        after = CascadeState(
            sums, state.velocity_m_s, gained, turned, jnp.ones_like(memory.begun)
        )
        return speeds, after


def _commanded_acceleration(
    loops: Cascade,
    state: State,
    vehicle: Vehicle,
    memory: CascadeState,
    period_s: Float[Array, ""],
) -> tuple[Vector, Float[Array, "3"], Float[Array, "3"]]:
    """Return commanded acceleration, updated velocity integral and filtered rate."""
    wanted = jnp.asarray(POSITION) * (loops.target_m - state.position_m)
    across = jnp.sum(wanted[:2] ** 2)
    fast = across > MAX_HORIZONTAL_SPEED**2
    # The horizontal set point is scaled, not clipped per axis, so it keeps its
    # direction.
    share = jnp.where(
        fast, MAX_HORIZONTAL_SPEED / jnp.sqrt(jnp.where(fast, across, 1.0)), 1.0
    )
    climb = jnp.clip(wanted[2], -DESCENT_M_S, MAX_CLIMB_SPEED)
    wanted = jnp.stack([share * wanted[0], share * wanted[1], climb])
    missed = wanted - state.velocity_m_s
    rate = (state.velocity_m_s - memory.velocity_m_s) / period_s
    # Exact discretization of a first-order low pass. The first sample has no velocity
    # before it, so its finite difference is masked by `begun`.
    passed = -jnp.expm1(-ACCELERATION_CUTOFF * period_s) * memory.begun
    gained = memory.gained_m_s2 + passed * (rate - memory.gained_m_s2)
    command = jnp.asarray(VELOCITY) * missed + memory.pull_m_s2
    command = command - jnp.asarray(ACCELERATION) * gained
    east, north, up = three(command)
    pull, leans, low, high = limited_pull(vehicle, (east, north, up + FLIGHT_GRAVITY))
    # Conditional integration: an axis at its limit does not wind up further.
    stays = jnp.stack(
        [
            leans & (missed[0] * command[0] > 0),
            leans & (missed[1] * command[1] > 0),
            (low & (missed[2] < 0)) | (high & (missed[2] > 0)),
        ]
    )
    more = jnp.where(stays, 0.0, jnp.asarray(VELOCITY_INTEGRAL) * period_s * missed)
    sums = jnp.clip(
        memory.pull_m_s2 + more, -MAX_VELOCITY_INTEGRAL, MAX_VELOCITY_INTEGRAL
    )
    return pull, sums, gained


def attitude_error(quaternion: Four, pull: Vector, yaw_rad: Float[Array, ""]) -> Vector:
    """Return the attitude error about body x, y and z [rad, for small errors].

    Args:
        quaternion: Body to world.
        pull: Desired direction of body z, world axes; of any length but zero.
        yaw_rad: Desired heading of body x, from east to north.
    """
    seen = turned_back(quaternion, pull)
    length = jnp.sqrt(dot(seen, seen))
    x, y, z = (part / length for part in seen)
    plus = 1 + z
    opposite = plus < OPPOSITE_DIRECTION
    half = jnp.sqrt(jnp.where(opposite, OPPOSITE_DIRECTION, plus) / 2)
    # The cross product of z and the pull, (-y, x, 0), has the length sin(alpha).
    n_x = jnp.where(opposite, 1.0, -y / (2 * half))
    n_y = jnp.where(opposite, 0.0, x / (2 * half))
    half = jnp.where(opposite, 0.0, half)
    east, north = jnp.cos(yaw_rad), jnp.sin(yaw_rad)
    heading = turned_back(quaternion, (east, north, jnp.zeros_like(east)))
    turned = turned_back((n_x, n_y, jnp.zeros_like(n_x), half), heading)
    # The heading's component in the plane perpendicular to the pull.
    y, x = turned[1], turned[0]
    # arctan2(0, 0) has a NaN gradient: a heading parallel to the pull gives no error.
    none = (y == 0) & (x == 0)
    angle = jnp.arctan2(jnp.where(none, 0.0, y), jnp.where(none, 1.0, x))
    turn = YAW_WEIGHT * angle / 2
    c, s = jnp.cos(turn), jnp.sin(turn)
    return (
        2 * (n_x * c + n_y * s),
        2 * (n_y * c - n_x * s),
        2 * half * s / YAW_WEIGHT,
    )
