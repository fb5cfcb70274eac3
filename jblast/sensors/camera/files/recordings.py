"""Camera recordings, read block by block: a folder of frames, or a video."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument
from jblast.sensors.camera.events.log_intensity import darkest_of
from jblast.sensors.camera.files.frames import (
    frame_and_bits,
    frame_files,
    read_frames,
)
from jblast.sensors.camera.files.video.read import Video, open_video
from jblast.sensors.camera.files.video.stamps import check_even
from jblast.sensors.camera.image.compositing import srgb_to_linear

Block = tuple[Float[np.ndarray, " _"], np.ndarray]


@dataclass(frozen=True)
class ImageSequence:
    """Frames and their times; the frames are read when they are asked for.

    Attributes:
        path: The folder or the video.
        width: Pixels of a row.
        height: Rows.
        times: Of the frames, from the first [s].
        source: The frames' files, or the video.
        srgb: Whether values of PNG frames are sRGB, and not linear light.
        bits: Bit depth of values; None of floats.
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
        """Whether it is one file, with a clock and a curve of its own."""
        return isinstance(self.source, Video)

    @property
    def darkest(self) -> float:
        """Floor of the light that values can represent (`log_intensity`)."""
        return darkest_of(self.bits)

    @property
    def frames_hz(self) -> float:
        """Frames a second, on average."""
        # 500 Hz, not 500.00000000000006
        return float(f"{(len(self) - 1) / self.times[-1]:.12g}")

    def blocks(self, length: int = 16, *, decoded: bool = True) -> Iterator[Block]:
        """Return times [s] and grey frames (frame, height, width) of linear light.

        Args:
            length: Frames of a block.
            decoded: Whether all are floats of single precision with full scale 1; else
                grey PNG frames of 8 bits keep their values, for a table that decodes
                them faster.

        Raises:
            InputError: A frame cannot be read, or is of another size or kind than the
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
    path: str | Path, fps: float | None = None, *, srgb: bool = False
) -> ImageSequence:
    """Look at a folder of frames, or at a video.

    Args:
        path: PNG frames in the order of their names, or `.npy` files of floats; or a
            file that FFmpeg reads.
        fps: Frames a second: frame k stands at k / fps. A video without it goes by its
            own clock, which for slow motion is not that of what was filmed.
        srgb: Whether grey values of PNG frames are sRGB; by default they are linear
            light. A video names its own curve.

    Raises:
        InputError: There is no such recording, or it is not whole: as in `frame_files`
            and `open_video`. PNG frames need `fps`.
    """
    path = Path(path)
    if path.is_file():
        video = open_video(path, even=False)
        if fps is None:
            check_even(path, video.times, f", or say its rate ({argument('fps')})")
        times = video.times if fps is None else np.arange(len(video)) / fps
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
            f"{path}: expected to be told how many PNG frames a second there are "
            f"({argument('fps')})"
        )
    first, bits = frame_and_bits(files[0])
    height, width = first.shape
    times = np.arange(len(files)) / fps
    return ImageSequence(path, width, height, times, tuple(files), srgb, bits)
