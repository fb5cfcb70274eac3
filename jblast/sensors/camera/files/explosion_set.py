"""Explosion sets read from files: sheets cut into heat, colour and opacity."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float, UInt8

from jblast.errors import InputError
from jblast.sensors.camera.files.explosion_index import ExplosionIndex, explosion_index
from jblast.sensors.camera.files.view_index import read_index
from jblast.sensors.camera.files.webp import check_whole_webp, read_webp
from jblast.sensors.camera.rendering.baked.explosion_views import ExplosionViews
from jblast.sensors.camera.rendering.baked.sides import shown_towards, triangles

SHIPPED = Path(__file__).parents[1] / "explosion"
FAINTEST = 2
"""Opacity up to which a texel shows nothing, of 255: what compression leaves."""


def explosion_views(
    directory: str | Path | None = None,
    *,
    towards: ArrayLike | Sequence[ArrayLike] | None = None,
    sides: Literal[1, 3] = 1,
) -> ExplosionViews:
    """Read an explosion set, or those views of it that some cameras see.

    Args:
        directory: Of the set; None for the one that comes with jblast.
        towards: Directions from blasts to cameras, east, north, up, one or rows of
            them; None for all views. Where a camera goes elsewhere, the nearest of the
            views that were read is shown.
        sides: How many views a picture is mixed of.

    Raises:
        InputError: There is no index, or it is not as above; a file is missing, not
            whole, of another size, or has no alpha. The message names the file.

    Example:
        `jblast.render(scene, camera, times, views=explosion_views())`
    """
    index = explosion_index(SHIPPED if directory is None else Path(directory))
    for file in index.files:
        check_whole_webp(file)
    chosen = np.arange(len(index.files))
    if towards is not None:
        rows = np.reshape(np.asarray(towards, float), (-1, 3))
        chosen = shown_towards(index.directions, rows, sides)
    with ThreadPoolExecutor() as pool:
        frames = list(pool.map(lambda v: _frames(index, v), chosen.tolist()))
    texels = np.stack(frames)
    anchors, directions, ups, radii = (
        part[chosen]
        for part in (index.anchors, index.directions, index.ups, index.radii)
    )
    corners, inverses = triangles(index.directions)
    # those of the whole set that are read whole: fewer views have other triangles
    kept = np.flatnonzero(np.all(np.isin(corners, chosen), axis=1))
    kept = kept if len(kept) else np.zeros(1, int)
    corners = np.minimum(np.searchsorted(chosen, corners[kept]), len(chosen) - 1)
    inverses = inverses[kept]
    boxes, heights = _extents(texels, anchors[:, 1])
    return ExplosionViews(
        frames=jnp.asarray(texels),
        direction=directions,
        up=ups,
        radius=radii,
        spread=_spread(texels),
        box=boxes,
        height=_height(heights / radii, ups[:, 2]),
        phase=index.phases,
        anchor=anchors,
        corners=jnp.asarray(corners),
        inverses=inverses,
        sides=sides,
    )


def is_explosion_set(directory: str | Path) -> bool:
    """Return whether a folder of views is an explosion set, by its index.

    Raises:
        InputError: It has no index that can be read.
    """
    return "kind" in read_index(Path(directory))[1]


def _frames(index: ExplosionIndex, view: int) -> UInt8[np.ndarray, "frame size size 5"]:
    """Return heat, colour and opacity of a view's frames, from its sheet."""
    path, size, count = index.files[view], index.size, len(index.phases)
    sheet = read_webp(path)
    columns = index.columns or max(1, sheet.shape[1] // size)
    rows = -(-count // columns)
    expected = 2 * rows * size, columns * size
    if sheet.shape[:2] != expected:
        raise InputError(
            f"{path}: expected {expected[1]} x {expected[0]} pixels, {count} frames of "
            f"{size} x {size} twice in {columns} columns, got {sheet.shape[1]} x "
            f"{sheet.shape[0]}"
        )
    cut = sheet.reshape(2, rows, size, columns, size, 4).transpose(0, 1, 3, 2, 4, 5)
    heat, cover = cut.reshape(2, rows * columns, size, size, 4)[:, :count]
    texels = np.concatenate([heat[..., :1], cover], axis=-1)
    edge = np.ones((size, size), bool)
    edge[1:-1, 1:-1] = False
    texels[:, edge, 4] = 0
    texels[..., 4] *= texels[..., 4] > FAINTEST
    return texels


def _extents(
    texels: UInt8[np.ndarray, "view frame size size 5"],
    foot: Float[np.ndarray, " view"],
) -> tuple[Float[np.ndarray, "view frame 4"], Float[np.ndarray, "view frame"]]:
    """Return the box that shows anything, and how high its middle is [px]."""
    alpha = texels[..., 4]
    size = alpha.shape[-1]
    boxes = []
    for axis in (-2, -1):
        some = np.max(alpha, axis=axis) > 0
        first = np.argmax(some, axis=-1)
        last = size - 1 - np.argmax(some[..., ::-1], axis=-1)
        boxes += [first, np.where(np.max(some, axis=-1), last, first)]
    rows = np.sum(alpha > 127, axis=-1)
    mass = np.maximum(np.sum(rows, axis=-1), 1)
    middle = np.where(
        rows.any(axis=-1), rows @ np.arange(float(size)) / mass, foot[:, None]
    )
    return np.stack(boxes, axis=-1).astype(float), foot[:, None] - middle


def _spread(
    texels: UInt8[np.ndarray, "view frame size size 5"],
) -> Float[np.ndarray, "view frame 2"]:
    """Return how a silhouette spreads otherwise than along its columns [-].

    Returns:
        Covariance of columns and rows, and variance of rows, over that of columns; of
        what is nowhere opaque those of a disc.
    """
    opaque = (texels[..., 4] > 127).astype(np.float32)
    number = np.maximum(opaque.sum((-2, -1)), 1.0)
    place = np.arange(opaque.shape[-1]) - 0.5 * (opaque.shape[-1] - 1)
    columns, rows = opaque.sum(-2), opaque.sum(-1)
    x, y = columns @ place / number, rows @ place / number
    # pixels are as wide as they are: 1/12
    wide = columns @ place**2 / number - x**2 + 1.0 / 12.0
    tall = rows @ place**2 / number - y**2 + 1.0 / 12.0
    mixed = (opaque @ place) @ place / number - x * y
    some = np.expand_dims(opaque.any((-2, -1)), -1)
    shape = np.stack([mixed, tall], axis=-1) / wide[..., None]
    return np.where(some, shape, [0.0, 1.0])


def _height(
    raised: Float[np.ndarray, "view frame"], level: Float[np.ndarray, " view"]
) -> Float[np.ndarray, " frame"]:
    """Return the height of the cloud's middle over its radius, by all views.

    Args:
        raised: By how much it is above the burst in a picture, over the radius.
        level: Cosine of each view's elevation.
    """
    return level @ raised / max(float(level @ level), 1e-6)
