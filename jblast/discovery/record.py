r"""Smoothing of a noisy record, and equations of motion in integral form.

Smoothed states are the natural cubic spline that minimises
$\sum (x_i - f(t_i))^2 + \lambda \int f''^2$, with $\lambda$ by generalised
cross-validation (Reinsch 1967, Numer. Math. 10:177). With $Q$ the second differences
and $R$ the integrals of products of hat functions,
$$f = x - \lambda Q (R + \lambda Q^T Q)^{-1} Q^T x$$

The weak form needs no derivative of the data. A window $\varphi$ of half width $H$
around $t_k$ is $(1 - s^2)^4$ with $s = (t - t_k)/H$, and zero outside. By parts,
$$-\int \varphi' x\, dt = \sum_j c_j \int \varphi\, \theta_j(x, u)\, dt$$
so that noise in $x$ is averaged, where a difference quotient would amplify it
(Messenger and Bortz 2021, Multiscale Model. Simul. 19:1474, eq. 2.3).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

POWER = 4
r"""Power of a window: $\varphi$ and three derivatives vanish at its bounds."""
PER_HALF_WIDTH = 4
"""Windows per half width: closer ones overlap so much that they add no information."""
MAX_WINDOWS = 600
"""Largest number of windows: their covariance is a full matrix of this size."""
MIN_ROWS_PER_HALF_WIDTH = 4
"""Mean number of rows in a half width: fewer do not resolve the shape of a window."""
INTERVALS = 4
"""Quadrature intervals per half width at least, as a gap between rows may be wider."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)
"""Gauss's rule with three points in each interval, exact to degree 5."""
PENALTIES = np.logspace(-1.0, 12.0, 27)
"""Penalties that are compared, two in a decade, for rows one unit of time apart: from
nearly no smoothing to a straight line."""
MAX_FREEDOM = 0.5
"""Largest number of degrees of freedom per row: a spline through all rows leaves no
residuals to estimate the noise from."""
PROBES = 50
"""Random vectors that estimate the trace of the smoother (Hutchinson 1990), without its
straight line, whose part is known. For at most twice as many rows unit vectors give the
exact trace."""


JUMP_SDS = 10.0
"""Size of a jump of a state relative to the noise of its steps: noise alone exceeds
half of that in one of a million rows."""
JUMP_SHARE = 0.02
"""Size of a jump relative to the spread of its state: smaller ones change no
equation."""


class Sides(NamedTuple):
    r"""Both sides of the equations of some states, without coefficients.

    Attributes:
        columns: Smoothed states, then inputs, at the quadrature points.
        left: $-\int \varphi' x$ of the recorded states.
    """

    columns: Float[np.ndarray, "place column"]
    left: Float[np.ndarray, "window state"]


class Windows(NamedTuple):
    r"""Integrals over windows, as matrices.

    Attributes:
        time: Quadrature points, at least three between two rows.
        integral: $\int \varphi f$ from values at the quadrature points.
        derivative: $-\int \varphi' f$ from values at the quadrature points.
        of_rows: $-\int \varphi' f$ from values at the rows, linear between them.
        centre: Centre of each window.
        half: Half width of all windows.
    """

    time: Float[np.ndarray, " place"]
    integral: sparse.csr_array
    derivative: sparse.csr_array
    of_rows: sparse.csr_array
    centre: Float[np.ndarray, " window"]
    half: float


def windows(
    time: Float[np.ndarray, " row"], half: float, most: int = MAX_WINDOWS
) -> Windows:
    """Return the integrals over windows that cover a run evenly.

    Args:
        time: Times of the rows, increasing.
        half: Half width of a window, in the unit of the times.
        most: Largest number of windows.
    """
    span = time[-1] - time[0] - 2.0 * half
    # windows overlap, so that all rows have nearly the same weight
    count = min(most, 1 + int(np.ceil(PER_HALF_WIDTH * span / half)))
    # intervals end at rows, where interpolated inputs have a kink
    places, weights = _quadrature(time, half / INTERVALS)
    centres = np.linspace(time[0] + half, time[-1] - half, count)
    first = np.searchsorted(places, centres - half)
    last = np.searchsorted(places, centres + half)
    row = np.repeat(np.arange(count), last - first)
    column = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    offset = (places[column] - centres[row]) / half
    bell = 1.0 - offset**2
    shape = (count, len(places))

    # Sparse, as a window has only the points within its half width.
    def matrix(values: Float[np.ndarray, " entry"]) -> sparse.csr_array:
        return sparse.csr_array((values * weights[column], (row, column)), shape)

    integral = matrix(bell**POWER)
    derivative = matrix(2.0 * POWER / half * offset * bell ** (POWER - 1))
    of_rows = derivative @ _between(time, places)
    return Windows(places, integral, derivative, of_rows, centres, half)


class Record(NamedTuple):
    r"""Recorded states with their smoothed values and their integral equations.

    Attributes:
        time_s: Times of the rows.
        states: Recorded states at the rows.
        inputs: Inputs at the rows.
        held: Whether inputs are constant until the next row.
        windows: Integrals over windows.
        smooth: Smoothed states at the rows.
        sides: Sides of the equations for the recorded states.
        noise_sd: Standard deviation of the noise of each state.
        runs: First row of each run.
        sides_of: Function of other states at these rows, with the same smoothing.
    """

    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    held: bool
    windows: Windows
    smooth: Float[np.ndarray, "row state"]
    sides: Sides
    noise_sd: Float[np.ndarray, " state"]
    runs: tuple[int, ...]
    sides_of: Callable[[Float[np.ndarray, "row state"]], Sides]

    @property
    def spread(self) -> Float[np.ndarray, " state"]:
        """Standard deviation of each state, noise included."""
        return np.std(self.states, axis=0)

    def with_noise(self, rng: np.random.Generator) -> Sides:
        """Return the sides of the smoothed states with new noise of the same size."""
        drawn = self.noise_sd * rng.standard_normal(self.smooth.shape)
        return self.sides_of(self.smooth + drawn)


def trajectory_record(
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    *,
    held: bool = False,
    runs: Sequence[int] = (0,),
) -> Record:
    """Return the record of a trajectory of one or several runs.

    Each run is smoothed on its own, and no window contains rows of two of them.

    Args:
        time_s: Times of the rows, increasing from run to run [s].
        states: States in any units.
        inputs: Inputs, without errors.
        held: Whether inputs are constant until the next row, as commands are; else they
            are linear between rows.
        runs: First row of each run.
    """
    parts = rows_of_runs(runs, len(time_s))
    smooth = [smoothed(time_s[part], states[part]) for part in parts]
    half = min(
        half_width(time_s[part], of.curves.value, of.curves.slope(time_s[part]))
        for part, of in zip(parts, smooth, strict=True)
    )
    most = max(MAX_WINDOWS // len(parts), PER_HALF_WIDTH)
    cuts = [windows(time_s[part], half, most) for part in parts]

    def sides(states: Float[np.ndarray, "row state"], curves: Sequence[Curves]):
        columns, left = [], []
        for part, cut, of in zip(parts, cuts, curves, strict=True):
            at = of.at(cut.time)
            # inputs are exact: interpolated, not smoothed
            between = [
                input_at(time_s[part], column[part], cut.time, held=held)
                for column in inputs.T
            ]
            columns.append(np.column_stack([at, *between]))
            # the curve by quadrature plus its residuals by the rows: the left side then
            # has the noise of the rows, neither smoothed nor counted twice
            over = states[part] - of.value
            left.append(cut.derivative @ at + cut.of_rows @ over)
        return Sides(np.concatenate(columns), np.concatenate(left))

    def again(states: Float[np.ndarray, "row state"]) -> Sides:
        pairs = zip(parts, smooth, strict=True)
        return sides(states, [of.again(states[part]) for part, of in pairs])

    def joined(name: str) -> sparse.csr_array:
        return sparse.csr_array(sparse.block_diag([getattr(c, name) for c in cuts]))

    curves = [of.curves for of in smooth]
    lengths = [part.stop - part.start for part in parts]
    variances = np.stack([of.noise_sd**2 for of in smooth])
    return Record(
        time_s,
        states,
        inputs,
        held,
        Windows(
            np.concatenate([cut.time for cut in cuts]),
            joined("integral"),
            joined("derivative"),
            joined("of_rows"),
            np.concatenate([cut.centre for cut in cuts]),
            half,
        ),
        np.concatenate([of.value for of in curves]),
        sides(states, curves),
        np.sqrt(np.average(variances, axis=0, weights=lengths)),
        tuple(runs),
        again,
    )


def rows_of_runs(runs: Sequence[int], rows: int) -> list[slice]:
    """Return the rows of each run by the first row of each."""
    return [slice(first, last) for first, last in pairwise([*runs, rows])]


def jumps_of(
    time: Float[np.ndarray, " row"], states: Float[np.ndarray, "row state"]
) -> tuple[int, ...]:
    """Return the rows, from zero, before which a state jumps.

    The step to a row differs from those beside it by more than `JUMP_SDS` and
    `JUMP_SHARE`, and the steps beside it differ by half as much in the other direction:
    so does the step of a jump alone, not that of a faulty row or of a bend.
    """
    gaps = np.diff(time)[:, None]
    slopes = np.diff(states, axis=0) / gaps
    over = (slopes[1:-1] - 0.5 * (slopes[2:] + slopes[:-2])) * gaps[1:-1]
    # the median is not moved by some jumps
    sd = np.median(np.abs(over), axis=0) / 0.6745
    least = np.maximum(JUMP_SDS * sd, JUMP_SHARE * np.std(states, axis=0))
    middle, beside = over[1:-1], np.stack([over[:-2], over[2:]])
    alone = np.abs(beside + 0.5 * middle) < 0.25 * np.abs(middle)
    found = (np.abs(middle) > least) & alone.all(axis=0)
    return tuple((np.flatnonzero(found.any(axis=1)) + 3).tolist())


def input_at(
    time: Float[np.ndarray, " row"],
    value: Float[np.ndarray, " row"],
    places: Float[np.ndarray, "..."],
    *,
    held: bool,
) -> Float[np.ndarray, "..."]:
    """Return an input between its rows, constant from each to the next or linear."""
    if not held:
        return np.asarray(np.interp(places, time, value))
    row = np.searchsorted(time, places, side="right") - 1
    return np.asarray(value[np.clip(row, 0, len(time) - 1)])


def half_width(
    time: Float[np.ndarray, " row"],
    value: Float[np.ndarray, "row state"],
    slope: Float[np.ndarray, "row state"],
) -> float:
    """Return the half width for the fastest state.

    It is the ratio of the standard deviations of the state and of its derivative, 1/6
    of the period of an oscillation. It contains four rows or more, and is an eighth of
    the record at most.
    """
    length = float(time[-1] - time[0])
    own = float(np.min(np.std(value, axis=0) / np.sqrt(np.mean(slope**2, axis=0))))
    shortest = MIN_ROWS_PER_HALF_WIDTH * length / (len(time) - 1)
    return min(max(own, shortest), length / 8.0)


def _quadrature(
    time: Float[np.ndarray, " row"], longest: float
) -> tuple[Float[np.ndarray, " place"], Float[np.ndarray, " place"]]:
    """Return quadrature points and weights, in intervals that end at rows.

    No interval is longer than `longest`.
    """
    gaps = np.diff(time)
    counts = np.maximum(1, np.ceil(gaps / longest)).astype(int)
    length = np.repeat(gaps / counts, counts)
    nth = np.arange(len(length)) - np.repeat(np.cumsum(counts) - counts, counts)
    start = np.repeat(time[:-1], counts) + nth * length
    places = start[:, None] + 0.5 * length[:, None] * (NODES + 1.0)
    return places.ravel(), (0.5 * length[:, None] * WEIGHTS).ravel()


def _between(
    time: Float[np.ndarray, " row"], places: Float[np.ndarray, " place"]
) -> sparse.csr_array:
    """Return the matrix of linear interpolation from the rows to other times."""
    left = np.searchsorted(time, places, side="right") - 1
    share = (places - time[left]) / (time[left + 1] - time[left])
    place = np.arange(len(places))
    values = np.concatenate([1.0 - share, share])
    return sparse.csr_array(
        (values, (np.tile(place, 2), np.concatenate([left, left + 1]))),
        (len(places), len(time)),
    )


class Curves(NamedTuple):
    """States as smooth curves.

    Attributes:
        value: States at the rows.
        at: States at any time.
        slope: Derivatives of the states at any time.
    """

    value: Float[np.ndarray, "row state"]
    at: Callable[[Float[np.ndarray, " place"]], Float[np.ndarray, "place state"]]
    slope: Callable[[Float[np.ndarray, " place"]], Float[np.ndarray, "place state"]]


class Smoothed(NamedTuple):
    """Smoothed states.

    Attributes:
        curves: Curves of the states.
        noise_sd: Standard deviation of the noise: root of the sum of squared residuals
            over the number of rows less degrees of freedom.
        again: Function that smooths other states at these rows equally.
    """

    curves: Curves
    noise_sd: Float[np.ndarray, " state"]
    again: Callable[[Float[np.ndarray, "row state"]], Curves]


def smoothed(
    time: Float[np.ndarray, " row"], states: Float[np.ndarray, "row state"]
) -> Smoothed:
    """Return each state smoothed by a cubic spline (Wahba 1990, chapter 4).

    Errors are assumed independent and of equal size.
    """
    # time in rows, so that the penalties suit any unit of time
    scaled = (time - time[0]) / float(np.mean(np.diff(time)))
    rows, count = states.shape
    probes = _probes(scaled)
    best = np.full(count, np.inf)
    penalty, freedom = np.zeros(count), np.zeros(count)
    for tried in PENALTIES:
        passed = _smooth(scaled, np.column_stack([states, probes]), tried)
        # generalised cross-validation; the trace by random signs (Hutchinson), since
        # the matrix itself is as large as the rows squared
        free = 2.0 + float(np.sum(probes * passed[:, count:]))
        over = np.mean((states - passed[:, :count]) ** 2, axis=0)
        score = over / max(1.0 - free / rows, 1.0 / rows) ** 2
        better = (score < best) & (free < MAX_FREEDOM * rows)
        best = np.where(better, score, best)
        penalty = np.where(better, tried, penalty)
        freedom = np.where(better, free, freedom)

    def again(states: Float[np.ndarray, "row state"]) -> Curves:
        columns = [
            _smooth(scaled, states[:, [state]], penalty[state])
            for state in range(count)
        ]
        value = np.concatenate(columns, axis=1)
        spline = CubicSpline(time, value, bc_type="natural")
        return Curves(value, spline, spline.derivative())

    curves = again(states)
    over = np.sum((states - curves.value) ** 2, axis=0)
    return Smoothed(curves, np.sqrt(over / (rows - freedom)), again)


def _probes(time: Float[np.ndarray, " row"]) -> Float[np.ndarray, "row probe"]:
    """Return probe vectors whose products with their smoothed values add to a trace."""
    rows = len(time)
    if rows <= 2 * PROBES:
        probes = np.eye(rows)
    else:
        probes = np.random.default_rng(0).choice([-1.0, 1.0], (rows, PROBES))
        probes /= np.sqrt(PROBES)
    # a spline does not change straight lines: their part of the trace is exactly 2
    line = np.linalg.qr(np.column_stack([np.ones(rows), time]))[0]
    return probes - line @ (line.T @ probes)


def _smooth(
    time: Float[np.ndarray, " row"],
    values: Float[np.ndarray, "row column"],
    penalty: float,
) -> Float[np.ndarray, "row column"]:
    """Return the spline of each column at the rows."""
    gaps = np.diff(time)
    left, right = 1.0 / gaps[:-1], 1.0 / gaps[1:]
    # column j of Q has left, -(left + right), right at the rows j, j + 1, j + 2, so
    # that the matrix is banded and a solution costs as much as the rows
    middle = -(left + right)
    bands = np.zeros((3, len(middle)))
    bands[2] = (gaps[:-1] + gaps[1:]) / 3.0
    bands[2] += penalty * (left**2 + middle**2 + right**2)
    bands[1, 1:] = gaps[1:-1] / 6.0
    bands[1, 1:] += penalty * (middle[:-1] * left[1:] + right[:-1] * middle[1:])
    bands[0, 2:] = penalty * right[:-2] * left[2:]
    bent = np.diff(np.diff(values, axis=0) / gaps[:, None], axis=0)
    force = penalty * np.asarray(solveh_banded(bands, bent))
    off = np.zeros(values.shape)
    off[:-2] += left[:, None] * force
    off[1:-1] += middle[:, None] * force
    off[2:] += right[:, None] * force
    return values - off
