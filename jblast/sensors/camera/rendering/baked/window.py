"""The part of an image that pictures are in, so that no more of it is looked at.

Where rays meet a picture is known at every sixteenth row and column; a cell between
them may show some of it if the picture's box reaches into what its corners span. The
smallest window of a few sizes that holds all such cells is looked at: one program for
all frames, with a branch for each size.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.sensors.camera.geometry.pixel_rays import Rays

STRIDE = 16
"""Rows and columns from one corner to the next."""

SIZES = ((0.125, 0.125), (0.25, 0.25), (0.5, 0.5), (0.75, 0.5), (1.0, 1.0))
"""Rows and columns of windows, as parts of the image's; each holds the one before. A
cloud of smoke is higher than wide."""

SMALL = 64
"""Images of fewer rows or columns are looked at as a whole."""

SLACK = 0.1
"""By how much of a cell a lens may bend what is within it."""


def corner_rays(rays: Rays) -> Rays:
    """Return the rays at the corners of all cells."""
    rows, columns = (_places(size) for size in rays.farthest.shape)
    at = np.ix_(rows, columns)
    return Rays(rays.origin, rays.direction[:, *at], rays.farthest[at])


def _places(size: int) -> Int[np.ndarray, " corner"]:
    before = np.arange(0, size - 1, STRIDE) if size > 1 else np.zeros(1, int)
    return np.append(before, size - 1)


def ray_pitch(
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
    met: Bool[Array, "row column"],
    anchor: tuple[Float[Array, ""], Float[Array, ""]],
    shape: tuple[int, ...],
) -> Float[Array, ""]:
    """Return how far a ray is from the next on a picture, at a place of it [px].

    The root of the area, so that it is alike in all directions; taken in the cell
    beside the corner nearest to the place.

    Args:
        x: Where rays at corners meet the picture.
        y: Likewise.
        met: Whether they do.
        anchor: The place.
        shape: Rows and columns of all rays.
    """
    away = jnp.square(x - anchor[0]) + jnp.square(y - anchor[1])
    row, column = jnp.divmod(jnp.argmin(jnp.where(met, away, jnp.inf)), x.shape[1])
    row = jnp.minimum(row, x.shape[0] - 2)
    column = jnp.minimum(column, x.shape[1] - 2)
    down, right = (
        jnp.asarray(np.maximum(np.diff(_places(size)), 1), x.dtype)[at]
        for size, at in zip(shape, (row, column), strict=True)
    )
    x_down, y_down = (p[row + 1, column] - p[row, column] for p in (x, y))
    x_right, y_right = (p[row, column + 1] - p[row, column] for p in (x, y))
    area = jnp.abs(x_right * y_down - x_down * y_right) / (down * right)
    some = area > 0.0
    return jnp.where(some, jnp.sqrt(jnp.where(some, area, 1.0)), 1.0)


def touched(
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
    met: Bool[Array, "row column"],
    unknown: Bool[Array, "row column"],
    box: Float[Array, "4"],
) -> Bool[Array, "_ _"]:
    """Return which cells may show some of a box.

    Args:
        x: Where rays at corners meet the picture.
        y: Likewise.
        met: Whether they do.
        unknown: Corners without a direction; their cells may show anything.
        box: First and last x, first and last y.
    """

    def spans(places, first, last):
        low = -_most(jnp.where(met, -places, -jnp.inf))
        high = _most(jnp.where(met, places, -jnp.inf))
        slack = SLACK * (high - low)
        return (high + slack >= first) & (low - slack <= last)

    some = ~_all(~met)
    known = spans(x, box[0], box[1]) & spans(y, box[2], box[3])
    return some & (known | ~_all(~unknown))


def _most(values):
    across = jnp.maximum(values[:, 1:], values[:, :-1])
    return jnp.maximum(across[1:], across[:-1])


def _all(flags):
    across = flags[:, 1:] & flags[:, :-1]
    return across[1:] & across[:-1]


def in_window(
    cells: Bool[Array, "_ _"],
    rays: Rays,
    look: Callable[[Rays], Float[Array, "row column 4"]],
    parts: Sequence[tuple[float, float]] = SIZES,
) -> Float[Array, "row column 4"]:
    """Return what is seen along all rays, having looked only where cells are touched.

    Args:
        cells: Which may show something.
        rays: Of the whole image.
        look: What is seen along rays; nothing outside the cells.
        parts: As in `laid_in_window`.
    """
    shape, dtype = rays.farthest.shape, jax.eval_shape(look, rays).dtype
    nothing = jnp.zeros((*shape, 4), dtype)
    return laid_in_window(cells, rays, lambda part, _: look(part), nothing, parts)


def laid_in_window(
    cells: Bool[Array, "_ _"],
    rays: Rays,
    lay: Callable[[Rays, Float[Array, "row column _"]], Float[Array, "row column _"]],
    behind: Float[Array, "row column _"],
    parts: Sequence[tuple[float, float]] = SIZES,
) -> Float[Array, "row column _"]:
    """Return an image over which something is laid, only where cells are touched.

    Args:
        cells: Which may show something.
        rays: Of the whole image.
        lay: Lays what is seen along rays over what is behind, which it leaves as it is
            outside the cells.
        behind: The whole image.
        parts: Rows and columns of windows, as parts of the image's; the last is all.
            Of none nothing is looked at.
    """

    def over(part: Rays, beneath: Array, _: None) -> Array:
        return lay(part, beneath)

    return laid_in_windows(cells[None], rays, over, behind[None], None, parts)[0]


def laid_in_windows(
    cells: Bool[Array, "image _ _"],
    rays: Rays,
    lay: Callable[[Rays, Array, Any], Array],
    behind: Float[Array, "image row column _"],
    each: Any,
    parts: Sequence[tuple[float, float]] = SIZES,
) -> Float[Array, "image row column _"]:
    """Return images over which something is laid, in windows of one size.

    Images are changed where they stand, one after another: none is copied.

    Args:
        cells: Which are touched, of each image.
        rays: Of every image.
        lay: As in `laid_in_window`; also takes what there is for each image.
        behind: The images.
        each: Arrays whose first axis are the images; None: nothing.
        parts: As in `laid_in_window`.
    """
    shape = rays.farthest.shape
    if min(shape) < SMALL:
        return jax.lax.map(lambda x: lay(rays, *x), (behind, each))
    sizes = np.ceil(np.array(parts) * np.array(shape)).astype(int)
    starts, needs = zip(
        *(
            jax.vmap(partial(_extent, size=shape[i]))(jnp.any(cells, axis=2 - i))
            for i in (0, 1)
        ),
        strict=True,
    )
    needed = jnp.max(jnp.stack(needs), axis=1)
    which = jnp.sum(jnp.any(needed[None] > sizes[:-1], axis=1))

    def branch(size):
        rows, columns = (int(n) for n in size)

        def image(images, inputs):
            number, row, column, own = inputs
            row = jnp.clip(row, 0, shape[0] - rows)
            column = jnp.clip(column, 0, shape[1] - columns)
            part = Rays(
                rays.origin,
                jax.lax.dynamic_slice(
                    rays.direction, (0, row, column), (3, rows, columns)
                ),
                jax.lax.dynamic_slice(rays.farthest, (row, column), (rows, columns)),
            )
            at = number, row, column, 0
            beneath = jax.lax.dynamic_slice(
                images, at, (1, rows, columns, images.shape[3])
            )
            laid = lay(part, beneath[0], own)[None]
            return jax.lax.dynamic_update_slice(images, laid, at), None

        def run():
            if not rows * columns:
                return behind
            inputs = jnp.arange(len(behind)), *starts, each
            return jax.lax.scan(image, behind, inputs)[0]

        return run

    return jax.lax.switch(which, [branch(size) for size in sizes])


def _extent(
    touched: Bool[Array, " cell"], size: int
) -> tuple[Int[Array, ""], Int[Array, ""]]:
    """Return the first row or column of the cells touched, and how many they have."""
    places = _places(size)
    first = jnp.asarray(places)[jnp.argmax(touched)]
    last = jnp.asarray(places)[len(touched) - jnp.argmax(touched[::-1])]
    count = jnp.where(jnp.any(touched), last - first + 1, 0)
    return first, count
