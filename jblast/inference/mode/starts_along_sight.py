"""Where a search begins that knows a direction: along the line of sight."""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.posterior.posterior import Posterior
from jblast.parameters import CHARGE_POSITION
from jblast.quantities import CLOCK_TIMES, DIRECTIONS
from jblast.scene import Free

AWAY = 100.0
"""How far a charge is seen from at least, for a start [m]."""
FARTHER = 3.0
"""Starts along a line are spread by this factor, one standard deviation."""
BEARINGS = ("bearing_rad", "jolt_bearing_rad")
"""What says in which direction the charge is, or in which it is not."""


def sight_length(posterior: Posterior) -> Float[Array, ""]:
    """Return a typical distance of what sensors see the direction of [m]; else zero.

    How far sound goes in the time between the log's first and last clock times.
    """
    quantity = posterior.layout.quantity
    if not np.isin(quantity, tuple(DIRECTIONS)).any():
        return jnp.zeros(())
    clock = posterior.measured[np.isin(quantity, CLOCK_TIMES)]
    if clock.size == 0:
        return jnp.asarray(AWAY)
    return jnp.maximum(STANDARD_SOUND_SPEED * jnp.ptp(clock), AWAY)


def places_along_sight(
    posterior: Posterior,
    z: Float[Array, "start free"],
    normal: Float[Array, "start free"],
) -> Float[Array, "start free"]:
    """Move every other start's free places onto lines of sight, where there are any.

    Args:
        posterior: Has the bearings.
        z: Starts.
        normal: A standard normal draw for each coordinate.
    """
    names, beliefs = posterior.parameters.names, posterior.parameters.beliefs
    scene = posterior.parameters.scene
    for shot, charge in enumerate(scene.charges):
        place = [name + scene.label(charge) for name in CHARGE_POSITION]
        at = [names.index(name) if name in names else -1 for name in place]
        if at[0] < 0 or at[1] < 0:
            continue
        up = jnp.broadcast_to(charge.up, len(z)) if at[2] < 0 else z[:, at[2]]
        moved = _along_sight(
            posterior,
            np.array(posterior.layout.shot) == shot,
            jnp.stack([z[:, at[0]], z[:, at[1]], up], axis=1),
            normal[:, at[0]],
        )
        for i, coordinate in zip(at, moved.T, strict=True):
            if i >= 0 and isinstance(beliefs[i], Free):
                z = z.at[:, i].set(coordinate)
    return z


def _along_sight(
    posterior: Posterior,
    of_shot: np.ndarray,
    place: Float[Array, "start 3"],
    spread: Float[Array, " start"],
) -> Float[Array, "start 3"]:
    """Move every other place onto the line of sight of the first bearing, if any.

    The others stay: a second bearing may say better, or a library of places be drawn
    for logs that are yet to come.

    Args:
        posterior: Has the bearings.
        of_shot: Which rows are of the charge.
        place: East, north, up of the charge in each start [m].
        spread: A standard normal draw for each.
    """
    layout = posterior.layout
    seen = np.flatnonzero(of_shot & np.isin(layout.quantity, BEARINGS))
    if seen.size == 0:
        return place
    tall = np.flatnonzero(of_shot & np.isin(layout.quantity, "elevation_rad"))
    angle = posterior.measured[seen[0]]
    if layout.quantity[seen[0]] == "jolt_bearing_rad":  # thrown away from it
        angle = angle + math.pi
    rise = jnp.tan(posterior.measured[tall[0]]) if tall.size else 0.0
    line = jnp.stack([jnp.sin(angle), jnp.cos(angle), jnp.asarray(rise)])
    distance = sight_length(posterior) * FARTHER**spread
    on_line = layout.position[seen[0]][None, :] + distance[:, None] * line[None, :]
    return jnp.where(jnp.arange(len(place))[:, None] % 2 == 0, on_line, place)
