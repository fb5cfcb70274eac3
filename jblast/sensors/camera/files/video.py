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

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import InputError, needed
from jblast.files import replacing
from jblast.observations.records.clips import open_container
from jblast.sensors.camera.image import LUMINANCE, srgb_to_linear

if TYPE_CHECKING:
    from av.error import FFmpegError

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


@dataclass(frozen=True)
class Video:
    """An indexed video: time stamps of its frames, and its header.

    Attributes:
        path: The file.
        width: Width as shown, after rotation [px].
        height: Height as shown [px].
        stamps: Time stamps of its frames, in order, in the file's own ticks.
        times: Times of its frames, from the first [s].
        turns: Quarter turns counterclockwise from the stored to the shown image.
        table: Linear light of each value, 256 or 65,536 of them, full scale 1.
        bits: Bit depth of the file; values of more than 8 bits are scaled to 16.
    """

    path: Path
    width: int
    height: int
    stamps: tuple[int, ...]
    times: Float[np.ndarray, " frame"]
    turns: int
    table: Float[np.ndarray, " value"]
    bits: int = 8

    def __len__(self) -> int:
        return len(self.stamps)

    def frames(self, first: int = 0) -> Iterator[np.ndarray]:
        """Yield values of red, green and blue, (height, width, 3), from a frame on.

        Raises:
            InputError: A frame cannot be decoded, or has another size.
        """
        with opened(self.path) as (container, stream):
            number = 0
            # AVI cannot be sought by stamps: it is decoded from the start
            if first and not has_no_stamps(container):
                container.seek(self.stamps[first], stream=stream, backward=True)
                number = None
            try:
                for frame in container.decode(stream):
                    _check_frame(self.path, frame)
                    if number is None:  # a seek ends at the key frame before
                        number = bisect_left(self.stamps, frame.pts)
                    if number >= first:
                        yield self._values(frame)
                    number += 1
            except ffmpeg_error() as error:
                why = f"frame {number}: {error.strerror}"
                raise cut_short(self.path, why) from None
        # frames may be missing without an error of the decoder
        if number != len(self):
            raise cut_short(self.path, f"{number:,} of {len(self):,} frames")

    def colours(
        self, values: np.ndarray, scale: float = 1.0
    ) -> Float[np.ndarray, "height width 3"]:
        """Return the linear light of values, full scale `scale`."""
        return scale * self.table[values]

    def luminance(self, values: np.ndarray) -> Float[np.ndarray, "height width"]:
        """Return the grey linear light of values, full scale 1, in single precision."""
        # weights folded into the table: one look-up per channel, no product per pixel
        red, green, blue = (
            np.take(np.float32(weight) * self.table, values[..., channel])
            for channel, weight in enumerate(LUMINANCE)
        )
        return red + green + blue

    def _values(self, frame: Any) -> np.ndarray:
        values = _rgb(frame, deep=len(self.table) > 256)
        # cameras held upright store their frames lying, with a rotation
        values = np.rot90(values, self.turns)
        if values.shape[:2] != (self.height, self.width):
            raise InputError(
                f"{self.path}: expected frames of one size, got {self.width} x "
                f"{self.height} and {values.shape[1]} x {values.shape[0]} pixels"
            )
        return values


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
        stamps = frame_stamps(path, container, stream)
        base = stream.time_base
        ratio = stream.codec_context.sample_aspect_ratio
    if ratio not in (None, 0, 1):
        raise InputError(
            f"{path}: expected square pixels, got width over height {ratio}; scale "
            "it first"
        )
    times = seconds(stamps, base)
    if even:
        check_even(path, times)
    with opened(path) as (container, stream):
        try:
            frame = next(iter(container.decode(stream)))
        except StopIteration:
            raise cut_short(path, "no frame can be decoded") from None
        except ffmpeg_error() as error:
            raise cut_short(path, f"frame 0: {error.strerror}") from None
        _check_frame(path, frame)
        if frame.rotation % 90:
            raise InputError(
                f"{path}: expected a stated rotation by a multiple of 90 degrees, got "
                f"{frame.rotation}"
            )
        turns = frame.rotation // 90 % 4
        bits = max(part.bits for part in frame.format.components)
        size = frame.width, frame.height
        width, height = size if turns % 2 == 0 else size[::-1]
        # a video without a stated curve in RGB comes from a screen: sRGB
        curve = int(frame.color_trc)
        if curve == UNSPECIFIED and frame.format.is_rgb:
            curve = SRGB
        table = light_table(curve, 16 if bits > 8 else 8, path)
    return Video(path, width, height, tuple(stamps), times, turns, table, max(bits, 8))


def _check_frame(path: Path, frame: Any) -> None:
    """Reject a frame that is damaged or interlaced."""
    if frame.is_corrupt:
        raise cut_short(path, f"a damaged frame at {float(frame.time or 0.0):.6g} s")
    if frame.interlaced_frame:
        raise InputError(
            f"{path}: expected progressive frames, got interlaced ones, whose rows "
            "have two times; convert it (ffmpeg -i IN -vf yadif OUT)"
        )


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
    if Path(path).suffix.lower() not in CONTAINERS:
        raise InputError(
            f"{path}: expected a name of a video ending in {', '.join(CONTAINERS)}"
        )
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
    if not there:
        raise InputError(
            f"{path}: expected a PyAV with an H.264 encoder, {' or '.join(ENCODERS)}, "
            "got one without"
        )
    return there[0]


def frame_stamps(path: Path, container: Any, stream: Any) -> list[int]:
    """Return the time stamps of all frames in order, without decoding.

    Raises:
        InputError: The file is incomplete, or has fewer than two frames.
    """
    decoding = has_no_stamps(container)
    stamps = []
    try:
        for packet in container.demux(stream):
            if packet.size and not packet.is_discard:
                stamps.append(packet.dts if decoding else packet.pts)
    except ffmpeg_error() as error:
        raise cut_short(path, str(error.strerror)) from None
    if None in stamps:
        raise InputError(
            f"{path}: expected a video whose frames have time stamps, got one without; "
            "put it into a container such as MP4"
        )
    if len(stamps) < 2:
        raise InputError(
            f"{path}: expected a video of at least two frames, got {len(stamps)}"
        )
    # packets are in order of decoding, which for B-frames is not that of showing
    stamps.sort()
    if len(stamps) < stream.frames and not _is_spaced(container, stream, stamps):
        raise cut_short(path, f"{len(stamps):,} of {stream.frames:,} frames")
    _check_end(path, container, stream, stamps)
    return stamps


def has_no_stamps(container: Any) -> bool:
    """Return True if frames have no time stamps but only their order, as in AVI."""
    return container.format.name == "avi"


def seconds(stamps: Sequence[int], base: Fraction) -> Float[np.ndarray, " frame"]:
    """Return time stamps as seconds from the first."""
    ticks = np.array(stamps, np.int64) - stamps[0]
    return ticks * base.numerator / base.denominator


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
    if is_even(times):
        return
    steps = np.diff(times)
    usual = float(np.median(steps))
    longest = int(np.argmax(np.abs(steps - usual)))
    at = int(np.argmin(steps)) if steps.min() <= 0 else longest
    raise InputError(
        f"{path}: expected a constant frame rate, got frames {at} and {at + 1} "
        f"{1e3 * steps[at]:.4g} ms apart, usually {1e3 * usual:.4g} ms; convert "
        "it (ffmpeg -i IN -fps_mode cfr OUT)"
    )


def cut_short(path: Path, why: str) -> InputError:
    """Return the error for an incomplete video."""
    return InputError(
        f"{path}: expected a complete video, but it is cut short or damaged ({why})"
    )


def _is_spaced(container: Any, stream: Any, stamps: list[int]) -> bool:
    """Return True if an AVI has its stated number of frames, empty ones included."""
    if not has_no_stamps(container):  # there, one tick is one frame
        return False
    return stamps[-1] + max(b - a for a, b in pairwise(stamps)) >= stream.frames


def _check_end(path: Path, container: Any, stream: Any, stamps: list[int]) -> None:
    """Raise if the last frame ends before the stated duration of a file."""
    if stream.frames:
        return
    stated = _stated_duration(container, stream)
    steps = [b - a for a, b in pairwise(stamps)]
    last = float((stamps[-1] + max(steps)) * stream.time_base)
    if (
        stated is not None
        and last + 0.5 * float(max(steps) * stream.time_base) < stated
    ):
        raise cut_short(path, f"{last:.4g} of {stated:.4g} s")


def _stated_duration(container: Any, stream: Any) -> float | None:
    """Return the stated duration of the stream [s], or None."""
    if text := stream.metadata.get("DURATION"):  # Matroska's, "00:01:02.500000000"
        try:
            hours, minutes, rest = (float(part) for part in text.split(":"))
        except ValueError:
            return None
        return 3600 * hours + 60 * minutes + rest
    if stream.duration:
        return float(stream.duration * stream.time_base)
    if len(container.streams) == 1 and container.duration:
        return container.duration / 1e6
    return None


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


def light_table(number: int, bits: int, path: Path) -> Float[np.ndarray, " value"]:
    """Return the linear light of each value of a bit depth.

    Args:
        number: Number of the curve in H.273.
        bits: 8 or 16; the largest value is full scale.
        path: The video, for the message.

    Raises:
        InputError: The curve is not supported, such as those of HDR.
    """
    if number not in CURVES:
        raise InputError(
            f"{path}: expected a video of standard dynamic range, got one with "
            f"transfer curve {number} of ITU-T H.273 (HDR, if 16 or 18); convert it "
            "to BT.709"
        )
    values = np.arange(1 << bits) / ((1 << bits) - 1)
    return CURVES[number](values).astype(np.float32)


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
        if not streams:
            raise InputError(f"{path}: expected a video, got a file without one")
        # decoding by frames and slices in parallel
        streams[0].thread_type = "AUTO"
        yield container, streams[0]


def ffmpeg_error() -> "type[FFmpegError]":
    """Return PyAV's error type, imported on use."""
    from av.error import FFmpegError

    return FFmpegError
