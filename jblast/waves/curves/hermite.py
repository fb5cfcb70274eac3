r"""A curve through printed values with printed slopes: cubic between neighbours.

Value and slope are continuous, curvature jumps at the nodes. With values and slopes
exact, the error over a spacing $h$ is $h^4/384$ times the fourth derivative. Outside
the nodes the curve is a straight line. Between evenly spaced nodes the stretch is found
by arithmetic, else by a search.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


@dataclass(frozen=True)
class HermiteCurve:
    """Cubics in the fraction of the way from one node to the next.

    Attributes:
        nodes: In ascending order.
        coefficients: Of the powers 0 to 3 of the fraction, one row a stretch.
        slope_before: Slope of the line before the first node.
        slope_after: Slope of the line after the last node.
    """

    nodes: Float[np.ndarray, " node"]
    coefficients: Float[np.ndarray, "stretch 4"]
    slope_before: float
    slope_after: float

    def inside(self, x: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        """Return the value between the nodes, in NumPy."""
        stretch = np.searchsorted(self.nodes[1:-1], x, side="right")
        t = (x - self.nodes[stretch]) / np.diff(self.nodes)[stretch]
        return (self.coefficients[stretch] * t[..., None] ** np.arange(4)).sum(-1)

    def value(self, x: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return the value anywhere."""
        nodes, spacing = (
            jnp.asarray(array, x.dtype) for array in (self.nodes, np.diff(self.nodes))
        )
        inside = jnp.minimum(jnp.maximum(x, nodes[0]), nodes[-1])
        if self._is_even():  # a search and its gathers take most of the time
            way = (inside - nodes[0]) / spacing[0]
            stretch = jnp.minimum(way.astype(jnp.int32), spacing.size - 1)
            t = way - stretch.astype(x.dtype)
        else:
            stretch = jnp.searchsorted(nodes[1:-1], inside, side="right")
            t = (inside - nodes[stretch]) / spacing[stretch]
        # By columns, which XLA reads twice as fast as rows; a stretch is never outside.
        c0, c1, c2, c3 = (
            jnp.asarray(column, x.dtype).at[stretch].get(mode="promise_in_bounds")
            for column in self.coefficients.T
        )
        outer = jnp.where(x < nodes[1], self.slope_before, self.slope_after)
        # Exactly on an end each of the two terms gives half of the slope: together one.
        return c0 + t * (c1 + t * (c2 + t * c3)) + outer.astype(x.dtype) * (x - inside)

    def _is_even(self) -> bool:
        """Whether the nodes are evenly spaced, but for rounding."""
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
        nodes: In ascending order.
        values: There.
        slopes: There.
        slope_before: Of the line before the first node; its slope if not given.
        slope_after: Of the line after the last node; its slope if not given.

    Raises:
        ValueError: The nodes do not ascend.
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
