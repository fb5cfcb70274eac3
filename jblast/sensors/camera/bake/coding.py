r"""Rendered frames as 8-bit pictures: heat, shade and opacity.

Blender renders a frame twice, as OpenEXR files without compression, which are read
here. Heat, colour and opacity of each pixel follow from the two.

Heat $h$ codes light logarithmically, as a temperature does. Fire that is as bright as a
black body of $T_h = T_a + h\,(T - T_a)$, $T$ the temperature of the fireball's law,
emits

$$\frac{L}{L(T)} = \exp\left[w \left(1 - \frac{T}{T_h}\right)\right], \qquad w =
\frac{c_2}{\lambda T}$$

(Wien). With the $w$ used, this is a black body's relative luminance within 9 %, from
1100 K to the reference. $h = 0$ is dark, $h = 1$ as bright as the law.

A view's sheet has two halves of the same tiles, one tile per frame, row after row. The
upper half is heat as grey, opaque. The lower half is the colour of soot and dust under
the sky, straight, as sRGB, with the opacity of fire and smoke as alpha.

The visible radius of an explosion in a picture is

$$R = 2\,\sigma_x, \qquad \sigma_x^2 = \frac{\sum_x n_x (x - \bar x)^2}{\sum_x n_x}$$

with $n_x$ the number of pixels of column $x$ that belong to the cloud. It is the radius
of a disc, and of half a disc on the ground: columns of both are as high as
$\sqrt{R^2 - x^2}$, whose variance is $R^2/4$. A rim, or lobes, affect it less than the
width of the outline.
"""

import math
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import InputError, read_bytes
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.image import LUMINANCE, srgb_to_linear

REFERENCE_TEMPERATURE = 2200.0
"""Temperature of heat 1 [K]: that of the fireball's law at its start."""
AIR_TEMPERATURE = 288.15
"""Temperature of heat 0, the surrounding air [K]."""
WIEN = 11.12
r"""$w$ at the reference temperature [-]: $\lambda$ = 588 nm, amid visible light."""
MIN_OPACITY = 1.0 / 255.0
"""Opacity up to which a pixel has no heat: one step of 8 bits."""
SMOOTHED = 1.1
"""Standard deviation of the average of shade [px]: its few rays leave noise. A larger
one would blur the lobes."""
MAGIC = b"\x76\x2f\x31\x01"
TYPES = {1: "<f2", 2: "<f4"}
"""Types of an OpenEXR channel: half and single precision."""
Channels = dict[str, Float[np.ndarray, "height width"]]
OPAQUE = 0.5
"""Opacity from which a pixel belongs to the cloud [-]: dust that is swept over the
ground is mostly thinner."""


class Layers(NamedTuple):
    """A frame of an explosion without background.

    Attributes:
        heat: Heat, 0 to 1.
        shade: Linear colour under the sky, straight, 0 to 1.
        alpha: Opacity, 0 to 1.
    """

    heat: Float[np.ndarray, "height width"]
    shade: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]


def heat_of_light(light: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the heat of light relative to the reference's, clipped to 0 to 1."""
    logs = np.log(np.maximum(light, 1e-30))  # any light this small is heat 0
    temperature = REFERENCE_TEMPERATURE / (1.0 - np.minimum(logs, 0.0) / WIEN)
    span = REFERENCE_TEMPERATURE - AIR_TEMPERATURE
    return np.clip((temperature - AIR_TEMPERATURE) / span, 0.0, 1.0)


def light_of_heat(heat: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the light of heat relative to the reference's: the inverse of coding."""
    span = REFERENCE_TEMPERATURE - AIR_TEMPERATURE
    temperature = AIR_TEMPERATURE + heat * span
    return np.exp(WIEN * (1.0 - REFERENCE_TEMPERATURE / temperature))


def sheet(frames: list[Layers], columns: int) -> UInt8[np.ndarray, "height width 4"]:
    """Return the two halves of a view's sheet; remaining tiles are empty.

    Args:
        frames: All of one size.
        columns: Tiles in a row.
    """
    heats, shades = [], []
    for heat, shade, alpha in frames:
        grey = np.rint(255.0 * np.where(alpha > MIN_OPACITY, heat, 0.0)).astype(
            np.uint8
        )
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
    """Return the frames of a sheet; the inverse of `sheet`, except for rounding.

    Args:
        picture: Both halves.
        size: Side of a tile [px].
        number: Number of frames.
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
    """Return the tiles per row with which both halves together are about square."""
    return max(1, math.ceil(math.sqrt(2 * number)))


def _tiled(tiles: list[np.ndarray], columns: int, blank: np.ndarray) -> np.ndarray:
    missing = -len(tiles) % columns
    tiles = [*tiles, *[blank] * missing]
    rows = [
        np.concatenate(tiles[start : start + columns], axis=1)
        for start in range(0, len(tiles), columns)
    ]
    return np.concatenate(rows, axis=0)


def layers_of(glow: Channels, shade: Channels) -> Layers:
    """Return a frame's layers.

    Opacity and heat come from the emitting gas, which has little noise. The colour
    under the sky is the light of the scattering gas over its own opacity, both averaged
    over neighbours.

    Args:
        glow: Channels R, G, B, A of the emitting gas: premultiplied, linear.
        shade: Likewise for the scattering gas.
    """
    alpha = np.clip(glow["A"], 0.0, 1.0)
    # premultiplied light over alpha: the mean source of the ray
    there = np.maximum(alpha, MIN_OPACITY)
    weights = np.asarray(LUMINANCE)  # float64, so that light is too
    light = sum(w * glow[c] for w, c in zip(weights, "RGB", strict=True)) / there
    heat = np.where(alpha > MIN_OPACITY, heat_of_light(np.asarray(light)), 0.0)
    # guards the division in empty pixels, which are transparent anyway
    opacity = np.maximum(averaged(shade["A"]), 1e-3)
    colour = np.stack([averaged(shade[c]) / opacity for c in "RGB"], axis=-1)
    return Layers(heat, np.clip(colour, 0.0, 1.0), alpha)


def averaged(
    image: Float[np.ndarray, "height width"],
) -> Float[np.ndarray, "height width"]:
    """Return an image averaged over neighbours by a Gaussian of `SMOOTHED`."""
    reach = int(np.ceil(3 * SMOOTHED))
    weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / SMOOTHED))
    weights /= weights.sum()
    for axis in (0, 1):
        size = image.shape[axis]
        around = [(reach, reach) if axis == a else (0, 0) for a in (0, 1)]
        padded = np.pad(image, around)
        shifted = (
            np.take(padded, np.arange(start, start + size), axis)
            for start in range(len(weights))
        )
        image = sum(
            (w * part for w, part in zip(weights, shifted, strict=True)),
            np.zeros_like(image),
        )
    return image


def read_exr(path: str | Path) -> Channels:
    """Return the channels of an OpenEXR file by name, such as `shade.Combined.R`.

    Raises:
        InputError: It is no such file, or incomplete; the message names it.
    """
    data = read_bytes(path, "an OpenEXR picture")
    if not data.startswith(MAGIC):
        raise InputError(f"{path}: expected an OpenEXR picture, got something else")
    try:
        return _channels(data)
    except (struct.error, IndexError, KeyError, ValueError) as error:
        raise InputError(
            f"{path}: expected a complete OpenEXR picture of scan lines, uncompressed, "
            f"but it cannot be read ({error})"
        ) from None


def _channels(data: bytes) -> Channels:
    # uncompressed scan lines have a fixed layout, which one NumPy type describes
    attributes, place = _attributes(data)
    if attributes["compression"] != b"\0":
        raise ValueError("it is compressed")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    if not (0 < width < 2**15 and 0 < height < 2**15):
        raise ValueError(f"{width} x {height} pixels")
    names = _channel_types(attributes["channels"])
    line = np.dtype(
        [("y", "<i4"), ("bytes", "<i4")] + [(n, t, (width,)) for n, t in names]
    )
    offsets = np.frombuffer(data, "<u8", height, place)
    # NaN marks lines that an incomplete file does not have
    found = {name: np.full((height, width), np.nan, np.float32) for name, _ in names}
    for offset in offsets.tolist():
        (row,) = np.frombuffer(data, line, 1, offset)
        for name in found:
            found[name][row["y"] - top] = row[name]
    return found


def _attributes(data: bytes) -> tuple[dict[str, bytes], int]:
    """Return the header's attributes, and the position after the header."""
    found, place = {}, len(MAGIC) + 4
    while data[place]:
        name, place = _word(data, place)
        _, place = _word(data, place)
        (size,) = struct.unpack_from("<i", data, place)
        place += 4
        found[name] = data[place : place + size]
        place += size
    return found, place + 1


def _channel_types(listed: bytes) -> list[tuple[str, str]]:
    found, place = [], 0
    while listed[place]:
        name, place = _word(listed, place)
        (kind,) = struct.unpack_from("<i", listed, place)
        found.append((name, TYPES[kind]))
        place += 16  # type, linearity, sampling across and down
    return found


def _word(data: bytes, place: int) -> tuple[str, int]:
    end = data.index(b"\0", place)
    return data[place:end].decode(), end + 1


def visible_radius(alpha: Float[np.ndarray, "height width"]) -> float:
    """Return the radius of a silhouette [px]; 0 if nothing is opaque.

    The variance of pixel centres is increased by that within a pixel, 1/12.

    Args:
        alpha: Opacity of fire and smoke, 0 to 1.
    """
    # column sums: their spread is insensitive to a rim (module docstring)
    columns = (alpha > OPAQUE).sum(axis=0).astype(float)
    total = columns.sum()
    if total == 0:
        return 0.0
    place = np.arange(len(columns))
    middle = (columns @ place) / total
    variance = (columns @ np.square(place - middle)) / total
    return 2.0 * float(np.sqrt(variance + 1.0 / 12.0))
