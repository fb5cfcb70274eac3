r"""Cascaded control as PX4 has it: place, velocity, attitude, body rates.

- velocity wanted $v_{sp} = k_p (r_{sp} - r)$, cut to what is allowed;
- pull $F/m = k_v (v_{sp} - v) + \int k_i (v_{sp} - v) dt - k_a \dot v + g z$, within
  the limits of `pull.py`, with $\dot v$ from the turns before, low-passed at 5 Hz; an
  axis that is cut gathers no more of the same;
- the attitude error of Brescianini, Hehn and D'Andrea (2013), by `tilt_first.py`;
- body rates wanted $\omega_{sp} = k_q e_q$, cut to what is allowed;
- $M = J (k_\omega (\omega_{sp} - \omega) + \int k_j (\omega_{sp} - \omega) dt) +
  \omega \times J \omega$, and rotor speeds by `allocation.py`.

PX4-Autopilot's default parameters: multicopter_position_control_gain_params.c (commit
900e472), mc_att_control_params.c (03e7435), mc_rate_control_params.c (00ba1d7). Those
of body rates are in shares of the greatest moment there, which is another for every
airframe: here $k_\omega$ is that of the vehicle's SE(3) hold, and the integral keeps
PX4's ratio to it. The derivative of body rates, for sensors that lag, is left out.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.allocation import allocation, speeds_within
from jblast.vehicle.control.position_hold import Controller, Readied
from jblast.vehicle.control.pull import THRUST_FLOOR, limited_pull
from jblast.vehicle.control.tilt_first import attitude_error
from jblast.vehicle.dynamics.components import (
    Four,
    Vector,
    add,
    cross,
    dot,
    four,
    rotation,
    rows,
    three,
    times,
)
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.quadrotor.numbers import floats
from jblast.vehicle.quadrotor.parameters import Vehicle

POSITION = (0.95, 0.95, 1.0)  # MPC_XY_P, MPC_Z_P
VELOCITY = (1.8, 1.8, 4.0)  # MPC_XY_VEL_P_ACC, MPC_Z_VEL_P_ACC
VELOCITY_INTEGRAL = (0.4, 0.4, 2.0)  # MPC_XY_VEL_I_ACC, MPC_Z_VEL_I_ACC
ACCELERATION = (0.2, 0.2, 0.0)  # MPC_XY_VEL_D_ACC, MPC_Z_VEL_D_ACC
ATTITUDE = (6.5, 6.5, 2.8)  # MC_ROLL_P, MC_PITCH_P, MC_YAW_P
RATE_INTEGRAL = (4 / 3, 4 / 3, 1 / 2)  # MC_ROLLRATE_I / _P, MC_YAWRATE_I / _P
RATE_MOST = (math.radians(220), math.radians(220), math.radians(200))
RATE_INTEGRAL_MOST = (2.0, 2.0, 1.5)  # MC_RR_INT_LIM / MC_ROLLRATE_P
SPEED_MOST, CLIMB_MOST, DESCENT_MOST = 12.0, 3.0, 1.5  # MPC_XY_VEL_MAX, MPC_Z_VEL_MAX_*
LOW_PASS = 2 * math.pi * 5.0  # MPC_VELD_LP
GATHERED_MOST = FLIGHT_GRAVITY  # PX4's, of the integral of velocity


class Gathered(eqx.Module):
    """What a cascade remembers.

    Attributes:
        pull_m_s2: Integral of the velocity's error, as the pull it asks for.
        velocity_m_s: At the turn before.
        gained_m_s2: Low-passed rate of the velocity.
        rate_rad_s2: Integral of the body rates' error, as the rate it asks for.
        begun: 1 from the first turn on, 0 before.
    """

    pull_m_s2: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    gained_m_s2: Float[Array, "3"]
    rate_rad_s2: Float[Array, "3"]
    begun: Float[Array, ""]


class Cascade(Readied):
    r"""Holds a place and a heading by loops within loops.

    Attributes:
        target_m: East, north, up [m].
        body_rate: $k_\omega$, of the innermost loop [1/s].
        yaw_rad: Heading of body x, from east to north [rad].
        position: $k_p$ [1/s].
        velocity: $k_v$ [1/s].
        velocity_integral: $k_i$ [1/s2].
        acceleration: $k_a$ [1].
        attitude: $k_q$ [1/s].
        rate_integral: $k_j / k_\omega$ [1/s].
    """

    target_m: Float[Array, "3"] = eqx.field(converter=floats)
    body_rate: Float[Array, ""] = eqx.field(converter=floats)
    yaw_rad: Float[Array, ""] = eqx.field(converter=floats, default=0.0)
    position: Float[Array, "3"] = eqx.field(converter=floats, default=POSITION)
    velocity: Float[Array, "3"] = eqx.field(converter=floats, default=VELOCITY)
    velocity_integral: Float[Array, "3"] = eqx.field(
        converter=floats, default=VELOCITY_INTEGRAL
    )
    acceleration: Float[Array, "3"] = eqx.field(converter=floats, default=ACCELERATION)
    attitude: Float[Array, "3"] = eqx.field(converter=floats, default=ATTITUDE)
    rate_integral: Float[Array, "3"] = eqx.field(
        converter=floats, default=RATE_INTEGRAL
    )

    def start(self) -> Gathered:
        """Return what it remembers at the start: nothing."""
        none = jnp.zeros_like(self.target_m)
        return Gathered(none, none, none, none, jnp.zeros_like(none[0]))

    def ready(self, vehicle: Vehicle) -> Controller:
        """Return the same with its allocation inverted, once for a flight."""
        return _Ready(self, jnp.linalg.inv(allocation(vehicle)))


class _Ready(eqx.Module):
    """A cascade that need not invert its allocation at every turn."""

    loops: Cascade
    inverse: Float[Array, "4 4"]

    def start(self) -> Gathered:
        return self.loops.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Gathered,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Gathered]:
        loops, quaternion = self.loops, four(state.quaternion)
        pull, sums, gained = _pull(loops, state, vehicle, memory, period_s)
        attitude = rotation(quaternion)
        upward = (attitude[0][2], attitude[1][2], attitude[2][2])
        along = jnp.maximum(dot(pull, upward), THRUST_FLOOR * FLIGHT_GRAVITY)
        error = attitude_error(quaternion, pull, loops.yaw_rad)
        wanted = jnp.clip(
            loops.attitude * jnp.stack(error),
            -jnp.asarray(RATE_MOST),
            jnp.asarray(RATE_MOST),
        )
        missed = wanted - state.body_rate_rad_s
        most = loops.body_rate * jnp.asarray(RATE_INTEGRAL_MOST)
        turned = memory.rate_rad_s2 + (
            loops.body_rate * loops.rate_integral * period_s * missed
        )
        turned = jnp.clip(turned, -most, most)
        turn = three(loops.body_rate * missed + turned)
        inertia, w = rows(vehicle.inertia_kg_m2), three(state.body_rate_rad_s)
        moment = add(times(inertia, turn), cross(w, times(inertia, w)))
        asked: Four = (vehicle.mass_kg * along, *moment)
        speeds = speeds_within(vehicle, self.inverse, asked)
        after = Gathered(
            sums, state.velocity_m_s, gained, turned, jnp.ones_like(memory.begun)
        )
        return speeds, after


def _pull(
    loops: Cascade,
    state: State,
    vehicle: Vehicle,
    memory: Gathered,
    period_s: Float[Array, ""],
) -> tuple[Vector, Float[Array, "3"], Float[Array, "3"]]:
    """Return the pull to ask for, the integral and the rate of the velocity after."""
    wanted = loops.position * (loops.target_m - state.position_m)
    across = jnp.sum(wanted[:2] ** 2)
    fast = across > SPEED_MOST**2
    share = jnp.where(fast, SPEED_MOST / jnp.sqrt(jnp.where(fast, across, 1.0)), 1.0)
    climb = jnp.clip(wanted[2], -DESCENT_MOST, CLIMB_MOST)
    wanted = jnp.stack([share * wanted[0], share * wanted[1], climb])
    missed = wanted - state.velocity_m_s
    rate = (state.velocity_m_s - memory.velocity_m_s) / period_s
    passed = -jnp.expm1(-LOW_PASS * period_s) * memory.begun
    gained = memory.gained_m_s2 + passed * (rate - memory.gained_m_s2)
    asked = loops.velocity * missed + memory.pull_m_s2 - loops.acceleration * gained
    pull, leans, low, high = limited_pull(
        vehicle, three(asked.at[2].add(FLIGHT_GRAVITY))
    )
    stays = jnp.stack(
        [
            leans & (missed[0] * asked[0] > 0),
            leans & (missed[1] * asked[1] > 0),
            (low & (missed[2] < 0)) | (high & (missed[2] > 0)),
        ]
    )
    more = jnp.where(stays, 0.0, loops.velocity_integral * period_s * missed)
    sums = jnp.clip(memory.pull_m_s2 + more, -GATHERED_MOST, GATHERED_MOST)
    return pull, sums, gained
