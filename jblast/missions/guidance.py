r"""The set point of a vehicle on a mission, and the controller that follows it.

A plan is a table of legs: arrays, so that a batch flies a batch of plans. A leg is a
path of constant curvature, straight or circular: $p(s) = p_0 + t\,\sin(\kappa s)/\kappa
+ n\,(1 - \cos \kappa s)/\kappa$, with the velocity along $t\cos\kappa s + n\sin\kappa
s$. The table is padded with legs that are never entered, because its last leg is a
landing or a hold without end.

The phases come one after another: the rotors stand while the sensors are calibrated,
idle once armed, fly the legs, and stand when the vehicle has landed. The set point
moves along a leg at a speed that grows by $a$ at most and is never above

- the leg's own, and what can be braked for, $\sqrt{v_{end}^2 + 2 a l}$ with $l$ still
  to go;
- that times $1 - (e - e_0)/(e_1 - e_0)$, within 0 and 1, where the vehicle is $e$ away
  from it: the set point waits for a vehicle that a blast has moved away (as in PX4,
  PositionSmoothing; $e_1$ is its MPC_XY_ERR_MAX, from memory).

At the end of a leg that waits, the set point stands until the vehicle has come within
the acceptance radius and stayed for the time that the item specifies. The vehicle has
landed when it has been slow and as low as the ground for some time.

The position hold follows the set point. Its velocity and acceleration are added to the
velocity that the hold is given, $v - v_{sp} - a/k_d$, so that the hold requests
$-k_p e_x - k_d (v - v_{sp}) + a$ and its integral depends on positions alone. $a$ has
the set point's acceleration and the drag of the rotors at hover at that velocity in
still air, $(c_d, c_d, c_z) \sum \Omega_i v_{sp} / m$ with the drag coefficients $c$ of
a rotor. Without it an Iris trails 0.2 m behind at 5 m/s for as long as its integral
needs.

The controller's memory is not stored. It is computed again from the states that it was
given, which are the stored rows (or their estimates) where each turn is stored.
"""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.types import as_float_array
from jblast.vehicle import Controller, Gains, PositionHold, State, Vehicle
from jblast.vehicle.control.position_hold import PreparedController
from jblast.vehicle.state import three

IDLE_SHARE = 0.2
"""Of the speed at which the rotors carry the weight; declared."""
CALIBRATING, ARMED, FLYING, ENDED = range(4)
"""Phases, in their order."""
PHASES = ("calibrating", "armed", "flying", "disarmed")
CALIBRATE_S, IDLE_S = 2.0, 1.0
"""How long the first two last; declared (COM_SPOOLUP_TIME is 1 s)."""
NEAR_M, FAR_M = 0.5, 2.0
"""$e_0$ and $e_1$."""
LOW_M, SLOW_M_S, LANDED_S = 0.05, 0.3, 0.5
"""What counts as landed, and after how long; declared."""
TURN_RAD_S = 0.7853981633974483
"""Most that the heading turns [MPC_YAWRAUTO_MAX, 45 degrees a second]."""
AT_END_M = 1e-6
"""Rounding of the path length: the set point of a leg that waits reaches its end in the
limit."""


class Legs(eqx.Module):
    r"""Legs, in the order in which they are flown.

    Attributes:
        start_m: $p_0$: east, north, up.
        along: $t$: unit vector.
        inward: $n$: unit vector to the middle of the circle; zero: straight.
        curvature_per_m: $\kappa$.
        length_m: To its end.
        speed_m_s: Most on the way.
        end_speed_m_s: Most at its end, so that what follows can be braked for.
        goal_m: The waypoint.
        acceptance_m: How near the vehicle must come to it.
        hold_s: How long it stays there; infinite: for ever.
        yaw_rad: Heading from east to north; NaN: as it is.
        waits: Whether the set point stops at its end until the vehicle has come and
            stayed; else it passes.
        lands: Whether it ends on the ground.
        visit: Which item it belongs to, as they are flown, from 0.
    """

    start_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    along: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    inward: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    curvature_per_m: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    length_m: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    speed_m_s: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    end_speed_m_s: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    goal_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    acceptance_m: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    hold_s: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    yaw_rad: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    waits: Bool[Array, "*batch leg"] = eqx.field(converter=jnp.asarray)
    lands: Bool[Array, "*batch leg"] = eqx.field(converter=jnp.asarray)
    visit: Int[Array, "*batch leg"] = eqx.field(
        converter=lambda x: jnp.asarray(x, jnp.int32)
    )

    @property
    def count(self) -> int:
        """Legs in the table, padding included."""
        return self.length_m.shape[-1]

    def padded(self, count: int) -> "Legs":
        """Return the table with its last leg repeated up to so many.

        The last is never left, so what stands behind it is never flown.
        """
        missing = count - self.count
        if missing < 0:
            raise ValueError(f"expected at least {self.count} legs, got {count}")
        widths = {1: [(0, missing)], 2: [(0, missing), (0, 0)]}
        return Legs(
            *(
                np.pad(np.asarray(getattr(self, name)), widths[dims], mode="edge")
                for name, dims in FIELDS.items()
            )
        )


FIELDS = {
    "start_m": 2,
    "along": 2,
    "inward": 2,
    "curvature_per_m": 1,
    "length_m": 1,
    "speed_m_s": 1,
    "end_speed_m_s": 1,
    "goal_m": 2,
    "acceptance_m": 1,
    "hold_s": 1,
    "yaw_rad": 1,
    "waits": 1,
    "lands": 1,
    "visit": 1,
}
"""Of `Legs`, with their number of axes without a batch."""


class GuidanceHistory(NamedTuple):
    """Output of the guidance at each row.

    Attributes:
        set_point_m: Where the vehicle should have been.
        phase: Of `PHASES`.
        leg: Which leg was flown.
    """

    set_point_m: Float[Array, "time 3"]
    phase: Int[Array, " time"]
    leg: Int[Array, " time"]


class Progress(NamedTuple):
    """How far a mission has come.

    Attributes:
        phase: Of `PHASES`.
        leg: Which one is flown.
        since_s: Of the phase, up to arming; then of the hold, or on the ground.
        along_m: Of the set point, from the leg's start.
        speed_m_s: Of the set point.
        yaw_rad: Its heading.
    """

    phase: Int[Array, ""]
    leg: Int[Array, ""]
    since_s: Float[Array, ""]
    along_m: Float[Array, ""]
    speed_m_s: Float[Array, ""]
    yaw_rad: Float[Array, ""]


class SetPoint(NamedTuple):
    """Where the vehicle should be, and how it should move there."""

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    acceleration_m_s2: Float[Array, "3"]


class Guidance(eqx.Module):
    """The legs of a mission, and how they are followed.

    Attributes:
        legs: Of the plan.
        acceleration_m_s2: Of the set point.
        yaw_rad: Heading at the start.
        ground_m: Height of the ground.
    """

    legs: Legs
    acceleration_m_s2: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    yaw_rad: Float[Array, "*batch"] = eqx.field(converter=as_float_array, default=0.0)
    ground_m: Float[Array, "*batch"] = eqx.field(converter=as_float_array, default=0.0)

    def start(self) -> Progress:
        """Return the progress before the first turn."""
        none = jnp.zeros_like(self.yaw_rad)
        count = jnp.zeros_like(none, jnp.int32)
        return Progress(count, count, none, none, none, self.yaw_rad)

    def set_point(self, now: Progress) -> Float[Array, "3"]:
        """Return where the vehicle should be [m]."""
        return point_on(self.legs, now.leg, now.along_m)[0]

    def __call__(
        self, state: State, now: Progress, period_s: Float[Array, ""]
    ) -> tuple[SetPoint, Progress]:
        """Return the set point of this turn, and the progress afterwards."""
        legs, leg, rate = self.legs, now.leg, self.acceleration_m_s2
        place, way, inward = point_on(legs, leg, now.along_m)
        flies = now.phase == FLYING
        left = legs.length_m[leg] - now.along_m
        end = legs.end_speed_m_s[leg]
        # a millionth of a metre a second more: the root has a slope there
        brake = jnp.sqrt(end * end + 2 * rate * jnp.maximum(left, 0.0) + 1e-12)
        away = _length(state.position_m - place)
        share = jnp.clip(1 - (away - NEAR_M) / (FAR_M - NEAR_M), 0.0, 1.0)
        most = share * jnp.minimum(legs.speed_m_s[leg], brake)
        change = rate * period_s
        speed = jnp.minimum(now.speed_m_s + change, most)
        # thrown off, it brakes as it may; towards the leg's end as it must
        speed = jnp.maximum(
            speed, jnp.minimum(now.speed_m_s - change, legs.speed_m_s[leg])
        )
        speed = jnp.where(flies, jnp.minimum(jnp.maximum(speed, 0.0), brake), 0.0)
        gain = jnp.clip((speed - now.speed_m_s) / period_s, -rate, rate)
        curvature = legs.curvature_per_m[leg]
        aim = SetPoint(
            place, speed * way, gain * way + speed * speed * curvature * inward
        )
        along = now.along_m + speed * period_s
        waits = legs.waits[leg]
        at_end = along >= legs.length_m[leg] - AT_END_M
        along = jnp.where(waits, jnp.minimum(along, legs.length_m[leg]), along)
        return aim, self._after(state, now, speed, along, at_end & flies, period_s)

    def _after(
        self,
        state: State,
        now: Progress,
        speed: Float[Array, ""],
        along: Float[Array, ""],
        at_end: Array,
        period_s: Float[Array, ""],
    ) -> Progress:
        """Return the progress after a turn."""
        legs, leg, phase = self.legs, now.leg, now.phase
        flies, lands = phase == FLYING, legs.lands[leg]
        near = _length(state.position_m - legs.goal_m[leg]) <= legs.acceptance_m[leg]
        slow = _length(state.velocity_m_s) <= SLOW_M_S
        low = state.position_m[2] <= self.ground_m + LOW_M
        rests = lands & low & slow & flies
        since = now.since_s + period_s
        # a hold once begun goes on, wherever a blast throws the vehicle
        holds = legs.waits[leg] & at_end & (near | (now.since_s > 0)) & ~lands
        since = jnp.where(flies & ~(holds | rests), 0.0, since)
        comes_back = holds & (since >= legs.hold_s[leg]) & near
        goes_on = jnp.where(legs.waits[leg], comes_back, at_end & ~lands)
        landed = rests & (since >= LANDED_S)
        timed_out = jnp.where(
            phase == CALIBRATING, since >= CALIBRATE_S, since >= IDLE_S
        )
        steps_on = jnp.where(flies, landed, timed_out & (phase < ENDED))
        begins = steps_on | (goes_on & flies)
        passed = jnp.where(legs.waits[leg], 0.0, along - legs.length_m[leg])
        aim = legs.yaw_rad[leg]
        off = jnp.where(jnp.isnan(aim), 0.0, aim - now.yaw_rad)
        turn = jnp.remainder(off + jnp.pi, 2 * jnp.pi) - jnp.pi
        most = TURN_RAD_S * period_s
        turn = jnp.where(flies, jnp.clip(turn, -most, most), 0.0)
        follows = goes_on & flies
        last = jnp.minimum(leg + 1, legs.count - 1)
        return Progress(
            jnp.where(steps_on, phase + 1, phase),
            jnp.where(follows, last, leg),
            jnp.where(begins, 0.0, since),
            jnp.where(follows, passed, jnp.where(flies, along, now.along_m)),
            speed,
            now.yaw_rad + turn,
        )


@kept
def replay(
    guidance: Guidance, states: State, period_s: Float[Array, ""]
) -> GuidanceHistory:
    """Return what the guidance said along a flight.

    Args:
        guidance: Of the flight.
        states: What the guidance was shown, a row each time that it was asked.
        period_s: Between two.
    """

    def turn(now: Progress, state: State) -> tuple[Progress, GuidanceHistory]:
        aim, after = guidance(state, now, period_s)
        return after, GuidanceHistory(aim.position_m, now.phase, now.leg)

    return jax.lax.scan(turn, guidance.start(), states)[1]


Memory = tuple[Float[Array, "3"], Progress]


class MissionControl(PreparedController):
    """Flies a mission unattended.

    Attributes:
        guidance: The mission.
        hold: Who follows the set point; its target and heading are not used.

    Example:
        `simulate(vehicle, start, control=MissionControl(guidance, hold), ...)`
    """

    guidance: Guidance
    hold: PositionHold

    @property
    def gains(self) -> Gains:
        """Of the hold: by them the step is checked."""
        return self.hold.gains

    def start(self) -> Memory:
        """Return the hold's integral and the mission's progress."""
        return self.hold.start(), self.guidance.start()

    def ready(self, vehicle: Vehicle) -> Controller:
        """Return the same with its allocation inverted, once for a flight."""
        return _Ready(self, self.hold.ready(vehicle))


class _Ready(eqx.Module):
    """A mission's control that need not invert its allocation at every turn."""

    control: MissionControl
    hold: Any

    def start(self) -> Memory:
        return self.control.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Memory,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Memory]:
        integral, now = memory
        aim, after = self.control.guidance(state, now, period_s)
        moved = as_if_at_rest(vehicle, self.control.gains, state, aim)
        hold = eqx.tree_at(
            lambda ready: (ready.hold.target_m, ready.hold.yaw_rad),
            self.hold,
            (aim.position_m, now.yaw_rad),
        )
        speeds, gained = hold(time_s, moved, vehicle, integral, period_s)
        idle = IDLE_SHARE * _hover_speed(vehicle)
        idle = jnp.where(now.phase == ARMED, idle, 0.0)
        flies = now.phase == FLYING
        speeds = jnp.where(flies, speeds, idle)
        return speeds, (jnp.where(flies, gained, 0.0), after)


def as_if_at_rest(vehicle: Vehicle, gains: Gains, state: State, aim: SetPoint) -> State:
    """Return what a hold is shown, so that it follows an aim that moves.

    Args:
        vehicle: The hold's model of the vehicle.
        gains: Of the hold.
        state: Of the vehicle.
        aim: Where it should be.
    """
    drag = 4 * _hover_speed(vehicle) * vehicle.rotor_drag / vehicle.mass_kg

    def along(
        speed: Array, wanted: Array, gained: Array, gain: Array, pull: Array
    ) -> Array:
        lead = gained + pull * wanted
        some = gain > 0
        lead = jnp.where(some, lead / jnp.where(some, gain, 1.0), 0.0)
        return speed - wanted - lead

    # axis by axis: a step of many vehicles has no arrays but theirs
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
    """Return the speed at which the rotors carry the weight [rad/s]."""
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return jnp.sqrt(weight / (4 * vehicle.thrust_coefficient))


def _length(vector: Float[Array, "3"]) -> Float[Array, ""]:
    """Return the length of a vector, with a slope of 0 at 0."""
    square = jnp.sum(vector * vector)
    some = square > 0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


def point_on(
    legs: Legs, leg: Int[Array, ""], along_m: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """Return a point of a leg, the way there, and the way to the circle's middle.

    Args:
        legs: One plan's.
        leg: Which.
        along_m: From its start [m].
    """
    curvature = legs.curvature_per_m[leg]
    is_round = curvature > 0
    bend = jnp.where(is_round, curvature, 1.0)
    angle = curvature * along_m
    sine, cosine = jnp.sin(angle), jnp.cos(angle)
    ahead = jnp.where(is_round, sine / bend, along_m)
    aside = jnp.where(is_round, (1 - cosine) / bend, 0.0)
    tangent, normal = legs.along[leg], legs.inward[leg]
    place = legs.start_m[leg] + ahead * tangent + aside * normal
    way = cosine * tangent + sine * normal
    return place, way, cosine * normal - sine * tangent
