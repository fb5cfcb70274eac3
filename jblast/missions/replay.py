"""What a mission's guidance did, told again from the rows of its flight.

The controller's memory is not stored; but it follows from the states it was shown, and
these are the rows (or their estimate) where a row is stored each time that it is asked.
"""

from typing import NamedTuple

import jax
from jaxtyping import Array, Float, Int

from jblast.kept_programs import kept
from jblast.missions.guidance import Guidance, Progress
from jblast.vehicle import State


class GuidanceHistory(NamedTuple):
    """What the guidance said at each row.

    Attributes:
        set_point_m: Where the vehicle should have been.
        phase: Of `guidance.PHASES`.
        leg: Which leg was flown.
    """

    set_point_m: Float[Array, "time 3"]
    phase: Int[Array, " time"]
    leg: Int[Array, " time"]


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
