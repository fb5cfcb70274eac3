r"""Curves printed as points, made smooth and safe to leave.

Through the points runs a cubic spline of $\ln y$ in $\ln z$, which goes on as a power
law with the end slope. The natural one has no curvature at its ends: so value, slope
and curvature are continuous everywhere, and there are no joins to speak of.
"""

import numpy as np
from jaxtyping import Float

from jblast.waves.curves.hermite import HermiteCurve, hermite_curve


def natural_log_spline(
    z: Float[np.ndarray, " point"], y: Float[np.ndarray, " point"]
) -> HermiteCurve:
    """Return ln y against ln z through points: in NumPy, always in float64.

    Args:
        z: Positive and rising.
        y: Positive.
    """
    return _spline(np.log(z), np.log(y), None)


def clamped_log_spline(
    z: Float[np.ndarray, " point"],
    y: Float[np.ndarray, " point"],
    start_slope: float,
    end_slope: float,
) -> HermiteCurve:
    """Return the same with given slopes d ln y/d ln z at the ends, for curved ones.

    Args:
        z: Positive and rising.
        y: Positive.
        start_slope: At the first point.
        end_slope: At the last point.
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
    """Solve by elimination: safe since the middle outweighs what is beside it."""
    middle, right = middle.tolist(), right.tolist()
    for i in range(1, len(right)):
        share = below[i] / middle[i - 1]
        middle[i] -= share * above[i - 1]
        right[i] -= share * right[i - 1]
    right[-1] /= middle[-1]
    for i in reversed(range(len(right) - 1)):
        right[i] = (right[i] - above[i] * right[i + 1]) / middle[i]
    return np.array(right)
