r"""Fireballs, looked for in no more of an image than may show some of one.

A ray shows a fireball of the radius $R$ at the distance $d$ if it is less than
$\arcsin(R/d)$ off its middle. The rays of a cell are no farther from the nearest of its
corners than these are from each other. So nothing is missed, and what is seen is that
of `fireballs_seen`; most frames have most of their pixels to spare.
"""

from collections.abc import Callable
from functools import reduce

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.scene import Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.baked.window import (
    SLACK,
    corner_rays,
    in_window,
    laid_in_windows,
)
from jblast.sensors.camera.rendering.fireball_image import cloud, fireballs_seen

SIZES = ((0.0, 0.0), (0.4, 0.3), (1.0, 1.0))
"""Rows and columns of windows: few, as each is compiled for itself."""


def fireballs_in_window(
    scene: Scene, rays: Rays, time: Float[Array, ""], appearance: Appearance
) -> Float[Array, "4 row column"]:
    """Return what `fireballs_seen` does, in less time where fireballs are small.

    Args:
        scene: Charges and air.
        rays: Of a whole image, row by row.
        time: On the common clock [s].
        appearance: How they are exposed.
    """
    cells = cells_touched(scene, corner_rays(rays), time)

    def look(part: Rays) -> Float[Array, "row column 4"]:
        seen = fireballs_seen(scene, part, time, appearance)
        return jnp.moveaxis(seen, 0, -1)

    return jnp.moveaxis(in_window(cells, rays, look, SIZES), -1, 0)


def fireballs_over(
    scene: Scene,
    rays: Rays,
    times: Float[Array, " time"],
    appearance: Appearance,
    behind: Float[Array, "time row column 3"],
) -> Float[Array, "time row column 3"]:
    """Return images with the fireballs in front; no more of them is touched than they.

    Args:
        scene: Charges and air.
        rays: One a pixel, row by row.
        times: Of the images, on the common clock [s].
        appearance: How they are exposed.
        behind: The images.
    """
    corners = corner_rays(rays)
    cells = jax.vmap(lambda time: cells_touched(scene, corners, time))(times)

    # for gradients what a window shows is computed again: it would fill the memory
    @jax.checkpoint
    def lay(
        part: Rays, beneath: Float[Array, "row column 3"], time: Float[Array, ""]
    ) -> Float[Array, "row column 3"]:
        seen = jnp.moveaxis(fireballs_seen(scene, part, time, appearance), 0, -1)
        return seen[..., :3] + (1.0 - seen[..., 3:]) * beneath

    dtype = jax.eval_shape(lay, rays, behind[0], times[0]).dtype
    return laid_in_windows(cells, rays, lay, behind.astype(dtype), times, SIZES)


def cells_touched(
    scene: Scene, corners: Rays, time: Float[Array, ""]
) -> Bool[Array, "_ _"]:
    """Return which cells between corners may show a fireball.

    Args:
        scene: Charges and air.
        corners: Rays at the corners of the cells.
        time: On the common clock [s].
    """
    way = corners.direction
    # no ray of a cell is farther from its nearest corner than half a diagonal
    slope = _chord(way[:, 1:, 1:], way[:, :-1, :-1])
    other = _chord(way[:, 1:, :-1], way[:, :-1, 1:])
    size = (0.5 + SLACK) * jnp.maximum(slope, other)
    unknown = _any(~(corners.farthest > 0.0))
    found = [jnp.zeros_like(unknown)]
    for charge in scene.charges:
        ball = cloud(scene, charge, time)
        offset = ball.centre - corners.origin
        square = jnp.sum(jnp.square(offset))
        away = jnp.sqrt(jnp.where(square > 0.0, square, 1.0))
        apart = _chord(way, (offset / away)[:, None, None] + jnp.zeros_like(way))
        nearest = -_four(-apart, jnp.maximum)
        sine = ball.radius / away
        within = ~(sine < 1.0) | ~(square > 0.0)
        cosine = jnp.sqrt(1.0 - jnp.square(jnp.where(within, 0.0, sine)))
        # chords obey the triangle's inequality; this is that of the angle arcsin(R/d)
        seen = ~(nearest > sine * jnp.sqrt(2.0 / (1.0 + cosine)) + size)
        # a radius that is no number is seen
        found.append((seen | within | unknown) & ~(ball.radius <= 0.0))
    return reduce(jnp.logical_or, found)


def _chord(a: Float[Array, "3 _ _"], b: Float[Array, "3 _ _"]) -> Float[Array, "_ _"]:
    square = jnp.sum(jnp.square(a - b), axis=0)
    some = square > 0.0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


def _four(values: Array, join: Callable[[Array, Array], Array]) -> Array:
    across = join(values[:, 1:], values[:, :-1])
    return join(across[1:], across[:-1])


def _any(flags: Bool[Array, "_ _"]) -> Bool[Array, "_ _"]:
    return _four(flags, jnp.logical_or)
