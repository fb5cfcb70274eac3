r"""The surroundings of a fireball: landscape, and surfaces lit by the fireball.

Landscape. The default background of a moving camera is textured ground and a sky. The
texture is tiled. It is stored at every size down to one pixel, each half of the one
before (Williams 1983, "Pyramidal parametrics"), and interpolated between the two sizes
whose pixels are as large as the footprint of a ray on the ground. Far away it is even,
and does not flicker when the camera moves. The light of the sky falls from its horizon
upwards by $e^{-\sin(h)/s}$, $h$ the elevation. A pixel on the horizon shows both in
proportion to their shares of it, so that its light is continuous as the camera turns.

Light of the fireball. A surface of a background is as bright as the light that falls on
it. By day that is the illuminance $E_0$, under which the background was taken. The
fireball adds $E$ to it,

$$B = B_0\,(1 + E/E_0), \qquad E = \pi\,\bar L\,F$$

in each of red, green and blue, $E_0$ being white. $\bar L$ is the mean light of the
fireball's disc as in `fireball.py`. $F$ is the configuration factor: the share of the
surface's view that a sphere of radius $R$ fills, its centre at the distance $d$ and at
the angle $\beta$ from the surface's normal. $F = (R/d)^2 \cos\beta$ if the plane of the
surface does not cut the sphere. If it does, $|\cos\beta| < R/d$, the part above gives

$$F = \frac{\cos\beta\,\arccos y - x \sin\beta \sqrt{1 - y^2}}{\pi (d/R)^2}
+ \frac1\pi \arctan\frac{\sin\beta \sqrt{1 - y^2}}{x}, \quad
x^2 = \frac{d^2}{R^2} - 1,\; y = -x \cot\beta$$

(Howell's catalogue of configuration factors, a planar element and a sphere; from
memory, tested against the integral). Within the sphere it keeps its value at the
sphere's surface, $(1 + \cos\beta)/2$. A charge on the ground lights the ground with
half a ball. Far away the light falls by the third power of the distance until the ball
has risen, then by the square of the distance and the cosine.

Neglected: shadows, light that is reflected more than once, smoke between the fire and
the surface, the ground's own heat, and the flash of the shock in air before the
products are visible, which is hotter and shorter than the fireball of the law.

Images of each component are summed one after another, and the arc tangent is a
polynomial: with JAX's own functions it would take as long as the fireball itself.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.sensors.camera.fireball import (
    Appearance,
    Cloud,
    Glow,
    between,
    lumpy_depth,
)
from jblast.sensors.camera.geometry import Rays, Surfaces

GROUND = (0.16, 0.14, 0.11)
"""Light of even ground without a texture: dry soil, full scale 1. Declared."""
HORIZON = (0.55, 0.70, 0.90)
"""Light of a clear sky above the horizon, full scale 1. Declared."""
FALL = 0.6
"""Sine of the elevation over which the sky's light falls by e [-]. Declared."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Quadrature of the mean over the disc: exact to 1e-4."""
TERMS = {"float64": 13, "float32": 8}
"""Terms of the polynomial: the arc tangent to 1e-11 in float64 and, at the precision of
float32, to 1e-7; near zero much better."""


class Landscape(eqx.Module):
    """Level ground and sky.

    Attributes:
        texels: Linear light of the texture at all its sizes, row by row, full scale 1.
        start: First texel of each size.
        rows: Rows of each size.
        columns: Columns of each size.
        metres_per_pixel: Scale of the texture [m/px]; east is to its right, north up,
            and its middle is at the origin.
        horizon: Light of the sky above the horizon.
    """

    texels: Float[Array, "texel 3"]
    start: Int[Array, " size"]
    rows: Int[Array, " size"]
    columns: Int[Array, " size"]
    metres_per_pixel: Float[Array, ""]
    horizon: Float[Array, "3"]

    def light(
        self, rays: Rays, pixel: Float[Array, ""]
    ) -> Float[Array, "3 row column"]:
        """Return the light along rays; black for rays without a direction.

        Args:
            rays: Rays that end at the ground, or nowhere.
            pixel: Angle of a pixel [rad].
        """
        up, height = rays.direction[2], rays.origin[2]
        shown = rays.farthest > 0.0
        solid = jnp.isfinite(rays.farthest) & shown
        share = jnp.clip(0.5 - up / pixel, 0.0, 1.0)
        end = height + jnp.where(solid, rays.farthest, 0.0) * up
        # surfaces of a depth image; rays that end on the ground do so up to rounding
        share = jnp.where(solid & (end > 1e-3 * height), 1.0, share)
        fall = jnp.exp(-jnp.maximum(up, 0.0) / FALL)
        # even ground needs no look-ups, which take most of the time
        if len(self.texels) == 1:
            ground = self.texels[0]
        else:
            # as far as a quarter of a pixel below the horizon: the mean of the texture
            reach = jnp.minimum(rays.farthest, 4.0 * height / pixel)
            ground = self._ground(rays, reach, pixel)
        # colour by colour: XLA would calculate a product with all again for each
        return jnp.stack(
            [
                jnp.where(shown, share * ground[n] + (1.0 - share) * fall * sky, 0.0)
                for n, sky in enumerate(self.horizon)
            ]
        )

    def _ground(
        self, rays: Rays, distance: Float[Array, "row column"], pixel: Float[Array, ""]
    ) -> Float[Array, "3 row column"]:
        """Return the texture at the ends of rays of some lengths [m]."""
        east, north = (
            (rays.origin[axis] + distance * rays.direction[axis])
            / self.metres_per_pixel
            for axis in (0, 1)
        )
        covered = distance * pixel / self.metres_per_pixel
        # at a slant the footprint is longer along the ray than across: geometric mean
        slant = jnp.sqrt(jnp.maximum(-rays.direction[2], 1e-3))
        size = jnp.log2(jnp.maximum(covered / slant, 1.0))
        size = jnp.clip(size, 0.0, len(self.rows) - 1.0)
        lower = jnp.floor(size).astype(int)
        part = (size - lower.astype(size.dtype))[None]
        upper = jnp.minimum(lower + 1, len(self.rows) - 1)
        fine, coarse = (self._texture(east, north, s) for s in (lower, upper))
        return (1.0 - part) * fine + part * coarse

    def _texture(
        self,
        east: Float[Array, "row column"],
        north: Float[Array, "row column"],
        size: Int[Array, "row column"],
    ) -> Float[Array, "3 row column"]:
        """Return the texture at positions [px] and sizes, interpolated bilinearly."""
        rows, columns, start = self.rows[size], self.columns[size], self.start[size]
        high, wide = (count.astype(east.dtype) for count in (rows, columns))
        across, along = (n[0].astype(east.dtype) for n in (self.columns, self.rows))
        x = (east / across + 0.5) * wide - 0.5
        y = (0.5 - north / along) * high - 0.5
        left, top = jnp.floor(x), jnp.floor(y)
        right, down = (x - left)[None], (y - top)[None]
        left, top = left.astype(int), top.astype(int)

        def texel(row, column):
            # modulo tiles the texture
            at = start + (row % rows) * columns + column % columns
            return jnp.moveaxis(self.texels[at], -1, 0)

        above = (1.0 - right) * texel(top, left) + right * texel(top, left + 1)
        below = (1.0 - right) * texel(top + 1, left) + right * texel(top + 1, left + 1)
        return (1.0 - down) * above + down * below


def landscape(
    texture: Float[np.ndarray, "height width 3"] | None = None,
    metres_per_pixel: float = 1.0,
    horizon: tuple[float, float, float] = HORIZON,
) -> Landscape:
    """Return ground with a texture, or even ground, under a clear sky.

    Args:
        texture: Linear light, full scale 1.
        metres_per_pixel: Scale of the texture [m/px].
        horizon: Light of the sky above the horizon, full scale 1.
    """
    image = np.array([[GROUND]]) if texture is None else np.asarray(texture, float)
    sizes = [image]
    # down to one pixel: the mean light of the texture, seen far away
    while max(sizes[-1].shape[:2]) > 1:
        sizes.append(_halved(sizes[-1]))
    counts = [size.shape[0] * size.shape[1] for size in sizes]
    return Landscape(
        jnp.asarray(np.concatenate([size.reshape(-1, 3) for size in sizes])),
        jnp.asarray(np.cumsum([0, *counts[:-1]])),
        jnp.asarray([size.shape[0] for size in sizes]),
        jnp.asarray([size.shape[1] for size in sizes]),
        jnp.asarray(float(metres_per_pixel)),
        jnp.asarray(horizon),
    )


def _halved(image: np.ndarray) -> np.ndarray:
    """Return an image of half the size; an odd row is shared between two."""
    for axis in (0, 1):
        size = image.shape[axis]
        if size > 1:
            # box filter by differences of the running sum; odd sizes have fractional
            # bounds
            edges = np.arange(size // 2 + 1) * (size / (size // 2))
            whole = np.concatenate(
                [np.zeros_like(image.take([0], axis)), np.cumsum(image, axis)], axis
            )
            low = np.floor(edges).astype(int)
            part = edges - low
            shape = [1, 1, 1]
            shape[axis] = -1
            part = part.reshape(shape)
            high = np.minimum(low + 1, size)
            ends = (1 - part) * whole.take(low, axis) + part * whole.take(high, axis)
            image = np.diff(ends, axis=axis) * (size // 2 / size)
    return image


def disc_light(ball: Cloud, ends: Glow, appearance: Appearance) -> Float[Array, "3"]:
    r"""Return $\bar L$: the mean emitted light of a fireball's disc [cd/m2].

    $\int_0^1 (1 - e^{-\tau h^3})\,L(h^2)\,2h\,dh$ by Gauss-Legendre quadrature.

    Args:
        ball: The fireball.
        ends: Light of its limb and of its middle [cd/m2].
        appearance: Distribution of its smoke.
    """
    h = jnp.asarray(0.5 * (1.0 + _NODES), ball.radius.dtype)[None]
    weight = jnp.asarray(_WEIGHTS, h.dtype)[None] * h
    alpha = -jnp.expm1(-lumpy_depth(ball, appearance) * h**3)
    light = between(*ends, jnp.square(h))
    return jnp.sum((weight * alpha)[None] * light, axis=(1, 2))


def _arctan_series(terms: int) -> list[float]:
    """Return the polynomial of (arctan(z) / z - 1) / z^2 in z^2, for z from 0 to 1."""

    def ratio(square):
        root = np.sqrt(square)
        return (np.arctan(root) / root - 1.0) / square

    # Chebyshev points: nearly the best polynomial of this degree
    ends = np.polynomial.Chebyshev.interpolate(ratio, terms - 1, [0.0, 1.0])
    return [float(c) for c in ends.convert(kind=np.polynomial.Polynomial).coef]


_ARCTAN = {dtype: _arctan_series(terms) for dtype, terms in TERMS.items()}


def sphere_factor(
    centre: Float[Array, "3"], radius: Float[Array, ""], surfaces: Surfaces
) -> Float[Array, "row column"]:
    r"""Return $F$: the share of a surface's view that a sphere fills; 0 for no surface.

    Args:
        centre: Centre of the sphere: east, north, up [m].
        radius: Radius of the sphere [m]; it is invisible if that is 0.
        surfaces: Positions and normals of the surfaces.
    """
    begun = ~(radius <= 0.0)  # negated: a NaN radius stays visible as NaN
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
    # the plain cosine law while the sphere is entirely above the plane
    whole = near * jnp.maximum(cosine, 0.0)
    # sine and cosine of arccos y are `across` and -x cos(beta), over sin(beta)
    # the plane of the surface cuts the sphere
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
    """Return the angle of (x, y) from the x axis, for y >= 0, not both 0."""
    aside = jnp.abs(x)
    steep = y > aside
    # reduced to 0 to 1, the range of the polynomial
    tangent = jnp.minimum(y, aside) / jnp.maximum(y, aside)
    series = _ARCTAN[jnp.dtype(tangent.dtype).name]
    square, rest = jnp.square(tangent), series[-1]
    for term in series[-2::-1]:
        rest = rest * square + term
    angle = tangent + tangent * square * rest
    angle = jnp.where(steep, 0.5 * jnp.pi - angle, angle)
    return jnp.where(x < 0.0, jnp.pi - angle, angle)
