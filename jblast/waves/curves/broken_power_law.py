r"""Curves printed as a power law with breaks, read in logarithms.

$$y = A\,z^n \prod_i \left[1 + (z/a_i)^{n_i}\right]^{m_i}$$

as Kinney and Graham write theirs. Every such curve is a power of z far inside its first
break and far outside its last, so it goes on by itself. Powers up to the tenth overflow
single precision at z = 1e4; their logarithms do not.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


class Break(NamedTuple):
    """One factor.

    Attributes:
        z: Where the slope changes, $a$.
        power: $n$.
        share: $m$; the slope changes by $m n$.
    """

    z: float
    power: float
    share: float


@dataclass(frozen=True)
class BrokenPowerLaw:
    """One curve.

    Attributes:
        factor: $A$.
        exponent: $n$.
        breaks: The factors in brackets.
        z_min: Below it the curve goes on as a power law with its slope there.
        z_max: Likewise above it.
    """

    factor: float
    exponent: float
    breaks: tuple[Break, ...]
    z_min: float = 0.0
    z_max: float = math.inf

    def log_value(self, log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return ln y."""
        inside = log_z
        if self.z_min > 0.0:
            inside = jnp.maximum(inside, math.log(self.z_min))
        if math.isfinite(self.z_max):
            inside = jnp.minimum(inside, math.log(self.z_max))
        value = math.log(self.factor) + self.exponent * inside
        for knee in self.breaks:
            steps = knee.power * (inside - math.log(knee.z))
            value = value + knee.share * jax.nn.softplus(steps)
        # Exactly on an end each of two terms gives half of the slope: together one.
        if self.z_min > 0.0:
            value = value + self.log_slope(self.z_min) * jnp.minimum(
                log_z - math.log(self.z_min), 0.0
            )
        if math.isfinite(self.z_max):
            value = value + self.log_slope(self.z_max) * jnp.maximum(
                log_z - math.log(self.z_max), 0.0
            )
        return value

    def log_slope(self, z: float) -> float:
        """Return d ln y / d ln z, at a place within z_min to z_max."""
        return self.exponent + math.fsum(
            knee.share * knee.power / (1.0 + (z / knee.z) ** -knee.power)
            for knee in self.breaks
        )
