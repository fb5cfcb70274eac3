r"""The arrival of Kinney's and Graham's shock: one over its speed, integrated.

$$c_0 t(Z) = \int_{r_c}^{Z} dz / M(z), \qquad r_c = 0.053 \text{ m for 1 kg}$$

from the surface of the charge, where the time is zero. Tabulated once as two Chebyshev
series in $\ln Z$: of $\ln[c_0 t/(Z - r_c)]$ up to a split, past it of the head start
over sound $Z - c_0 t$. The derivative is not that of the series but $1/M$ itself.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.waves.curves.chebyshev import chebyshev_sum
from jblast.waves.laws.kinney_graham.curves import (
    RELATIVE_PRESSURE,
    kinney_graham_mach_number,
)

CHARGE_RADIUS = 0.053
"""Radius of 1 kg of TNT (1600 kg/m3) [m/kg^(1/3)], where Kinney's and Graham's arrival
starts, as we remember it.
"""

FIRST = 0.06
"""Where the integral is first used [m/kg^(1/3)]: at the surface the arrival is zero.

Its logarithm has no slope there; before this place it is a power law.
"""

_SPLIT = 10.0
_LAST = 1e6


@dataclass(frozen=True)
class _ArrivalTable:
    """Everything in m/kg^(1/3).

    Attributes:
        near: Series of ln[c t / (Z - r)] from `FIRST` to the split.
        first_slope: d ln t / d ln Z before it.
        far: Series of Z - c t from the split to Z = 1e6.
        far_slope: Its slope in ln Z from there on.
    """

    near: Sequence[float]
    first_slope: float
    far: Sequence[float]
    far_slope: float


@cache
def _arrival_table() -> _ArrivalTable:
    """Integrate 1/M: in NumPy, always in float64, also under jit."""

    def relative_pressure(log_z: np.ndarray) -> np.ndarray:
        value = np.full_like(log_z, math.log(RELATIVE_PRESSURE.factor))
        for z, power, share in RELATIVE_PRESSURE.bends:
            value += share * np.logaddexp(0.0, power * (log_z - math.log(z)))
        return np.exp(value)

    def mach_number(log_z: np.ndarray) -> np.ndarray:
        return np.sqrt(1.0 + 6.0 / 7.0 * relative_pressure(log_z))

    def near_integrand(log_z: np.ndarray) -> np.ndarray:
        """Z/M, for c dt = Z/M d ln Z."""
        return np.exp(log_z) / mach_number(log_z)

    def far_integrand(log_z: np.ndarray) -> np.ndarray:
        """Z (1 - 1/M), free of cancellation."""
        m = mach_number(log_z)
        strength = 6.0 / 7.0 * relative_pressure(log_z)
        return np.exp(log_z) * strength / (m * (m + 1.0))

    # Degrees by trial: each leaves less than 1e-11 of the arrival.
    chebyshev = np.polynomial.Chebyshev
    surface, first, split, last = np.log([CHARGE_RADIUS, FIRST, _SPLIT, _LAST]).tolist()
    integral = chebyshev.interpolate(near_integrand, 80, domain=[surface, split])
    integral = integral.integ(lbnd=surface)
    near = chebyshev.interpolate(
        lambda log_z: np.log(integral(log_z) / (np.exp(log_z) - CHARGE_RADIUS)),
        50,
        domain=[first, split],
    )
    far = chebyshev.interpolate(far_integrand, 30, domain=[split, last])
    far = far.integ(lbnd=split, k=[_SPLIT - float(integral(split))])
    return _ArrivalTable(
        near=near.coef.tolist(),
        first_slope=float(near_integrand(np.array([first]))[0] / integral(first)),
        far=far.coef.tolist(),
        far_slope=float(far_integrand(np.array([last]))[0]),
    )


@jax.custom_jvp
def kinney_graham_log_sound_fraction(
    log_z: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return ln(c t / R): the arrival as a fraction of the sound's travel time."""
    table = _arrival_table()
    first, split, last = math.log(FIRST), math.log(_SPLIT), math.log(_LAST)

    inside = jnp.clip(log_z, first, split)
    near = chebyshev_sum(table.near, inside, first, split)
    near = near + jnp.log1p(-CHARGE_RADIUS * jnp.exp(-inside))
    near = near + (table.first_slope - 1.0) * jnp.minimum(log_z - inside, 0.0)

    far_log_z = jnp.maximum(log_z, split)
    inside = jnp.minimum(far_log_z, last)
    head_start = chebyshev_sum(table.far, inside, split, last)
    head_start = head_start + table.far_slope * (far_log_z - inside)
    far = jnp.log1p(-head_start * jnp.exp(-far_log_z))
    return jnp.where(log_z < split, near, far)


@kinney_graham_log_sound_fraction.defjvp
def kinney_graham_log_sound_fraction_jvp(primals, tangents):
    """Make dt/dR = 1/U exact: d ln t/d ln R = (R/t)/U."""
    (log_z,), (tangent,) = primals, tangents
    fraction = kinney_graham_log_sound_fraction(log_z)
    # Far inside, the power law's time is so short that one over it would overflow.
    outside = jnp.maximum(log_z, math.log(FIRST))
    slope = jnp.where(
        log_z < math.log(FIRST),
        _arrival_table().first_slope,
        jnp.exp(-kinney_graham_log_sound_fraction(outside))
        / kinney_graham_mach_number(outside),
    )
    return fraction, (slope - 1.0) * tangent
