"""What a file holds of one clock: its channels, read stretch by stretch."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.observations.records.pressure_record import PressureRecord

BLOCK = 2**20
"""Samples of all channels together that are read at a time: eight megabytes."""


@dataclass(frozen=True)
class Recording:
    """Channels of one file that share rate and start; nothing of them is read yet.

    Attributes:
        source: The file.
        names: Of the channels: the stem of the file, or stem.channel, counted from 1.
        labels: What a message calls each: "channel 2", "column pressure_kpa".
        rate_hz: Samples a second [Hz].
        length: Samples of each channel.
        read: Returns the samples from one to before another, in pascals if
            `calibrated`; what is no number stands as NaN.
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None where the file does not say.
        calibrated: Whether the samples are pascals.
        full_scale: Largest size that a sample can have; None: nobody said.
        notes: What was done in reading, a sentence each.
        first_line: Line of the first sample in a text; None where samples are counted.
    """

    source: str
    names: tuple[str, ...]
    labels: tuple[str, ...]
    rate_hz: float
    length: int
    read: Callable[[int, int], Float[np.ndarray, "channel sample"]]
    start_s: float = 0.0
    epoch: datetime | None = None
    calibrated: bool = True
    full_scale: float | None = None
    notes: tuple[str, ...] = ()
    first_line: int | None = None

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return self.length / self.rate_hz

    def samples(self, start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        """Return a stretch of every channel.

        Raises:
            InputError: One of the samples is no finite number.
        """
        samples = self.read(max(start, 0), min(stop, self.length))
        if np.isfinite(samples).all():
            return samples
        channel, sample = np.argwhere(~np.isfinite(samples.T))[0][::-1]
        where = f"{self.source}: {self.labels[channel]}"
        if not np.isfinite(samples[channel]).any():
            raise InputError(f"{where}: expected samples, got no number in it")
        nth = max(start, 0) + int(sample)
        raise InputError(
            f"{where}, {self.place(nth)}: expected a finite sample, "
            f"got {samples[channel, sample]}"
        )

    def place(self, sample: int) -> str:
        """Name a sample in a message: its line, or which it is and when."""
        if self.first_line is not None:
            return f"line {self.first_line + sample}"
        return f"sample {sample + 1} ({self.start_s + sample / self.rate_hz:.6g} s)"

    def blocks(self) -> Iterator[tuple[int, Float[np.ndarray, "channel sample"]]]:
        """Go through the file in constant memory: where a block begins, and it."""
        size = max(BLOCK // len(self.names), 1)
        for start in range(0, self.length, size):
            yield start, self.samples(start, start + size)

    def record(
        self, channel: int, start: int = 0, stop: int | None = None
    ) -> PressureRecord:
        """Return a stretch of one channel, counted from 0, as a `PressureRecord`."""
        start, stop = max(start, 0), self.length if stop is None else stop
        return self.stretch(channel, start, self.samples(start, stop)[channel])

    def stretch(
        self, channel: int, start: int, samples: Float[np.ndarray, " sample"]
    ) -> PressureRecord:
        """Return samples of a channel that were read before, as a `PressureRecord`."""
        return PressureRecord(
            name=self.names[channel],
            samples=samples,
            rate_hz=self.rate_hz,
            start_s=self.start_s + start / self.rate_hz,
            epoch=self.epoch,
            calibrated=self.calibrated,
            full_scale=self.full_scale,
            source=self.source,
            notes=self.notes,
        )


def channel_names(stem: str, count: int) -> tuple[str, ...]:
    """Name the channels of a file: by its stem, or stem.channel of several."""
    if count == 1:
        return (stem,)
    return tuple(f"{stem}.{number}" for number in range(1, count + 1))
