"""What blasts do to an estimate: how far off it is before each, and at most after."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.autopilot.estimator.estimate import MOVES, PLACE, TURN
from jblast.autopilot.estimator.followed import Followed

WATCHED_S = 10.0
"""How long after it came a blast is held to account, until the next one at most."""
BEFORE_S = 1.0
"""How long before it came the estimate is looked at."""


class Thrown(NamedTuple):
    """Errors of an estimate by blast: root mean square before, greatest after.

    Attributes:
        place_before_m: Of the position.
        place_m: Likewise, after.
        moves_before_m_s: Of the velocity.
        moves_m_s: Likewise, after.
        turn_before_rad: Of the attitude.
        turn_rad: Likewise, after.
    """

    place_before_m: Float[Array, "*batch blast"]
    place_m: Float[Array, "*batch blast"]
    moves_before_m_s: Float[Array, "*batch blast"]
    moves_m_s: Float[Array, "*batch blast"]
    turn_before_rad: Float[Array, "*batch blast"]
    turn_rad: Float[Array, "*batch blast"]


def thrown(
    followed: Followed, time_s: Float[Array, " time"], arrival_s: Float[Array, " blast"]
) -> Thrown:
    """Return what blasts did to an estimate; NaN of one that the flight does not meet.

    Args:
        followed: The estimate along a flight.
        time_s: Of its rows.
        arrival_s: Of the blasts at the vehicle; infinite: never.
    """
    later = jnp.where(
        arrival_s[None, :] > arrival_s[:, None], arrival_s[None, :], jnp.inf
    )
    until = jnp.minimum(jnp.min(later, axis=1), arrival_s + WATCHED_S)
    sizes = [
        jnp.linalg.norm(followed.error[:, part], axis=-1)
        for part in (PLACE, MOVES, TURN)
    ]

    def of(came: Array, end: Array) -> list[Array]:
        before = (time_s >= came - BEFORE_S) & (time_s < came)
        after = (time_s >= came) & (time_s < end)
        found = []
        for size in sizes:
            found += [_rms(size, before), _most(size, after)]
        return found

    return Thrown(*jax.vmap(of)(arrival_s, until))


def _rms(values: Float[Array, " time"], rows: Bool[Array, " time"]) -> Array:
    count = jnp.sum(rows).astype(values.dtype)
    square = jnp.sum(jnp.where(rows, jnp.square(values), 0.0))
    some = count > 0
    mean = jnp.where(some, square / jnp.where(some, count, 1.0), jnp.nan)
    return jnp.sqrt(mean)


def _most(values: Float[Array, " time"], rows: Bool[Array, " time"]) -> Array:
    # one that is lost has no size: it stays NaN
    greatest = jnp.max(jnp.where(rows, values, -1.0))
    return jnp.where(greatest < 0, jnp.nan, greatest)
