"""A stretch of samples that one channel recorded, and what is known of its scale."""

import math
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class PressureRecord:
    """Samples of one channel on an even clock.

    Attributes:
        name: The stem of its file, or stem.channel, channels counted from 1.
        samples: In double precision: overpressure [Pa] if `calibrated`, else in a unit
            that nobody said, as a share of full scale or counts.
        rate_hz: Samples a second [Hz].
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None where the file does not say.
        calibrated: Whether the samples are pascals.
        full_scale: Largest size that a sample can have, in their unit; None where
            nothing clips, or nobody said at what.
        high_pass_hz: Corner of the recorder's first-order high-pass [Hz]; None where
            there is none, or nobody said.
        source: The file.
        notes: What was done in reading, for the reader of an answer: a sentence each.
    """

    name: str
    samples: Float[np.ndarray, " sample"]
    rate_hz: float
    start_s: float = 0.0
    epoch: datetime | None = None
    calibrated: bool = True
    full_scale: float | None = None
    high_pass_hz: float | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise ValueError(f"rate_hz must be positive, got {self.rate_hz:g} Hz")
        if not math.isfinite(self.start_s):
            raise ValueError(f"start_s must be finite, got {self.start_s} s")
        if self.epoch is not None and self.epoch.tzinfo is None:
            raise ValueError(f"epoch must have a time zone, got {self.epoch}")

    @property
    def time_s(self) -> Float[np.ndarray, " sample"]:
        """Time of each sample on the recorder's clock [s]."""
        return self.start_s + np.arange(self.samples.size) / self.rate_hz

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return self.samples.size / self.rate_hz
