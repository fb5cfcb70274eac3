r"""The arrival of a shock front as the integral of one over its speed, in scaled terms.

$$c_0 t(Z) = c_0 t(Z_1) + \int_{Z_1}^{Z} dz / M(z)$$

A law tabulates it once: near the source as $\ln(c_0 t/Z)$, past a join as the head
start over sound $Z - c_0 t$, in a coordinate in which that becomes a straight line. The
derivative is that of neither but $1/M$ itself.

Distances and $c_0 t$ are in one unit, the law's: metres for 1 kg, or the length of an
explosion's energy.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.waves.curves.chebyshev import chebyshev_sum

Curve = Callable[[Float[Array, "..."]], Float[Array, "..."]]
LogPressure = Callable[[np.ndarray], np.ndarray]

LAST = 1e6
"""Where a head start goes over into its straight line, in units of the distance."""


class Tail(NamedTuple):
    r"""The pressure past the join.

    Attributes:
        log_pressure: $\ln(p/P_0)$ against $\ln Z$.
        degree: Of the head start's series.
        log_length: $\ln b$ of a weak shock, $p/P_0 = A/(Z\sqrt{\ln(Z/b)})$; None where
            the pressure falls as $1/Z$.
    """

    log_pressure: LogPressure
    degree: int
    log_length: float | None = None


@dataclass(frozen=True)
class Arrival:
    r"""One arrival, as $\ln(c_0 t/Z)$ against $\ln Z$.

    Attributes:
        first: $\ln Z$ where the integral is first used.
        join: $\ln Z$ where the head start takes over.
        inner: Before the first: a curve, or $d\ln t/d\ln Z$ of a power law.
        near: The curve from the first to the join.
        head_start: $Z - c_0 t$ past the join.
        mach_number: $U/c_0$ against $\ln Z$.
    """

    first: float
    join: float
    inner: Curve | float
    near: Curve
    head_start: Curve
    mach_number: Curve


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def log_sound_fraction(
    log_z: Float[Array, "..."], arrival: Arrival
) -> Float[Array, "..."]:
    """Return ln(c t / Z): the arrival as a fraction of the sound's travel time."""
    inside = jnp.clip(log_z, arrival.first, arrival.join)
    near = arrival.near(inside)
    if not callable(arrival.inner):
        near = near + (arrival.inner - 1.0) * jnp.minimum(log_z - inside, 0.0)
    beyond = jnp.maximum(log_z, arrival.join)
    far = jnp.log1p(-arrival.head_start(beyond) * jnp.exp(-beyond))
    fraction = jnp.where(log_z < arrival.join, near, far)
    if callable(arrival.inner):  # outermost: within the other it is a fifth slower
        inner = arrival.inner(jnp.minimum(log_z, arrival.first))
        fraction = jnp.where(log_z < arrival.first, inner, fraction)
    return fraction


@log_sound_fraction.defjvp
def log_sound_fraction_jvp(arrival, primals, tangents):
    """Make dt/dZ = 1/U exact: d ln t/d ln Z = (Z/t)/U."""
    (log_z,), (tangent,) = primals, tangents
    fraction = log_sound_fraction(log_z, arrival)
    if callable(arrival.inner):
        slope = jnp.exp(-fraction) / arrival.mach_number(log_z)
    else:
        before = log_z < arrival.first
        # Far inside, the power law's time is so short that one over it would overflow.
        outside = jnp.where(before, 0.0, fraction)
        mach = arrival.mach_number(jnp.maximum(log_z, arrival.first))
        slope = jnp.where(before, arrival.inner, jnp.exp(-outside) / mach)
    return fraction, (slope - 1.0) * tangent


def chebyshev_arrival(
    log_pressure: LogPressure,
    mach_number: Curve,
    *,
    start: float,
    start_time: float,
    first: float,
    join: float,
    degrees: tuple[int, int],
    tail: Tail,
    inner_slope: float | None = None,
) -> Arrival:
    r"""Integrate 1/M as Chebyshev series: in NumPy and float64, also under jit.

    Args:
        log_pressure: $\ln(p/P_0)$ against $\ln Z$ to the join.
        mach_number: The same shock's, in JAX.
        start: $Z$ where the integral starts.
        start_time: $c_0 t$ there. Where it is zero, the near series is that of
            $\ln[c_0 t/(Z - Z_1)]$.
        first: $Z$ where it is first used.
        join: $Z$ where the head start takes over.
        degrees: Of the integral and of its logarithm, to the join.
        tail: The pressure from there on.
        inner_slope: $d\ln t/d\ln Z$ before the first; the integral's there if None.
    """
    log_start, log_first, log_join = np.log([start, first, join]).tolist()
    radius = 0.0 if start_time else start

    def slowness(log_z: np.ndarray) -> np.ndarray:
        """Z/M, for c dt = Z/M d ln Z."""
        return np.exp(log_z) / np.sqrt(1.0 + 6.0 / 7.0 * np.exp(log_pressure(log_z)))

    interpolate = np.polynomial.Chebyshev.interpolate
    integral = interpolate(slowness, degrees[0], domain=[log_start, log_join])
    integral = integral.integ(lbnd=log_start, k=[start_time])
    series = interpolate(
        lambda log_z: np.log(integral(log_z) / (np.exp(log_z) - radius)),
        degrees[1],
        domain=[log_first, log_join],
    )
    coefficients = series.coef.tolist()

    def near(log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        value = chebyshev_sum(coefficients, log_z, log_first, log_join)
        return value + jnp.log1p(-radius * jnp.exp(-log_z)) if radius else value

    if inner_slope is None:
        inner_slope = float(slowness(np.array([log_first]))[0] / integral(log_first))
    lead = join - (join - radius) * math.exp(series(log_join))
    return Arrival(
        first=log_first,
        join=log_join,
        inner=inner_slope,
        near=near,
        head_start=head_start(tail, log_join, lead),
        mach_number=mach_number,
    )


def head_start(tail: Tail, log_join: float, lead: float) -> Curve:
    r"""Integrate $1 - 1/M$ past the join: a Chebyshev series, then a straight line.

    The coordinate is $\ln Z$ where the pressure falls as $1/Z$. Where the shock is weak
    it is $q = \sqrt{\ln(Z/b)}$: with $p/P_0 = A/(Zq)$ the slope tends to $\tfrac67 A$.

    Args:
        tail: The pressure there.
        log_join: $\ln Z$ where it starts.
        lead: The head start there.
    """
    log_pressure, degree, log_length = tail

    def gain(at: np.ndarray) -> np.ndarray:
        """(1 - 1/M) dZ by the coordinate, free of cancellation."""
        log_z = at if log_length is None else log_length + at * at
        step = np.exp(log_z) * (1.0 if log_length is None else 2.0 * at)
        strength = 6.0 / 7.0 * np.exp(log_pressure(log_z))
        m = np.sqrt(1.0 + strength)
        return step * strength / (m * (m + 1.0))

    start, end = log_join, math.log(LAST)
    if log_length is not None:
        start, end = math.sqrt(start - log_length), math.sqrt(end - log_length)
    series = np.polynomial.Chebyshev.interpolate(gain, degree, domain=[start, end])
    coefficients = series.integ(lbnd=start, k=[lead]).coef.tolist()
    slope = float(gain(np.array([end]))[0])

    def value(log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        at = log_z if log_length is None else jnp.sqrt(log_z - log_length)
        inside = jnp.minimum(at, end)
        return chebyshev_sum(coefficients, inside, start, end) + slope * (at - inside)

    return value
