r"""Handbook fits of peak pressure: sums of powers of one over the scaled distance.

Their segments are blended, and left as power laws, by `log_polynomial.LogCurve`: a sum
that ends on a negative constant turns negative far away, and no handbook means it
there.
"""

import math
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np


@dataclass(frozen=True)
class ReciprocalPolynomial:
    r"""One segment: $y = \sum_i c_i z^{-i}$.

    Attributes:
        z_min: Where it starts.
        z_max: Where it ends.
        coefficients: $c_0, c_1, \dots$
    """

    z_min: float
    z_max: float
    coefficients: tuple[float, ...]

    def log_value(self, log_z: Any) -> Any:
        """Return ln y: floats, NumPy and JAX arrays alike."""
        xp = np if isinstance(log_z, float | np.ndarray) else jnp
        u = xp.exp(-log_z)
        value = self.coefficients[-1]
        for coefficient in reversed(self.coefficients[:-1]):
            value = value * u + coefficient
        return xp.log(value)

    def log_slope(self, log_z: float) -> float:
        """Return d ln y / d ln z."""
        terms = [c * math.exp(-i * log_z) for i, c in enumerate(self.coefficients)]
        return -math.fsum(i * t for i, t in enumerate(terms)) / math.fsum(terms)
