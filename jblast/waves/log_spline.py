r"""Curves printed as points, made smooth and safe to leave.

Through the points runs the natural cubic spline of $\ln y$ in $\ln z$. Its curvature
is zero at both ends, where it goes on as a power law with the end slope: so value,
slope and curvature are continuous everywhere, and there are no joins to speak of.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


@dataclass(frozen=True)
class LogSpline:
    r"""A spline, by its pieces $\ln y = \sum_{i<4} c_i (\ln z - x)^i$.

    Attributes:
        knots: $x$ of each piece, and at the end that of the last point.
        pieces: $c_0$ to $c_3$ of each piece.
        end_slopes: d ln y/d ln z before the first point and past the last.
    """

    knots: tuple[float, ...]
    pieces: tuple[tuple[float, float, float, float], ...]
    end_slopes: tuple[float, float]

    def log_value(self, log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return ln y."""
        inside = jnp.clip(log_z, self.knots[0], self.knots[-1])
        knots = jnp.asarray(self.knots[:-1], log_z.dtype)
        pieces = jnp.asarray(self.pieces, log_z.dtype)
        at = jnp.searchsorted(knots[1:], inside, side="right", method="compare_all")
        x = inside - knots[at]
        c = pieces[at]
        value = c[..., 0] + x * (c[..., 1] + x * (c[..., 2] + x * c[..., 3]))
        middle = 0.5 * (self.knots[0] + self.knots[-1])
        end_slope = jnp.where(log_z < middle, *self.end_slopes).astype(log_z.dtype)
        # Exactly on an end each of the two terms gives half of the slope: together one.
        return value + end_slope * (log_z - inside)


def natural_log_spline(z: np.ndarray, y: np.ndarray) -> LogSpline:
    """Return the spline through points: in NumPy, always in float64.

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
    cubic = np.diff(half) / (3.0 * h)
    return LogSpline(
        knots=tuple(x.tolist()),
        pieces=tuple(
            map(tuple, np.stack([f[:-1], start, half[:-1], cubic], 1).tolist())
        ),
        end_slopes=(float(start[0]), float(start[-1] + h[-1] * half[-2])),
    )
