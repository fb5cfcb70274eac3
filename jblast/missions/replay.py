"""What a mission's guidance did, told again from the rows of its flight.

The controller's memory is not stored; but it follows from the states it was asked at,
and these are the rows where a row is stored each time that it is asked.
"""

from typing import NamedTuple

import jax
from jaxtyping import Array, Float, Int

from jblast.kept_programs import kept
from jblast.missions.guidance import Guidance, Progress
from jblast.vehicle import State, Trajectory


class Told(NamedTuple):
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
    guidance: Guidance, trajectory: Trajectory, period_s: Float[Array, ""]
) -> Told:
    """Return what the guidance said along a flight.

    Args:
        guidance: Of the flight.
        trajectory: One flight, a row each time that its controller was asked.
        period_s: Between two.
    """

    def turn(now: Progress, state: State) -> tuple[Progress, Told]:
        aim, after = guidance(state, now, period_s)
        return after, Told(aim.position_m, now.phase, now.leg)

    return jax.lax.scan(turn, guidance.start(), trajectory.states)[1]
