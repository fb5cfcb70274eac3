r"""Curves printed as polynomials in the logarithm, made smooth and safe to leave.

A curve is $\ln y = p_k(\ln z)$, one polynomial $p_k$ a segment. Where segments meet,
the printed values jump and the slopes break; where the table ends, the polynomials run
away. So neighbours are blended in $\ln y$ over a stretch of $\ln z$ around each join,
and outside the table the curve goes on as a power law with its end slope.
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import jax.numpy as jnp
from jaxtyping import Array, Float

BLEND_WIDTH = 0.05
"""Width of a blend, in z: from join / sqrt(1.05) to join * sqrt(1.05)."""


@runtime_checkable
class Segment(Protocol):
    """One stretch of a curve: a `LogPolynomial` or a `ReciprocalPolynomial`."""

    @property
    def z_min(self) -> float:
        """Where it starts."""
        ...

    @property
    def z_max(self) -> float:
        """Where it ends."""
        ...

    def log_value(self, log_z: Any) -> Any:
        """Return ln y: floats, NumPy and JAX arrays alike."""
        ...

    def log_slope(self, log_z: Any) -> Any:
        """Return d ln y / d ln z."""
        ...


@dataclass(frozen=True)
class LogPolynomial:
    r"""One segment: $\ln y = \sum_i c_i u^i$ with $u = k_0 + k_1 \ln z$.

    Attributes:
        z_min: Where it starts.
        z_max: Where it ends.
        offset: $k_0$.
        scale: $k_1$.
        coefficients: $c_0, c_1, \dots$
    """

    z_min: float
    z_max: float
    offset: float
    scale: float
    coefficients: tuple[float, ...]

    def log_value(self, log_z: Any) -> Any:
        """Return ln y by Horner's rule: floats, NumPy and JAX arrays alike."""
        u = self.offset + self.scale * log_z
        value = self.coefficients[-1]
        for coefficient in reversed(self.coefficients[:-1]):
            value = value * u + coefficient
        return value

    def log_slope(self, log_z: Any) -> Any:
        """Return d ln y / d ln z: floats and NumPy arrays alike."""
        u = self.offset + self.scale * log_z
        slope = 0.0
        for power in range(len(self.coefficients) - 1, 0, -1):
            slope = slope * u + power * self.coefficients[power]
        return self.scale * slope


@dataclass(frozen=True)
class LogCurve:
    """Segments one after the other, each starting where the one before it ends.

    Attributes:
        segments: In order of z.
    """

    segments: tuple[Segment, ...]

    @property
    def z_min(self) -> float:
        """Where the table starts."""
        return self.segments[0].z_min

    @property
    def z_max(self) -> float:
        """Where the table ends."""
        return self.segments[-1].z_max

    def log_value(self, log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return ln y: twice continuously differentiable inside the table.

        At both ends of the table value and slope are continuous.
        """
        start, end = math.log(self.z_min), math.log(self.z_max)
        # The polynomials only ever see the table, or their NaN gradients would leak.
        inside = jnp.minimum(jnp.maximum(log_z, start), end)
        value = self.segments[0].log_value(self._within(inside, 0))
        for k in range(1, len(self.segments)):
            rise = smooth_step(inside, self.segments[k].z_min)
            value = value + rise * (
                self.segments[k].log_value(self._within(inside, k)) - value
            )
        end_slope = jnp.where(
            log_z < 0.5 * (start + end),
            self.segments[0].log_slope(start),
            self.segments[-1].log_slope(end),
        ).astype(log_z.dtype)
        # Exactly on an end each of the two terms gives half of the slope: together one.
        return value + end_slope * (log_z - inside)

    def _within(self, log_z: Float[Array, "..."], segment: int) -> Float[Array, "..."]:
        """Keep a segment's input in its reach, blends included."""
        half = 0.5 * math.log1p(BLEND_WIDTH)
        if segment > 0:
            log_z = jnp.maximum(log_z, math.log(self.segments[segment].z_min) - half)
        if segment < len(self.segments) - 1:
            log_z = jnp.minimum(log_z, math.log(self.segments[segment].z_max) + half)
        return log_z


def smooth_step(log_z: Float[Array, "..."], join: float) -> Float[Array, "..."]:
    r"""Return $6t^5 - 15t^4 + 10t^3$: 0 before a blend, 1 after it, twice smooth.

    $t$ runs from 0 to 1 over the blend, in $\ln z$.
    """
    width = math.log1p(BLEND_WIDTH)
    t = jnp.clip((log_z - (math.log(join) - 0.5 * width)) / width, 0.0, 1.0)
    return t * t * t * (10.0 + t * (6.0 * t - 15.0))
