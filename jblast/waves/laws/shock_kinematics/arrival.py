r"""The arrival of a shock front as the integral of one over its speed, in scaled terms.

$$c_0 t(Z) = c_0 t_{KB}(Z_1) + \int_{Z_1}^{Z} dz / M(z)$$

is tabulated once as two Chebyshev series: up to the join of $\ln(c_0 t/Z)$ in
$\ln Z$; past it of the head start over sound $Z - c_0 t$ in $q = \sqrt{\ln(Z/b)}$,
where it is nearly a straight line. The derivative is not that of the series but $1/M$
itself.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.curves.chebyshev import chebyshev_sum
from jblast.waves.laws.kingery_bulmash.table import kingery_bulmash_curve
from jblast.waves.laws.shock_kinematics.front import (
    JOIN,
    LOG_STANDARD_PRESSURE,
    front_mach_number,
    front_tail,
)


@dataclass(frozen=True)
class _ArrivalTable:
    r"""Arrival of one burst, scaled: everything in m/kg^(1/3).

    Attributes:
        near_start: ln Z where the near series starts.
        near: Chebyshev series of ln(c t / R) from there to the join.
        inner_slope: d ln t / d ln R before it.
        far_start: $q = \sqrt{\ln(Z/b)}$ at the join.
        far_end: The same at Z = 1e6, where the far series ends.
        far: Chebyshev series of R - c t in q.
        far_slope: $\tfrac67 A/P_0$, the slope of R - c t in q that follows.
    """

    near_start: float
    near: Sequence[float]
    inner_slope: float
    far_start: float
    far_end: float
    far: Sequence[float]
    far_slope: float


@cache
def _arrival_table(burst: str) -> _ArrivalTable:
    """Integrate 1/U: in NumPy, always in float64, also under jit."""
    pressure = kingery_bulmash_curve("incident_pressure", burst).segments[0]
    arrival = kingery_bulmash_curve("arrival_time", burst).segments[0]
    tail = front_tail(burst)
    amplitude = tail.amplitude / STANDARD_PRESSURE
    start, join = math.log(pressure.z_min), math.log(JOIN)

    def mach_number(relative_pressure: np.ndarray) -> np.ndarray:
        return np.sqrt(1.0 + 6.0 / 7.0 * relative_pressure)

    def near_integrand(log_z: np.ndarray) -> np.ndarray:
        """Z/M, for c dt = Z/M d ln Z."""
        relative = np.exp(pressure.log_value(log_z) - LOG_STANDARD_PRESSURE)
        return np.exp(log_z) / mach_number(relative)

    def far_integrand(q: np.ndarray) -> np.ndarray:
        """(1 - 1/M) dZ/dq with Z = b exp(q^2), free of cancellation."""
        m = mach_number(amplitude / (tail.length * np.exp(q * q) * q))
        return 12.0 / 7.0 * amplitude / (m * (m + 1.0))

    # Degrees by trial: each leaves less than 1e-10 of the arrival.
    chebyshev = np.polynomial.Chebyshev
    first = STANDARD_SOUND_SPEED * math.exp(arrival.log_value(start))
    integral = chebyshev.interpolate(near_integrand, 90, domain=[start, join])
    integral = integral.integ(lbnd=start)
    near = chebyshev.interpolate(
        lambda log_z: np.log((first + integral(log_z)) / np.exp(log_z)),
        50,
        domain=[start, join],
    )
    far_start = math.sqrt(join - math.log(tail.length))
    far_end = math.sqrt(math.log(1e6 / tail.length))
    far = chebyshev.interpolate(far_integrand, 18, domain=[far_start, far_end])
    far = far.integ(lbnd=far_start, k=[JOIN * -math.expm1(near(join))])
    return _ArrivalTable(
        near_start=start,
        near=near.coef.tolist(),
        inner_slope=arrival.log_slope(start),
        far_start=far_start,
        far_end=far_end,
        far=far.coef.tolist(),
        far_slope=6.0 / 7.0 * amplitude,
    )


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def log_sound_fraction(log_z: Float[Array, "..."], burst: str) -> Float[Array, "..."]:
    """Return ln(c t / R): the arrival as a fraction of the sound's travel time."""
    table, tail = _arrival_table(burst), front_tail(burst)
    join = math.log(tail.join)

    inside = jnp.clip(log_z, table.near_start, join)
    near = chebyshev_sum(table.near, inside, table.near_start, join)
    near = near + (table.inner_slope - 1.0) * jnp.minimum(log_z - inside, 0.0)

    far_log_z = jnp.maximum(log_z, join)
    q = jnp.sqrt(far_log_z - math.log(tail.length))
    inside = jnp.minimum(q, table.far_end)
    head_start = chebyshev_sum(table.far, inside, table.far_start, table.far_end)
    head_start = head_start + table.far_slope * (q - inside)
    return jnp.where(log_z < join, near, jnp.log1p(-head_start * jnp.exp(-far_log_z)))


@log_sound_fraction.defjvp
def log_sound_fraction_jvp(burst, primals, tangents):
    """Make dt/dR = 1/U exact: d ln t/d ln R = (R/t)/U."""
    (log_z,), (tangent,) = primals, tangents
    table = _arrival_table(burst)
    fraction = log_sound_fraction(log_z, burst)
    slope = jnp.where(
        log_z < table.near_start,
        table.inner_slope,
        jnp.exp(-fraction) / front_mach_number(log_z, burst),
    )
    return fraction, (slope - 1.0) * tangent
