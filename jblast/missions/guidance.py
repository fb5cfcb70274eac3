r"""Set point of a vehicle on a mission, and the controller that follows it.

A plan is a table of legs: arrays, so that a batch of vehicles can have a batch of
plans. On a leg the tangent changes linearly: $p(s) = p_0 + t s + c s^2/2$ with the
tangent $t + c s$. A line has $c = 0$; any other leg is the path of a constant
acceleration (see `route`). A leg whose end speed is 0 ends with a stop. The last leg
never ends: it is a landing or a hover without end. So a table may be padded with
copies of it.

The phases are calibration with rotors at rest, idling once armed, flight along the
legs, and rotors at rest after the landing. The set point moves along a leg with an
acceleration of at most $a$ and a speed of at most

- the leg's limit and the braking limit $\sqrt{v_{end}^2 + 2 a l}$ with the remaining
  length $l$;
- this times $1 - (e - e_0)/(e_1 - e_0)$, clipped to 0 and 1, with the distance $e$ of
  the vehicle from the set point: the set point waits for a vehicle displaced by a blast
  (as in PX4, PositionSmoothing; $e_1$ is its MPC_XY_ERR_MAX, from memory).

At the end of a leg that waits, the set point stops until the vehicle is within the
acceptance radius and has stayed for the time of the item. The vehicle has landed after
some time at low speed and ground height.

The position controller follows the set point. The velocity passed to it is
$v - v_{sp} - a/k_d$, so it commands $-k_p e_x - k_d (v - v_{sp}) + a$ and its integral
depends on positions only. $a$ includes the set point's acceleration and the drag of the
rotors at hover speed, at that velocity in still air,
$(c_d, c_d, c_z) \sum \Omega_i v_{sp} / m$ with the drag coefficients $c$ of a rotor.
Without it an Iris lags 0.2 m behind at 5 m/s until its integral has compensated.

The controller's state is not stored. It is recomputed from the states passed to it,
which are the stored rows (or their estimates) if each sample is stored.
"""

import dataclasses
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.types import as_numbers
from jblast.vehicle import Gains, PositionHold, State, Trajectory, Vehicle
from jblast.vehicle.state import length_of, three

IDLE_SHARE = 0.2
"""Idle speed of armed rotors over their hover speed; declared."""
CALIBRATING, ARMED, FLYING, ENDED = range(4)
"""Phases in order."""
CALIBRATE_S, IDLE_S = 2.0, 1.0
"""Durations of calibration and idling; declared (COM_SPOOLUP_TIME is 1 s)."""
NEAR_M, FAR_M = 0.5, 2.0
"""$e_0$ and $e_1$: distances at which the set point slows down and stops."""
LOW_M, SLOW_M_S, LANDED_S = 0.05, 0.3, 0.5
"""Height and speed of a landed vehicle, and their minimum duration; declared."""
PHASE_S = (CALIBRATE_S, IDLE_S, LANDED_S, math.inf)
"""Duration of each phase; of flight the time at rest on the ground."""
MAX_YAW_RATE_RAD_S = 0.7853981633974483
"""Maximum yaw rate of the set point [MPC_YAWRAUTO_MAX, 45 degrees per second]."""
END_TOLERANCE_M = 1e-6
"""Tolerance of a leg's end: under the braking limit, the set point of a leg that waits
reaches its end only asymptotically."""


class Legs(eqx.Module):
    r"""Legs, in the order in which they are flown.

    Attributes:
        start_m: $p_0$: east, north, up.
        way: $t$: tangent at the start.
        bend_per_m: $c$: change of the tangent.
        length_m: Length, in $s$.
        speed_m_s: Maximum speed, of $s$.
        end_speed_m_s: Maximum speed at its end, for braking on following legs. 0: the
            set point waits there for the vehicle.
        goal_m: The waypoint.
        acceptance_m: Acceptance radius of the waypoint.
        hold_s: Waiting time at the end; infinite on the last leg.
        yaw_rad: Heading from east to north.
        visit: Index of its item in the order of execution, from 0.
    """

    start_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_numbers)
    way: Float[Array, "*batch leg 3"] = eqx.field(converter=as_numbers)
    bend_per_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_numbers)
    length_m: Float[Array, "*batch leg"] = eqx.field(converter=as_numbers)
    speed_m_s: Float[Array, "*batch leg"] = eqx.field(converter=as_numbers)
    end_speed_m_s: Float[Array, "*batch leg"] = eqx.field(converter=as_numbers)
    goal_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_numbers)
    acceptance_m: Float[Array, "*batch leg"] = eqx.field(converter=as_numbers)
    hold_s: Float[Array, "*batch leg"] = eqx.field(converter=as_numbers)
    yaw_rad: Float[Array, "*batch leg"] = eqx.field(converter=as_numbers)
    visit: Int[Array, "*batch leg"] = eqx.field(
        converter=lambda x: jnp.asarray(x, jnp.int32)
    )

    @property
    def count(self) -> int:
        """Number of legs, padding included."""
        return self.length_m.shape[-1]

    def padded(self, count: int) -> "Legs":
        """Return the table of one plan, padded with copies of its last leg."""
        missing = count - self.count
        if missing < 0:
            raise ValueError(f"expected at least {self.count} legs, got {count}")
        # NumPy, because padding with JAX would compile a program per number of legs.
        return jax.tree.map(
            lambda x: jnp.asarray(np.concatenate([x, np.repeat(x[-1:], missing, 0)])),
            self,
        )

    def at(
        self,
        leg: Int[Array | np.ndarray, ""],
        along_m: Float[Array | np.ndarray, ""],
    ) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
        """Return point, tangent, and the change of the tangent per metre, of one plan.

        Args:
            leg: Index of the leg.
            along_m: Distance from its start [m].
        """
        way, bend = self.way[leg], self.bend_per_m[leg]
        place = self.start_m[leg] + along_m * (way + along_m / 2 * bend)
        return place, way + along_m * bend, bend


class Progress(NamedTuple):
    """State of the guidance.

    Attributes:
        phase: One of `CALIBRATING` to `ENDED`.
        leg: Index of the current leg.
        since_s: Time in the phase before flight; then waiting time or time on ground.
        along_m: Position of the set point along the leg.
        speed_m_s: Speed of the set point.
        yaw_rad: Heading of the set point.
    """

    phase: Int[Array, ""]
    leg: Int[Array, ""]
    since_s: Float[Array, ""]
    along_m: Float[Array, ""]
    speed_m_s: Float[Array, ""]
    yaw_rad: Float[Array, ""]


class SetPoint(NamedTuple):
    """Set point of position, velocity and acceleration: east, north, up."""

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    acceleration_m_s2: Float[Array, "3"]


class Guidance(eqx.Module):
    """Guidance along the legs of a mission.

    Attributes:
        legs: Legs of the plan.
        acceleration_m_s2: Maximum acceleration of the set point.
        yaw_rad: Heading at the start.
    """

    legs: Legs
    acceleration_m_s2: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    yaw_rad: Float[Array, "*batch"] = eqx.field(converter=as_numbers, default=0.0)

    def start(self) -> Progress:
        """Return the state before the first sample."""
        none = jnp.zeros_like(self.yaw_rad)
        count = jnp.zeros_like(none, jnp.int32)
        return Progress(count, count, none, none, none, self.yaw_rad)

    def __call__(
        self, state: State, now: Progress, period_s: Float[Array, ""]
    ) -> tuple[SetPoint, Progress]:
        """Return the set point of this sample and the next state."""
        legs, leg, rate = self.legs, now.leg, self.acceleration_m_s2
        place, way, bend = legs.at(leg, now.along_m)
        flies = now.phase == FLYING
        length, end = legs.length_m[leg], legs.end_speed_m_s[leg]
        # 1e-12 (1e-6 m/s) keeps the gradient of the root finite at zero.
        left = jnp.maximum(length - now.along_m, 0.0)
        brake = jnp.sqrt(end * end + 2 * rate * left + 1e-12)
        most = jnp.minimum(legs.speed_m_s[leg], brake)
        away = length_of(state.position_m - place)
        share = jnp.clip(1 - (away - NEAR_M) / (FAR_M - NEAR_M), 0.0, 1.0)
        change = rate * period_s
        speed = jnp.clip(share * most, now.speed_m_s - change, now.speed_m_s + change)
        speed = jnp.where(flies, jnp.clip(speed, 0.0, most), 0.0)
        # The feed-forward is limited, because the set point may stop within one period.
        gain = jnp.clip((speed - now.speed_m_s) / period_s, -rate, rate)
        aim = SetPoint(place, speed * way, gain * way + speed * speed * bend)

        along, since = now.along_m + speed * period_s, now.since_s + period_s
        waits, at_end = end == 0, along >= length - END_TOLERANCE_M
        near = length_of(state.position_m - legs.goal_m[leg]) <= legs.acceptance_m[leg]
        # A waiting time continues once begun, even if a blast displaces the vehicle.
        holds = waits & at_end & (near | (now.since_s > 0))
        follows = jnp.where(waits, holds & near & (since >= legs.hold_s[leg]), at_end)
        follows = follows & flies
        low = (state.position_m[2] <= LOW_M) & (
            length_of(state.velocity_m_s) <= SLOW_M_S
        )
        # Only the last leg has no end.
        rests = low & jnp.isinf(legs.hold_s[leg])
        steps_on = (rests | ~flies) & (
            since >= jnp.asarray(PHASE_S, since.dtype)[now.phase]
        )
        counts = ~(follows | steps_on) & (holds | rests | ~flies)
        # The overshoot beyond a leg's end is carried into the next one, so that no
        # distance is lost.
        passed = jnp.where(waits, 0.0, along - length)
        along = jnp.where(waits, jnp.minimum(along, length), along)
        # The shorter direction of rotation.
        turn = legs.yaw_rad[leg] - now.yaw_rad + jnp.pi
        turn = jnp.remainder(turn, 2 * jnp.pi) - jnp.pi
        turn_most = jnp.where(flies, MAX_YAW_RATE_RAD_S * period_s, 0.0)
        return aim, Progress(
            jnp.where(steps_on, now.phase + 1, now.phase),
            jnp.where(follows, leg + 1, leg),
            jnp.where(counts, since, 0.0),
            jnp.where(follows, passed, jnp.where(flies, along, now.along_m)),
            speed,
            now.yaw_rad + jnp.clip(turn, -turn_most, turn_most),
        )


@kept
def replay(
    guidance: Guidance, flight: Trajectory, period_s: Float[Array, ""]
) -> tuple[Float[Array, "time 3"], Int[Array, " time"], Bool[Array, " time"]]:
    """Return set points, items and arming of a flight, as in `vehicle.Trajectory`.

    Args:
        guidance: Guidance of the flight.
        flight: States passed to the guidance, one row per sample.
        period_s: Period of the controller.
    """

    def turn(
        now: Progress, state: State
    ) -> tuple[Progress, tuple[Array, Array, Array]]:
        aim, after = guidance(state, now, period_s)
        flies = now.phase == FLYING
        item = jnp.where(flies, guidance.legs.visit[now.leg], -1)
        return after, (aim.position_m, item, flies | (now.phase == ARMED))

    # The rows of a diverged vehicle are NaN: its last state stays.
    known = jnp.isfinite(flight.position_m[:, 0])
    last = jax.lax.cummax(jnp.where(known, jnp.arange(known.size), 0))
    return jax.lax.scan(turn, guidance.start(), flight.at(last).states)[1]


Memory = tuple[Float[Array, "3"], Progress]


class MissionControl(eqx.Module):
    """Controller of a vehicle on a mission.

    Attributes:
        guidance: The mission.
        hold: Controller that follows the set point; its target and heading are ignored.

    Example:
        `simulate(vehicle, start, control=MissionControl(guidance, hold), ...)`
    """

    guidance: Guidance
    hold: PositionHold

    @property
    def gains(self) -> Gains:
        """Gains of the position controller; the step limit depends on them."""
        return self.hold.gains

    def start(self) -> Memory:
        """Return the initial integral of the controller and state of the guidance."""
        return self.hold.start(), self.guidance.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Memory,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Memory]:
        """Return rotor speed commands [rad/s], shape (4,), and the next state."""
        integral, now = memory
        aim, after = self.guidance(state, now, period_s)
        moved = as_if_at_rest(vehicle, self.gains, state, aim)
        hold = eqx.tree_at(
            lambda hold: (hold.target_m, hold.yaw_rad),
            self.hold,
            (aim.position_m, now.yaw_rad),
        )
        speeds, gained = hold(time_s, moved, vehicle, integral, period_s)
        idle = IDLE_SHARE * _hover_speed(vehicle)
        idle = jnp.where(now.phase == ARMED, idle, 0.0)
        flies = now.phase == FLYING
        speeds = jnp.where(flies, speeds, idle)
        # The integral begins at zero with the flight: on the ground it would wind up.
        return speeds, (jnp.where(flies, gained, 0.0), after)


def as_if_at_rest(vehicle: Vehicle, gains: Gains, state: State, aim: SetPoint) -> State:
    """Return the state to pass to a position controller for a moving set point.

    Args:
        vehicle: The controller's model of the vehicle.
        gains: Gains of the controller.
        state: State of the vehicle.
        aim: The set point.
    """
    # Feed-forward of the drag at the desired velocity: without it an Iris lags by 0.2 m
    # at 5 m/s.
    drag = 4 * _hover_speed(vehicle) * vehicle.rotor_drag / vehicle.mass_kg

    def along(
        speed: Array, wanted: Array, gained: Array, gain: Array, pull: Array
    ) -> Array:
        lead = gained + pull * wanted
        # Without a velocity gain there is no lead; the guarded division keeps gradients
        # finite.
        some = gain > 0
        lead = jnp.where(some, lead / jnp.where(some, gain, 1.0), 0.0)
        return speed - wanted - lead

    # Axis by axis, so that a batch has one array per component (see `vehicle.state`).
    axes = map(
        three,
        (
            state.velocity_m_s,
            aim.velocity_m_s,
            aim.acceleration_m_s2,
            gains.velocity,
            drag,
        ),
    )
    shown = jnp.stack([along(*axis) for axis in zip(*axes, strict=True)])
    return dataclasses.replace(state, velocity_m_s=shown)


def _hover_speed(vehicle: Vehicle) -> Float[Array, ""]:
    """Return the rotor speed of hover in still air [rad/s]."""
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return jnp.sqrt(weight / (4 * vehicle.thrust_coefficient))
