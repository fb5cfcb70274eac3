"""When the frames of a video are shown, and whether they are all there."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.sensors.camera.files.video.container import ffmpeg_error

UNEVEN = 0.5
"""Share of the usual interval that one may be off: clocks of telephones waver by less,
and a frame that is missing is off by one."""


def frame_stamps(path: Path, container: Any, stream: Any) -> list[int]:
    """Return the time stamps of all frames in order, without decoding one.

    Raises:
        InputError: The file breaks off, or holds fewer than two frames.
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
    stamps.sort()
    if len(stamps) < stream.frames and not _is_spaced(container, stream, stamps):
        raise cut_short(path, f"{len(stamps):,} of {stream.frames:,} frames")
    _check_end(path, container, stream, stamps)
    return stamps


def has_no_stamps(container: Any) -> bool:
    """Return whether frames have only the order in which they are decoded: AVI's."""
    return container.format.name == "avi"


def seconds(stamps: Sequence[int], base: Fraction) -> Float[np.ndarray, " frame"]:
    """Return time stamps as seconds from the first."""
    ticks = np.array(stamps, np.int64) - stamps[0]
    return ticks * base.numerator / base.denominator


def check_even(path: Path, times: Float[np.ndarray, " frame"], other: str = "") -> None:
    """Refuse frames that do not follow each other at one rate.

    Args:
        path: The video, for the message.
        times: Of its frames [s].
        other: What else can be done about it.

    Raises:
        InputError: An interval is `UNEVEN` off the usual one, or is nothing.
    """
    steps = np.diff(times)
    usual = float(np.median(steps))
    off = np.abs(steps - usual)
    if (steps > 0).all() and off.max() < UNEVEN * usual:
        return
    at = int(np.argmin(steps)) if steps.min() <= 0 else int(np.argmax(off))
    raise InputError(
        f"{path}: expected a constant frame rate, got frames {at} and {at + 1} "
        f"{1e3 * steps[at]:.4g} ms apart where {1e3 * usual:.4g} ms are usual; convert "
        f"it (ffmpeg -i IN -fps_mode cfr OUT){other}"
    )


def cut_short(path: Path, why: str) -> InputError:
    """Return what is said of a video that is not whole."""
    return InputError(
        f"{path}: expected a whole video, but it is cut short or damaged ({why})"
    )


def _is_spaced(container: Any, stream: Any, stamps: list[int]) -> bool:
    """Return whether an AVI has so many frames with the empty ones between them."""
    if not has_no_stamps(container):  # there, one tick is one frame
        return False
    return stamps[-1] + max(b - a for a, b in pairwise(stamps)) >= stream.frames


def _check_end(path: Path, container: Any, stream: Any, stamps: list[int]) -> None:
    """Compare the last frame with how long a file without a count says it lasts."""
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
    """Return how long the stream is to last [s]; None if nothing tells."""
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
