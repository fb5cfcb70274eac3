"""Sound tracks of video clips: MP4, MOV, MKV and others, decoded by PyAV (FFmpeg).

Time 0 is the first frame of the picture, from which flashes in the same clip are timed.
The delay of the encoder is removed as the container states it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, check_declared, needed, reading
from jblast.observations.records.recording import FULL_SCALE, Clock, Column, Group

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ogv")
MAX_GAP_S = 0.02
"""Largest deviation of a time stamp from an even clock [s]: stamps of Matroska are
rounded to a millisecond, and a missing packet of AAC at 48 kHz lasts 21 ms."""


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


def open_clip(path: Path) -> tuple[Group, ...]:
    """Return the first sound track of a clip, which is read whole.

    Raises:
        InputError: As for `open_container`; or it has no sound, sound is missing
            between two packets, or there is more than the file can contain.
    """
    with open_container(path) as container:
        import av

        if not container.streams.audio:
            raise InputError(f"{path}: expected a clip with sound, got one without")
        sound = container.streams.audio[0]
        rate, codec = sound.codec_context.sample_rate, sound.codec_context.name
        # floats from -1 to 1 by channel
        planar = av.AudioResampler("fltp")
        parts, length, first = [], 0, None
        for frame in container.decode(sound):
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
            parts += [one.to_ndarray() for one in planar.resample(frame)]
            length += frame.samples
            check_declared(path, 4 * length * frame.layout.nb_channels)
        if first is None:
            raise InputError(f"{path}: expected a clip with sound, got no samples")
        begin = _first_frame_s(container)
    samples = np.concatenate(parts, axis=1)
    column = Column(
        name="",
        unit=FULL_SCALE,
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        channels=len(samples),
        clocks=(Clock(float(rate), first - begin),),
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


def _first_frame_s(container: Any) -> float:
    """Return the time of the first frame of the picture [s]; 0 without a picture."""
    if not container.streams.video:
        return 0.0
    container.seek(0)
    frame = next(container.decode(video=0), None)
    return float(frame.time or 0.0) if frame else 0.0
