r"""Fitted and tabulated curves over scaled distance, with slopes and tails.

All curves give $\ln y$ as a function of $\ln z$ with a continuous slope, and continue
as a power law with the end slope outside their table.

A printed polynomial in the logarithm is one segment $p_k(\ln z)$ (`LogPolynomial`); a
handbook fit of a pressure is a sum of powers of $1/z$ (`ReciprocalPolynomial`). Where
segments meet, the printed values jump and the slopes change. Beyond the table,
polynomials diverge, and a sum with a negative constant becomes negative, which no
handbook intends. `LogCurve` therefore blends neighbours in $\ln y$ over an interval of
$\ln z$ around each join, and replaces them outside the table by a power law.

Kinney and Graham print power laws with breaks,

$$y = A\,z^n \prod_i \left[1 + (z/a_i)^{n_i}\right]^{m_i}$$

which are powers of z far inside the first break and far outside the last, so they need
no continuation (`BrokenPowerLaw`). Powers up to the tenth overflow single precision at
z = 1e4; their logarithms do not.

Printed values with known slopes are joined by cubics (`HermiteCurve`). Value and slope
are continuous, the curvature jumps at the nodes. With exact values and slopes the error
over a spacing $h$ is $h^4/384$ times the fourth derivative. Between evenly spaced nodes
the interval is found by arithmetic, otherwise by a search. Values without slopes get
the slopes of a cubic spline in $\ln z$; the natural spline has no curvature at its
ends, so value, slope and curvature are continuous everywhere.

The arrival of a shock front is the integral of one over its speed,

$$c_0 t(Z) = c_0 t(Z_1) + \int_{Z_1}^{Z} dz / M(z)$$

tabulated once for each law as Chebyshev series (`Arrival`): near the source as
$\ln(c_0 t/Z)$, past a join as the head start over sound $Z - c_0 t$, in a coordinate in
which it becomes a straight line. The derivative is $1/M$ itself, not that of the table.
Distances and $c_0 t$ have the unit of the law: metres for 1 kg, or the length of an
explosion's energy.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

# Narrow, so that the printed curve is kept nearly everywhere; wide enough that the
# slope of the blend stays near the printed slopes.
BLEND_WIDTH = 0.05
"""Width of a blend, in z: from join / sqrt(1.05) to join * sqrt(1.05)."""
Curve = Callable[[Float[Array, "..."]], Float[Array, "..."]]
LogPressure = Callable[[np.ndarray], np.ndarray]
# Far beyond every range of use; from there on the head start is a straight line.
HEAD_START_END = 1e6
"""Largest scaled distance of the series of a head start."""


@runtime_checkable
class Segment(Protocol):
    """One segment of a curve: a `LogPolynomial` or a `ReciprocalPolynomial`."""

    @property
    def z_min(self) -> float:
        """Lower limit of z."""
        ...

    @property
    def z_max(self) -> float:
        """Upper limit of z."""
        ...

    def log_value(self, log_z: Any) -> Any:
        """Return ln y: floats, NumPy and JAX arrays alike."""
        ...

    def log_slope(self, log_z: Any) -> Any:
        """Return d ln y / d ln z."""
        ...


@dataclass(frozen=True)
class LogPolynomial:
    r"""One segment: $\ln y = \sum_i c_i u^i$ with $u = k_0 + k_1 \ln z$.

    Attributes:
        z_min: Lower limit of z.
        z_max: Upper limit of z.
        offset: $k_0$.
        scale: $k_1$.
        coefficients: $c_0, c_1, \dots$
    """

    z_min: float
    z_max: float
    offset: float
    scale: float
    coefficients: tuple[float, ...]

    def log_value(self, log_z: Any) -> Any:
        """Return ln y by Horner's rule: floats, NumPy and JAX arrays alike."""
        u = self.offset + self.scale * log_z
        value = self.coefficients[-1]
        for coefficient in reversed(self.coefficients[:-1]):
            value = value * u + coefficient
        return value

    def log_slope(self, log_z: Any) -> Any:
        """Return d ln y / d ln z: floats and NumPy arrays alike."""
        u = self.offset + self.scale * log_z
        slope = 0.0
        for power in range(len(self.coefficients) - 1, 0, -1):
            slope = slope * u + power * self.coefficients[power]
        return self.scale * slope


@dataclass(frozen=True)
class LogCurve:
    """Segments one after the other, each starting where the one before it ends.

    Attributes:
        segments: In order of z.
    """

    segments: tuple[Segment, ...]

    @property
    def z_min(self) -> float:
        """Lower limit of the table."""
        return self.segments[0].z_min

    @property
    def z_max(self) -> float:
        """Upper limit of the table."""
        return self.segments[-1].z_max

    def log_value(self, log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return ln y: twice continuously differentiable inside the table.

        At both ends of the table value and slope are continuous.
        """
        start, end = math.log(self.z_min), math.log(self.z_max)
        # Clamped on the input: a polynomial far outside its table overflows, and a
        # `where` around the result would let its NaN gradient through.
        inside = jnp.minimum(jnp.maximum(log_z, start), end)
        value = self.segments[0].log_value(self._within(inside, 0))
        for k in range(1, len(self.segments)):
            rise = smooth_step(inside, self.segments[k].z_min)
            value = value + rise * (
                self.segments[k].log_value(self._within(inside, k)) - value
            )
        end_slope = jnp.where(
            log_z < 0.5 * (start + end),
            self.segments[0].log_slope(start),
            self.segments[-1].log_slope(end),
        ).astype(log_z.dtype)
        # Exactly on an end each of the two terms gives half of the slope: together one.
        return value + end_slope * (log_z - inside)

    def _within(self, log_z: Float[Array, "..."], segment: int) -> Float[Array, "..."]:
        """Return ln z clamped to the range of a segment, with its blends."""
        half = 0.5 * math.log1p(BLEND_WIDTH)
        if segment > 0:
            log_z = jnp.maximum(log_z, math.log(self.segments[segment].z_min) - half)
        if segment < len(self.segments) - 1:
            log_z = jnp.minimum(log_z, math.log(self.segments[segment].z_max) + half)
        return log_z


def smooth_step(log_z: Float[Array, "..."], join: float) -> Float[Array, "..."]:
    r"""Return $6t^5 - 15t^4 + 10t^3$: 0 before a blend, 1 after it, twice smooth.

    $t$ runs from 0 to 1 over the blend, in $\ln z$.
    """
    width = math.log1p(BLEND_WIDTH)
    t = jnp.clip((log_z - (math.log(join) - 0.5 * width)) / width, 0.0, 1.0)
    return t * t * t * (10.0 + t * (6.0 * t - 15.0))


@dataclass(frozen=True)
class ReciprocalPolynomial:
    r"""One segment: $y = \sum_i c_i z^{-i}$.

    Attributes:
        z_min: Lower limit of z.
        z_max: Upper limit of z.
        coefficients: $c_0, c_1, \dots$
    """

    z_min: float
    z_max: float
    coefficients: tuple[float, ...]

    def log_value(self, log_z: Any) -> Any:
        """Return ln y: floats, NumPy and JAX arrays alike."""
        xp = np if isinstance(log_z, float | np.ndarray) else jnp
        u = xp.exp(-log_z)
        value = self.coefficients[-1]
        for coefficient in reversed(self.coefficients[:-1]):
            value = value * u + coefficient
        return xp.log(value)

    def log_slope(self, log_z: float) -> float:
        """Return d ln y / d ln z."""
        terms = [c * math.exp(-i * log_z) for i, c in enumerate(self.coefficients)]
        return -math.fsum(i * t for i, t in enumerate(terms)) / math.fsum(terms)


class Break(NamedTuple):
    """One factor of a broken power law.

    Attributes:
        z: Position of the change of slope, $a$.
        power: $n$.
        share: $m$; the slope changes by $m n$.
    """

    z: float
    power: float
    share: float


@dataclass(frozen=True)
class BrokenPowerLaw:
    """Power law with smooth changes of slope.

    Attributes:
        factor: $A$.
        exponent: $n$.
        breaks: The factors in brackets.
        z_min: Lower limit; below it the curve is a power law with the slope there.
        z_max: Upper limit; above it the curve is a power law with the slope there.
    """

    factor: float
    exponent: float
    breaks: tuple[Break, ...]
    z_min: float = 0.0
    z_max: float = math.inf

    def log_value(self, log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return ln y."""
        inside = log_z
        if self.z_min > 0.0:
            inside = jnp.maximum(inside, math.log(self.z_min))
        if math.isfinite(self.z_max):
            inside = jnp.minimum(inside, math.log(self.z_max))
        value = math.log(self.factor) + self.exponent * inside
        for knee in self.breaks:
            steps = knee.power * (inside - math.log(knee.z))
            # ln(1 + (z/a)^n) without the overflow of the power
            value = value + knee.share * jax.nn.softplus(steps)
        # Exactly on an end each of two terms gives half of the slope: together one.
        if self.z_min > 0.0:
            value = value + self.log_slope(self.z_min) * jnp.minimum(
                log_z - math.log(self.z_min), 0.0
            )
        if math.isfinite(self.z_max):
            value = value + self.log_slope(self.z_max) * jnp.maximum(
                log_z - math.log(self.z_max), 0.0
            )
        return value

    def log_slope(self, z: float) -> float:
        """Return d ln y / d ln z, at a z from z_min to z_max."""
        return self.exponent + math.fsum(
            knee.share * knee.power / (1.0 + (z / knee.z) ** -knee.power)
            for knee in self.breaks
        )


@dataclass(frozen=True)
class HermiteCurve:
    """Cubics in the fraction of the distance between two nodes.

    Attributes:
        nodes: Nodes in ascending order.
        coefficients: Coefficients of the powers 0 to 3 of the fraction, one row for
            each interval.
        slope_before: Slope of the line before the first node.
        slope_after: Slope of the line after the last node.
    """

    nodes: Float[np.ndarray, " node"]
    coefficients: Float[np.ndarray, "interval 4"]
    slope_before: float
    slope_after: float

    def inside(self, x: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        """Return the value between the nodes, in NumPy."""
        interval = np.searchsorted(self.nodes[1:-1], x, side="right")
        t = (x - self.nodes[interval]) / np.diff(self.nodes)[interval]
        return (self.coefficients[interval] * t[..., None] ** np.arange(4)).sum(-1)

    def value(self, x: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return the value anywhere."""
        nodes, spacing = (
            jnp.asarray(array, x.dtype) for array in (self.nodes, np.diff(self.nodes))
        )
        inside = jnp.minimum(jnp.maximum(x, nodes[0]), nodes[-1])
        if self._is_even():  # a search and its gathers take most of the time
            position = (inside - nodes[0]) / spacing[0]
            interval = jnp.minimum(position.astype(jnp.int32), spacing.size - 1)
            t = position - interval.astype(x.dtype)
        else:
            interval = jnp.searchsorted(nodes[1:-1], inside, side="right")
            t = (inside - nodes[interval]) / spacing[interval]
        # By columns, which XLA reads twice as fast as rows; no index is out of bounds.
        c0, c1, c2, c3 = (
            jnp.asarray(column, x.dtype).at[interval].get(mode="promise_in_bounds")
            for column in self.coefficients.T
        )
        outer = jnp.where(x < nodes[1], self.slope_before, self.slope_after)
        # Exactly on an end each of the two terms gives half of the slope: together one.
        return c0 + t * (c1 + t * (c2 + t * c3)) + outer.astype(x.dtype) * (x - inside)

    def _is_even(self) -> bool:
        """Return True if the nodes are evenly spaced, up to rounding."""
        even = np.linspace(self.nodes[0], self.nodes[-1], self.nodes.size)
        return bool(np.allclose(self.nodes, even, rtol=0, atol=1e-12 * np.ptp(even)))


def hermite_curve(
    nodes: Float[np.ndarray, " node"],
    values: Float[np.ndarray, " node"],
    slopes: Float[np.ndarray, " node"],
    slope_before: float | None = None,
    slope_after: float | None = None,
) -> HermiteCurve:
    """Return the curve of given values and slopes.

    Args:
        nodes: Nodes in ascending order.
        values: Values at the nodes.
        slopes: Slopes at the nodes.
        slope_before: Slope before the first node; by default that at the node.
        slope_after: Slope after the last node; by default that at the node.

    Raises:
        ValueError: The nodes are not in ascending order.
    """
    spacing = np.diff(nodes)
    if not np.all(spacing > 0):
        raise ValueError("nodes must ascend")
    rise, start, end = np.diff(values), spacing * slopes[:-1], spacing * slopes[1:]
    return HermiteCurve(
        nodes=nodes,
        coefficients=np.stack(
            [values[:-1], start, 3 * rise - 2 * start - end, start + end - 2 * rise], 1
        ),
        slope_before=float(slopes[0]) if slope_before is None else slope_before,
        slope_after=float(slopes[-1]) if slope_after is None else slope_after,
    )


def natural_log_spline(
    z: Float[np.ndarray, " point"], y: Float[np.ndarray, " point"]
) -> HermiteCurve:
    """Return ln y against ln z through points: in NumPy, always in float64.

    Args:
        z: Positive numbers in ascending order.
        y: Positive values.
    """
    return _spline(np.log(z), np.log(y), None)


def clamped_log_spline(
    z: Float[np.ndarray, " point"],
    y: Float[np.ndarray, " point"],
    start_slope: float,
    end_slope: float,
) -> HermiteCurve:
    """Return ln y against ln z through points, with given slopes at the ends.

    Args:
        z: Positive numbers in ascending order.
        y: Positive values.
        start_slope: d ln y/d ln z at the first point.
        end_slope: d ln y/d ln z at the last point.
    """
    return _spline(np.log(z), np.log(y), (start_slope, end_slope))


def _spline(
    x: np.ndarray, f: np.ndarray, slopes: tuple[float, float] | None
) -> HermiteCurve:
    h, rise = np.diff(x), np.diff(f) / np.diff(x)
    # Half the curvature at each point: continuous slopes give one equation for each
    # point but the ends, where it is zero or follows from the slope.
    below, middle, above = (np.zeros(x.size) for _ in range(3))
    right = np.zeros(x.size)
    below[1:-1], middle[1:-1], above[1:-1] = h[:-1], 2.0 * (h[:-1] + h[1:]), h[1:]
    right[1:-1] = 3.0 * np.diff(rise)
    if slopes is None:
        middle[[0, -1]] = 1.0
    else:
        middle[0], above[0] = 2.0 * h[0], h[0]
        below[-1], middle[-1] = h[-1], 2.0 * h[-1]
        right[[0, -1]] = 3.0 * (rise[0] - slopes[0]), 3.0 * (slopes[1] - rise[-1])
    half = _tridiagonal_solution(below, middle, above, right)
    start = rise - h * (2.0 * half[:-1] + half[1:]) / 3.0
    end = start[-1] + h[-1] * (half[-2] + half[-1])
    return hermite_curve(x, f, np.append(start, end))


def _tridiagonal_solution(
    below: np.ndarray, middle: np.ndarray, above: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Return the solution of a tridiagonal system, by elimination."""
    # no pivoting: the matrix of a spline is diagonally dominant
    middle, right = middle.tolist(), right.tolist()
    for i in range(1, len(right)):
        share = below[i] / middle[i - 1]
        middle[i] -= share * above[i - 1]
        right[i] -= share * right[i - 1]
    right[-1] /= middle[-1]
    for i in reversed(range(len(right) - 1)):
        right[i] = (right[i] - above[i] * right[i + 1]) / middle[i]
    return np.array(right)


class Tail(NamedTuple):
    r"""Pressure beyond the join.

    Attributes:
        log_pressure: $\ln(p/P_0)$ against $\ln Z$.
        degree: Degree of the series of the head start.
        log_length: $\ln b$ of a weak shock, $p/P_0 = A/(Z\sqrt{\ln(Z/b)})$; None if the
            pressure falls as $1/Z$.
    """

    log_pressure: LogPressure
    degree: int
    log_length: float | None = None


def head_start(tail: Tail, log_join: float, lead: float) -> Curve:
    r"""Integrate $1 - 1/M$ beyond the join: a Chebyshev series, then a straight line.

    The coordinate is $\ln Z$ where the pressure falls as $1/Z$. Where the shock is weak
    it is $q = \sqrt{\ln(Z/b)}$: with $p/P_0 = A/(Zq)$ the slope tends to $\tfrac67 A$.

    Args:
        tail: Pressure beyond the join.
        log_join: $\ln Z$ of the join.
        lead: Head start at the join.
    """
    log_pressure, degree, log_length = tail

    def gain(at: np.ndarray) -> np.ndarray:
        """Return (1 - 1/M) dZ/d(coordinate)."""
        # (M - 1)/M as x/(M (M + 1)), which does not cancel for a weak shock
        log_z = at if log_length is None else log_length + at * at
        step = np.exp(log_z) * (1.0 if log_length is None else 2.0 * at)
        strength = 6.0 / 7.0 * np.exp(log_pressure(log_z))
        m = np.sqrt(1.0 + strength)
        return step * strength / (m * (m + 1.0))

    start, end = log_join, math.log(HEAD_START_END)
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


@dataclass(frozen=True)
class Arrival:
    r"""One arrival, as $\ln(c_0 t/Z)$ against $\ln Z$.

    Attributes:
        first: Smallest $\ln Z$ of the integral.
        join: $\ln Z$ at which the head start replaces the integral.
        inner: Curve below `first`, or $d\ln t/d\ln Z$ of a power law.
        near: Curve from `first` to the join.
        head_start: $Z - c_0 t$ beyond the join.
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
    """Return ln(c t / Z): the arrival as a fraction of the travel time of sound."""
    # each branch has an argument in its own range, so that no gradient is NaN
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
    """Return value and derivative, with dt/dZ = 1/U: d ln t/d ln Z = (Z/t)/U."""
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
        mach_number: Mach number of the same shock, in JAX.
        start: $Z$ at the start of the integral.
        start_time: $c_0 t$ at the start. If it is zero, the near series is that of
            $\ln[c_0 t/(Z - Z_1)]$.
        first: Smallest $Z$ at which the integral is used.
        join: $Z$ at which the head start replaces the integral.
        degrees: Degrees of the integral and of its logarithm, to the join.
        tail: Pressure beyond the join.
        inner_slope: $d\ln t/d\ln Z$ below `first`; None for that of the integral.
    """
    log_start, log_first, log_join = np.log([start, first, join]).tolist()
    radius = 0.0 if start_time else start

    def slowness(log_z: np.ndarray) -> np.ndarray:
        """Return Z/M, the integrand of c dt = Z/M d ln Z."""
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


def chebyshev_sum(
    coefficients: Sequence[float], x: Float[Array, "..."], start: float, end: float
) -> Float[Array, "..."]:
    """Sum a Chebyshev series on [start, end] by Clenshaw's recurrence."""
    t = (2.0 * x - (start + end)) / (end - start)
    last, previous = jnp.zeros_like(t), jnp.zeros_like(t)
    for coefficient in reversed(coefficients[1:]):
        last, previous = 2.0 * t * last - previous + coefficient, last
    return t * last - previous + coefficients[0]


def data_rows(name: str) -> list[dict[str, str]]:
    """Read the rows of a table, by column name.

    Args:
        name: Name of the file in `data/`, without the suffix.
    """
    text = files("jblast.waves").joinpath(f"data/{name}.csv").read_text()
    # The head of a table states its provenance in comments.
    lines = (line for line in text.splitlines() if not line.startswith("#"))
    return list(csv.DictReader(lines))
