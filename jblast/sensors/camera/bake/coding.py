r"""An explosion's frames as pictures of 8 bits: how hot, what colour, how opaque.

Heat $h$ codes light logarithmically, as a temperature does. Fire that is as bright as a
black body of $T_h = T_a + h\,(T - T_a)$, $T$ the temperature of the fireball's law,
gives off

$$\frac{L}{L(T)} = \exp\left[w \left(1 - \frac{T}{T_h}\right)\right], \qquad w =
\frac{c_2}{\lambda T}$$

(Wien). With the $w$ taken it is a black body's relative luminance within 9 %, from
1100 K to the reference. $h = 0$ is dark, $h = 1$ as bright as the law.

A view's sheet has two halves of the same tiles, one tile a frame, row after row. The
upper is heat as grey, opaque. The lower is the colour of soot and dust under the sky,
straight, as sRGB, with the opacity of fire and smoke as alpha.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from jblast.sensors.camera.image.compositing import srgb_to_linear

REFERENCE_TEMPERATURE = 2200.0
"""At which heat is coded [K]: the fireball's at its start."""

AIR_TEMPERATURE = 288.15
"""Of the air around [K]."""

WIEN = 11.12
r"""$w$ at the reference temperature [-]."""

LEAST = 1.0 / 255.0
"""Opacity below which nothing is there [-]: what 8 bits round to nothing."""


class Layers(NamedTuple):
    """A frame of an explosion, without what is behind it.

    Attributes:
        heat: 0 to 1.
        shade: Linear colour under the sky, straight, 0 to 1.
        alpha: Opacity, 0 to 1.
    """

    heat: Float[np.ndarray, "height width"]
    shade: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]


def heat_of_light(light: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the heat of light relative to the reference's, clipped to 0 to 1."""
    logs = np.log(np.maximum(light, 1e-30))
    temperature = REFERENCE_TEMPERATURE / (1.0 - np.minimum(logs, 0.0) / WIEN)
    span = REFERENCE_TEMPERATURE - AIR_TEMPERATURE
    return np.clip((temperature - AIR_TEMPERATURE) / span, 0.0, 1.0)


def light_of_heat(heat: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the light of heat relative to the reference's: the way back."""
    span = REFERENCE_TEMPERATURE - AIR_TEMPERATURE
    temperature = AIR_TEMPERATURE + heat * span
    return np.exp(WIEN * (1.0 - REFERENCE_TEMPERATURE / temperature))


def sheet(frames: list[Layers], columns: int) -> UInt8[np.ndarray, "height width 4"]:
    """Return the two halves of a view's sheet; tiles that are left over are empty.

    Args:
        frames: All of one size.
        columns: Tiles in a row.
    """
    from jblast.sensors.camera.files.png import srgb_bytes

    heats, shades = [], []
    for heat, shade, alpha in frames:
        grey = np.rint(255.0 * np.where(alpha > LEAST, heat, 0.0)).astype(np.uint8)
        opaque = np.full_like(grey, 255)
        heats.append(np.stack([grey, grey, grey, opaque], axis=-1))
        layer = np.concatenate([shade, alpha[..., None]], axis=-1)
        shades.append(srgb_bytes(np.clip(layer, 0.0, 1.0)))
    blank_heat = np.zeros_like(heats[0])
    blank_heat[..., 3] = 255
    upper = _tiled(heats, columns, blank_heat)
    return np.concatenate([upper, _tiled(shades, columns, np.zeros_like(shades[0]))])


def frames_of_sheet(
    picture: UInt8[np.ndarray, "height width 4"], size: int, number: int
) -> list[Layers]:
    """Return the frames of a sheet; the way back, but for rounding.

    Args:
        picture: Both halves.
        size: Side of a tile [px].
        number: How many of the tiles are frames.
    """
    columns, rows = sheet_layout(picture.shape[:2], size)
    found = []
    for index in range(number):
        row, column = divmod(index, columns)
        across = slice(column * size, (column + 1) * size)
        heat = picture[row * size : (row + 1) * size, across, 0] / 255.0
        below = picture[(rows + row) * size : (rows + row + 1) * size, across] / 255.0
        found.append(Layers(heat, srgb_to_linear(below[..., :3]), below[..., 3]))
    return found


def sheet_layout(shape: tuple[int, ...], size: int) -> tuple[int, int]:
    """Return columns and rows of tiles in each half of a sheet."""
    return shape[1] // size, shape[0] // (2 * size)


def columns_for(number: int) -> int:
    """Return how many tiles a row has: both halves together are about square."""
    return max(1, math.ceil(math.sqrt(2 * number)))


def _tiled(tiles: list[np.ndarray], columns: int, blank: np.ndarray) -> np.ndarray:
    missing = -len(tiles) % columns
    tiles = [*tiles, *[blank] * missing]
    rows = [
        np.concatenate(tiles[start : start + columns], axis=1)
        for start in range(0, len(tiles), columns)
    ]
    return np.concatenate(rows, axis=0)
