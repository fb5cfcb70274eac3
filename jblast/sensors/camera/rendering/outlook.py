"""What a camera that stands looks along and at: the same for all of its frames.

Of an image only the rows that a fire can light are computed for its light: the sky is
not lit, and often takes half of the image or more.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jblast.scene import Camera, Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays, pixel_rays
from jblast.sensors.camera.geometry.surfaces import Surfaces, surfaces_seen
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.flash import flash

PARTS = 16
"""Rows are cut to so many parts of an image's height: each is a program of its own."""


class LitRows(eqx.Module):
    """Surfaces of some rows of an image; the others have none.

    Attributes:
        surfaces: Of these rows.
        first: The first of them.
    """

    surfaces: Surfaces
    first: Int[Array, ""]


class Outlook(eqx.Module):
    """The rays of an image, and what there is for a fire to light.

    Attributes:
        rays: One a pixel, or several.
        lit: Surfaces of the background; None: nothing is lit.
        supersample: Rays along each side of a pixel.
    """

    rays: Rays
    lit: LitRows | None
    supersample: int = eqx.field(static=True)


def outlook_of(
    camera: Camera,
    depth: Float[Array, "height width"] | None = None,
    *,
    ground: bool = True,
    supersample: int = 1,
    lit: bool = True,
    lit_ground: bool | None = None,
) -> Outlook:
    """Return the outlook of a camera.

    Args:
        camera: Who looks.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: Whether the plane up = 0 hides what is below it.
        supersample: Rays along each side of a pixel.
        lit: Whether the fire lights what is there.
        lit_ground: Whether it lights the plane up = 0; by default where that hides.
    """
    surfaces = None
    if lit:
        plane = ground if lit_ground is None else lit_ground
        ends = pixel_rays(camera, depth, ground=plane)
        surfaces = lit_rows(surfaces_seen(ends, image=depth is not None))
    rays = pixel_rays(camera, depth, supersample=supersample, ground=ground)
    return Outlook(rays, surfaces, supersample)


def lit_rows(surfaces: Surfaces) -> LitRows:
    """Return the rows in which there is a surface; all of them where it is not known.

    Args:
        surfaces: Of a whole image.
    """
    height = surfaces.solid.shape[0]
    first, count = 0, height
    if not isinstance(surfaces.solid, Tracer):
        rows = np.flatnonzero(np.asarray(surfaces.solid).any(axis=1))
        rows = rows if len(rows) else np.zeros(1, int)
        step = -(-height // PARTS)
        count = min(-(-int(rows[-1] + 1 - rows[0]) // step) * step, height)
        first = min(int(rows[0]), height - count)
    part = jax.tree.map(lambda a: a[..., first : first + count, :], surfaces)
    return LitRows(part, jnp.asarray(first))


def brightened(
    behind: Float[Array, "height width 3"],
    lit: LitRows,
    scene: Scene,
    time: Float[Array, ""],
    appearance: Appearance,
) -> Float[Array, "height width 3"]:
    """Return a background in the light of the fire.

    Args:
        behind: As the day lights it.
        lit: What there is to be lit.
        scene: Charges and air.
        time: On the common clock [s].
        appearance: How bright the day is.
    """
    gained = jnp.moveaxis(flash(scene, lit.surfaces, time, appearance), 0, -1)
    if gained.shape[0] == behind.shape[0]:
        return behind * (1.0 + gained)
    at = lit.first, 0, 0
    part = jax.lax.dynamic_slice(behind, at, (gained.shape[0], *behind.shape[1:]))
    lighter = (part * (1.0 + gained)).astype(behind.dtype)
    return jax.lax.dynamic_update_slice(behind, lighter, at)
