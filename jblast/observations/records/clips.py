"""Sound tracks of video clips: MP4, MOV, MKV and others, decoded by PyAV (FFmpeg).

Time 0 is the first frame of the picture, from which flashes in the same clip are timed.
The delay of the encoder is removed as the container states it.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, check_declared, needed, reading
from jblast.observations.records.recording import FULL_SCALE, Clock, Column, Group

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ogv")
MAX_GAP_S = 0.02
"""Largest deviation of a time stamp from an even clock [s]: stamps of Matroska are
rounded to a millisecond, and a missing packet of AAC at 48 kHz lasts 21 ms."""


class Track(NamedTuple):
    """The sound track of a clip.

    Attributes:
        samples: Samples as a share of full scale.
        rate_hz: Sampling rate [Hz].
        start_s: Time of the first sample, from the first frame of the picture [s].
        codec: Name of the compression.
    """

    samples: Float[np.ndarray, "channel sample"]
    rate_hz: float
    start_s: float
    codec: str


def has_sound(path: Path) -> bool:
    """Return True if a clip has a sound track.

    Raises:
        InputError: As for `open_container`.
    """
    with open_container(path) as container:
        return bool(container.streams.audio)


def created(path: Path) -> str | None:
    """Return the time at which a clip states that it was created; None without one.

    Raises:
        InputError: As for `open_container`.
    """
    with open_container(path) as container:
        return container.metadata.get("creation_time")


def read_track(path: Path) -> Track:
    """Read the first sound track of a clip whole.

    Raises:
        InputError: As for `open_container`; or it has no sound, sound is missing
            between two packets, or there is more than the file can contain.
    """
    with reading(path, "a complete video"), open_container(path) as container:
        if not container.streams.audio:
            raise InputError(f"{path}: expected a clip with sound, got one without")
        sound = container.streams.audio[0]
        rate = sound.codec_context.sample_rate
        parts, length, first = [], 0, None
        for frame in container.decode(sound):
            values = _floats(frame)
            at = float(frame.pts * frame.time_base) if frame.pts is not None else None
            if first is None:
                first = at or 0.0
            off = 0.0 if at is None else at - first - length / rate
            if abs(off) > MAX_GAP_S:
                raise InputError(
                    f"{path}: expected sound without gaps, got {abs(off):.3g} s "
                    f"{'missing' if off > 0 else 'repeated'} at {at:.6g} s; cut the "
                    "clip there"
                )
            parts.append(values)
            length += values.shape[1]
            check_declared(path, length * len(values) * values.itemsize)
        if first is None:
            raise InputError(f"{path}: expected a clip with sound, got no samples")
        codec = str(sound.codec_context.name)
        begin = _first_frame_s(container)
    samples = np.concatenate(parts, axis=1).astype(np.float64)
    return Track(samples, float(rate), first - begin, codec)


def open_clip(path: Path) -> tuple[Group, ...]:
    """Return the sound track of a clip.

    Raises:
        InputError: As for `read_track`.
    """
    samples, rate_hz, start_s, codec = read_track(path)
    column = Column(
        name="",
        unit=FULL_SCALE,
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        channels=len(samples),
        clocks=(Clock(rate_hz, start_s),),
        full_scale=1.0,
        notes=(
            f"sound track ({codec}); times count from the first frame of the picture",
        ),
    )
    return (Group((column,)),)


def open_container(path: Path) -> Any:
    """Return an opened video, a context that closes it.

    Raises:
        InputError: There is no such file, PyAV is not installed, or it cannot read the
            file.
    """
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; expected a video")
    av = needed("av", "video", path, "a video is read")
    with reading(path, "a complete video"):
        # only local files: a playlist must not open connections to other machines
        return av.open(str(path), options={"protocol_whitelist": "file"})


def _floats(frame: Any) -> Float[np.ndarray, "channel sample"]:
    """Return the samples of a frame as shares of full scale."""
    values = frame.to_ndarray()
    if not frame.format.is_planar:
        values = values.reshape(-1, frame.layout.nb_channels).T
    if values.dtype.kind == "u":  # 8 bits, with silence at 128
        return (values.astype(np.float32) - 128.0) / 128.0
    if values.dtype.kind == "i":
        return values.astype(np.float32) / -float(np.iinfo(values.dtype).min)
    return values.astype(np.float32)


def _first_frame_s(container: Any) -> float:
    """Return the time of the first frame of the picture [s]; 0 without a picture."""
    if not container.streams.video:
        return 0.0
    video = container.streams.video[0]
    container.seek(0)
    stamps = [
        packet.pts
        for packet, _ in zip(container.demux(video), range(32), strict=False)
        if packet.pts is not None and not packet.is_discard
    ]
    return float(min(stamps) * video.time_base) if stamps else 0.0
