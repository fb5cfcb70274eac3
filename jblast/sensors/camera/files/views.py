"""Sets of views as files: folders of PNG frames and an index of where they belong.

`views.toml` stands in the folder; what all views share may stand at its top:

    frames_hz = 30.0
    charge_mass_kg = 5.0          # TNT equivalent of what exploded in the pictures
    srgb = true                   # false: the PNG files hold linear light
    metres_per_pixel = 0.05       # at the burst
    anchor_px = [159.5, 277.0]    # the burst in the pictures, x and y; else the middle

    [[view]]
    frames = "south"              # a folder of numbered frames, or a list of files
    azimuth_deg = 180.0           # from the blast to the viewer, clockwise from north
    elevation_deg = 5.0           # above the horizon; 0 if it is not said

    [[view]]
    frames = ["a.png", "b.png"]
    direction = [0.0, 1.0, 0.2]   # the same as east, north, up
    up = [0.0, 0.0, 1.0]          # what is up in the pictures, if it was not held level
    metres_per_pixel = 0.04

What is up in the pictures of a camera straight above is north, if only its `direction`
is said; with an azimuth it is what a camera sees that looks down from there.
"""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.scene.reader.tables import fixed_list
from jblast.sensors.camera.files.frames import frame_files, read_pictures
from jblast.sensors.camera.files.view_index import (
    direction_of,
    known_keys,
    positive,
    read_index,
    view_entries,
)
from jblast.sensors.camera.rendering.billboards import Views

SHARED = ("metres_per_pixel", "anchor_px")
KEYS = {
    "": ("frames_hz", "charge_mass_kg", "srgb", *SHARED, "view"),
    "[[view]] ": ("frames", "azimuth_deg", "elevation_deg", "direction", "up", *SHARED),
}
"""Keys of the index, and of each view."""


def read_views(directory: str | Path) -> Views:
    """Read a set of views; all their frames are of one size and number.

    Raises:
        InputError: There is no index, or it is not as above; a frame is missing, of
            another size, not whole, or has no alpha. The message names the file.
    """
    directory = Path(directory)
    source, index = read_index(directory)
    if "kind" in index:
        raise InputError(
            f"{source}: kind: expected pictures of one's own, which say none, got "
            f"{shown(index['kind'])}; an explosion set is read by `explosion_views`"
        )
    known_keys(index, KEYS[""], f"{source}: ")
    entries = view_entries(index, source)
    hz = positive(index.get("frames_hz"), f"{source}: frames_hz")
    mass = _mass(index, source)
    srgb = index.get("srgb", True)
    if not isinstance(srgb, bool):
        raise InputError(f"{source}: srgb: expected true or false, got {shown(srgb)}")
    pictures: list[np.ndarray] = []
    directions, ups, scales, anchors = [], [], [], []
    for number, entry in enumerate(entries, start=1):
        where = f"{source}: [[view]] {number} "
        if not isinstance(entry, dict):
            raise InputError(f"{where}: expected a table, got {shown(entry)}")
        known_keys(entry, KEYS["[[view]] "], where)
        entry = {key: index[key] for key in SHARED if key in index} | entry
        files = _files(directory, entry.get("frames"), f"{where}frames")
        pictures.append(read_pictures(files))
        if pictures[-1].shape != pictures[0].shape:
            raise InputError(
                f"{where}frames: expected {_size(pictures[0])} as in the first view, "
                f"got {_size(pictures[-1])}"
            )
        direction, up = direction_of(entry, where)
        directions.append(direction)
        ups.append(_up(entry, direction, up, where))
        scale = entry.get("metres_per_pixel")
        scales.append(positive(scale, f"{where}metres_per_pixel"))
        anchors.append(_anchor(entry, pictures[0], f"{where}anchor_px"))
    return Views(
        frames=jnp.asarray(np.stack(pictures)),
        direction=np.stack(directions),
        up=np.stack(ups),
        metres_per_pixel=np.array(scales),
        anchor=np.stack(anchors),
        frames_hz=hz,
        charge_mass=mass,
        srgb=srgb,
    )


def single_view(
    directory: str | Path,
    *,
    frames_hz: float,
    metres_per_pixel: float,
    charge_mass_kg: float,
    anchor: tuple[float, float] | None = None,
    srgb: bool = True,
) -> Views:
    """Read a folder of frames without an index as the one view there is.

    Args:
        directory: PNG frames with alpha, their names in order.
        frames_hz: Frame k shows the blast k / frames_hz after the burst [1/s].
        metres_per_pixel: At the burst [m/px].
        charge_mass_kg: TNT equivalent of what exploded in the pictures [kg].
        anchor: (x, y) of the burst [px]; by default the middle of the picture.
        srgb: Whether colours are sRGB, or linear light.

    Raises:
        InputError: As in `read_views`; or a number is not positive.
    """
    frames = read_pictures(frame_files(directory))
    height, width = frames.shape[1:3]
    middle = ((width - 1) / 2, (height - 1) / 2)
    return Views(
        frames=jnp.asarray(frames[None]),
        direction=np.array([[0.0, -1.0, 0.0]]),  # one is nearest from anywhere
        up=np.array([[0.0, 0.0, 1.0]]),
        metres_per_pixel=np.array([positive(metres_per_pixel, "metres_per_pixel")]),
        anchor=np.array([middle if anchor is None else anchor], float),
        frames_hz=positive(frames_hz, "frames_hz"),
        charge_mass=positive(charge_mass_kg, "charge_mass_kg"),
        srgb=srgb,
    )


def _files(directory: Path, frames: Any, where: str) -> list[Path]:
    """Return the files of a view: those of a folder, or those listed."""
    if isinstance(frames, str) and frames:
        return frame_files(directory / frames)
    named = isinstance(frames, list) and all(isinstance(f, str) and f for f in frames)
    if not named or not frames:
        raise InputError(
            f"{where}: expected a folder, or a list of PNG files, got {shown(frames)}"
        )
    return [directory / name for name in frames]


def _up(
    entry: dict[str, Any],
    direction: Float[np.ndarray, "3"],
    level: Float[np.ndarray, "3"],
    where: str,
) -> Float[np.ndarray, "3"]:
    """Return what is up in a view's pictures, across its direction."""
    if "up" not in entry:
        return level
    at = f"{where}up"
    vector = fixed_list(entry["up"], at, "[east, north, up]")
    across = vector - (vector @ direction) * direction
    length = np.linalg.norm(across)
    if not length > 1e-3 * np.linalg.norm(vector):
        raise InputError(
            f"{at}: expected a vector across the view's direction, not zero, got "
            f"{shown(entry['up'])}"
        )
    return across / length


def _mass(index: dict[str, Any], source: Path) -> float:
    """Return the mass of the charge in the pictures."""
    where = f"{source}: charge_mass_kg"
    if "charge_mass_kg" not in index:
        raise InputError(
            f"{where}: expected the TNT equivalent [kg] of what exploded in the "
            "pictures, by which they are scaled to the scene's charge; write "
            "charge_mass_kg = 5.0 above the first [[view]], if that was 5 kg"
        )
    return positive(index["charge_mass_kg"], where)


def _anchor(
    entry: dict[str, Any], pictures: np.ndarray, where: str
) -> Float[np.ndarray, "2"]:
    if "anchor_px" in entry:
        return fixed_list(entry["anchor_px"], where, "[x, y]")
    height, width = pictures.shape[1:3]
    return np.array([(width - 1) / 2, (height - 1) / 2])


def _size(pictures: np.ndarray) -> str:
    count, height, width = pictures.shape[:3]
    return f"{count} frames of {width} x {height} pixels"
