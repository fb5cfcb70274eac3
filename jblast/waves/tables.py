r"""Curves of scaled distance: printed forms, and the tables that JAX evaluates.

A form is a function of $\ln z$ that returns $\ln y$. It is written against the array
API, so that NumPy and JAX evaluate the same lines. A `Curve` is a form within its span,
and a power law with the end slope outside, because polynomials diverge there.

Segments of a printed curve do not meet. `joined` blends neighbours in $\ln y$ over 5 %
of $z$ around each join, so that value, slope and curvature are continuous.

The arrival of a shock front is the integral of one over its speed,

$$c_0 t(Z) = c_0 t(Z_1) + \int_{Z_1}^{Z} dz / M(z)$$

by Gauss's rule in $\ln z$ between even nodes, and from the last node to $Z$ (`arrival`,
as $\ln(c_0 t/Z)$). Distances and $c_0 t$ have the unit of the law: metres for 1 kg, or
the length of an explosion's energy.

NumPy evaluates the form itself, which is exact. JAX evaluates polynomials and their
blends by themselves (`segmented`), and all other forms by a `Table`: cubics on an even
grid of $\ln z$, filled from the form at the first use. The grid is halved until the
table is within `TOLERANCE` of its form, after 30 to 4000 nodes. A table takes 2 ns a
row on a CPU, the form of Kinney and Graham 120.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from jblast.types import Float, namespace

if TYPE_CHECKING:
    Numbers = Any
else:
    Numbers = Float[Any, "..."] | float | int
"""An array of NumPy or of JAX."""
Form = Callable[[Any], Any]
"""ln y as a function of ln z."""

# Narrow, so that the printed curve is kept nearly everywhere; wide enough that the
# slope of the blend stays near the printed slopes.
BLEND_WIDTH = 0.05
"""Width of a blend, in z: from join / sqrt(1.05) to join * sqrt(1.05)."""
# An order below what rounding to single precision does to ln p.
TOLERANCE = 1e-7
"""Largest difference of a table from its form, in ln y."""
FIRST_STEP, LAST_STEP = 1 / 8, 1 / 4096
"""Spacings of a grid in ln z: the first that is tried, and the least."""
# Errors of a slope: 1e-13 from rounding, and (1e-3)^4/30 times the fifth derivative.
SLOPE_STEP = 1e-3
"""Step in ln z of the differences that give the slope of a form."""
# The integrand is smooth over this step: eight Gauss points leave rounding.
ARRIVAL_STEP = 1 / 16
"""Spacing in ln z of the nodes of an arrival."""


def slope_of(form: Form, x: Any) -> Any:
    """Return the slope of a form in NumPy, by differences of fourth order."""
    h = SLOPE_STEP
    near, far = form(x + h) - form(x - h), form(x + 2 * h) - form(x - 2 * h)
    return (8.0 * near - far) / (12.0 * h)


@dataclass(frozen=True)
class Table:
    """Cubics in the fraction of an interval of an even grid, straight beyond it.

    Attributes:
        first: First node.
        step: Spacing of the nodes.
        rows: Coefficients of the powers 0 to 3, one row for each interval. The first
            and the last row are the lines before and after the grid.
    """

    first: float
    step: float
    rows: Float[np.ndarray, "interval 4"]

    def __call__(self, x: Numbers) -> Numbers:
        """Return the value, in JAX."""
        xp = namespace(x)
        position = x * (1.0 / self.step) + (1.0 - self.first / self.step)
        row = xp.clip(position.astype(np.int32), 0, len(self.rows) - 1)
        t = position - row.astype(x.dtype)
        # By columns, which XLA reads twice as fast as rows; no index is out of bounds.
        c0, c1, c2, c3 = (
            xp.asarray(column, dtype=x.dtype).at[row].get(mode="promise_in_bounds")
            for column in self.rows.T
        )
        return c0 + t * (c1 + t * (c2 + t * c3))


def hermite_table(
    first: float, step: float, values: np.ndarray, slopes: np.ndarray
) -> Table:
    """Return the table of values and slopes at even nodes."""
    rise, start, end = np.diff(values), step * slopes[:-1], step * slopes[1:]
    rows = [values[:-1], start, 3 * rise - 2 * start - end, start + end - 2 * rise]
    before = [values[0] - start[0], start[0], 0.0, 0.0]
    after = [values[-1], end[-1], 0.0, 0.0]
    return Table(first, step, np.vstack([before, np.stack(rows, 1), after]))


def tabulated(form: Form, first: float, last: float) -> Table:
    """Return the table of a form from one ln z to another, in NumPy and float64."""
    step = FIRST_STEP
    while True:
        count = math.ceil((last - first) / step)
        x = np.linspace(first, last, count + 1)
        even = (last - first) / count
        table = hermite_table(first, even, form(x), slope_of(form, x))
        # a cubic leaves its form most near the middle, and beside a jump of curvature
        t = np.array([0.25, 0.5, 0.75])
        cubics = table.rows[1:-1] @ t ** np.arange(4)[:, None]
        error = np.max(np.abs(cubics - form(x[:-1, None] + even * t)))
        if error <= TOLERANCE or step <= LAST_STEP:
            return table
        step /= 2


@dataclass(frozen=True, eq=False)
class Curve:
    """A form within its span, and a power law with the end slope outside.

    Attributes:
        form: ln y of ln z.
        z_min: First z of the form.
        z_max: Last z of the form.
        cheap: True if JAX evaluates the form itself.
    """

    form: Form
    z_min: float
    z_max: float
    cheap: bool = False

    def __call__(self, log_z: Numbers) -> Numbers:
        """Return ln y: by the table in JAX, exact in NumPy."""
        if namespace(log_z) is np or self.cheap:
            return self.exact(log_z)
        return self.table(log_z)

    def exact(self, log_z: Numbers) -> Numbers:
        """Return ln y by the form, in NumPy or JAX."""
        xp = namespace(log_z)
        first, last = math.log(self.z_min), math.log(self.z_max)
        # Clamped on the input: a polynomial far outside its span overflows, and a
        # `where` around the result would let its NaN gradient through. Exactly on an
        # end both terms give half of the slope: together one.
        inside = xp.minimum(xp.maximum(log_z, first), last)
        start, end = self.end_slopes
        slope = xp.where(log_z <= first, start, end)
        return self.form(inside) + slope * (log_z - inside)

    def then(self, relation: Form) -> "Curve":
        """Return the curve of a quantity that follows from this one, in ln of both."""
        return Curve(lambda x: relation(self.form(x)), self.z_min, self.z_max)

    @cached_property
    def end_slopes(self) -> tuple[float, float]:
        """Slopes d ln y/d ln z at both ends of the span."""
        ends = np.log([self.z_min, self.z_max])
        start, end = slope_of(self.form, ends).tolist()
        return start, end

    @cached_property
    def table(self) -> Table:
        """Table of the form over its span."""
        return tabulated(self.form, math.log(self.z_min), math.log(self.z_max))


def polynomial(
    coefficients: Sequence[float], offset: float = 0.0, scale: float = 1.0
) -> Form:
    r"""Return $\ln y = \sum_i c_i u^i$ with $u = k_0 + k_1 \ln z$.

    Args:
        coefficients: $c_0, c_1, \dots$
        offset: $k_0$.
        scale: $k_1$.
    """
    # numbers of Python take the precision of the argument
    numbers = [float(coefficient) for coefficient in coefficients]

    def form(log_z: Numbers) -> Numbers:
        u, value = offset + scale * log_z, numbers[-1]
        for coefficient in reversed(numbers[:-1]):
            value = value * u + coefficient
        return value

    return form


def power_sum(*terms: tuple[float, float]) -> Form:
    """Return ln y of a sum of powers of z.

    Args:
        terms: Factor and exponent of each power.
    """

    def form(log_z: Numbers) -> Numbers:
        xp = namespace(log_z)
        return xp.log(sum(factor * xp.exp(n * log_z) for factor, n in terms))

    return form


def broken_power(
    factor: float, exponent: float, *breaks: tuple[float, float, float]
) -> Form:
    r"""Return a power law with smooth changes of slope.

    $$y = A\,z^n \prod_i \left[1 + (z/a_i)^{n_i}\right]^{m_i}$$

    Args:
        factor: $A$.
        exponent: $n$.
        breaks: $a_i$, $n_i$, $m_i$.
    """

    def form(log_z: Numbers) -> Numbers:
        xp = namespace(log_z)
        value = math.log(factor) + exponent * log_z
        for a, n, m in breaks:
            # ln(1 + e^s) without overflow of powers up to the tenth
            value = value + m * xp.logaddexp(n * (log_z - math.log(a)), 0.0)
        return value

    return form


def smooth_step(x: Numbers, start: float, end: float) -> Numbers:
    r"""Return $6t^5 - 15t^4 + 10t^3$: 0 before `start`, 1 after `end`, twice smooth."""
    t = namespace(x).clip((x - start) / (end - start), 0.0, 1.0)
    return t * t * t * (10.0 + t * (6.0 * t - 15.0))


def joined(segments: Sequence[Form], joins: Sequence[float]) -> Form:
    """Return segments with a blend around each join.

    Args:
        segments: Forms in order of z.
        joins: z at which each but the first takes over.
    """
    half = 0.5 * math.log1p(BLEND_WIDTH)
    centres = [math.log(z) for z in joins]

    def form(log_z: Numbers) -> Numbers:
        xp = namespace(log_z)
        # each within its own range and its blends, so that no polynomial overflows
        value = segments[0](xp.minimum(log_z, centres[0] + half))
        for k, segment in enumerate(segments[1:]):
            own = xp.maximum(log_z, centres[k] - half)
            if k + 1 < len(centres):
                own = xp.minimum(own, centres[k + 1] + half)
            share = smooth_step(log_z, centres[k] - half, centres[k] + half)
            value = value + share * (segment(own) - value)
        return value

    return form


def segmented(segments: Sequence[Form], ends: Sequence[float]) -> Curve:
    """Return the curve of segments between ends."""
    first, *joins, last = ends
    form = joined(segments, joins) if joins else segments[0]
    # A blend takes a table of 10,000 nodes, and three polynomials not much longer.
    return Curve(form, first, last, cheap=True)


def spline_slopes(
    x: Float[np.ndarray, " point"],
    y: Float[np.ndarray, " point"],
    end_slopes: tuple[float, float] | None = None,
) -> Float[np.ndarray, " point"]:
    """Return the slopes of the cubic spline through points, at these points.

    Args:
        x: Ascending.
        y: Values.
        end_slopes: Slopes at both ends; None for the natural spline, which has no
            curvature there.
    """
    each, rise = 1.0 / np.diff(x), np.diff(y) / np.diff(x)
    # Continuous curvature gives one equation for each point between the ends.
    matrix = np.zeros((x.size, x.size))
    rows = np.arange(1, x.size - 1)
    matrix[rows, rows - 1], matrix[rows, rows + 1] = each[:-1], each[1:]
    matrix[rows, rows] = 2.0 * (each[:-1] + each[1:])
    right = np.zeros(x.size)
    right[1:-1] = 3.0 * (rise[:-1] * each[:-1] + rise[1:] * each[1:])
    if end_slopes is None:
        matrix[0, :2], matrix[-1, -2:] = (2.0, 1.0), (1.0, 2.0)
        right[[0, -1]] = 3.0 * rise[[0, -1]]
    else:
        matrix[0, 0] = matrix[-1, -1] = 1.0
        right[[0, -1]] = end_slopes
    return np.linalg.solve(matrix, right)


def cubics(
    x: Float[np.ndarray, " point"],
    y: Float[np.ndarray, " point"],
    slopes: Float[np.ndarray, " point"],
) -> Form:
    """Return the cubics between points with slopes, extrapolated at the ends."""
    h, rise = np.diff(x), np.diff(y) / np.diff(x)
    bend = 3.0 * rise - 2.0 * slopes[:-1] - slopes[1:]
    cube = slopes[:-1] + slopes[1:] - 2.0 * rise
    columns = y[:-1], slopes[:-1], bend / h, cube / h**2

    def form(at: Numbers) -> Numbers:
        xp = namespace(at)
        interval = xp.searchsorted(xp.asarray(x[1:-1]), at, side="right")
        t = at - xp.asarray(x)[interval]
        c0, c1, c2, c3 = (xp.asarray(column)[interval] for column in columns)
        return c0 + t * (c1 + t * (c2 + t * c3))

    return form


def arrival(log_ratio: Form, start: float, start_time: float, last: float) -> Form:
    r"""Return $\ln(c_0 t/Z)$ of a shock front, by integration of 1/M.

    Args:
        log_ratio: $\ln(p/P_0)$ of $\ln Z$.
        start: $Z$ at the start of the integral.
        start_time: $c_0 t$ at the start.
        last: Largest $Z$.
    """
    points, weights = np.polynomial.legendre.leggauss(8)
    points, weights = (points + 1.0) / 2.0, weights / 2.0
    step, first = ARRIVAL_STEP, math.log(start)
    nodes = first + step * np.arange(math.ceil((math.log(last) - first) / step) + 1)

    def passed(xp: Any, x: Numbers, width: Numbers) -> Numbers:
        """Return the integral of Z/M in ln Z over some intervals."""
        total = 0.0 * x
        for point, weight in zip(points.tolist(), weights.tolist(), strict=True):
            at = x + point * width
            mach = xp.sqrt(1.0 + 6.0 / 7.0 * xp.exp(log_ratio(at)))
            total = total + weight * xp.exp(at) / mach
        return total * width

    parts = passed(np, nodes[:-1], np.full(nodes.size - 1, step))
    times = start_time + np.concatenate([[0.0], np.cumsum(parts)])

    def form(log_z: Numbers) -> Numbers:
        xp = namespace(log_z)
        last_node = nodes.size - 1
        node = xp.clip(((log_z - first) / step).astype(np.int32), 0, last_node)
        begin = xp.asarray(nodes)[node]
        time = xp.asarray(times)[node] + passed(xp, begin, log_z - begin)
        return xp.log(time) - log_z

    return form


@cache
def data_rows(name: str) -> list[dict[str, str]]:
    """Read the rows of a table, by column name.

    Args:
        name: Name of the file in `data/`, without the suffix.
    """
    text = files("jblast.waves").joinpath(f"data/{name}.csv").read_text()
    # The head of a table states its provenance in comments.
    lines = (line for line in text.splitlines() if not line.startswith("#"))
    return list(csv.DictReader(lines))
