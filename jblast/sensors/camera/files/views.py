"""Explosion sets as files: pictures from several sides, and the index `views.toml`.

A set of one's own pictures, which are shown unchanged, has a folder of PNG frames with
alpha for each view:

    frames_hz = 30.0
    charge_mass_kg = 5.0          # TNT equivalent of what exploded in the pictures
    srgb = true                   # false: the PNG files are linear light
    metres_per_pixel = 0.05       # at the burst
    anchor_px = [159.5, 277.0]    # the burst in the pictures, x and y; else the middle

    [[view]]
    frames = "south"              # a folder of numbered frames
    azimuth_deg = 180.0           # from the blast to the viewer, clockwise from north
    elevation_deg = 5.0           # above the horizon; default 0

A simulated set, which the laws of the fireball scale and light, has a sheet of all
frames for each view:

    kind = "explosion"
    size_px = 128                 # frames are square
    phases = [0.0004, 0.001]      # of each frame: time over the fireball's duration
    columns = 8                   # frames in a row; default: as many as fit
    reference_temperature_k = 2200.0   # at which heat was coded
    air_temperature_k = 288.15
    [made]                        # how it was made, and its licence; not read

    [[view]]
    file = "00.webp"
    azimuth_deg = 180.0
    elevation_deg = 5.0
    anchor_px = [63.5, 96.0]      # the burst, on the ground, in every frame
    radius_px = [20.1, 24.0]      # visible radius of each frame

Keys of all views may stand above them. The pictures are those of a level camera: an
azimuth determines the up of one that looks down.

A sheet is a WebP image with alpha: rows of frames in its upper half, whose grey is heat
(0: as cold as the air, 255: as hot as the middle of the fireball), and the same frames
below, with the colour of soot and dust (sRGB, straight) and the opacity of all.
"""

import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float, UInt8

from jblast.errors import InputError, read_text, require, shown
from jblast.parameters import POSITIVE, Bounds
from jblast.scene import Camera, Scene
from jblast.scene.values import (
    Number,
    Numbers,
    Table,
    Text,
    Truth,
    Value,
    Whole,
    Word,
    known,
)
from jblast.sensors.camera.explosion import ExplosionViews
from jblast.sensors.camera.files.images import (
    check_whole_webp,
    frame_files,
    read_pictures,
    read_webp,
)
from jblast.sensors.camera.image import linear_to_srgb
from jblast.waves.fireballs import fireball_duration

INDEX = "views.toml"
SHIPPED = Path(__file__).parents[1] / "explosion"
"""Explosion set that is part of the package."""
FAINTEST = 2
"""Opacity up to which a texel is invisible, of 255: artefacts of compression."""
OPAQUE = 127
"""Opacity above which a texel is part of the silhouette, of 255."""
LENGTH = Number(POSITIVE)


@dataclass(frozen=True)
class PerFrame:
    """A list of a positive number for each frame."""

    form: str

    def read(self, value: Any, where: str) -> Float[np.ndarray, " frame"]:
        """Return the numbers."""
        require(isinstance(value, list) and value, where, self.form, shown(value))
        return np.array([LENGTH.read(x, f"{where}[{i}]") for i, x in enumerate(value)])


Keys = dict[str, tuple[Value, Any]]
"""Kind of value and default of each key; a key with the default `...` is required."""
PLACE: Keys = {
    "azimuth_deg": (Number(), ...),
    "elevation_deg": (Number(Bounds(at_least=-90.0, at_most=90.0)), 0.0),
}
OWN: Keys = {
    "frames_hz": (LENGTH, ...),
    "charge_mass_kg": (LENGTH, ...),
    "srgb": (Truth(), True),
}
OWN_VIEW: Keys = {
    "frames": (Text("a folder of frames"), ...),
    "metres_per_pixel": (LENGTH, ...),
    "anchor_px": (Numbers("[x, y]"), None),
}
SIMULATED: Keys = {
    "kind": (Word(["explosion"]), ...),
    "size_px": (Whole(4, 1 << 14), ...),
    "phases": (PerFrame("a list with the phase of each frame"), ...),
    "columns": (Whole(1, 1 << 14), None),
    "reference_temperature_k": (LENGTH, None),
    "air_temperature_k": (LENGTH, None),
    "made": (Table("a table"), None),
}
SIMULATED_VIEW: Keys = {
    "file": (Text("a WebP file"), ...),
    "radius_px": (PerFrame("a list with the visible radius of each frame [px]"), ...),
    "anchor_px": (Numbers("[x, y]"), ...),
}


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
        InputError: There is no index, or it is not as above; all views are from below
            the ground; a picture is missing, incomplete, of another size, or has no
            alpha. The message names the file.

    Example:
        `jblast.render(scene, camera, times, views=explosion_views())`
    """
    directory = SHIPPED if directory is None else Path(directory)
    source, index = _index(directory)
    entries = index.pop("view", None)
    is_list = isinstance(entries, list) and entries
    require(is_list, source, "views written [[view]]", "none")
    hot = "kind" in index
    keys, view_keys = (SIMULATED, SIMULATED_VIEW) if hot else (OWN, OWN_VIEW)
    view_keys = PLACE | view_keys
    shared = {key: index.pop(key) for key in view_keys if key in index}
    top = _values(index, keys, f"{source}:")
    views = []
    for number, entry in enumerate(entries or [], start=1):
        where = f"{source}: [[view]] {number}"
        require(isinstance(entry, dict), where, "a table", shown(entry))
        views.append(_values(shared | entry, view_keys, where))
    directions, ups = _directions(views)
    above = directions[:, 2] >= 0.0
    expected, got = "views from above the ground", f"{len(above)} from below it only"
    require(above.any(), f"{source}: elevation_deg", expected, got)
    chosen = np.arange(len(views))
    if towards is not None:
        rows = np.reshape(np.asarray(towards, float), (-1, 3))
        # a set is large: views that no camera needs are not decoded
        chosen = np.unique(np.argmax(rows @ directions.T, axis=1))
    read = _simulated if hot else _own
    found = read(directory, top, [views[number] for number in chosen])
    texels = found.pop("frames")
    return ExplosionViews(
        frames=jnp.asarray(texels),
        direction=directions[chosen],
        up=ups[chosen],
        box=_boxes(texels),
        hot=hot,
        **found,
    )


def views_of(
    scene: Scene, camera: Camera, directory: str | Path | None = None
) -> ExplosionViews:
    """Read those views of a set that a camera needs: all, if it moves.

    Args:
        scene: Scene with the charges.
        camera: The camera.
        directory: As for `explosion_views`.

    Raises:
        InputError: As in `explosion_views`.
    """
    if camera.mount:
        return explosion_views(directory)
    places = [[float(axis) for axis in one.position_m] for one in scene.charges]
    eye = np.asarray(camera.position, float)
    return explosion_views(directory, towards=eye - np.array(places))


def _index(directory: Path) -> tuple[Path, dict[str, Any]]:
    """Return the path and the content of a set's index."""
    source = directory / INDEX
    got = "no index" if directory.is_dir() else "no such directory"
    require(source.is_file(), directory, f"a directory of views with {INDEX}", got)
    try:
        return source, tomllib.loads(read_text(source, "an index of views in TOML"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{source}: broken TOML: {error}") from None


def _values(entry: dict[str, Any], keys: Keys, where: str) -> dict[str, Any]:
    """Return the checked values of all keys of a table, or their defaults."""
    for name in entry:
        known(name, keys, where, "key")
    missing = [
        n for n, (_, default) in keys.items() if default is ... and n not in entry
    ]
    for name in missing:
        require(False, f"{where} {name}", keys[name][0].form, "nothing")
    return {
        name: kind.read(entry[name], f"{where} {name}") if name in entry else default
        for name, (kind, default) in keys.items()
    }


def _directions(views: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit vectors towards the viewers, and up in their pictures."""
    azimuth, elevation = (np.radians([view[key] for view in views]) for key in PLACE)
    flat, high = np.cos(elevation), np.sin(elevation)
    east, north = np.sin(azimuth), np.cos(azimuth)
    direction = np.stack([flat * east, flat * north, high], axis=-1)
    return direction, np.stack([-high * east, -high * north, flat], axis=-1)


def _own(
    directory: Path, top: dict[str, Any], views: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return fields of views of one's own pictures."""
    pictures: list[np.ndarray] = []
    for view in views:
        folder = directory / view["frames"]
        pictures.append(read_pictures(frame_files(folder)))
        expected, got = (
            f"{len(some)} frames of {some.shape[2]} x {some.shape[1]} pixels"
            for some in (pictures[0], pictures[-1])
        )
        require(got == expected, folder, f"{expected} as in the first view", got)
    texels = np.stack(pictures)
    colours, alpha = texels[..., :3], texels[..., 3:]
    if not top["srgb"]:
        colours = np.rint(255.0 * linear_to_srgb(colours / 255.0)).astype(np.uint8)
    texels = np.concatenate([np.zeros_like(alpha), colours, alpha], axis=-1)
    # the last picture fades into a blank one
    texels = np.pad(texels, [(0, 0), (0, 1), *[(0, 0)] * 3])
    count, height, width = texels.shape[1:4]
    mass = top["charge_mass_kg"]
    middle = [(width - 1) / 2, (height - 1) / 2]
    lengths = np.array([np.cbrt(mass) / view["metres_per_pixel"] for view in views])
    return {
        "frames": texels,
        "radius": np.tile(lengths[:, None], count),
        "spread": np.broadcast_to([0.0, 1.0], (len(views), count, 2)),
        "height": np.zeros(count),
        "phase": np.arange(count) / top["frames_hz"] / float(fireball_duration(mass)),
        "anchor": [middle if v["anchor_px"] is None else v["anchor_px"] for v in views],
    }


def _simulated(
    directory: Path, top: dict[str, Any], views: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return fields of views of a simulated explosion."""
    source, phases = directory / INDEX, top["phases"]
    rises = (np.diff(phases) > 0.0).all()
    require(rises, f"{source}: phases", "rising numbers", shown(phases.tolist()))
    for view in views:
        count, where = len(view["radius_px"]), f"{source}: {view['file']}: radius_px"
        expected = f"{len(phases)} numbers, one per phase"
        require(count == len(phases), where, expected, f"{count}")
        check_whole_webp(directory / view["file"])

    def texels_of(view: dict[str, Any]) -> np.ndarray:
        return sheet_frames(
            directory / view["file"], top["size_px"], len(phases), top["columns"]
        )

    # WebP decoding releases the interpreter lock
    with ThreadPoolExecutor() as pool:
        texels = np.stack([*pool.map(texels_of, views)])
    anchors, radii = (
        np.stack([view[key] for view in views]) for key in ("anchor_px", "radius_px")
    )
    middle, spread = _silhouettes(texels, anchors[:, 1])
    # least squares over the views: height = h cos(elevation), for one h per frame
    level = np.cos(np.radians([view["elevation_deg"] for view in views]))
    heights = (anchors[:, 1:] - middle) / radii
    return {
        "frames": texels,
        "radius": radii,
        "spread": spread,
        "height": level @ heights / max(float(level @ level), 1e-6),
        "phase": phases,
        "anchor": anchors,
    }


def sheet_frames(
    path: Path, size: int, count: int, columns: int | None = None
) -> UInt8[np.ndarray, "frame size size 5"]:
    """Return heat, colour (sRGB) and opacity of a view's frames, from its sheet.

    Args:
        path: The sheet.
        size: Side of a frame [px].
        count: Number of frames.
        columns: Frames in a row; None for as many as fit.

    Raises:
        InputError: It cannot be read, or has another size.
    """
    sheet = read_webp(path)
    columns = columns or max(1, sheet.shape[1] // size)
    rows = -(-count // columns)
    expected = (
        f"{columns * size} x {2 * rows * size} pixels, {count} frames of {size} x "
        f"{size} twice in {columns} columns"
    )
    is_whole = sheet.shape[:2] == (2 * rows * size, columns * size)
    require(is_whole, path, expected, f"{sheet.shape[1]} x {sheet.shape[0]}")
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


def _boxes(
    texels: UInt8[np.ndarray, "view frame height width 5"],
) -> Float[np.ndarray, "view frame 4"]:
    """Return first and last column, first and last row of visible texels [px]."""
    bounds = []
    for axis in (-2, -1):
        some = np.max(texels[..., 4], axis=axis) > 0
        first = np.argmax(some, axis=-1)
        last = some.shape[-1] - 1 - np.argmax(some[..., ::-1], axis=-1)
        bounds += [first, np.where(np.max(some, axis=-1), last, first)]
    return np.stack(bounds, axis=-1).astype(float)


def _silhouettes(
    texels: UInt8[np.ndarray, "view frame size size 5"],
    foot: Float[np.ndarray, " view"],
) -> tuple[Float[np.ndarray, "view frame"], Float[np.ndarray, "view frame 2"]]:
    """Return middle row [px] and shape of silhouettes.

    Args:
        texels: Frames.
        foot: Row of the burst, the middle of a picture that is nowhere opaque.

    Returns:
        The middle row; covariance of columns and rows, and variance of rows, over that
        of columns: those of a disc for a picture that is nowhere opaque.
    """
    opaque = (texels[..., 4] > OPAQUE).astype(np.float32)
    number = np.maximum(opaque.sum((-2, -1)), 1.0)
    place = np.arange(opaque.shape[-1]) - 0.5 * (opaque.shape[-1] - 1)
    columns, rows = opaque.sum(-2), opaque.sum(-1)
    x, y = columns @ place / number, rows @ place / number
    # the variance within a pixel, 1/12, is added to that of the pixels' centres
    wide = columns @ place**2 / number - x**2 + 1.0 / 12.0
    tall = rows @ place**2 / number - y**2 + 1.0 / 12.0
    mixed = (opaque @ place) @ place / number - x * y
    some = np.any(opaque, axis=(-2, -1))
    shape = np.stack([mixed, tall], axis=-1) / wide[..., None]
    spread = np.where(some[..., None], shape, [0.0, 1.0])
    return np.where(some, y - place[0], foot[:, None]), spread
