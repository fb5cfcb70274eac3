"""Frames as a video, whole or not at all."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from jblast.errors import InputError, needed
from jblast.files import replacing
from jblast.sensors.camera.files.video.transfer import SRGB

CONTAINERS = {".mp4": "mp4", ".mov": "mov", ".mkv": "matroska"}
"""What FFmpeg calls them, by the file's suffix."""

ENCODERS = "libx264", "libopenh264"
"""Of H.264, the first there is."""

QUALITY = {"crf": "16", "preset": "fast"}
"""Of x264: no difference to be seen."""

BT709, STUDIO = 1, 1
"""Matrix and primaries, and range of values, in ITU-T H.273."""

AddFrame = Callable[[UInt8[np.ndarray, "height width 3"]], None]


def check_video(path: str | Path) -> None:
    """Refuse a video that cannot be written, before anything is computed.

    Raises:
        InputError: Its name ends in none of `CONTAINERS`, PyAV is not installed, or it
            has no encoder of H.264.
    """
    if Path(path).suffix.lower() not in CONTAINERS:
        raise InputError(
            f"{path}: expected a name of a video that ends in {', '.join(CONTAINERS)}"
        )
    _encoder(path)


@contextmanager
def video_writer(
    path: str | Path, width: int, height: int, frames_hz: float
) -> Iterator[AddFrame]:
    """Give what adds a frame, values of sRGB, to a video of H.264.

    Its pixels are 4:2:0, as all players take them: a last column or row is repeated
    where there is an odd number of them. The curve is named, sRGB.

    Args:
        path: An existing file is replaced when all frames are there.
        width: Of a frame.
        height: Of a frame.
        frames_hz: How many are shown a second.

    Raises:
        InputError: As in `check_video`.
    """
    import av
    from av.video.reformatter import ColorRange, Colorspace

    container = CONTAINERS[Path(path).suffix.lower()]
    even = height % 2, width % 2
    rate = Fraction(frames_hz).limit_denominator(1000)
    with (
        replacing(path) as temporary,
        av.open(str(temporary), "w", format=container) as file,
    ):
        stream: Any = file.add_stream(_encoder(path), rate=rate)
        stream.height, stream.width = height + even[0], width + even[1]
        stream.pix_fmt = "yuv420p"
        stream.options = QUALITY
        coder = stream.codec_context
        coder.time_base = 1 / rate
        coder.colorspace = coder.color_primaries = BT709
        coder.color_range, coder.color_trc = STUDIO, SRGB
        count = 0

        def add(frame: UInt8[np.ndarray, "height width 3"]) -> None:
            nonlocal count
            whole = np.pad(frame, ((0, even[0]), (0, even[1]), (0, 0)), mode="edge")
            shown = av.VideoFrame.from_ndarray(whole, format="rgb24").reformat(
                format="yuv420p",
                dst_colorspace=Colorspace.ITU709,
                dst_color_range=ColorRange.MPEG,
            )
            shown.pts, shown.time_base = count, coder.time_base
            count += 1
            file.mux(stream.encode(shown))

        yield add
        file.mux(stream.encode())


def _encoder(path: str | Path) -> str:
    """Return the name of the encoder."""
    av = needed("av", "video", path, "a video is written")
    there = [name for name in ENCODERS if name in av.codecs_available]
    if not there:
        raise InputError(
            f"{path}: expected a PyAV with an encoder of H.264, "
            f"{' or '.join(ENCODERS)}, got one without"
        )
    return there[0]
