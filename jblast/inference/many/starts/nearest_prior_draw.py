"""Where fits begin for want of better: the nearest of draws of the prior.

The layout is the same for all logs, so places to start from are too: a reference set is
drawn (as `inference.mode.starts` draws), what each would read is computed once, and a
log starts from those whose readings are nearest to its own, in standard deviations. A
free
origin time is left out of the comparison, and set so that the log is late by nothing.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.inference.many.residuals.rows import LaneRows
from jblast.inference.mode.starts import starts
from jblast.inference.posterior.posterior import Posterior
from jblast.observations import CLOCK_TIMES
from jblast.scene import Free

REFERENCE_DRAWS = 64
"""Size of the reference set."""
AT_ONCE = 4096
"""Logs compared with it together: what stays in a cache."""


class ReferenceSet(NamedTuple):
    """Places, and what would be read of them.

    Attributes:
        z: Places.
        projected: Readings in standard deviations, without what an origin time adds.
        half_square: Half of their squared length.
        weight: What turns a log's readings into the same.
        late: Mean lateness of a log's readings.
        late_of_place: And of the places'.
        clock: 1 for the coordinate that is the origin time.
    """

    z: Float[Array, "place free"]
    projected: Float[Array, "row place"]
    half_square: Float[Array, " place"]
    weight: Float[Array, "row row"]
    late: Float[Array, " row"]
    late_of_place: Float[Array, " place"]
    clock: Float[Array, " free"]

    def nearest(
        self, measured: Float[Array, "row lane"], skipped: int = 0
    ) -> Float[Array, "free lane"]:
        """Return the places nearest to logs, but for so many that are nearer."""
        return jax.lax.map(
            lambda log: self._nearest(log, skipped), measured.T, batch_size=AT_ONCE
        ).T

    def _nearest(self, log: Float[Array, " row"], skipped: int):
        away = self.half_square - (self.weight @ log) @ self.projected
        for _ in range(skipped):
            away = away.at[jnp.argmin(away)].set(jnp.inf)
        best = jnp.argmin(away)
        return self.z[best] + self.clock * (self.late @ log - self.late_of_place[best])


def reference_set(
    key: PRNGKeyArray,
    posterior: Posterior,
    rows: LaneRows,
    sigma: Float[np.ndarray, " row"],
    count: int = REFERENCE_DRAWS,
) -> ReferenceSet:
    """Draw a reference set.

    Args:
        key: Random key.
        posterior: Of any log of the layout.
        rows: The layout.
        sigma: Instrument errors of a typical log.
        count: How many places.
    """
    z = starts(key, posterior, count)
    misfit = jax.vmap(posterior.misfit)(z)
    scale = np.hypot(sigma, np.median(np.asarray(misfit.sd), axis=0))
    readings = rows.to_error_scale(misfit.predicted)
    good = np.isfinite(np.asarray(readings)).all(axis=0)
    z, readings = z[good], readings[:, good]
    timed = np.isin(rows.layout.quantity, CLOCK_TIMES)
    clock = [
        name == "origin_time_s" and isinstance(belief, Free)
        for name, belief in zip(
            rows.parameters.names, rows.parameters.beliefs, strict=True
        )
    ]
    late = timed / scale**2
    late = late / late.sum() if any(clock) and timed.any() else 0 * late
    weight = (np.eye(scale.size) - timed[:, None] * late[None, :]) / scale[:, None]
    projected = weight @ np.asarray(readings)
    # of no device in particular, whatever drew them: lanes may lie on another
    return ReferenceSet(
        *map(
            jnp.asarray,
            (
                np.asarray(z),
                projected,
                0.5 * np.sum(projected**2, axis=0),
                weight,
                late,
                late @ np.asarray(readings),
                np.array(clock, float),
            ),
        ),
    )
