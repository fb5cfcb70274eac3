"""The rays of an image: whence each pixel's light comes, and from how far at most."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene.camera import Camera
from jblast.sensors.camera.geometry.unproject import unproject


class Rays(eqx.Module):
    """Straight lines from a camera, one a pixel or several.

    Attributes:
        origin: East, north, up of all [m].
        direction: East, north, up, of length one.
        farthest: Where the ray ends at the background [m]; infinite where nothing ends
            it, 0 for a pixel that shows no direction.
    """

    origin: Float[Array, "3"]
    direction: Float[Array, "3 row column"]
    farthest: Float[Array, "row column"]


@partial(jax.jit, static_argnames=("supersample", "ground"))
def pixel_rays(
    camera: Camera,
    depth: Float[Array, "height width"] | None = None,
    *,
    supersample: int = 1,
    ground: bool = True,
) -> Rays:
    """Return the rays of all pixels, row by row.

    Compiled here, where `unproject` marks a pixel without a direction and raises
    nothing, and where many programs can share it.

    Args:
        camera: Who looks.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        supersample: Rays along each side of a pixel, evenly spaced; one goes through
            its centre.
        ground: Whether rays end at the plane up = 0.
    """
    dtype = camera.position.dtype
    x, y = (
        (jnp.arange(size * supersample, dtype=dtype) + 0.5) / supersample - 0.5
        for size in (camera.width, camera.height)
    )
    unit = unproject(camera, jnp.stack(jnp.meshgrid(x, y), axis=-1))
    unit = jnp.moveaxis(unit, -1, 0)  # whole images of each component: faster
    shown = ~jnp.isnan(unit[0])
    unit = jnp.where(shown, unit, 1.0)
    farthest = jnp.full(shown.shape, jnp.inf, dtype)
    if depth is not None:
        farthest = jnp.repeat(depth, supersample, axis=0).astype(dtype)
        farthest = jnp.repeat(farthest, supersample, axis=1)
    if ground:
        down = unit[2] < 0
        hit = -camera.position[2] / jnp.where(down, unit[2], -1.0)
        farthest = jnp.minimum(farthest, jnp.where(down, hit, jnp.inf))
    return Rays(camera.position, unit, jnp.where(shown, farthest, 0.0))


def pixels(
    image: Float[Array, "channel row column"], supersample: int
) -> Float[Array, "height width channel"]:
    """Return the mean over each pixel's rays, channels last."""
    channels, rows, columns = image.shape
    n = supersample
    if n > 1:
        image = image.reshape(channels, rows // n, n, columns // n, n).mean((2, 4))
    return jnp.moveaxis(image, 0, -1)
