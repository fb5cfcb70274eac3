"""Layers laid over an image, calculated only in the tiles that may show them.

An image is divided into square tiles. A fire is compared with the rays at the corners
of each tile, and laid over the tiles that may show some of it, one after another: a
small fire costs little, and the program contains a layer once, for the size of a tile.
Nothing is missed: the result is that of the layer over the whole image.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Shaped

from jblast.sensors.camera.geometry import Rays

TILE = 32
"""Rows and columns of a tile. Smaller ones follow a fire more closely, and take more
turns of a loop."""
SLACK = 0.1
"""Margin of a tile for the bending of its rays by the lens, as a share of its size."""
State = TypeVar("State")
Image = Float[Array, "channel row column"]


def turns(
    count: Any,
    most: int,
    turn: Callable[[Any, State], State],
    start: State,
    *,
    reverse: bool,
) -> State:
    """Return the state after some turns of a loop.

    Args:
        count: Number of turns, which may be known inside jit only.
        most: Largest possible number.
        turn: Returns the next state, from the number of the turn and the state.
        start: State before the first turn.
        reverse: True for derivatives in reverse mode too, which need a fixed number of
            turns: those after `count` are skipped.
    """
    if not reverse:
        return jax.lax.fori_loop(0, count, turn, start)

    def some(i, state):
        return jax.lax.cond(i < count, turn, lambda _, kept: kept, i, state)

    return jax.lax.fori_loop(0, most, some, start)


def is_small(image: Array) -> bool:
    """Return True for images of less than a tile, which are calculated as a whole."""
    return min(image.shape[-2:]) < TILE


def padded(image: Image) -> Float[Array, "channel padded_row padded_column"]:
    """Return an image with whole tiles, unless it is small."""
    if is_small(image):
        return image
    return jnp.pad(image, [(0, 0), *((0, -size % TILE) for size in image.shape[1:])])


def padded_rays(rays: Rays, more: int = 0) -> Rays:
    """Return rays with whole tiles, extrapolated beyond the image.

    Args:
        rays: Rays of an image.
        more: Rows and columns after the last tile.
    """
    if is_small(rays.farthest) and not more:
        return rays
    room = [(0, -size % TILE + more) for size in rays.farthest.shape]
    # odd reflection: linear about the last ray
    direction = jnp.pad(
        rays.direction, [(0, 0), *room], mode="reflect", reflect_type="odd"
    )
    return Rays(rays.origin, direction, jnp.pad(rays.farthest, room, mode="edge"))


def corner_rays(rays: Rays) -> Rays:
    """Return the rays at the corners of all tiles, of which neighbours share them."""
    whole = padded_rays(rays, 1)
    corners = whole.farthest[::TILE, ::TILE]
    return Rays(rays.origin, whole.direction[:, ::TILE, ::TILE], corners)


def over_corners(
    values: Array, join: Callable[[Array, Array], Array]
) -> Shaped[Array, "tile_row tile_column"]:
    """Return a reduction over the four corners of each tile."""
    across = join(values[:, 1:], values[:, :-1])
    return join(across[1:], across[:-1])


def without_direction(corners: Rays) -> Bool[Array, "_ _"]:
    """Return the tiles that a lens shows in part: they may show anything."""
    return over_corners(~(corners.farthest > 0.0), jnp.logical_or)


def on_tiles(
    touched: Bool[Array, "_ _"],
    rays: Rays,
    layer: Callable[[Rays], Float[Array, "4 row column"]],
    image: Image,
    *,
    reverse: bool,
) -> Image:
    """Return an image with a layer over it.

    Args:
        touched: Mask of the tiles that may show some of the layer.
        rays: Rays of the image, in whole tiles.
        layer: Returns red, green and blue times alpha, and alpha, along rays.
        image: The image, in whole tiles or small.
        reverse: As in `turns`.
    """
    order, count = jnp.argsort(~touched.ravel()), jnp.sum(touched)
    channels = len(image)

    def laid(over: Float[Array, "4 row column"], beneath: Image) -> Image:
        return over[:channels] + (1.0 - over[3:]) * beneath

    if is_small(image):
        return laid(layer(rays), image)
    nothing = jnp.zeros_like(jax.eval_shape(layer, rays), shape=(4, TILE, TILE))

    def turn(i: Any, whole: Image) -> Image:
        row, column = (TILE * k for k in jnp.divmod(order[i], touched.shape[1]))
        part = Rays(
            rays.origin,
            jax.lax.dynamic_slice(rays.direction, (0, row, column), (3, TILE, TILE)),
            jax.lax.dynamic_slice(rays.farthest, (row, column), (TILE, TILE)),
        )
        at = 0, row, column
        beneath = jax.lax.dynamic_slice(whole, at, (channels, TILE, TILE))
        # a condition about the layer, not about the image, which it would copy; XLA
        # does not merge the two, and calculates no part of the layer twice
        over = jax.lax.cond(i < count, layer, lambda part: nothing, part)
        return jax.lax.dynamic_update_slice(whole, laid(over, beneath), at)

    def by_tile(image: Image) -> Image:
        # derivatives in reverse mode need a fixed number of turns
        return jax.lax.fori_loop(0, touched.size if reverse else count, turn, image)

    def as_whole(image: Image) -> Image:
        return laid(layer(rays), image)

    # a GPU calculates all rays of a batch of images simultaneously
    return jax.lax.platform_dependent(image, cpu=by_tile, default=as_whole)
