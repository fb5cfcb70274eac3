"""The rows of an image that a fire can light: no more of it is computed.

The sky is not lit, and often takes half of the image or more.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jblast.scene import Scene
from jblast.sensors.camera.geometry.surfaces import Surfaces
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
