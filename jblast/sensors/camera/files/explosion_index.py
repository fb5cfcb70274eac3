"""Explosion sets as files: an index, and one sheet of all frames for each view.

`views.toml` stands in the folder:

    kind = "explosion"
    size_px = 128                 # frames are square
    phases = [0.0004, 0.001]      # of each frame: time over the fireball's duration
    anchor_px = [63.5, 96.0]      # the burst, on the ground, in every frame; may stand
                                  # in each view instead
    reference_temperature_k = 2200.0   # at which heat was coded
    air_temperature_k = 288.15
    columns = 8                   # frames beside each other; else as many as fit
    [made]                        # how it was made, and its licence; not looked at

    [[view]]
    file = "00.webp"
    azimuth_deg = 180.0           # from the blast to the viewer, clockwise from north
    elevation_deg = 5.0
    radius_px = [20.1, 24.0]      # visible radius of each frame

A sheet is a WebP image with alpha: rows of frames in its upper half, whose grey is heat
(0: as cold as the air, 255: as hot as the middle of the fireball), and the same frames
below, with the colour of soot and dust (sRGB, straight) and the opacity of all.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.scene.reader.tables import fixed_list
from jblast.sensors.camera.files.view_index import (
    direction_of,
    known_keys,
    positive,
    read_index,
    view_entries,
)

KIND = "explosion"
KEYS = (
    *("kind", "size_px", "phases", "anchor_px", "columns", "made", "view"),
    *("reference_temperature_k", "air_temperature_k"),
)
VIEW_KEYS = (
    *("file", "azimuth_deg", "elevation_deg", "direction", "radius_px", "anchor_px"),
)


class ExplosionIndex(NamedTuple):
    """What the index of a set says.

    Attributes:
        size: Of a frame [px].
        phases: Of the frames.
        columns: Of frames on a sheet; 0 for as many as fit.
        files: Of the views.
        anchors: Of the burst in each view's frames [px].
        directions: Towards their viewers.
        ups: What is up in their pictures.
        radii: Visible radius of each frame [px].
    """

    size: int
    phases: Float[np.ndarray, " frame"]
    columns: int
    files: list[Path]
    anchors: Float[np.ndarray, "view 2"]
    directions: Float[np.ndarray, "view 3"]
    ups: Float[np.ndarray, "view 3"]
    radii: Float[np.ndarray, "view frame"]


def explosion_index(directory: Path) -> ExplosionIndex:
    """Return what the index of a set says.

    Raises:
        InputError: There is none, or it is not as above.
    """
    source, index = read_index(directory)
    if index.get("kind") != KIND:
        raise InputError(
            f'{source}: kind: expected "{KIND}", got {shown(index.get("kind"))}'
        )
    known_keys(index, KEYS, f"{source}: ")
    size = _whole(index.get("size_px"), f"{source}: size_px", 4)
    phases = _rising(index.get("phases"), f"{source}: phases")
    columns = 0
    if "columns" in index:
        columns = _whole(index["columns"], f"{source}: columns", 1)
    files, directions, ups, radii, anchors = [], [], [], [], []
    for number, entry in enumerate(view_entries(index, source), start=1):
        where = f"{source}: [[view]] {number} "
        if not isinstance(entry, dict):
            raise InputError(f"{where}: expected a table, got {shown(entry)}")
        known_keys(entry, VIEW_KEYS, where)
        name = entry.get("file")
        if not isinstance(name, str) or not name:
            raise InputError(f"{where}file: expected a WebP file, got {shown(name)}")
        files.append(directory / name)
        direction, up = direction_of(entry, where)
        directions.append(direction)
        ups.append(up)
        anchor = entry.get("anchor_px", index.get("anchor_px"))
        anchors.append(fixed_list(anchor, f"{where}anchor_px", "[x, y]"))
        radii.append(_radii(entry.get("radius_px"), len(phases), f"{where}radius_px"))
    above = [direction[2] >= 0.0 for direction in directions]
    if not any(above):
        raise InputError(
            f"{source}: elevation_deg: expected views from above the ground, got "
            f"{len(above)} from below it alone"
        )
    rows = (np.stack(part) for part in (anchors, directions, ups, radii))
    return ExplosionIndex(size, phases, columns, files, *rows)


def _whole(value: Any, where: str, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise InputError(
            f"{where}: expected a whole number from {least} on, got {shown(value)}"
        )
    return value


def _numbers(value: Any, where: str, expected: str) -> Float[np.ndarray, " number"]:
    if not isinstance(value, list) or not value:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return np.array([positive(number, where) for number in value])


def _rising(value: Any, where: str) -> Float[np.ndarray, " frame"]:
    phases = _numbers(value, where, "a list with the phase of each frame, rising")
    falls = np.flatnonzero(np.diff(phases) <= 0.0)
    if len(falls):
        before, after = phases[falls[0]], phases[falls[0] + 1]
        raise InputError(
            f"{where}: expected rising numbers, got {after:g} after {before:g}"
        )
    return phases


def _radii(value: Any, count: int, where: str) -> Float[np.ndarray, " frame"]:
    radii = _numbers(value, where, "a list with the visible radius of each frame [px]")
    if len(radii) != count:
        raise InputError(
            f"{where}: expected {count} numbers, one for each phase, got {len(radii)}"
        )
    return radii
