r"""A curve through printed values with printed slopes: cubic between neighbours.

Value and slope are continuous, curvature jumps at the nodes. With values and slopes
exact, the error over a spacing $h$ is $h^4/384$ times the fourth derivative. Outside
the nodes the curve is a straight line.
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

    def piece(
        self, stretch: int, fraction: Float[np.ndarray, "..."]
    ) -> Float[np.ndarray, "..."]:
        """Return the value at fractions of one stretch, in NumPy."""
        return np.polynomial.polynomial.polyval(fraction, self.coefficients[stretch])

    def value(self, x: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return the value anywhere."""
        nodes, spacing, coefficients = (
            jnp.asarray(array, x.dtype)
            for array in (self.nodes, np.diff(self.nodes), self.coefficients)
        )
        inside = jnp.minimum(jnp.maximum(x, nodes[0]), nodes[-1])
        stretch = jnp.searchsorted(nodes[1:-1], inside, side="right")
        c0, c1, c2, c3 = jnp.moveaxis(coefficients[stretch], -1, 0)
        t = (inside - nodes[stretch]) / spacing[stretch]
        outer = jnp.where(x < nodes[1], self.slope_before, self.slope_after)
        # Exactly on an end each of the two terms gives half of the slope: together one.
        return c0 + t * (c1 + t * (c2 + t * c3)) + outer.astype(x.dtype) * (x - inside)


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
