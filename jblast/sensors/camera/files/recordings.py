"""Camera recordings: folders of frames and videos, read on demand."""

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import argument, require
from jblast.sensors.camera.files.images import frame_and_bits, frame_files
from jblast.sensors.camera.files.video import check_even, is_even, open_video
from jblast.sensors.camera.image import srgb_to_linear
from jblast.sensors.camera.pixel import darkest_of

Block = tuple[Float[np.ndarray, " _"], np.ndarray]
CACHE_BYTES = 1 << 27
"""Memory for decoded frames of a video, because the refinement for events reads a time
again [bytes]: 20 frames of 1080p."""
ROUNDING = 1e-9
"""Distance from a frame, in intervals, up to which it is not interpolated."""


@dataclass(frozen=True)
class ImageSequence:
    """Frames and their times; the frames are read on demand.

    Attributes:
        path: The folder or the video.
        times: Times of the frames, from the first, rising [s].
        picture: Returns a frame by its number: grey (height, width) or colours, linear
            light with full scale 1, or grey of 8 bits as in its file.
        width: Pixels of a row.
        height: Number of rows.
        srgb: True if grey of 8 bits is sRGB, false for linear light.
        bits: Bit depth of values; None for floats.
        is_video: True for one file, with a clock and a transfer curve of its own.
    """

    path: Path
    times: Float[np.ndarray, " frame"]
    picture: Callable[[int], np.ndarray]
    width: int
    height: int
    srgb: bool = False
    bits: int | None = 8
    is_video: bool = False

    def __len__(self) -> int:
        return len(self.times)

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
        values = np.arange(256) / 255.0
        light = (srgb_to_linear(values) if self.srgb else values).astype(np.float32)
        for start in range(0, len(self), length):
            times = self.times[start : start + length]
            frames = np.stack([self.picture(start + k) for k in range(len(times))])
            if decoded:
                is_coded = frames.dtype == np.uint8
                frames = light[frames] if is_coded else frames.astype(np.float32)
            yield times, frames

    def at(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ ..."]:
        """Return light at some times from the first frame on, linear in time [s].

        The last frame is repeated after its time.
        """
        # fractional number of the frame
        place = np.interp(times, self.times, np.arange(len(self)))
        whole = np.rint(place)
        place = np.where(np.abs(place - whole) < ROUNDING, whole, place)
        before = np.floor(place).astype(int)
        share = place - before
        # each frame is decoded once per call; the next one only if it has a share
        numbers = np.union1d(before, before[share > 0] + 1)
        frames = {int(k): self.picture(int(k)) for k in numbers}
        return np.stack(
            [
                frames[k] if not s else (1.0 - s) * frames[k] + s * frames[k + 1]
                for k, s in zip(before.tolist(), share.tolist(), strict=True)
            ]
        )


def open_recording(
    path: str | Path,
    fps: float | None = None,
    *,
    srgb: bool = False,
    varying: bool = False,
) -> ImageSequence:
    """Open a folder of frames, or a video, as grey.

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
    require(path.exists(), path, "a directory of PNG frames or a video", "no such file")
    if path.is_file():
        return _video(path, fps, varying)
    files = frame_files(path, arrays=True)
    expected = (
        f"the rate of the PNG frames, in frames per second; add {argument('fps')}"
    )
    require(fps is not None, path, expected)
    assert fps is not None
    first, bits = frame_and_bits(files[0])
    height, width = first.shape

    def picture(number: int) -> np.ndarray:
        frame = frame_and_bits(files[number], srgb=srgb)
        expected = f"{_kind(first, bits)} as in {files[0].name}"
        got = _kind(*frame)
        require(got == _kind(first, bits), files[number], expected, got)
        return frame[0]

    times = np.arange(len(files)) / fps
    return ImageSequence(path, times, picture, width, height, srgb, bits)


def _video(path: Path, fps: float | None, varying: bool) -> ImageSequence:
    video = open_video(path, even=False)
    times = video.times
    if not varying or (np.diff(times) <= 0).any():
        check_even(path, times)
    if fps is not None and is_even(times):
        times = np.arange(len(video)) / fps
    values = by_number(video.frames)
    return ImageSequence(
        path,
        times,
        lambda number: video.luminance(values(number)),
        *(video.width, video.height),
        bits=video.bits,
        is_video=True,
    )


def _kind(frame: np.ndarray, bits: int | None) -> str:
    """Return size and depth of a grey frame, for messages."""
    depth = "floats" if bits is None else f"{bits} bits"
    grey = "grey" if frame.dtype == np.uint8 else "light"
    return f"{frame.shape[1]} x {frame.shape[0]} pixels, {depth}, {grey}"


def by_number(
    start: Callable[[], Iterator[np.ndarray]],
) -> Callable[[int], np.ndarray]:
    """Return a function of a frame's number; fast for those soon after the last ones.

    Args:
        start: Returns an iterator over all frames.
    """
    kept: OrderedDict[int, np.ndarray] = OrderedDict()
    decoder = enumerate(start())
    latest = -1

    def frame(number: int) -> np.ndarray:
        nonlocal decoder, latest
        if number not in kept and number <= latest:
            decoder = enumerate(start())
        while number not in kept:
            latest, values = next(decoder)
            kept[latest] = values
            # at least two frames, between which a time is interpolated
            if len(kept) > max(2, CACHE_BYTES // values.nbytes):
                kept.popitem(last=False)
        return kept[number]

    return frame
