"""Backgrounds of films, and paths of cameras, as files.

A background is a grey, a colour, an image, or the frames of a folder or video. The path
of a camera's carrier is the table of a flight.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import argument, read_text, require, shown
from jblast.scene import Camera
from jblast.sensors.camera.files.images import check_size, frame_files, read_colours
from jblast.sensors.camera.files.recordings import ImageSequence, by_number
from jblast.sensors.camera.files.video import open_video
from jblast.sensors.camera.geometry import CameraPath

Background = float | Float[np.ndarray, "..."] | ImageSequence
COLUMNS = (
    *("time_s", "east_m", "north_m", "up_m"),
    *("quaternion_i", "quaternion_j", "quaternion_k", "quaternion_w"),
)


def background_named(
    text: str, camera: Camera, times: Float[np.ndarray, " frame"]
) -> Background:
    """Return the background that a command-line word names.

    Args:
        text: A grey of linear light, 0 to 1; red, green and blue with commas between; a
            PNG file; a directory of them, one per frame; or a video that starts at the
            first frame. PNG files are sRGB.
        camera: Camera, whose image size a file must have.
        times: Times of the frames to render [s].

    Raises:
        InputError: It is none of these, there are too few images, or they have another
            size.
    """
    path, times = Path(text), times - times[0]
    if path.is_dir():
        files = frame_files(path)
        expected = f"at least {len(times):,} frames, one per rendered frame"
        require(len(files) >= len(times), path, expected, f"{len(files):,}")
        return background_frames(files[: len(times)], times, camera)
    if path.suffix.lower() == ".png" and path.is_file():
        return background_image(path, camera)
    if path.is_file():
        return _background_video(path, camera, float(times[-1]))
    try:
        light = np.array([float(word) for word in text.split(",")])
    except ValueError:
        light = np.zeros(0)
    is_light = len(light) in (1, 3) and ((light >= 0) & (light <= 1)).all()
    expected = "a grey or R,G,B from 0 to 1, a PNG file, a directory of them or a video"
    require(is_light, argument("background"), expected, text)
    # numbers are linear light, files are sRGB
    return float(light[0]) if len(light) == 1 else light


def background_frames(
    files: Sequence[Path], times: Float[np.ndarray, " picture"], camera: Camera
) -> ImageSequence:
    """Return sRGB files as a background.

    Args:
        files: PNG files, one per time; read on demand.
        times: Times from the film's first frame on [s].
        camera: Camera, whose image size they must have.
    """
    size = camera.width, camera.height
    folder = files[0].parent
    return ImageSequence(
        folder, times, lambda k: background_image(files[k], camera), *size
    )


def background_image(path: Path, camera: Camera) -> Float[np.ndarray, "height width 3"]:
    """Return the linear light of an sRGB file of the size of a camera's images."""
    image = read_colours(path)
    check_size(path, image.shape[1::-1], camera)
    return image


def _background_video(path: Path, camera: Camera, last_s: float) -> ImageSequence:
    """Return a video as a background; it starts at the film's first frame."""
    video = open_video(path)
    check_size(path, (video.width, video.height), camera)
    # the last frame lasts one mean interval, as all others do
    lasts = video.times[-1] * len(video) / (len(video) - 1)
    expected = f"a video as long as the film, {last_s:.6g} s"
    require(last_s <= lasts, path, expected, f"one of {lasts:.6g} s")
    values = by_number(video.frames)
    colours = lambda number: video.table[values(number)]  # noqa: E731
    return ImageSequence(path, video.times, colours, video.width, video.height)


def read_camera_path(path: str | Path) -> CameraPath:
    """Read a path: CSV with time_s, east_m, north_m, up_m and quaternion_i, j, k, w.

    Other columns, and lines that begin with #, are ignored.

    Args:
        path: The file; the quaternion is that from body to world, k before w.

    Raises:
        InputError: A column is missing, a value is not a finite number, the times do
            not rise, a quaternion is zero, or there are fewer than two rows.
    """
    text = read_text(path, "a CSV file of a flight").splitlines()
    lines = {
        number: line
        for number, line in enumerate(text, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    }
    table = csv.DictReader(lines.values(), skipinitialspace=True)
    header = [name.strip() for name in table.fieldnames or ()]
    table.fieldnames = header
    expected = f"columns {', '.join(COLUMNS)}, as in the flight.csv of a flight"
    require({*COLUMNS} <= {*header}, path, expected, shown(", ".join(header)))
    rows: list[list[float]] = []
    for number, cells in zip([*lines][1:], table, strict=False):
        at = f"{path}: line {number}"
        try:
            row = [float(cells[name]) for name in COLUMNS]
        except (TypeError, ValueError):  # a missing cell is None
            row = [np.nan]
        expected = f"finite numbers in {', '.join(COLUMNS)}"
        require(np.isfinite(row).all(), at, expected, shown(lines[number]))
        before = rows[-1][0] if rows else -np.inf
        require(
            row[0] > before, at, "times that rise", f"{row[0]:g} s after {before:g} s"
        )
        require(any(row[4:]), at, "a quaternion that is not zero", "zeros")
        rows.append(row)
    require(len(rows) > 1, path, "two or more rows after the header", f"{len(rows)}")
    values = np.array(rows)
    # decimals of a file leave quaternions slightly off unit length
    turns = values[:, 4:] / np.linalg.norm(values[:, 4:], axis=1, keepdims=True)
    return CameraPath(*map(jnp.asarray, (values[:, 0], values[:, 1:4], turns)))
