"""WAV and FLAC as records of pressure: shares of a full scale that somebody knows."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.observations.records.formats.scale import Scaling
from jblast.observations.records.opened_sound import opened_sound
from jblast.observations.records.recording import Recording, channel_names


def open_sound(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return what a sound file holds, none of its samples read yet.

    Whole numbers clip at their largest; floats clip nowhere that a file could tell.

    Raises:
        InputError: It is no sound file, or one that cannot be used (`read_sound`).
    """
    with opened_sound(path) as file:
        channels, rate_hz, length = file.channels, file.samplerate, file.frames
        bits = {"PCM_U8": 8, "PCM_S8": 8, "PCM_16": 16, "PCM_24": 24, "PCM_32": 32}.get(
            file.subtype
        )
    factor = 1.0 if scaling.full_scale_pa is None else scaling.full_scale_pa

    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        with opened_sound(path) as file:
            file.seek(start)
            samples = file.read(stop - start, dtype="float64", always_2d=True)
        return factor * samples.T

    recording = Recording(
        source=str(path),
        names=channel_names(path.stem, channels),
        labels=tuple(f"channel {number + 1}" for number in range(channels)),
        rate_hz=float(rate_hz),
        length=length,
        read=read,
        calibrated=scaling.full_scale_pa is not None,
        full_scale=None if bits is None else factor * (1.0 - 2.0 ** (1 - bits)),
    )
    return (recording,)
