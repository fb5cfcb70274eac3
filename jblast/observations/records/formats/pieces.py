"""What a file of many arrays holds, as recordings: named, numbered, in pascals."""

from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.observations.records.formats.scale import Scaling, scale_of
from jblast.observations.records.recording import Recording, channel_names

RATES = ("rate_hz", "sampling_rate_hz", "sampling_rate", "sample_rate", "fs_hz", "fs")
"""What samples a second are called where no times stand."""


class SampleClock(NamedTuple):
    """When samples were taken.

    Attributes:
        start_s: The first, on the recorder's clock [s].
        rate_hz: Samples a second [Hz].
        epoch: UTC of that clock's time zero; None where the file does not say.
    """

    start_s: float
    rate_hz: float
    epoch: datetime | None = None


class Piece(NamedTuple):
    """An array of samples within a file.

    Attributes:
        label: What a message calls it: "variable pressure_kpa".
        unit: As it is written; "" where none is.
        channels: How many it holds.
        length: Samples of each.
        read: Returns samples from one to before another, in its unit.
        clock: When they were taken.
    """

    label: str
    unit: str
    channels: int
    length: int
    read: Callable[[int, int], Float[np.ndarray, "channel sample"]]
    clock: SampleClock


def recordings_of(
    path: Path, pieces: Sequence[Piece], scaling: Scaling, notes: tuple[str, ...] = ()
) -> tuple[Recording, ...]:
    """Return a recording for each array, its channels numbered through the file.

    Raises:
        InputError: One holds volts of a sensitivity that nobody said, or no pressure.
    """
    names = channel_names(path.stem, sum(piece.channels for piece in pieces))
    recordings, first = [], 0
    for piece in pieces:
        last = first + piece.channels
        labels = tuple(
            piece.label if piece.channels == 1 else f"{piece.label}, channel {n + 1}"
            for n in range(piece.channels)
        )
        scale = scale_of(piece.unit, scaling, f"{path}: {piece.label}")
        recordings.append(
            Recording(
                source=str(path),
                names=names[first:last],
                labels=labels,
                rate_hz=piece.clock.rate_hz,
                length=piece.length,
                read=_scaled(piece, scale.factor),
                start_s=piece.clock.start_s,
                epoch=piece.clock.epoch,
                calibrated=scale.calibrated,
                notes=notes,
            )
        )
        first = last
    return tuple(recordings)


def left_out(labels: Sequence[str]) -> tuple[str, ...]:
    """Say which arrays hold no pressure."""
    return (f"left out, not pressure: {', '.join(labels)}",) if labels else ()


def _scaled(
    piece: Piece, factor: float
) -> Callable[[int, int], Float[np.ndarray, "channel sample"]]:
    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        return factor * np.asarray(piece.read(start, stop), np.float64)

    return read
