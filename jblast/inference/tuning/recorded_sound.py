"""A sound record for a sensor of a scene, read and held against what it says."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest
from jblast.observations.records.formats import Scaling, open_record
from jblast.scene import Instrument, Scene

SOUND_KINDS = ("microphone", "pressure")
FEWEST_SAMPLES = 512
MOST_SAMPLES = 2**23
"""Three minutes at 48 kHz: half a gigabyte for each unknown."""


class RecordedSound(NamedTuple):
    """A record, and whose it is.

    Attributes:
        source: The file.
        samples: As the file holds them.
        sensor: Its place among the scene's.
        pascals: What a sample of 1 stands for; None: the sensor's full scale.
        notes: What was done in reading.
    """

    source: str
    samples: Float[np.ndarray, " sample"]
    sensor: int
    pascals: float | None
    notes: tuple[str, ...]


def recorded_sound(
    path: str | os.PathLike[str],
    scene: Scene,
    source: str,
    sensor: str | None = None,
    full_scale_pa: float | None = None,
) -> RecordedSound:
    """Read what a microphone or a pressure gauge of a scene recorded.

    Args:
        path: The file.
        scene: What is there.
        source: Of the scene, for messages.
        sensor: Name of who recorded; None: the one that the file is named after, or
            the only one there is.
        full_scale_pa: Pascals that a sample of 1 stands for; None: 1 of floats, the
            sensor's full scale of whole numbers.

    Raises:
        InputError: It cannot be read, holds nothing, is of another rate than the
            sensor's, or it is open whose it is or what its samples stand for.
    """
    index = _index(Path(path), scene, source, sensor)
    own = scene.sensors[index]
    instrument = own.instrument or Instrument()
    who = f"sensor {own.name!r}"
    recordings = open_record(path, Scaling(full_scale_pa))
    count = sum(len(one.names) for one in recordings)
    if count > 1:
        raise InputError(
            f"{path}: expected the one channel of {who}, got {count}; write it into a "
            "file of its own"
        )
    (recording,) = recordings
    if abs(recording.rate_hz - instrument.rate) > 1e-6 * instrument.rate:
        raise InputError(
            f"{path}: expected {instrument.rate:g} samples a second, the rate_hz of "
            f"{who} in {source}, got {recording.rate_hz:g}"
        )
    if not FEWEST_SAMPLES <= recording.length <= MOST_SAMPLES:
        raise InputError(
            f"{path}: expected {FEWEST_SAMPLES:,} to {MOST_SAMPLES:,} samples, got "
            f"{recording.length:,}"
        )
    samples = recording.samples(0, recording.length)[0]
    if not np.ptp(samples) > 0:
        raise InputError(
            f"{path}: expected a record of sound, got {samples[0]:g} throughout"
        )
    pascals: float | None = 1.0
    if recording.full_scale is not None and full_scale_pa is None:
        if instrument.full_scale is None:
            raise InputError(
                f"{path}: holds whole numbers; expected {argument('full_scale')}, the "
                "pascals that a sample of 1 stands for, or full_scale_pa of "
                f"{who} in {source}"
            )
        pascals = None
    return RecordedSound(str(path), samples, index, pascals, recording.notes)


def _index(path: Path, scene: Scene, source: str, sensor: str | None) -> int:
    """Return which sensor of a scene recorded a file."""
    kinds = " or ".join(SOUND_KINDS)
    heard = [
        index for index, one in enumerate(scene.sensors) if one.kind in SOUND_KINDS
    ]
    names = [scene.sensors[index].name for index in heard]
    if not heard:
        raise InputError(f"{source}: expected a [[sensor]] of kind {kinds}, got none")
    if sensor is not None:
        _check_name(sensor, names, scene, source)
        index = heard[names.index(sensor)]
    elif path.stem in names:
        index = heard[names.index(path.stem)]
    elif len(heard) == 1:
        index = heard[0]
    else:
        raise InputError(
            f"{path}: expected {argument('sensor')}, which of {', '.join(names)} in "
            f"{source} recorded it; got none, and no file of a sensor's name"
        )
    own = scene.sensors[index]
    if own.mount or not np.isfinite(np.asarray(own.position_m)).all():
        raise InputError(
            f"{source}: [[sensor]] {own.name!r}: expected position_m of a sensor at "
            f"rest, got {'a mount' if own.mount else 'nothing'}"
        )
    return index


def _check_name(name: str, names: Sequence[str], scene: Scene, source: str) -> None:
    if name in names:
        return
    of_all = {one.name: one.kind for one in scene.sensors}
    if name in of_all:
        kind = of_all[name] or "not said"
        raise InputError(
            f"{argument('sensor')}: expected one of {', '.join(names)} in {source}, "
            f"which write sound, got {name!r}, whose kind is {kind}"
        )
    raise InputError(
        f"{argument('sensor')}: expected one of {', '.join(names)} in {source}, got "
        f"{name!r}{nearest(name, names)}"
    )
