"""Noisy states, smoothed: as much as generalised cross-validation says."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline, make_smoothing_spline

PENALTIES = np.logspace(-1.0, 12.0, 27)
"""Tried, for rows one unit of time apart; the last gives a straight line."""
FREEST = 0.5
"""Degrees of freedom per row, at most: a spline through every row leaves no noise."""
PROBES = 6
"""Random vectors that tell the trace of the smoother (Hutchinson 1990)."""


class Smoothed(NamedTuple):
    """Smoothed states.

    Attributes:
        value: At the rows.
        slope: Their derivatives at the rows.
        at: The states at any time.
        noise_sd: Standard deviation of the noise: the sum of squared residuals over
            rows less degrees of freedom, its root.
    """

    value: Float[np.ndarray, "row state"]
    slope: Float[np.ndarray, "row state"]
    at: Callable[[Float[np.ndarray, " place"]], Float[np.ndarray, "place state"]]
    noise_sd: Float[np.ndarray, " state"]


def smoothed(
    time: Float[np.ndarray, " row"], states: Float[np.ndarray, "row state"]
) -> Smoothed:
    """Smooth each state by a cubic spline (Wahba 1990, chapter 4).

    Errors are taken as independent from row to row, and equal.
    """
    unit = float(np.mean(np.diff(time)))
    scaled = (time - time[0]) / unit
    probes = np.random.default_rng(0).choice([-1.0, 1.0], (PROBES, len(time)))
    chosen = [_best(scaled, column, probes) for column in states.T]
    splines = [spline for spline, _ in chosen]

    def at(places: Float[np.ndarray, " place"]) -> Float[np.ndarray, "place state"]:
        return np.stack([s((places - time[0]) / unit) for s in splines], axis=1)

    slope = np.stack([s.derivative()(scaled) for s in splines], axis=1) / unit
    freedom = np.array([freedom for _, freedom in chosen])
    value = at(time)
    over = np.sum((states - value) ** 2, axis=0)
    return Smoothed(value, slope, at, np.sqrt(over / (len(time) - freedom)))


def _best(
    scaled: Float[np.ndarray, " row"],
    state: Float[np.ndarray, " row"],
    probes: Float[np.ndarray, "probe row"],
) -> tuple[BSpline, float]:
    """Return the spline cross-validation likes best, and its degrees of freedom."""
    rows, best = len(scaled), (np.inf, None, 0.0)
    for penalty in PENALTIES:
        spline = make_smoothing_spline(scaled, state, lam=penalty)
        over = np.mean((state - spline(scaled)) ** 2)
        passed = [make_smoothing_spline(scaled, p, lam=penalty)(scaled) for p in probes]
        freedom = float(np.mean(np.sum(probes * passed, axis=1)))
        score = over / max(1.0 - freedom / rows, 1.0 / rows) ** 2
        if score < best[0] and freedom < FREEST * rows:
            best = (score, spline, freedom)
    assert best[1] is not None
    return best[1], best[2]
