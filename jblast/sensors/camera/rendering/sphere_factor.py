r"""How much of what a surface sees is a sphere: the configuration factor.

Of a sphere of the radius $R$, its centre $d$ away and $\beta$ off the surface's normal,
$F = (R/d)^2 \cos\beta$ if the surface's own plane does not cut it. If it does,
$|\cos\beta| < R/d$, what is above the plane makes

$$F = \frac{\cos\beta\,\arccos y - x \sin\beta \sqrt{1 - y^2}}{\pi (d/R)^2}
+ \frac1\pi \arctan\frac{\sin\beta \sqrt{1 - y^2}}{x}, \quad
x^2 = \frac{d^2}{R^2} - 1,\; y = -x \cot\beta$$

(Howell's catalogue of configuration factors, a planar element and a sphere; from
memory, tested against the integral). Within the sphere it stays what it is on its
surface, $(1 + \cos\beta)/2$.

Images of each component are summed one after another, and the arc tangent is a
polynomial: with JAX's own ways it would take as long as the fireball itself.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.sensors.camera.geometry.surfaces import Surfaces

TERMS = {"float64": 13, "float32": 8}
"""Of the polynomial: the arc tangent to 1e-11 and, where no more can be told, to 1e-7;
near zero much better."""


def _arctan_series(terms: int) -> list[float]:
    """Return the polynomial of (arctan(z) / z - 1) / z^2 in z^2, for z from 0 to 1."""

    def ratio(square):
        root = np.sqrt(square)
        return (np.arctan(root) / root - 1.0) / square

    ends = np.polynomial.Chebyshev.interpolate(ratio, terms - 1, [0.0, 1.0])
    return ends.convert(kind=np.polynomial.Polynomial).coef.tolist()


_ARCTAN = {dtype: _arctan_series(terms) for dtype, terms in TERMS.items()}


def sphere_factor(
    centre: Float[Array, "3"], radius: Float[Array, ""], surfaces: Surfaces
) -> Float[Array, "row column"]:
    r"""Return $F$: the part that a sphere has of what surfaces see; 0 of no surface.

    Args:
        centre: Of the sphere: east, north, up [m].
        radius: Of the sphere [m]; none of it is seen if it is 0.
        surfaces: Where they are, and which way they face.
    """
    begun = ~(radius <= 0.0)  # a radius that is no number is seen
    lit = surfaces.solid & begun
    square = along = jnp.zeros((), radius.dtype)
    for axis in range(3):
        part = centre[axis] - surfaces.place[axis]
        square = square + part * part
        along = along + part * surfaces.normal[axis]
    apart = square > 0.0
    square = jnp.where(apart, square, 1.0)
    cosine = jnp.where(apart, along, 0.0) / jnp.sqrt(square)
    near = jnp.where(apart, jnp.minimum(jnp.square(radius) / square, 1.0), 1.0)
    near = jnp.where(lit, near, 0.5)  # (R/d)^2
    whole = near * jnp.maximum(cosine, 0.0)
    # sine and cosine of arccos y are `across` and -x cos(beta), over sin(beta)
    cut = jnp.square(cosine) < near
    slant = jnp.where(cut, cosine, 0.0)
    outside = near < 1.0
    x = jnp.where(outside, jnp.sqrt(jnp.where(outside, 1.0 / near - 1.0, 1.0)), 0.0)
    rest = 1.0 - jnp.square(slant) / near
    above = rest > 0.0
    across = jnp.where(above, jnp.sqrt(jnp.where(above, rest, 1.0)), 0.0)
    angles = _angle(across, -x * slant), _angle(across, x)
    part = near * (slant * angles[0] - x * across) + angles[1]
    return jnp.where(lit, jnp.where(cut, part / jnp.pi, whole), 0.0)


def _angle(y: Float[Array, "..."], x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the angle of a place from the x axis, y not negative; not both are 0."""
    aside = jnp.abs(x)
    steep = y > aside
    tangent = jnp.minimum(y, aside) / jnp.maximum(y, aside)
    series = _ARCTAN[jnp.dtype(tangent.dtype).name]
    square, rest = jnp.square(tangent), series[-1]
    for term in series[-2::-1]:
        rest = rest * square + term
    angle = tangent + tangent * square * rest
    angle = jnp.where(steep, 0.5 * jnp.pi - angle, angle)
    return jnp.where(x < 0.0, jnp.pi - angle, angle)
