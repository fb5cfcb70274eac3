"""What becomes of one sensor's samples while they are written down."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.observations.records.sound_file import write_sound_stream
from jblast.observations.records.sound_formats import Bits
from jblast.report.listen.overview import Envelope, Spectrogram
from jblast.report.listen.samples_csv import write_samples
from jblast.scene import Sensor
from jblast.sensors.listening.plan import Listening, instrument_of, samples_of
from jblast.sensors.signal.quantise import clipping

COLUMNS = {
    "microphone": ("overpressure_pa",),
    "pressure": ("overpressure_pa",),
    "anemometer": ("wind_east_m_s", "wind_north_m_s", "wind_up_m_s"),
    "geophone": ("ground_velocity_m_s",),
}
"""What a kind of sensor writes down, component by component."""
DRAWN = {"anemometer": "wind_speed_m_s"}
"""What is told and drawn instead, of several components: their magnitude."""
BITS = (8, 16, 24, 32)
"""What a whole number in a sound file may have; the least that holds a sensor's own."""
BEFORE, AFTER = 0.25, 6.0
"""What is drawn large: from the first arrival, some of the time to the end of the
positive phase before it, and so many positive phases after the last."""


class SensorRecord:
    """One sensor's record: where it is written, and what is kept of it to be told.

    Attributes:
        sensor: Whose it is.
        file: Name of its file.
        rate_hz: Samples a second.
        samples: How many it has.
        column: What is told and drawn of it, with its unit.
        full_scale: What a sample of 1 in a sound file stands for [Pa].
        largest: Largest magnitude written, in its unit.
        clipped: By charge, whether a sample clipped between its first arrival and the
            next charge's.
        clipped_samples: How many did in all.
        whole: Its wave form.
        near: Its wave form around the arrivals; None where no blast comes.
        spectrogram: Its spectra.
    """

    def __init__(self, listening: Listening, sensor: Sensor, file: str):
        instrument = instrument_of(sensor)
        self.sensor, self.file = sensor, file
        self.rate_hz, self.samples = instrument.rate, 0
        self.column: str = DRAWN.get(sensor.kind) or COLUMNS[sensor.kind][0]
        self.bits = instrument.bits
        self.full_scale = 1.0
        if self.bits is not None and instrument.full_scale is not None:
            self.full_scale = float(instrument.full_scale)
        # what 32 bits make of a sample at the limit is no less clipped
        self._limit = float(clipping(jnp.zeros(1), instrument).level) * (1 - 1e-6)
        self.largest, self.clipped_samples = 0.0, 0
        number = [other.name for other in listening.sensors].index(sensor.name)
        values = {name: rows[number] for name, rows in listening.truth.values.items()}
        self._first = np.fmin(values["air_arrival_s"], values["ground_arrival_s"])
        self.clipped: Bool[np.ndarray, " shot"] = np.zeros(self._first.shape, bool)
        planned = samples_of(listening, sensor)
        self.whole = Envelope(0, planned, self.rate_hz)
        self.near = _near(self._first, values, planned, self.rate_hz)
        self.spectrogram = Spectrogram(planned, self.rate_hz)

    def write(
        self,
        path: Path,
        packets: Iterable[Float[np.ndarray, "sample component"]],
        comments: Iterable[str],
    ) -> None:
        """Write the samples as they come; what a stream had that breaks is kept."""
        seen = self._seen(packets)
        if self.sensor.kind != "microphone":
            columns = COLUMNS[self.sensor.kind]
            write_samples(path, seen, self.rate_hz, columns, [*comments])
            return
        bits: Bits = "float"
        if self.bits is not None:
            bits = next(most for most in BITS if most >= self.bits)
        scaled = (samples[:, 0] / self.full_scale for samples in seen)
        write_sound_stream(path, scaled, self.rate_hz, bits)

    def _seen(
        self, packets: Iterable[Float[np.ndarray, "sample component"]]
    ) -> Iterator[Float[np.ndarray, "sample component"]]:
        """Look at packets as they go by."""
        for packet in packets:
            magnitude = np.linalg.norm(packet, axis=1)
            signal = packet[:, 0] if packet.shape[1] == 1 else magnitude
            self.whole.push(signal, self.samples)
            if self.near is not None:
                self.near.push(signal, self.samples)
            self.spectrogram.push(signal)
            self.largest = max(self.largest, float(magnitude.max(initial=0.0)))
            at = np.flatnonzero((np.abs(packet) >= self._limit).any(axis=1))
            self._clip((self.samples + at) / self.rate_hz)
            self.samples += len(packet)
            yield packet

    def _clip(self, times: Float[np.ndarray, " n"]) -> None:
        """Count samples that clipped, and say of which blast: the last that came."""
        self.clipped_samples += times.size
        order = np.argsort(self._first)
        # a front within the sample that it begins in
        came = np.searchsorted(self._first[order], times + 1.0 / self.rate_hz)
        self.clipped[order[np.unique(came[came > 0]) - 1]] = True


def _near(
    first: Float[np.ndarray, " shot"],
    values: dict[str, Float[np.ndarray, " shot"]],
    samples: int,
    rate_hz: float,
) -> Envelope | None:
    """Return what draws the arrivals of the first blast that comes, large."""
    first = np.where(first >= 0, first, np.inf)
    shot = int(first.argmin())
    duration = values["positive_duration_s"][shot]
    begin, end = first[shot], values["air_arrival_s"][shot] + duration
    if not (np.isfinite(begin) and np.isfinite(end)):
        return None
    begin -= BEFORE * (end - begin)
    end += AFTER * duration
    start, stop = (int(np.clip(t * rate_hz, 0, samples)) for t in (begin, end))
    return Envelope(start, stop, rate_hz) if stop > start + 1 else None
