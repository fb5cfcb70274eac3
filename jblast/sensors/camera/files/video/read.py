"""Videos as linear light with times, frame by frame."""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.sensors.camera.files.video.container import ffmpeg_error, opened
from jblast.sensors.camera.files.video.stamps import (
    check_even,
    cut_short,
    frame_stamps,
    has_no_stamps,
    seconds,
)
from jblast.sensors.camera.files.video.transfer import (
    SRGB,
    UNSPECIFIED,
    light_table,
)
from jblast.sensors.camera.image.grey_composite import LUMINANCE

HIGH_DEFINITION = 720
"""Rows from which on a video that does not say is coded by BT.709, and not BT.601."""

ROUNDED = 0x2 | 0x2000 | 0x40000
"""SWS_BILINEAR, SWS_FULL_CHR_H_INT and SWS_ACCURATE_RND of libswscale: without them its
colours are one or two values of 255 too dark."""


@dataclass(frozen=True)
class Video:
    """A video that was looked through, frame stamps and header.

    Attributes:
        path: The file.
        width: As shown, after turning.
        height: As shown.
        stamps: Of its frames, in order, in the file's own ticks.
        times: Of its frames, from the first [s].
        turns: Quarter turns counterclockwise from how it is stored to how it is shown.
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
        """Return values of red, green and blue, (height, width, 3), from a frame on.

        Raises:
            InputError: A frame cannot be decoded, or has another size.
        """
        with opened(self.path) as (container, stream):
            number = 0
            if first and not has_no_stamps(container):
                container.seek(self.stamps[first], stream=stream, backward=True)
                number = None
            try:
                for frame in container.decode(stream):
                    _check_frame(self.path, frame)
                    if number is None:  # at a frame from which decoding can begin
                        number = bisect_left(self.stamps, frame.pts)
                    if number >= first:
                        yield self._values(frame)
                    number += 1
            except ffmpeg_error() as error:
                why = f"frame {number}: {error.strerror}"
                raise cut_short(self.path, why) from None
        if number != len(self):
            raise cut_short(self.path, f"{number:,} of {len(self):,} frames")

    def colours(
        self, values: np.ndarray, scale: float = 1.0
    ) -> Float[np.ndarray, "height width 3"]:
        """Return the linear light of values, full scale `scale`."""
        return scale * self.table[values]

    def luminance(self, values: np.ndarray) -> Float[np.ndarray, "height width"]:
        """Return the grey linear light of values, full scale 1, in single precision."""
        red, green, blue = (
            np.take(np.float32(weight) * self.table, values[..., channel])
            for channel, weight in enumerate(LUMINANCE)
        )
        return red + green + blue

    def _values(self, frame: Any) -> np.ndarray:
        values = _rgb(frame, deep=len(self.table) > 256)
        values = np.rot90(values, self.turns)
        if values.shape[:2] != (self.height, self.width):
            raise InputError(
                f"{self.path}: expected frames of one size, got {self.width} x "
                f"{self.height} and {values.shape[1]} x {values.shape[0]} pixels"
            )
        return values


def open_video(path: str | Path, *, even: bool = True) -> Video:
    """Look through a video; its frames are decoded when they are asked for.

    Colours are turned into red, green and blue by the matrix the file names (else
    BT.709's from 720 rows on, BT.601's below), and into linear light by its curve (else
    BT.709's, or sRGB's where it holds red, green and blue). A video that is to be shown
    turned is turned.

    Args:
        path: Whatever FFmpeg reads.
        even: Whether frames must follow each other at one rate.

    Raises:
        InputError: As in `opened`; or it is not whole, its frame rate varies, its
            pixels are not square, its frames interlaced, turned by other than quarters,
            or HDR.
    """
    path = Path(path)
    with opened(path) as (container, stream):
        stamps = frame_stamps(path, container, stream)
        base = stream.time_base
        ratio = stream.codec_context.sample_aspect_ratio
    if ratio not in (None, 0, 1):
        raise InputError(
            f"{path}: expected square pixels, got some {ratio} as wide as high; scale "
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
        turns = _quarter_turns(path, frame)
        bits = max(part.bits for part in frame.format.components)
        size = frame.width, frame.height
        width, height = size if turns % 2 == 0 else size[::-1]
        curve = int(frame.color_trc)
        if curve == UNSPECIFIED and frame.format.is_rgb:
            curve = SRGB
        table = light_table(curve, 16 if bits > 8 else 8, path)
    return Video(path, width, height, tuple(stamps), times, turns, table, max(bits, 8))


def _check_frame(path: Path, frame: Any) -> None:
    """Refuse a frame that is damaged or interlaced."""
    if frame.is_corrupt:
        raise cut_short(path, f"a damaged frame at {float(frame.time or 0.0):.6g} s")
    if frame.interlaced_frame:
        raise InputError(
            f"{path}: expected whole frames, got interlaced ones, whose rows are of "
            "two times; convert it (ffmpeg -i IN -vf yadif OUT)"
        )


def _quarter_turns(path: Path, frame: Any) -> int:
    """Return by how many quarters a frame is to be turned counterclockwise."""
    if frame.rotation % 90:
        raise InputError(
            f"{path}: expected a video to be shown turned by a multiple of 90 degrees, "
            f"got {frame.rotation}"
        )
    return frame.rotation // 90 % 4


def _rgb(frame: Any, *, deep: bool) -> np.ndarray:
    """Return the red, green and blue of a frame as it is stored, full range."""
    from av.video.reformatter import Colorspace

    matrix = None  # the frame's own
    if int(frame.colorspace) == 2 and not frame.format.is_rgb:
        high = frame.height >= HIGH_DEFINITION
        matrix = Colorspace.ITU709 if high else Colorspace.ITU601
    kind = "gbrp16le" if deep else "rgb24"  # rgb48le comes out green, so rounded
    return frame.reformat(
        format=kind, src_colorspace=matrix, interpolation=ROUNDED
    ).to_ndarray()
