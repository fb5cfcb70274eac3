"""The fitted shock at a radius, read between the records of a run.

A run ends by a step cut short. Such a step leaves another pressure behind the shock
than a whole one, by 6e-6 with 200 cells, and its length jumps as a parameter varies:
differences of runs show the jumps, derivatives do not, for they hold the steps. The
records on the way come from whole steps and lie on a smooth curve.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.run import History

POINTS = 4
"""Records that a cubic goes through, two on either side."""


def front_pressure_at(history: History, radius: Float[Array, ""]) -> Float[Array, ""]:
    r"""Return the pressure behind the shock as it passes a radius [Pa].

    By the cubic through four records of $\ln p$ against $\ln R$.

    Args:
        history: Of one run with a fitted shock; it ends beyond the radius.
        radius: Where [m].

    Returns:
        It; NaN without two records before the radius and two beyond it.
    """
    beyond = jnp.searchsorted(history.clock, radius, side="right")
    first = jnp.clip(beyond - POINTS // 2, 0, history.clock.size - POINTS)
    x, y = (
        jnp.log(jax.lax.dynamic_slice(values, (first,), (POINTS,)))
        for values in (history.clock, history.front_pressure)
    )
    away = x - jnp.log(radius)
    powers = jnp.vander(away / (x[-1] - x[0]))
    value = jnp.exp(jnp.linalg.solve(powers, y)[-1])
    # A run that stands at its end repeats its last record.
    apart = (beyond - POINTS // 2 == first) & jnp.all(jnp.diff(x) > 0.0)
    return jnp.where(apart, value, jnp.nan)
