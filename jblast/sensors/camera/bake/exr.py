"""OpenEXR files as Blender writes them without compression: scan lines of one part."""

import struct
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, read_bytes

MAGIC = b"\x76\x2f\x31\x01"
TYPES = {1: "<f2", 2: "<f4"}
"""Of a channel: half and single precision."""

Channels = dict[str, Float[np.ndarray, "height width"]]


def read_exr(path: str | Path) -> Channels:
    """Return the channels of a file by their names, as `shade.Combined.R`.

    Raises:
        InputError: It is no such file, or not a whole one; the message names it.
    """
    data = read_bytes(path, "an OpenEXR picture")
    if not data.startswith(MAGIC):
        raise InputError(f"{path}: expected an OpenEXR picture, got something else")
    try:
        return _channels(data)
    except (struct.error, IndexError, KeyError, ValueError) as error:
        raise InputError(
            f"{path}: expected a whole OpenEXR picture of scan lines, uncompressed, "
            f"but it cannot be read ({error})"
        ) from None


def _channels(data: bytes) -> Channels:
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
    found = {name: np.full((height, width), np.nan, np.float32) for name, _ in names}
    for offset in offsets.tolist():
        (row,) = np.frombuffer(data, line, 1, offset)
        for name in found:
            found[name][row["y"] - top] = row[name]
    return found


def _attributes(data: bytes) -> tuple[dict[str, bytes], int]:
    """Return the header's attributes, and where what follows it begins."""
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
        place += 16  # kind, how it was coded, steps across and down
    return found


def _word(data: bytes, place: int) -> tuple[str, int]:
    end = data.index(b"\0", place)
    return data[place:end].decode(), end + 1
