"""Camera recordings, moving backgrounds and camera paths as files.

A recording is a folder of frames or a video, read block by block. A background is an
image, or the frames of a folder or video, linear in time between two of them. The path
of a camera's carrier is the table of a flight.
"""

import csv
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, read_text, shown
from jblast.scene import Camera
from jblast.sensors.camera.files.images import (
    frame_and_bits,
    frame_files,
    read_colours,
    read_frames,
)
from jblast.sensors.camera.files.video import Video, check_even, is_even, open_video
from jblast.sensors.camera.geometry import CameraPath
from jblast.sensors.camera.image import srgb_to_linear
from jblast.sensors.camera.pixel import darkest_of

Block = tuple[Float[np.ndarray, " _"], np.ndarray]
CACHE_BYTES = 1 << 27
"""Memory for decoded frames of a video, because the refinement for events reads a time
again [bytes]: 20 frames of 1080p."""
AHEAD = 64
"""Frames up to which decoding continues to a later frame; a seek beyond that decodes
from the last key frame, which is often as far."""
ROUNDING = 1e-9
"""Distance from a frame, in intervals, up to which it is not interpolated."""
Image = Float[np.ndarray, "height width 3"]
PLACE = ("east_m", "north_m", "up_m")
TURN = ("quaternion_i", "quaternion_j", "quaternion_k", "quaternion_w")
COLUMNS = ("time_s", *PLACE, *TURN)


@dataclass(frozen=True)
class ImageSequence:
    """Frames and their times; the frames are read on demand.

    Attributes:
        path: The folder or the video.
        width: Pixels of a row.
        height: Number of rows.
        times: Times of the frames, from the first [s].
        source: Files of the frames, or the video.
        srgb: True if values of PNG frames are sRGB, false for linear light.
        bits: Bit depth of values; None for floats.
    """

    path: Path
    width: int
    height: int
    times: Float[np.ndarray, " frame"]
    source: tuple[Path, ...] | Video
    srgb: bool
    bits: int | None = 8

    def __len__(self) -> int:
        return len(self.times)

    @property
    def is_video(self) -> bool:
        """True for one file, with a clock and a transfer curve of its own."""
        return isinstance(self.source, Video)

    @property
    def varying(self) -> bool:
        """True for a varying frame rate."""
        return not is_even(self.times)

    @property
    def darkest(self) -> float:
        """Floor of the light that values can represent (`log_intensity`)."""
        return darkest_of(self.bits)

    @property
    def frames_hz(self) -> float:
        """Frames per second, on average."""
        # 500 Hz, not 500.00000000000006
        return float(f"{(len(self) - 1) / self.times[-1]:.12g}")

    def blocks(self, length: int = 16, *, decoded: bool = True) -> Iterator[Block]:
        """Yield times [s] and grey frames (frame, height, width) of linear light.

        Args:
            length: Frames of a block.
            decoded: True for floats of single precision with full scale 1; false leaves
                grey PNG frames of 8 bits as they are, for a table that decodes them
                faster.

        Raises:
            InputError: A frame cannot be read, or has another size or kind than the
                first; the message names the file.
        """
        done = 0
        for frames in self._frames(length):
            if decoded:
                frames = self._decoded(frames)
            yield self.times[done : done + len(frames)], frames
            done += len(frames)

    def _frames(self, length: int) -> Iterator[np.ndarray]:
        if not isinstance(self.source, Video):
            yield from read_frames([*self.source], srgb=self.srgb, block=length)
            return
        video, held = self.source, []
        for values in video.frames():
            held.append(video.luminance(values))
            if len(held) == length:
                yield np.stack(held)
                held = []
        if held:
            yield np.stack(held)

    def _decoded(self, frames: np.ndarray) -> np.ndarray:
        if frames.dtype != np.uint8:
            return frames.astype(np.float32)
        values = np.arange(256) / 255.0
        light = srgb_to_linear(values) if self.srgb else values
        return light.astype(np.float32)[frames]


def open_recording(
    path: str | Path,
    fps: float | None = None,
    *,
    srgb: bool = False,
    varying: bool = False,
) -> ImageSequence:
    """Open a folder of frames, or a video.

    Args:
        path: PNG frames in the order of their names, or `.npy` files of floats; or a
            file that FFmpeg reads.
        fps: Frames per second: frame k is at k / fps. By default a video's own clock is
            used, which for slow motion is not that of the scene.
        srgb: True if grey values of PNG frames are sRGB; by default they are linear
            light. A video states its own curve.
        varying: True to accept a video of varying frame rate. Its times are the time
            stamps of the file, whatever `fps` is: no constant rate is right for it.

    Raises:
        InputError: There is no such recording, or it is incomplete: as in `frame_files`
            and `open_video`. PNG frames require `fps`. The frame rate varies.
    """
    path = Path(path)
    if path.is_file():
        video = open_video(path, even=False)
        times = video.times
        if not varying or (np.diff(times) <= 0).any():
            check_even(path, times)
        if fps is not None and is_even(times):
            times = np.arange(len(video)) / fps
        size = video.width, video.height
        return ImageSequence(path, *size, times, video, srgb, video.bits)
    if not path.exists():
        raise InputError(
            f"{path}: no such file or directory; expected a directory of PNG frames or "
            "a video"
        )
    files = frame_files(path, arrays=True)
    if fps is None:
        raise InputError(
            f"{path}: expected the rate of the PNG frames, in frames per second; add "
            f"{argument('fps')}"
        )
    first, bits = frame_and_bits(files[0])
    height, width = first.shape
    times = np.arange(len(files)) / fps
    return ImageSequence(path, width, height, times, tuple(files), srgb, bits)


@dataclass(frozen=True)
class MovingBackground:
    """Images behind a scene, linear in time between two of them.

    Attributes:
        times: Times of the images, from the film's first frame on, rising [s].
        picture: Returns the linear light of an image by its number, full scale 1.
    """

    times: Float[np.ndarray, " picture"]
    picture: Callable[[int], Image]

    def at(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ _ _ 3"]:
        """Return the background at some times from the film's first frame on [s].

        The last image is repeated after its time.
        """
        # fractional number of the frame
        place = np.interp(times, self.times, np.arange(len(self.times)))
        whole = np.rint(place)
        place = np.where(np.abs(place - whole) < ROUNDING, whole, place)
        before = np.floor(place).astype(int)
        share = place - before
        # each frame is decoded once per call; the next one only if it has a share
        needed = np.union1d(before, before[share > 0] + 1)
        images = {int(k): self.picture(int(k)) for k in needed}
        return np.stack(
            [
                images[k] if not s else (1.0 - s) * images[k] + s * images[k + 1]
                for k, s in zip(before.tolist(), share.tolist(), strict=True)
            ]
        )


def background_frames(
    files: Sequence[Path], times: Float[np.ndarray, " picture"], camera: Camera
) -> MovingBackground:
    """Return sRGB files as a background.

    Args:
        files: PNG files, one per time; read on demand.
        times: Times from the film's first frame on [s].
        camera: Camera, whose image size they must have.
    """
    return MovingBackground(times, lambda k: background_image(files[k], camera))


def background_video(path: str | Path, camera: Camera) -> MovingBackground:
    """Return a video as a background; it starts at the film's first frame.

    Args:
        path: Any file that FFmpeg reads.
        camera: Camera, whose image size it must have.

    Raises:
        InputError: It has another size; and as in `open_video`.
    """
    video = open_video(path)
    check_size(video.path, video.width, video.height, camera)
    frames = _FramesInAnyOrder(video)
    return MovingBackground(video.times, lambda k: video.colours(frames.values(k)))


def background_image(path: Path, camera: Camera) -> Image:
    """Return the linear light of an sRGB file as a background.

    Args:
        path: A PNG file.
        camera: Camera, whose image size it must have.

    Raises:
        InputError: It cannot be read, or has another size.
    """
    image = read_colours(path)
    check_size(path, image.shape[1], image.shape[0], camera)
    return image


def check_size(path: Path, width: int, height: int, camera: Camera) -> None:
    """Reject images of another size than a camera's.

    Raises:
        InputError: The sizes differ.
    """
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"{path}: expected {camera.width} x {camera.height} pixels as the "
            f"camera has, got {width} x {height}"
        )


class _FramesInAnyOrder:
    """Frames of a video by their numbers; fast for nearly consecutive numbers.

    Attributes:
        video: The video.
        held: Values of the last decoded frames, by number.
    """

    def __init__(self, video: Video):
        self.video = video
        self.held: OrderedDict[int, np.ndarray] = OrderedDict()
        self._frames: Iterator[np.ndarray] = iter(())
        self._next = len(video) + AHEAD + 1

    def values(self, number: int) -> np.ndarray:
        """Return the values of a frame, as `Video.frames` does."""
        # a seek for jumps; small steps forward continue decoding
        if number not in self.held and not 0 <= number - self._next <= AHEAD:
            self._frames, self._next = self.video.frames(number), number
        while number not in self.held:
            frame = next(self._frames)
            self.held[self._next] = frame
            self._next += 1
            # at least two frames, between which a time is interpolated
            if len(self.held) > max(2, CACHE_BYTES // frame.nbytes):
                self.held.popitem(last=False)
        self.held.move_to_end(number)
        return self.held[number]


def read_camera_path(path: str | Path) -> CameraPath:
    """Read a path: CSV with time_s, east_m, north_m, up_m and quaternion_i, j, k, w.

    Other columns, and lines that begin with #, are ignored.

    Args:
        path: The file; the quaternion is that from body to world, k before w.

    Raises:
        InputError: A column is missing, a value is not a finite number, the times do
            not rise, a quaternion is zero, or there are fewer than two rows.
    """
    lines = [
        (number, line)
        for number, line in enumerate(
            read_text(path, "a CSV file of a flight").splitlines(), start=1
        )
        if line.strip() and not line.lstrip().startswith("#")
    ]
    table = list(csv.reader(line for _, line in lines))
    header = [name.strip() for name in table[0]] if table else []
    for name in COLUMNS:
        if name not in header:
            raise InputError(
                f"{path}: expected a column {name}, as in the flight.csv of a flight, "
                f"got {shown(', '.join(header))}"
            )
    if len(table) < 3:
        raise InputError(
            f"{path}: expected two or more rows after the header, got {len(table) - 1}"
        )
    indices = [header.index(name) for name in COLUMNS]
    rows = []
    for (number, _), cells in zip(lines[1:], table[1:], strict=True):
        try:
            row = [float(cells[index]) for index in indices]
        except (ValueError, IndexError):
            row = [np.nan]
        if not np.isfinite(row).all():
            raise InputError(
                f"{path}: line {number}: expected finite numbers in "
                f"{', '.join(COLUMNS)}, got {shown(', '.join(cells))}"
            )
        rows.append(row)
    values = np.array(rows)
    late = np.flatnonzero(np.diff(values[:, 0]) <= 0.0)
    if len(late):
        raise InputError(
            f"{path}: line {lines[late[0] + 2][0]}: expected times that rise, got "
            f"{values[late[0] + 1, 0]:g} s after {values[late[0], 0]:g} s"
        )
    # decimals of a file leave quaternions slightly off unit length
    length = np.linalg.norm(values[:, 4:], axis=1, keepdims=True)
    if not length.all():
        number = lines[1 + int(np.argmin(length))][0]
        raise InputError(
            f"{path}: line {number}: expected a quaternion that is not zero, got zeros"
        )
    return CameraPath(
        jnp.asarray(values[:, 0]),
        jnp.asarray(values[:, 1:4]),
        jnp.asarray(values[:, 4:] / length),
    )
