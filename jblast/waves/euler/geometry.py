r"""Planes and spheres: areas, volumes, and where a swept volume takes a face.

Everything is a steradian's worth in a sphere (area $r^2$, volume $r^3/3$), and a square
metre's worth in a plane (1 and $r$).
"""

from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float

Geometry = Literal["planar", "spherical"]


def area(radius: Float[Array, "..."], geometry: Geometry) -> Float[Array, "..."]:
    """Return the area of a face [m2]."""
    return radius * radius if geometry == "spherical" else jnp.ones_like(radius)


def volume_between(
    inner: Float[Array, "..."],
    thickness: Float[Array, "..."],
    geometry: Geometry,
) -> Float[Array, "..."]:
    r"""Return the volume of a shell [m3], $h\,(r^2 + rh + h^2/3)$.

    Args:
        inner: Inner radius $r$ [m].
        thickness: $h$ [m]; given by itself, so that no thin shell is a difference of
            large numbers.
        geometry: "planar" or "spherical".
    """
    if geometry == "planar":
        return thickness
    return thickness * (inner * (inner + thickness) + thickness * thickness / 3.0)


def swept_radius(
    radius: Float[Array, "..."], volume: Float[Array, "..."], geometry: Geometry
) -> Float[Array, "..."]:
    r"""Return where a face lies once it has swept a volume, $\sqrt[3]{r^3+3V}$ [m].

    Args:
        radius: Where it was $r$ [m].
        volume: What it swept $V$ [m3], small against $r^3$.
        geometry: "planar" or "spherical".
    """
    if geometry == "planar":
        return radius + volume
    # y = r'/r - 1 solves y^3 + 3y^2 + 3y = x: its series, then Newton once. A cube root
    # has no vector instruction, and in float32 no digits for a small step.
    at_centre = radius == 0.0
    r = jnp.where(at_centre, 1.0, radius)
    x = jnp.where(at_centre, 0.0, volume / (r * r * r))
    y = x * (1.0 - x * (1.0 - 5.0 / 3.0 * x))
    rest = y * (3.0 + y * (3.0 + y)) - 3.0 * x
    return radius * (1.0 + y - rest / (3.0 * (1.0 + y) * (1.0 + y)))
