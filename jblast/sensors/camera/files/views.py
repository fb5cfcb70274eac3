"""Sets of views and explosion sets as files: an index and the pictures it names.

A set of views is folders of PNG frames and `views.toml`; keys that all views share may
be at its top:

    frames_hz = 30.0
    charge_mass_kg = 5.0          # TNT equivalent of what exploded in the pictures
    srgb = true                   # false: the PNG files are linear light
    metres_per_pixel = 0.05       # at the burst
    anchor_px = [159.5, 277.0]    # the burst in the pictures, x and y; else the middle

    [[view]]
    frames = "south"              # a folder of numbered frames, or a list of files
    azimuth_deg = 180.0           # from the blast to the viewer, clockwise from north
    elevation_deg = 5.0           # above the horizon; default 0

    [[view]]
    frames = ["a.png", "b.png"]
    direction = [0.0, 1.0, 0.2]   # the same as east, north, up
    up = [0.0, 0.0, 1.0]          # up in the pictures, if the camera was not level
    metres_per_pixel = 0.04

Without `up`, a `direction` straight from above implies that up in the pictures is
north. An azimuth implies the up of a camera that looks down from there.

An explosion set has one sheet of all frames for each view, and this `views.toml`:

    kind = "explosion"
    size_px = 128                 # frames are square
    phases = [0.0004, 0.001]      # of each frame: time over the fireball's duration
    anchor_px = [63.5, 96.0]      # the burst, on the ground, in every frame; may stand
                                  # in each view instead
    reference_temperature_k = 2200.0   # at which heat was coded
    air_temperature_k = 288.15
    columns = 8                   # frames in a row; default: as many as fit
    [made]                        # how it was made, and its licence; not read

    [[view]]
    file = "00.webp"
    azimuth_deg = 180.0           # from the blast to the viewer, clockwise from north
    elevation_deg = 5.0
    radius_px = [20.1, 24.0]      # visible radius of each frame

A sheet is a WebP image with alpha: rows of frames in its upper half, whose grey is heat
(0: as cold as the air, 255: as hot as the middle of the fireball), and the same frames
below, with the colour of soot and dust (sRGB, straight) and the opacity of all.
"""

import math
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float, UInt8

from jblast.errors import InputError, nearest, read_text, shown
from jblast.scene.values import Numbers, finite
from jblast.sensors.camera.explosion import ExplosionViews, upright
from jblast.sensors.camera.files.images import (
    check_whole_webp,
    frame_files,
    read_pictures,
    read_webp,
)
from jblast.sensors.camera.image import linear_to_srgb
from jblast.waves.fireball import fireball_duration

SHARED = ("metres_per_pixel", "anchor_px")
KEYS = {
    "": ("frames_hz", "charge_mass_kg", "srgb", *SHARED, "view"),
    "[[view]] ": ("frames", "azimuth_deg", "elevation_deg", "direction", "up", *SHARED),
}
"""Keys of the index, and of each view."""
SHIPPED = Path(__file__).parents[1] / "explosion"
"""Explosion set that is part of the package."""
FAINTEST = 2
"""Opacity up to which a texel is invisible, of 255: artefacts of compression."""
KIND = "explosion"
EXPLOSION_KEYS = (
    *("kind", "size_px", "phases", "anchor_px", "columns", "made", "view"),
    *("reference_temperature_k", "air_temperature_k"),
)
VIEW_KEYS = (
    "file",
    "azimuth_deg",
    "elevation_deg",
    "direction",
    "radius_px",
    "anchor_px",
)
INDEX = "views.toml"


def read_views(directory: str | Path) -> ExplosionViews:
    """Read a set of views; all their frames have one size and number.

    Raises:
        InputError: There is no index, or it is not as above; a frame is missing, has
            another size, is incomplete, or has no alpha. The message names the file.
    """
    directory = Path(directory)
    source, index = read_index(directory)
    if "kind" in index:
        raise InputError(
            f"{source}: kind: expected no such key in a set of user's pictures, got "
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
        # keys of a view override those at the top
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
    texels = np.stack(pictures)
    colours, alpha = texels[..., :3], texels[..., 3:]
    if not srgb:
        colours = np.rint(255.0 * linear_to_srgb(colours / 255.0)).astype(np.uint8)
    texels = np.concatenate([np.zeros_like(alpha), colours, alpha], axis=-1)
    # the last picture fades into a blank one
    texels = np.pad(texels, [(0, 0), (0, 1), *[(0, 0)] * 3])
    views, count = texels.shape[:2]
    boxes, _ = _extents(texels, np.zeros(views))
    return ExplosionViews(
        frames=jnp.asarray(texels),
        direction=np.stack(directions),
        up=np.stack(ups),
        radius=np.tile(np.cbrt(mass) / np.array(scales)[:, None], count),
        spread=np.broadcast_to([0.0, 1.0], (views, count, 2)),
        box=boxes,
        height=np.zeros(count),
        phase=np.arange(count) / hz / float(fireball_duration(mass)),
        anchor=np.stack(anchors),
        hot=False,
    )


def _files(directory: Path, frames: Any, where: str) -> list[Path]:
    """Return the files of a view: those of a folder, or those in a list."""
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
    """Return up in a view's pictures, a unit vector across its direction."""
    if "up" not in entry:
        return level
    at = f"{where}up"
    vector = Numbers("[east, north, up]").read(entry["up"], at)
    # only the part across the direction is visible as up
    across = vector - (vector @ direction) * direction
    length = np.linalg.norm(across)
    # nearly parallel vectors leave only rounding errors across
    if not length > 1e-3 * np.linalg.norm(vector):
        raise InputError(
            f"{at}: expected a vector across the view's direction, not zero, got "
            f"{shown(entry['up'])}"
        )
    return across / length


def _mass(index: dict[str, Any], source: Path) -> float:
    """Return the TNT equivalent of the charge in the pictures [kg]."""
    where = f"{source}: charge_mass_kg"
    if "charge_mass_kg" not in index:
        raise InputError(
            f"{where}: expected the TNT equivalent [kg] of the charge in the pictures, "
            "by which they are scaled to the scene's charge; write "
            "charge_mass_kg = 5.0 above the first [[view]], if that was 5 kg"
        )
    return positive(index["charge_mass_kg"], where)


def _anchor(
    entry: dict[str, Any], pictures: np.ndarray, where: str
) -> Float[np.ndarray, "2"]:
    if "anchor_px" in entry:
        return Numbers("[x, y]").read(entry["anchor_px"], where)
    height, width = pictures.shape[1:3]
    return np.array([(width - 1) / 2, (height - 1) / 2])


def _size(pictures: np.ndarray) -> str:
    count, height, width = pictures.shape[:3]
    return f"{count} frames of {width} x {height} pixels"


def explosion_views(
    directory: str | Path | None = None,
    *,
    towards: ArrayLike | Sequence[ArrayLike] | None = None,
) -> ExplosionViews:
    """Read an explosion set, or those of its views that some cameras need.

    Args:
        directory: Directory of the set; None for the one that comes with jblast.
        towards: Directions from blasts to cameras, east, north, up, one or rows of
            them; None for all views. From other directions the nearest of the views
            that were read is shown.

    Raises:
        InputError: There is no index, or it is not as above; a file is missing,
            incomplete, of another size, or has no alpha. The message names the file.

    Example:
        `jblast.render(scene, camera, times, views=explosion_views())`
    """
    index = explosion_index(SHIPPED if directory is None else Path(directory))
    for file in index.files:
        check_whole_webp(file)
    chosen = np.arange(len(index.files))
    if towards is not None:
        rows = np.reshape(np.asarray(towards, float), (-1, 3))
        # a set is large: views that no camera needs are not decoded
        chosen = np.unique(np.argmax(rows @ index.directions.T, axis=1))
    # WebP decoding releases the interpreter lock
    with ThreadPoolExecutor() as pool:
        frames = list(pool.map(lambda v: _frames(index, v), chosen.tolist()))
    texels = np.stack(frames)
    anchors, directions, ups, radii = (
        part[chosen]
        for part in (index.anchors, index.directions, index.ups, index.radii)
    )
    boxes, heights = _extents(texels, anchors[:, 1])
    # least squares over the views: height = h cos(elevation), for one h per frame
    level = ups[:, 2]
    return ExplosionViews(
        frames=jnp.asarray(texels),
        direction=directions,
        up=ups,
        radius=radii,
        spread=_spread(texels),
        box=boxes,
        height=(level @ (heights / radii) / max(float(level @ level), 1e-6)),
        phase=index.phases,
        anchor=anchors,
    )


def is_explosion_set(directory: str | Path) -> bool:
    """Return True if a folder of views is an explosion set, by its index.

    Raises:
        InputError: It has no index that can be read.
    """
    return "kind" in read_index(Path(directory))[1]


class ExplosionIndex(NamedTuple):
    """Content of the index of a set.

    Attributes:
        size: Side of a frame [px].
        phases: Phases of the frames.
        columns: Frames in a row of a sheet; 0 for as many as fit.
        files: Sheets of the views.
        anchors: Position of the burst in each view's frames [px].
        directions: Directions towards their viewers.
        ups: Up in their pictures.
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
    # half, row, column, then the tile's pixels
    cut = sheet.reshape(2, rows, size, columns, size, 4).transpose(0, 1, 3, 2, 4, 5)
    heat, cover = cut.reshape(2, rows * columns, size, size, 4)[:, :count]
    texels = np.concatenate([heat[..., :1], cover], axis=-1)
    # a transparent margin: interpolation at the edge must not repeat its texels
    edge = np.ones((size, size), bool)
    edge[1:-1, 1:-1] = False
    texels[:, edge, 4] = 0
    # faint artefacts would enlarge the box that is rendered
    texels[..., 4] *= texels[..., 4] > FAINTEST
    return texels


def _extents(
    texels: UInt8[np.ndarray, "view frame height width 5"],
    foot: Float[np.ndarray, " view"],
) -> tuple[Float[np.ndarray, "view frame 4"], Float[np.ndarray, "view frame"]]:
    """Return the box of visible texels, and the height of their middle [px]."""
    alpha = texels[..., 4]
    boxes = []
    for axis in (-2, -1):
        some = np.max(alpha, axis=axis) > 0
        first = np.argmax(some, axis=-1)
        last = some.shape[-1] - 1 - np.argmax(some[..., ::-1], axis=-1)
        boxes += [first, np.where(np.max(some, axis=-1), last, first)]
    rows = np.sum(alpha > 127, axis=-1)  # the silhouette: more than half opaque
    mass = np.maximum(np.sum(rows, axis=-1), 1)
    middle = np.where(
        rows.any(axis=-1), rows @ np.arange(float(rows.shape[-1])) / mass, foot[:, None]
    )
    return np.stack(boxes, axis=-1).astype(float), foot[:, None] - middle


def _spread(
    texels: UInt8[np.ndarray, "view frame size size 5"],
) -> Float[np.ndarray, "view frame 2"]:
    """Return the shape of silhouettes relative to the variance of their columns [-].

    Returns:
        Covariance of columns and rows, and variance of rows, over that of columns;
        those of a disc for a picture that is nowhere opaque.
    """
    # the silhouette: more than half opaque
    opaque = (texels[..., 4] > 127).astype(np.float32)
    number = np.maximum(opaque.sum((-2, -1)), 1.0)
    place = np.arange(opaque.shape[-1]) - 0.5 * (opaque.shape[-1] - 1)
    columns, rows = opaque.sum(-2), opaque.sum(-1)
    x, y = columns @ place / number, rows @ place / number
    # the variance within a pixel, 1/12, is added to that of the pixels' centres
    wide = columns @ place**2 / number - x**2 + 1.0 / 12.0
    tall = rows @ place**2 / number - y**2 + 1.0 / 12.0
    mixed = (opaque @ place) @ place / number - x * y
    some = np.expand_dims(opaque.any((-2, -1)), -1)
    shape = np.stack([mixed, tall], axis=-1) / wide[..., None]
    return np.where(some, shape, [0.0, 1.0])


def explosion_index(directory: Path) -> ExplosionIndex:
    """Return the content of the index of a set.

    Raises:
        InputError: There is none, or it is not as above.
    """
    source, index = read_index(directory)
    if index.get("kind") != KIND:
        raise InputError(
            f'{source}: kind: expected "{KIND}", got {shown(index.get("kind"))}'
        )
    known_keys(index, EXPLOSION_KEYS, f"{source}: ")
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
        anchors.append(Numbers("[x, y]").read(anchor, f"{where}anchor_px"))
        radii.append(_radii(entry.get("radius_px"), len(phases), f"{where}radius_px"))
    above = [direction[2] >= 0.0 for direction in directions]
    if not any(above):
        raise InputError(
            f"{source}: elevation_deg: expected views from above the ground, got "
            f"{len(above)} from below it only"
        )
    rows = (np.stack(part) for part in (anchors, directions, ups, radii))
    return ExplosionIndex(size, phases, columns, files, *rows)


def _whole(value: Any, where: str, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise InputError(
            f"{where}: expected a whole number of {least} or more, got {shown(value)}"
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
            f"{where}: expected {count} numbers, one per phase, got {len(radii)}"
        )
    return radii


def read_index(directory: Path) -> tuple[Path, dict[str, Any]]:
    """Return the path and the content of a set's index.

    Raises:
        InputError: There is no such directory or index, or it is not valid TOML.
    """
    source = directory / INDEX
    if not source.is_file():
        what = "has no index" if directory.is_dir() else "no such directory"
        raise InputError(
            f"{directory}: {what}; expected a directory of views with {INDEX}"
        )
    try:
        index = tomllib.loads(read_text(source, "an index of views in TOML"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: broken TOML: {error}") from None
    return source, index


def view_entries(index: dict[str, Any], source: Path) -> list[Any]:
    """Return the views of an index, at least one."""
    entries = index.get("view")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{source}: expected views written [[view]], got none")
    return entries


def direction_of(
    entry: dict[str, Any], where: str
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return the unit vector from the blast to the viewer, and a level camera's up."""
    if ("azimuth_deg" in entry) == ("direction" in entry):
        both = "both" if "direction" in entry else "neither"
        raise InputError(
            f"{where}azimuth_deg: expected either azimuth_deg or direction, got {both}"
        )
    if "direction" in entry:
        at = f"{where}direction"
        vector = Numbers("[east, north, up]").read(entry["direction"], at)
        if "elevation_deg" in entry or not vector.any():
            got = "elevation_deg too" if vector.any() else shown(entry["direction"])
            raise InputError(
                f"{at}: expected only [east, north, up], not zero, got {got}"
            )
        direction = vector / np.linalg.norm(vector)
        return direction, upright(direction)
    azimuth = math.radians(finite(entry["azimuth_deg"], f"{where}azimuth_deg"))
    at = f"{where}elevation_deg"
    elevation = math.radians(finite(entry.get("elevation_deg", 0.0), at))
    if abs(elevation) > math.pi / 2:
        raise InputError(
            f"{at}: expected between -90 and 90, got {shown(entry['elevation_deg'])}"
        )
    towards = np.array([math.sin(azimuth), math.cos(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    flat, high = math.cos(elevation), math.sin(elevation)
    return flat * towards + high * up, flat * up - high * towards


def positive(value: Any, where: str) -> float:
    """Return a positive number of an index."""
    expected = "a positive number"
    number = finite(value, where, expected)
    if number <= 0:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return number


def known_keys(entry: dict[str, Any], known: Sequence[str], where: str) -> None:
    """Reject keys that an index does not have."""
    for key in entry:
        if key not in known:
            raise InputError(
                f"{where}{shown(key)}: unknown key{nearest(key, known)}; "
                f"expected one of {', '.join(known)}"
            )
