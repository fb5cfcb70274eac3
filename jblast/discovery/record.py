r"""A noisy record, smoothed, and the equations of motion in integral form.

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

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from jblast.errors import InputError

POWER = 4
r"""Of a window; $\varphi$ and three derivatives vanish at its ends."""
PER_HALF_WIDTH = 4
"""Windows in each half width of one: closer ones add nothing."""
MAX_WINDOWS = 600
"""Largest number of windows."""
FEWEST_ROWS = 4
"""Rows in a half width, on average; fewer do not tell a window's shape."""
PIECES = 4
"""Pieces of quadrature in a half width, at least: a gap between rows may be wider."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)
"""Gauss's rule of three points in each piece, exact to degree 5."""
PENALTIES = np.logspace(-1.0, 12.0, 27)
"""Tried, for rows one unit of time apart; the last gives a straight line."""
FREEST = 0.5
"""Degrees of freedom per row, at most: a spline through every row leaves no noise."""
PROBES = 50
"""Random vectors that estimate the trace of the smoother (Hutchinson 1990), but for the
straight line, which it leaves as it is; for at most twice as many rows, unit vectors
give it exactly."""


class Sides(NamedTuple):
    r"""Both sides of the equations of some states, but for the coefficients.

    Attributes:
        columns: States, smoothed, then inputs, at the places of quadrature.
        left: $-\int \varphi' x$ of the states as they were recorded.
    """

    columns: Float[np.ndarray, "place column"]
    left: Float[np.ndarray, "window state"]


class Windows(NamedTuple):
    r"""Integrals over windows, as matrices.

    Attributes:
        time: Places of quadrature, at least three between two rows.
        integral: $\int \varphi f$ of what is known at the places.
        derivative: $-\int \varphi' f$ of what is known at the places.
        of_rows: $-\int \varphi' f$ of what is known at the rows, linear between them.
        centre: Of each window.
        half: Half width of all.
    """

    time: Float[np.ndarray, " place"]
    integral: sparse.csr_array
    derivative: sparse.csr_array
    of_rows: sparse.csr_array
    centre: Float[np.ndarray, " window"]
    half: float


def windows(time: Float[np.ndarray, " row"], half: float) -> Windows:
    """Return the integrals over windows spread evenly over a record.

    Args:
        time: Of the rows, rising.
        half: Half width of a window, in the unit of the times.
    """
    span = time[-1] - time[0] - 2.0 * half
    # overlapping, or some rows would count for more than others
    count = min(MAX_WINDOWS, 1 + int(np.ceil(PER_HALF_WIDTH * span / half)))
    # no piece crosses a row, where interpolated inputs have a kink
    places, weights = _quadrature(time, half / PIECES)
    centres = np.linspace(time[0] + half, time[-1] - half, count)
    first = np.searchsorted(places, centres - half)
    last = np.searchsorted(places, centres + half)
    row = np.repeat(np.arange(count), last - first)
    column = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    offset = (places[column] - centres[row]) / half
    bell = 1.0 - offset**2
    shape = (count, len(places))

    def matrix(values: Float[np.ndarray, " entry"]) -> sparse.csr_array:
        return sparse.csr_array((values * weights[column], (row, column)), shape)

    integral = matrix(bell**POWER)
    derivative = matrix(2.0 * POWER / half * offset * bell ** (POWER - 1))
    of_rows = derivative @ _between(time, places)
    return Windows(places, integral, derivative, of_rows, centres, half)


class Record(NamedTuple):
    r"""States over a time, and what they look like without noise.

    Attributes:
        time_s: Of the rows.
        states: At the rows, as recorded.
        inputs: At the rows.
        held: Whether inputs keep their value until the next row.
        windows: Integrals over windows.
        rate: What the terms are multiplied by: dt/ds, where windows lie in another time
            s than t.
        smooth: States at the rows, smoothed.
        sides: Of the equations, of the states as they were recorded.
        noise_sd: Standard deviation of the noise of each state, relative if `relative`.
        relative: Whether noise multiplies.
        sides_of: The sides of other states at these rows, smoothed as much.
    """

    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    held: bool
    windows: Windows
    rate: Float[np.ndarray, " place"]
    smooth: Float[np.ndarray, "row state"]
    sides: Sides
    noise_sd: Float[np.ndarray, " state"]
    relative: bool
    sides_of: Callable[[Float[np.ndarray, "row state"]], Sides]

    @property
    def noise_in_unit(self) -> Float[np.ndarray, " state"]:
        """Standard deviation of the noise of each state, in its unit, over the rows."""
        if not self.relative:
            return self.noise_sd
        return self.noise_sd * np.sqrt(np.mean(self.smooth**2, axis=0))

    def noise_map(self, state: int) -> sparse.csr_array:
        """Return what takes the noise of a state at the rows to the left side."""
        if not self.relative:
            return self.windows.of_rows
        return sparse.csr_array(
            self.windows.of_rows.multiply(self.smooth[:, state][None, :])
        )

    def with_noise(
        self, states: Float[np.ndarray, "row state"], rng: np.random.Generator
    ) -> Float[np.ndarray, "row state"]:
        """Return states with noise as large as this record's."""
        noise = self.noise_sd * rng.standard_normal(states.shape)
        return states * np.exp(noise) if self.relative else states + noise


def trajectory_record(
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    *,
    held: bool = False,
) -> Record:
    """Smooth the states and lay windows over them.

    Args:
        time_s: Of the rows, rising [s].
        states: In any units.
        inputs: Taken as exact.
        held: Inputs keep their value until the next row, as commands do; else they are
            linear between rows.
    """
    curves, noise_sd, again = smoothed(time_s, states)
    cut = windows(time_s, half_width(time_s, curves.value, curves.slope(time_s)))
    between = [input_at(time_s, column, cut.time, held=held) for column in inputs.T]

    def sides(states: Float[np.ndarray, "row state"], curves: Curves) -> Sides:
        at = curves.at(cut.time)
        # the curve by quadrature and its residuals by the rows: together no noise is
        # lost, and none is smoothed twice
        left = cut.derivative @ at + cut.of_rows @ (states - curves.value)
        return Sides(np.column_stack([at, *between]), left)

    return Record(
        time_s,
        states,
        inputs,
        held,
        cut,
        np.ones(len(cut.time)),
        curves.value,
        sides(states, curves),
        noise_sd,
        False,
        lambda states: sides(states, again(states)),
    )


def shock_record(
    time_s: Float[np.ndarray, " row"], radius_m: Float[np.ndarray, " row"]
) -> Record:
    """Smooth the radius of a shock and lay windows over it, both in ln of the time.

    A shock slows down as a power of time: in ln it is nearly straight, and few rows
    tell it, however unevenly they lie. What is looked for is dR/dt still; its noise is
    relative, so each window is divided by its own left side.

    Args:
        time_s: Since the detonation, positive, rising [s].
        radius_m: Positive [m].

    Raises:
        InputError: The smoothed radius does not grow all the time.
    """
    log_time = np.log(time_s)
    log_radius = np.log(radius_m)[:, None]
    curves, noise_sd, again = smoothed(log_time, log_radius)
    half = half_width(log_time, curves.value, curves.slope(log_time))
    cut = windows(log_time, half)
    left = cut.derivative @ np.exp(curves.at(cut.time))
    if not np.all(left > 0.0):
        raise InputError(
            "shock radius: expected one that grows with time; smoothed, it shrinks "
            "somewhere: its noise is too large"
        )
    relative = sparse.diags_array(1.0 / left[:, 0])
    cut = cut._replace(
        integral=sparse.csr_array(relative @ cut.integral),
        derivative=sparse.csr_array(relative @ cut.derivative),
        of_rows=sparse.csr_array(relative @ cut.of_rows),
    )

    def sides(log_radius: Float[np.ndarray, "row state"], curves: Curves) -> Sides:
        radius, smooth = np.exp(curves.at(cut.time)), np.exp(curves.value)
        noise = cut.of_rows @ (smooth * (log_radius - curves.value))
        return Sides(radius, cut.derivative @ radius + noise)

    def sides_of(radius: Float[np.ndarray, "row state"]) -> Sides:
        log_radius = np.log(radius)
        return sides(log_radius, again(log_radius))

    return Record(
        time_s,
        radius_m[:, None],
        np.empty((len(time_s), 0)),
        False,
        cut,
        np.exp(cut.time),
        np.exp(curves.value),
        sides(log_radius, curves),
        noise_sd,
        True,
        sides_of,
    )


def input_at(
    time: Float[np.ndarray, " row"],
    value: Float[np.ndarray, " row"],
    places: Float[np.ndarray, "..."],
    *,
    held: bool,
) -> Float[np.ndarray, "..."]:
    """Return an input between its rows, held from each to the next or linear."""
    if not held:
        return np.asarray(np.interp(places, time, value))
    row = np.searchsorted(time, places, side="right") - 1
    return np.asarray(value[np.clip(row, 0, len(time) - 1)])


def half_width(
    time: Float[np.ndarray, " row"],
    value: Float[np.ndarray, "row state"],
    slope: Float[np.ndarray, "row state"],
) -> float:
    """Return the half width that the fastest state asks for.

    It is the state's standard deviation over that of its derivative: 1/6 of the period
    of an oscillation. At least four rows lie in it, and it is an eighth of the record
    at most.
    """
    length = float(time[-1] - time[0])
    own = float(np.min(np.std(value, axis=0) / np.sqrt(np.mean(slope**2, axis=0))))
    fewest = FEWEST_ROWS * length / (len(time) - 1)
    return min(max(own, fewest), length / 8.0)


def _quadrature(
    time: Float[np.ndarray, " row"], longest: float
) -> tuple[Float[np.ndarray, " place"], Float[np.ndarray, " place"]]:
    """Return places and weights; no piece is longer than said, none crosses a row."""
    gaps = np.diff(time)
    pieces = np.maximum(1, np.ceil(gaps / longest)).astype(int)
    length = np.repeat(gaps / pieces, pieces)
    nth = np.arange(len(length)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    start = np.repeat(time[:-1], pieces) + nth * length
    places = start[:, None] + 0.5 * length[:, None] * (NODES + 1.0)
    return places.ravel(), (0.5 * length[:, None] * WEIGHTS).ravel()


def _between(
    time: Float[np.ndarray, " row"], places: Float[np.ndarray, " place"]
) -> sparse.csr_array:
    """Return what takes values at the rows to the places, linearly between rows."""
    left = np.searchsorted(time, places, side="right") - 1
    share = (places - time[left]) / (time[left + 1] - time[left])
    place = np.arange(len(places))
    values = np.concatenate([1.0 - share, share])
    return sparse.csr_array(
        (values, (np.tile(place, 2), np.concatenate([left, left + 1]))),
        (len(places), len(time)),
    )


class Curves(NamedTuple):
    """States as curves.

    Attributes:
        value: At the rows.
        at: The states at any time.
        slope: Their derivatives at any time.
    """

    value: Float[np.ndarray, "row state"]
    at: Callable[[Float[np.ndarray, " place"]], Float[np.ndarray, "place state"]]
    slope: Callable[[Float[np.ndarray, " place"]], Float[np.ndarray, "place state"]]


class Smoothed(NamedTuple):
    """Smoothed states.

    Attributes:
        curves: The states.
        noise_sd: Standard deviation of the noise: the sum of squared residuals over
            rows less degrees of freedom, its root.
        again: Smooths other states of these rows as much.
    """

    curves: Curves
    noise_sd: Float[np.ndarray, " state"]
    again: Callable[[Float[np.ndarray, "row state"]], Curves]


def smoothed(
    time: Float[np.ndarray, " row"], states: Float[np.ndarray, "row state"]
) -> Smoothed:
    """Smooth each state by a cubic spline (Wahba 1990, chapter 4).

    Errors are taken as independent from row to row, and equal.
    """
    # in rows: the penalties then suit any unit of time
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
        better = (score < best) & (free < FREEST * rows)
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
    """Return vectors of which the products with what they become add up to a trace."""
    rows = len(time)
    if rows <= 2 * PROBES:
        probes = np.eye(rows)
    else:
        probes = np.random.default_rng(0).choice([-1.0, 1.0], (rows, PROBES))
        probes /= np.sqrt(PROBES)
    # a spline passes straight lines as they are: their part of the trace is 2, exactly
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
    # column j of Q has left, -(left + right), right at the rows j, j + 1, j + 2
    middle = -(left + right)
    bands = np.zeros((3, len(middle)))
    bands[2] = (gaps[:-1] + gaps[1:]) / 3.0
    bands[2] += penalty * (left**2 + middle**2 + right**2)
    bands[1, 1:] = gaps[1:-1] / 6.0
    bands[1, 1:] += penalty * (middle[:-1] * left[1:] + right[:-1] * middle[1:])
    bands[0, 2:] = penalty * right[:-2] * left[2:]
    bent = np.diff(np.diff(values, axis=0) / gaps[:, None], axis=0)
    force = penalty * solveh_banded(bands, bent)
    off = np.zeros(values.shape)
    off[:-2] += left[:, None] * force
    off[1:-1] += middle[:, None] * force
    off[2:] += right[:, None] * force
    return values - off
