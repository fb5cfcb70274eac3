r"""Noisy states, smoothed: as much as generalised cross-validation says.

The natural cubic spline that minimises $\sum (x_i - f(t_i))^2 + \lambda \int f''^2$
(Reinsch 1967, Numer. Math. 10:177): with $Q$ the second differences and $R$ the
integrals of products of hat functions,
$$f = x - \lambda Q (R + \lambda Q^T Q)^{-1} Q^T x$$
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

PENALTIES = np.logspace(-1.0, 12.0, 27)
"""Tried, for rows one unit of time apart; the last gives a straight line."""
FREEST = 0.5
"""Degrees of freedom per row, at most: a spline through every row leaves no noise."""
PROBES = 50
"""Random vectors that tell the trace of the smoother (Hutchinson 1990), but for the
straight line, which it leaves as it is; unit vectors tell that of fewer rows."""


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
    scaled = (time - time[0]) / float(np.mean(np.diff(time)))
    rows, count = states.shape
    probes = _probes(scaled)
    best = np.full(count, np.inf)
    penalty, freedom = np.zeros(count), np.zeros(count)
    for tried in PENALTIES:
        passed = _smooth(scaled, np.column_stack([states, probes]), tried)
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
