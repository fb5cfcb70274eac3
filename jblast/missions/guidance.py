r"""Who tells the vehicle where to be: phases of a mission, and a set point on its legs.

The phases come one after another: the rotors stand while the sensors are calibrated,
idle once armed, fly the legs, and stand when the vehicle has landed. The set point
moves along a leg at a speed that grows by $a$ at most and is never above

- the leg's own, and what can be braked for, $\sqrt{v_{end}^2 + 2 a l}$ with $l$ still
  to go;
- that times $1 - (e - e_0)/(e_1 - e_0)$, within 0 and 1, where the vehicle is $e$ away
  from it: thrown by a blast, it finds the set point waiting (as PX4 has it,
  PositionSmoothing; $e_1$ is its MPC_XY_ERR_MAX, from memory).

At the end of a leg that waits, the set point stands until the vehicle has come within
the acceptance radius and stayed as long as the item says. Landed is who is as low as
the ground, and slow, for some time.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jblast.missions.legs import Legs, point_on
from jblast.types import as_float_array
from jblast.vehicle import State

CALIBRATING, ARMED, FLYING, ENDED = range(4)
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


def _length(vector: Float[Array, "3"]) -> Float[Array, ""]:
    """Return the length of a vector, with a slope of 0 at 0."""
    square = jnp.sum(vector * vector)
    some = square > 0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)
