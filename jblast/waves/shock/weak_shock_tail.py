r"""The weak-shock tail: how the peak of a blast decays far away.

$$p = \frac{A}{Z \sqrt{\ln(Z/b)}}, \qquad
  \frac{d \ln p}{d \ln Z} = -1 - \frac{1}{2 \ln(Z/b)}$$

The asymptote of a spherical shock with a sharp front in still air without absorption:
Landau (1945), Whitham (1974), *Linear and Nonlinear Waves*, section 9.3. Faster than
the acoustic 1/Z because the front keeps eating the wave behind it.
"""

import math
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.waves.curves.log_polynomial import Segment


@dataclass(frozen=True)
class WeakShockTail:
    """The tail of one pressure curve.

    Attributes:
        join: Scaled distance where it takes over [m/kg^(1/3)].
        amplitude: $A$ [Pa m/kg^(1/3)].
        length: $b$ [m/kg^(1/3)].
    """

    join: float
    amplitude: float
    length: float

    def log_pressure(self, log_z: Any) -> Any:
        """Return ln p (p in Pa), NumPy and JAX arrays alike; log_z lies past ln b."""
        log = jnp.log if isinstance(log_z, jax.Array) else np.log
        return (
            math.log(self.amplitude) - log_z - 0.5 * log(log_z - math.log(self.length))
        )


def tail_from(join: float, pressure: float, slope: float) -> WeakShockTail:
    r"""Return the tail that leaves a point: the slope decides $b$, then the value $A$.

    Args:
        join: Distance there, in any unit; $b$ is in the same.
        pressure: $p$ there, in any unit; $A$ is in its product with that of distance.
        slope: $d\ln p/d\ln Z$ there [-].

    Raises:
        InputError: The slope is flatter than that of 1/Z, which no tail's is.
    """
    if not slope < -1.0:
        raise InputError(f"slope at join must be steeper than -1, got {slope:g}")
    log_reach = -0.5 / (slope + 1.0)
    return WeakShockTail(
        join=join,
        amplitude=pressure * join * math.sqrt(log_reach),
        length=join * math.exp(-log_reach),
    )


def weak_shock_tail(pressure: Segment, join: float) -> WeakShockTail:
    """Return the tail that meets a pressure curve in value and slope.

    Args:
        pressure: The curve, ln Pa against ln Z.
        join: Where they meet [m/kg^(1/3)].

    Raises:
        InputError: The curve is flatter than 1/Z there, which no tail is.
    """
    log_z = math.log(join)
    return tail_from(
        join, math.exp(pressure.log_value(log_z)), pressure.log_slope(log_z)
    )
