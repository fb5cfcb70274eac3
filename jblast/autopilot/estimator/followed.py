"""What a vehicle believed along its flight, told again from the flight's rows.

The memory of a controller is not stored; but it follows from the states at which it was
asked, where a row is stored each time that it is.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.autopilot.estimator.control import EstimatedControl, Known
from jblast.autopilot.estimator.estimate import error_of
from jblast.vehicle import State, Trajectory


class Followed(NamedTuple):
    """An estimate along a flight.

    Attributes:
        shown: What who flew took for the state.
        error: That takes it to the truth, by the parts of `estimate`.
        deviation: How sure it was: one standard deviation of each.
    """

    shown: State
    error: Float[Array, "time 15"]
    deviation: Float[Array, "time 15"]


def followed(
    control: EstimatedControl, trajectory: Trajectory, period_s: Float[Array, ""]
) -> Followed:
    """Return what was believed along a flight.

    Args:
        control: Of the flight.
        trajectory: One flight, a row each time that its controller was asked.
        period_s: Between two.
    """

    def turn(known: Known, row: tuple[Array, State]) -> tuple[Known, Followed]:
        time_s, state = row
        known = control.sensed(time_s, state, known, period_s)
        estimate = known.estimate
        # after the turn's walk the instruments are off by what they keep
        error = error_of(estimate, state, known.held.biases)
        return known, Followed(
            control.shown(known, state),
            error,
            jnp.sqrt(jnp.diagonal(estimate.covariance)),
        )

    rows = trajectory.time_s, trajectory.states
    return jax.lax.scan(turn, control.known(), rows)[1]
