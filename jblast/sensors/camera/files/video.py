r"""Videos as files: read as linear light with times, and written, by PyAV (FFmpeg).

A video's values become linear light by the curve that its file states.

$$L = \begin{cases} V / 4.5 & V < 0.081 \\
((V + 0.099) / 1.099)^{1/0.45} & \text{else}\end{cases}$$

is BT.709's, which BT.601 and BT.2020 share. It is also assumed for files that state no
curve, as those of many cameras. A file may state sRGB, as ours do, a power of 2.2 or
2.8, or linear light.

Each frame has the time at which it is shown.

References:
    ITU-R BT.709-6, item 1.2; ITU-T H.273, table 3 (the numbers of the curves).
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import needed, reading, require
from jblast.files import replacing
from jblast.observations.records.clips import open_container
from jblast.sensors.camera.image import LUMINANCE, srgb_to_linear

HIGH_DEFINITION = 720
"""Rows from which on a video without a stated matrix is decoded as BT.709, below as
BT.601: the formats of high and of standard definition."""
ROUNDED = 0x2 | 0x2000 | 0x40000
"""SWS_BILINEAR, SWS_FULL_CHR_H_INT and SWS_ACCURATE_RND of libswscale: without them its
colours are one or two values of 255 too dark."""
CONTAINERS = {".mp4": "mp4", ".mov": "mov", ".mkv": "matroska"}
"""FFmpeg's names of containers, by the file's suffix."""
ENCODERS = "libx264", "libopenh264"
"""Encoders of H.264 in order of preference."""
QUALITY = {"crf": "16", "preset": "fast"}
"""Options of x264: visually lossless."""
BT709, STUDIO = 1, 1
"""Matrix and primaries, and range of values, in ITU-T H.273."""
AddFrame = Callable[[UInt8[np.ndarray, "height width 3"]], None]
UNEVEN = 0.5
"""Accepted deviation of an interval, as a share of the usual one: clocks of telephones
vary by less, and a missing frame is a deviation of one."""
UNSPECIFIED, SRGB = 2, 13
"""Numbers of transfer curves in H.273."""


COMPLETE = "a complete video"


@dataclass(frozen=True)
class Video:
    """An indexed video: times of its frames, and its header.

    Attributes:
        path: The file.
        width: Width as shown, after rotation [px].
        height: Height as shown [px].
        times: Times of its frames, from the first [s].
        turns: Quarter turns counterclockwise from the stored to the shown image.
        table: Linear light of each value, 256 or 65,536 of them, full scale 1.
        bits: Bit depth of the file; values of more than 8 bits are scaled to 16.
    """

    path: Path
    width: int
    height: int
    times: Float[np.ndarray, " frame"]
    turns: int
    table: Float[np.ndarray, " value"]
    bits: int = 8

    def __len__(self) -> int:
        return len(self.times)

    def frames(self) -> Iterator[np.ndarray]:
        """Yield values of red, green and blue, (height, width, 3).

        Raises:
            InputError: A frame cannot be decoded, or has another size.
        """
        count = 0
        for frame in _decoded(self.path):
            values = _rgb(frame, deep=len(self.table) > 256)
            # cameras held upright store their frames lying, with a rotation
            values = np.rot90(values, self.turns)
            got = f"{values.shape[1]} x {values.shape[0]}"
            expected = f"frames of {self.width} x {self.height} pixels"
            is_same = values.shape[:2] == (self.height, self.width)
            require(is_same, self.path, expected, got)
            yield values
            count += 1
        # frames may be missing without an error of the decoder
        got = f"{count:,} of {len(self):,} frames"
        require(count == len(self), self.path, COMPLETE, got)

    def luminance(self, values: np.ndarray) -> Float[np.ndarray, "height width"]:
        """Return the grey linear light of values, full scale 1, in single precision."""
        # weights folded into the table: one look-up per channel, no product per pixel
        red, green, blue = (
            np.take(np.float32(weight) * self.table, values[..., channel])
            for channel, weight in enumerate(LUMINANCE)
        )
        return red + green + blue


def open_video(path: str | Path, *, even: bool = True) -> Video:
    """Return an indexed video; its frames are decoded on demand.

    Colours are converted to red, green and blue by the matrix that the file states
    (else BT.709's from 720 rows on, BT.601's below), and to linear light by its curve
    (else BT.709's, or sRGB's for a file in red, green and blue). A stated rotation is
    applied.

    Args:
        path: Any file that FFmpeg reads.
        even: True to require a constant frame rate.

    Raises:
        InputError: As in `opened`; or it is incomplete, its frame rate varies, its
            pixels are not square, its frames are interlaced, rotated by other than
            quarter turns, or HDR.
    """
    path = Path(path)
    with opened(path) as (container, stream):
        ratio = stream.codec_context.sample_aspect_ratio
        got = f"width over height {ratio}"
        require(ratio in (None, 0, 1), path, "square pixels; scale it first", got)
        ticks = np.array(_stamps(path, container, stream), np.int64)
        base = stream.time_base
    times = (ticks - ticks[0]) * base.numerator / base.denominator
    if even:
        check_even(path, times)
    frame = next(_decoded(path), None)
    require(frame is not None, path, COMPLETE, "one without a frame")
    assert frame is not None
    expected = "a stated rotation by a multiple of 90 degrees"
    require(not frame.rotation % 90, path, expected, f"{frame.rotation}")
    turns = frame.rotation // 90 % 4
    width, height = (frame.width, frame.height)[:: -1 if turns % 2 else 1]
    bits = max(8, *(part.bits for part in frame.format.components))
    curve = int(frame.color_trc)
    # a video without a stated curve in RGB comes from a screen: sRGB
    if curve == UNSPECIFIED and frame.format.is_rgb:
        curve = SRGB
    expected = "standard dynamic range; convert it to BT.709"
    got = f"transfer curve {curve} of ITU-T H.273 (HDR, if 16 or 18)"
    require(curve in CURVES, path, expected, got)
    values = np.linspace(0.0, 1.0, 65536 if bits > 8 else 256)
    table = CURVES[curve](values).astype(np.float32)
    return Video(path, width, height, times, turns, table, bits)


def _decoded(path: Path) -> Iterator[Any]:
    """Yield the frames of a video as PyAV's, none damaged or interlaced."""
    with opened(path) as (container, stream), reading(path, COMPLETE):
        for frame in container.decode(stream):
            got = f"a damaged frame at {float(frame.time or 0.0):.6g} s"
            require(not frame.is_corrupt, path, COMPLETE, got)
            expected = "progressive frames (ffmpeg -i IN -vf yadif OUT)"
            require(not frame.interlaced_frame, path, expected, "interlaced ones")
            yield frame


def _stamps(path: Path, container: Any, stream: Any) -> list[int]:
    """Return the time stamps of all frames in order, without decoding."""
    # AVI has no time stamps, but one tick for each frame
    is_avi = container.format.name == "avi"
    with reading(path, COMPLETE):
        packets = [p for p in container.demux(stream) if p.size and not p.is_discard]
    stamps = [packet.dts if is_avi else packet.pts for packet in packets]
    expected = "a video whose frames have time stamps, as in MP4"
    require(None not in stamps, path, expected, "one without")
    require(len(stamps) > 1, path, "a video of at least two frames", f"{len(stamps)}")
    # packets are in order of decoding, which for B-frames is not that of showing
    stamps.sort()
    step = max(b - a for a, b in pairwise(stamps))
    if stream.frames:  # AVI counts empty ones, too
        count, stated = stamps[-1] + step if is_avi else len(stamps), stream.frames
    else:  # of Matroska: 00:01:02.500000000
        tag = re.fullmatch(r"(\d+):(\d+):([\d.]+)", stream.metadata.get("DURATION", ""))
        hours, minutes, seconds = map(float, tag.groups()) if tag else (0, 0, 0)
        count = stamps[-1] + 1.5 * step
        stated = (3600 * hours + 60 * minutes + seconds) / stream.time_base
    require(count >= stated, path, COMPLETE, f"{count:g} of {float(stated):g} ticks")
    return stamps


def _rgb(frame: Any, *, deep: bool) -> np.ndarray:
    """Return red, green and blue of a frame as stored, full range."""
    from av.video.reformatter import Colorspace

    matrix = None  # that of the frame
    if int(frame.colorspace) == 2 and not frame.format.is_rgb:
        high = frame.height >= HIGH_DEFINITION
        matrix = Colorspace.ITU709 if high else Colorspace.ITU601
    kind = "gbrp16le" if deep else "rgb24"  # with ROUNDED, rgb48le comes out green
    return frame.reformat(
        format=kind, src_colorspace=matrix, interpolation=ROUNDED
    ).to_ndarray()


def check_video(path: str | Path) -> None:
    """Reject a video that cannot be written, before anything is computed.

    Raises:
        InputError: Its name ends in none of `CONTAINERS`, PyAV is not installed, or it
            has no H.264 encoder.
    """
    suffix = Path(path).suffix.lower()
    expected = f"a name of a video ending in {', '.join(CONTAINERS)}"
    require(suffix in CONTAINERS, path, expected, suffix or "no suffix")
    _encoder(path)


@contextmanager
def video_writer(
    path: str | Path, width: int, height: int, frames_hz: float
) -> Iterator[AddFrame]:
    """Yield a function that adds a frame of sRGB values to an H.264 video.

    Its pixels are 4:2:0, which all players support; an odd last column or row is
    repeated. The stated curve is sRGB.

    Args:
        path: An existing file is replaced once all frames are written.
        width: Width of a frame [px].
        height: Height of a frame [px].
        frames_hz: Frames per second.

    Raises:
        InputError: As in `check_video`.
    """
    import av
    from av.video.reformatter import ColorRange, Colorspace

    container = CONTAINERS[Path(path).suffix.lower()]
    # 4:2:0 has one colour for 2 x 2 pixels
    even = height % 2, width % 2
    # containers store the rate as a fraction of small integers
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
        # frames that the encoder still delays
        file.mux(stream.encode())


def _encoder(path: str | Path) -> str:
    """Return the name of the first available encoder."""
    av = needed("av", "video", path, "a video is written")
    there = [name for name in ENCODERS if name in av.codecs_available]
    expected = f"a PyAV with an H.264 encoder, {' or '.join(ENCODERS)}"
    require(there, path, expected, "one without")
    return there[0]


def is_even(times: Float[np.ndarray, " frame"]) -> bool:
    """Return True if intervals are positive and deviate by less than `UNEVEN`."""
    steps = np.diff(times)
    # the median is not affected by a gap
    usual = float(np.median(steps))
    return bool((steps > 0).all() and np.abs(steps - usual).max() < UNEVEN * usual)


def check_even(path: Path, times: Float[np.ndarray, " frame"]) -> None:
    """Reject a varying frame rate.

    Args:
        path: The video, for the message.
        times: Times of its frames [s].

    Raises:
        InputError: The times are not even (`is_even`).
    """
    steps = np.diff(times)
    usual = float(np.median(steps))
    far = np.abs(steps - usual)
    at = int(np.argmin(steps) if steps.min() <= 0 else np.argmax(far))
    got = (
        f"frames {at} and {at + 1} {1e3 * steps[at]:.4g} ms apart, usually "
        f"{1e3 * usual:.4g} ms"
    )
    expected = "a constant frame rate (ffmpeg -i IN -fps_mode cfr OUT)"
    require(is_even(times), path, expected, got)


def bt709_to_linear(value: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the scene light of BT.709 values, full scale 1."""
    above = ((value + 0.099) / 1.099) ** (1 / 0.45)
    return np.where(value < 0.081, value / 4.5, above)


CURVES = {
    **dict.fromkeys((1, UNSPECIFIED, 6, 14, 15), bt709_to_linear),
    4: lambda value: value**2.2,
    5: lambda value: value**2.8,
    8: lambda value: value,
    SRGB: srgb_to_linear,
}
"""Transfer curves by their number in H.273, table 3."""


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a video, and yield it with its video stream.

    Raises:
        InputError: As in `open_container`, or it has no video stream.
    """
    with open_container(path) as container:
        from av.stream import Disposition

        cover = Disposition.attached_pic  # an image that stands for the file
        streams = [s for s in container.streams.video if not s.disposition & cover]
        require(streams, path, "a video", "a file without one")
        # decoding by frames and slices in parallel
        streams[0].thread_type = "AUTO"
        yield container, streams[0]
