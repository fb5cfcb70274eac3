"""Where a search begins in time: so that the median reading of a clock is met."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.posterior import Posterior
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import CLOCK_TIMES, FIREBALL_RADII
from jblast.scene import Free

SHORT = 1e-3
"""A time in which fireballs grow [s]."""


def with_times_met(
    posterior: Posterior,
    z: Float[Array, "start free"],
    normal: Float[Array, "start free"],
) -> Float[Array, "start free"]:
    """Set free origin times, by clocks that are known, then clocks that are not.

    Args:
        posterior: Has the readings.
        z: Starts, their places set.
        normal: A standard normal draw for each coordinate.
    """
    for i, label in _free(posterior, "origin_time_s"):
        z = _with_origin_time(posterior, z, i, label, normal[:, i])
    timed = np.isin(posterior.layout.quantity, CLOCK_TIMES)
    for i, label in _free(posterior, CLOCK_OFFSET):
        z = _met(posterior, z, i, timed & (np.array(posterior.layout.clock) == label))
    return z


def _free(posterior: Posterior, base: str) -> list[tuple[int, str]]:
    """Return the coordinates that are one free number, and the label of each."""
    parameters = posterior.parameters
    parts = [name.partition(".") for name in parameters.names]
    return [
        (i, label)
        for i, ((name, _, label), belief) in enumerate(
            zip(parts, parameters.beliefs, strict=True)
        )
        if name == base and isinstance(belief, Free)
    ]


def _with_origin_time(
    posterior: Posterior,
    z: Float[Array, "start free"],
    i: int,
    label: str,
    normal: Float[Array, " start"],
) -> Float[Array, "start free"]:
    """Set the origin time of a charge by its rows, those of a flash if radii are seen.

    Args:
        posterior: Has the readings.
        z: Starts.
        i: Coordinate of the origin time.
        label: Name of the charge.
        normal: A standard normal draw.
    """
    layout, scene = posterior.layout, posterior.parameters.scene
    named = [charge.name for charge in scene.charges]
    of_charge = np.array(layout.shot) == (named.index(label) if scene.others else 0)
    radii = of_charge & np.isin(layout.quantity, FIREBALL_RADII)
    rows = of_charge & np.isin(layout.quantity, CLOCK_TIMES)
    offsets = [name.partition(".") for name in posterior.parameters.names]
    unknown = [clock for base, _, clock in offsets if base == CLOCK_OFFSET]
    known = rows & ~np.isin(layout.clock, unknown)
    rows = known if known.any() else rows
    flash = rows & np.isin(layout.quantity, "flash_time_s")
    rows = flash if radii.any() and flash.any() else rows
    z = _met(posterior, z, i, rows)
    if radii.any():
        z = z.at[:, i].set(_before_radii(z[:, i], layout.time[radii], normal))
    return z


def _met(posterior: Posterior, z, i: int, rows: Bool[np.ndarray, " row"]):
    """Move a time by as much as the median of some readings is later than predicted."""
    if not rows.any():
        return z
    residual = jax.vmap(lambda z: posterior.misfit(z).residual)(z)
    return z.at[:, i].add(jnp.median(residual[:, np.flatnonzero(rows)], axis=1))


def _before_radii(origin, times, normal):
    """Return origin times, those that are not before the first radius moved there.

    A radius before the explosion hardly says when that was.
    """
    long = jnp.maximum(jnp.ptp(times), SHORT)
    earlier = times.min() - jnp.abs(normal) * long
    return jnp.where(origin < times.min(), origin, earlier)
