r"""Pressure and speed of a shock front in scaled terms: 1 kg in standard air.

Kingery and Bulmash up to $Z = 20$, the weak-shock tail from there, and the speed by
Rankine and Hugoniot. `laws.py` says why, and scales them.
"""

import math
from functools import cache

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.laws.kingery_bulmash.table import kingery_bulmash_curve
from jblast.waves.shock.weak_shock_tail import WeakShockTail, weak_shock_tail

JOIN = 20.0
"""Scaled distance where the tail takes over [m/kg^(1/3)]."""

LOG_STANDARD_PRESSURE = math.log(STANDARD_PRESSURE)


@cache
def front_tail(burst: str) -> WeakShockTail:
    """Return the tail that continues the pressure curve of a burst."""
    curve = kingery_bulmash_curve("incident_pressure", burst)
    return weak_shock_tail(curve.segments[-1], JOIN)


def front_log_pressure(log_z: Float[Array, "..."], burst: str) -> Float[Array, "..."]:
    """Return ln p (p in Pa) at standard ambient pressure."""
    near = log_z < math.log(JOIN)
    near_curve = kingery_bulmash_curve("incident_pressure", burst)
    return jnp.where(
        near,
        near_curve.log_value(jnp.where(near, log_z, math.log(JOIN))),
        front_tail(burst).log_pressure(jnp.where(near, math.log(JOIN), log_z)),
    )


def front_mach_number(log_z: Float[Array, "..."], burst: str) -> Float[Array, "..."]:
    """Return U/c."""
    return jnp.sqrt(
        1.0
        + 6.0 / 7.0 * jnp.exp(front_log_pressure(log_z, burst) - LOG_STANDARD_PRESSURE)
    )
