r"""Curves printed as points, made smooth and safe to leave.

Through the points runs the natural cubic spline of $\ln y$ in $\ln z$. Its curvature
is zero at both ends, where it goes on as a power law with the end slope: so value,
slope and curvature are continuous everywhere, and there are no joins to speak of.
"""

import numpy as np
from jaxtyping import Float

from jblast.waves.hermite_curve import HermiteCurve, hermite_curve


def natural_log_spline(
    z: Float[np.ndarray, " point"], y: Float[np.ndarray, " point"]
) -> HermiteCurve:
    """Return ln y against ln z through points: in NumPy, always in float64.

    Args:
        z: Positive and rising.
        y: Positive.
    """
    x, f = np.log(z), np.log(y)
    h, rise = np.diff(x), np.diff(f) / np.diff(x)
    # Half the curvature at each point: continuous slopes give one equation for each
    # point but the ends, where it is zero.
    equations, right = np.eye(x.size), np.zeros(x.size)
    for i in range(1, x.size - 1):
        equations[i, i - 1 : i + 2] = h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i]
        right[i] = 3.0 * (rise[i] - rise[i - 1])
    half = np.linalg.solve(equations, right)
    start = rise - h * (2.0 * half[:-1] + half[1:]) / 3.0
    return hermite_curve(x, f, np.append(start, start[-1] + h[-1] * half[-2]))
