r"""What stands behind a fire where no picture does: ground with a texture, and a sky.

The texture is tiled. It is kept at every size down to one pixel, each half of the one
before (Williams 1983, "Pyramidal parametrics"), and looked up between the two sizes
whose pixels are as large as what a ray covers of the ground: far away it is even, and
does not flicker when the camera moves.

The sky falls off from its horizon upwards by $e^{-\sin(h)/s}$, $h$ the height. A sun
(`sun.py`) may stand in it.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.sensors.camera.geometry.pixel_rays import Rays
from jblast.sensors.camera.rendering.sun import Sun

GROUND = (0.16, 0.14, 0.11)
"""Light of even ground where nothing is said: dry soil, full scale 1. Declared."""

HORIZON = (0.55, 0.70, 0.90)
"""Light of a clear sky above the horizon, full scale 1. Declared."""

FALL = 0.6
"""Sine of the height over which the sky's light falls by e [-]. Declared."""


class Landscape(eqx.Module):
    """Level ground and sky.

    Attributes:
        texels: Linear light of the texture at all its sizes, row by row, full scale 1.
        start: Where each size begins.
        rows: Of each size.
        columns: Of each size.
        metres_per_pixel: Of the texture [m/px]; east is to its right, north up, and its
            middle stands at the origin.
        horizon: Light of the sky above the horizon.
        sun: That stands in it; None if there is none.
    """

    texels: Float[Array, "texel 3"]
    start: Int[Array, " size"]
    rows: Int[Array, " size"]
    columns: Int[Array, " size"]
    metres_per_pixel: Float[Array, ""]
    horizon: Float[Array, "3"]
    sun: Sun | None = None

    def light(
        self, rays: Rays, pixel: Float[Array, ""]
    ) -> Float[Array, "3 row column"]:
        """Return what rays see; black where they show no direction.

        Args:
            rays: That end at the ground, or nowhere.
            pixel: Angle of one [rad].
        """
        up = rays.direction[2]
        solid = jnp.isfinite(rays.farthest) & (rays.farthest > 0.0)
        way = jnp.where(solid, rays.farthest, 0.0)
        east, north = (
            (rays.origin[axis] + way * rays.direction[axis]) / self.metres_per_pixel
            for axis in (0, 1)
        )
        covered = way * pixel / self.metres_per_pixel
        # at a slant a ray covers more along its way than across: the mean of both
        slant = jnp.sqrt(jnp.maximum(-up, 1e-3))
        size = jnp.log2(jnp.maximum(covered / slant, 1.0))
        size = jnp.clip(size, 0.0, len(self.rows) - 1.0)
        lower = jnp.floor(size).astype(int)
        part = (size - lower.astype(size.dtype))[None]
        upper = jnp.minimum(lower + 1, len(self.rows) - 1)
        fine, coarse = (self._texture(east, north, s) for s in (lower, upper))
        ground = (1.0 - part) * fine + part * coarse
        sky = self.horizon[:, None, None] * jnp.exp(-jnp.maximum(up, 0.0) / FALL)[None]
        if self.sun is not None:
            sky = sky + self.sun.light(rays.direction, pixel)[None]
        seen = jnp.where(solid[None], ground, sky)
        return jnp.where((rays.farthest > 0.0)[None], seen, 0.0)

    def _texture(
        self,
        east: Float[Array, "row column"],
        north: Float[Array, "row column"],
        size: Int[Array, "row column"],
    ) -> Float[Array, "3 row column"]:
        """Return the texture at places [px] and of sizes, between its pixels."""
        rows, columns, start = self.rows[size], self.columns[size], self.start[size]
        high, wide = (count.astype(east.dtype) for count in (rows, columns))
        across, along = (n[0].astype(east.dtype) for n in (self.columns, self.rows))
        x = (east / across + 0.5) * wide - 0.5
        y = (0.5 - north / along) * high - 0.5
        left, top = jnp.floor(x), jnp.floor(y)
        right, down = (x - left)[None], (y - top)[None]
        left, top = left.astype(int), top.astype(int)

        def texel(row, column):
            at = start + (row % rows) * columns + column % columns
            return jnp.moveaxis(self.texels[at], -1, 0)

        above = (1.0 - right) * texel(top, left) + right * texel(top, left + 1)
        below = (1.0 - right) * texel(top + 1, left) + right * texel(top + 1, left + 1)
        return (1.0 - down) * above + down * below


def landscape(
    texture: Float[np.ndarray, "height width 3"] | None = None,
    metres_per_pixel: float = 1.0,
    horizon: tuple[float, float, float] = HORIZON,
    sun: Sun | None = None,
) -> Landscape:
    """Return ground with a texture, or even ground, under a clear sky.

    Args:
        texture: Linear light, full scale 1.
        metres_per_pixel: Of it [m/px].
        horizon: Light of the sky above the horizon, full scale 1.
        sun: That stands in it; None if there is none.
    """
    image = np.array([[GROUND]]) if texture is None else np.asarray(texture, float)
    sizes = [image]
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
        sun,
    )


def _halved(image: np.ndarray) -> np.ndarray:
    """Return an image of half the size; an odd row is shared out."""
    for axis in (0, 1):
        size = image.shape[axis]
        if size > 1:
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
