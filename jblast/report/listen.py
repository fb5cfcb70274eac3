"""The records of a scene's sensors: text, JSON and tables of `jblast listen`.

Samples arrive in chunks of any size and are read once. The data stored for a figure
take constant memory and do not depend on the size of the chunks.
"""

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.files import replacing
from jblast.observations.records.sound import Bits, write_sound
from jblast.report.words import (
    aligned,
    comma_separated,
    commented,
    law_words,
    printed_number,
)
from jblast.results import ABSENT, AMONG, Document
from jblast.scene import Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.instrument import clipping
from jblast.sensors.listening import Listening, Truth, instrument_of, samples_of

MAX_LINES = 20
"""Largest number of printed sensors, half a screen; truth.csv has all of them."""
PRINTED = ("ground_arrival_s", "air_arrival_s", "peak_overpressure_pa")
CLOCK = "times are on each sensor's own clock; its file begins at 0 of that clock"
BITS = (8, 16, 24, 32)
"""Bit depths of a sound file; the least one that is not below the sensor's is used."""
BEFORE, AFTER = 0.25, 6.0
"""Extent of the enlarged figure: before the first arrival, as a share of the time to
the end of the positive phase; after that end, in positive durations."""
DRAWN_COLUMNS = 1600
"""Columns of a drawn waveform: about one a pixel."""
MAX_INSTANTS = 400
"""Largest number of columns of a spectrogram: about two pixels each."""
WINDOW_S = 0.04
"""Length of a window of the spectrogram, about [s]: it resolves 25 Hz, and a front to
0.04 s."""
OVERLAPS = (2, 16)
"""Number of windows that contain a sample: for a long record, and at most."""
CHUNK = 2**16
"""Samples per Fourier transform: it bounds the memory for packets of any size."""


class SensorRecord:
    """One sensor's record: where it is written, and its summary.

    Attributes:
        sensor: The sensor.
        kind: Its kind.
        is_sound: Whether its file is a sound file.
        file: Name of its file.
        rate_hz: Sampling rate [1/s].
        samples: Number of samples.
        column: Component that is printed and drawn, with its unit.
        full_scale: Pressure of a sample of 1 in a sound file [Pa].
        largest: Largest magnitude written, in its unit.
        clipped: By charge, whether a sample clipped between its first arrival and the
            next charge's.
        clipped_samples: Number of clipped samples.
        whole: Its waveform.
        near: Its waveform around the arrivals; None without a blast.
        spectrogram: Its spectrogram.
    """

    def __init__(self, listening: Listening, sensor: Sensor, file: str):
        instrument = instrument_of(sensor)
        self.sensor, self.file = sensor, file
        self.kind = SENSOR_KINDS[sensor.kind]
        self.is_sound = self.kind.file == ".wav"
        self.rate_hz, self.samples = instrument.rate, 0
        self.column = self.kind.column
        self.bits = instrument.bits
        self.full_scale = 1.0
        if self.bits is not None and instrument.full_scale is not None:
            self.full_scale = float(instrument.full_scale)
        # rounding to 32 bits may leave a clipped sample 1e-7 below the limit
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
        """Write the samples as they arrive; if the stream breaks, the rest is kept."""
        seen = self._seen(packets)
        if not self.is_sound:
            write_samples(path, seen, self.rate_hz, self.kind.columns, [*comments])
            return
        bits: Bits = "float"
        if self.bits is not None:
            bits = next(most for most in BITS if most >= self.bits)
        scaled = (samples[:, 0] / self.full_scale for samples in seen)
        write_sound(path, scaled, self.rate_hz, bits)

    def _seen(
        self, packets: Iterable[Float[np.ndarray, "sample component"]]
    ) -> Iterator[Float[np.ndarray, "sample component"]]:
        """Yield the packets, and update envelopes, spectrogram and clipping."""
        for packet in packets:
            magnitude = np.linalg.norm(packet, axis=1)
            # one curve a sensor: of a vector its magnitude
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
        """Count clipped samples, and assign them to the last blast that arrived."""
        self.clipped_samples += times.size
        # charges may be in any order; a sample belongs to the last arrival before it
        order = np.argsort(self._first)
        # a sample is the mean over its interval, so its front may lie inside it
        came = np.searchsorted(self._first[order], times + 1.0 / self.rate_hz)
        self.clipped[order[np.unique(came[came > 0]) - 1]] = True


def listening_text(
    listening: Listening, records: Sequence[SensorRecord], notes: Sequence[str] = ()
) -> str:
    """Return the records as a table with notes, for the terminal.

    Args:
        listening: The simulated recording.
        records: The records.
        notes: Further notes.
    """
    rows = [["sensor", "kind", "file", "ground", "air", "peak"]]
    for number, record in enumerate(records[:MAX_LINES]):
        shot = _first_shot(listening.truth, number)
        values = [listening.truth.values[name][number, shot] for name in PRINTED]
        numbers = [
            printed_number(name, value) if np.isfinite(value) else "never"
            for name, value in zip(PRINTED, values, strict=True)
        ]
        rows.append([record.sensor.name, record.sensor.kind, record.file, *numbers])
    sensors = "1 sensor" if len(records) == 1 else f"{len(records)} sensors"
    shots = len(listening.truth.shots)
    blasts = "1 blast" if shots == 1 else f"{shots} blasts"
    span = f"{listening.seconds:g} s each, from 0 on the sensor's own clock"
    lines = [f"Records of {sensors}, {blasts}: {span}", ""]
    lines += aligned(rows, right=(3, 4, 5))
    if len(records) > MAX_LINES:
        lines.append(f"and {len(records) - MAX_LINES} more, in truth.csv")
    if shots > 1:
        lines.append("arrivals and peak of the first blast at each sensor")
    notes = (*notes, *listening.notes, *warnings_of(listening, records))
    lines += [f"Note: {note.removeprefix('note: ')}" for note in notes]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class BlastAtSensor:
    """A blast at a sensor.

    Attributes:
        values: The quantities of `laws`; null for a wave that does not arrive.
        clipped: Whether a sample is clipped before the next blast arrives.
    """

    values: Mapping[str, float] = field(metadata=AMONG)
    clipped: bool


@dataclass(frozen=True)
class RecordAnswer:
    """The record of a sensor.

    Attributes:
        kind: Kind of the sensor.
        file: Name of the file.
        rate_hz: Sampling rate [1/s].
        samples: Number of samples.
        values: The quantities of `laws`, for the first blast to arrive.
        clipped: Whether a sample is clipped.
        clipped_samples: Number of clipped samples.
        largest: Largest magnitude, with its unit in the key.
        full_scale_pa: Pressure of a sample of 1 in the file of a microphone: 1 for
            floats.
        blasts: With several blasts, the quantities of each, by name of the charge.
    """

    kind: str
    file: str
    rate_hz: float
    samples: int
    values: Mapping[str, float] = field(metadata=AMONG)
    clipped: bool
    clipped_samples: int
    largest: Mapping[str, float] = field(metadata=AMONG)
    full_scale_pa: float | None = field(metadata=ABSENT)
    blasts: Mapping[str, BlastAtSensor] | None = field(metadata=ABSENT)


@dataclass(frozen=True)
class Recordings:
    """The records of a scene; null for a wave that does not arrive.

    Attributes:
        seconds: Duration of each record [s].
        laws: Law of each quantity.
        sensors: Records by name of the sensor: `largest_overpressure_pa`,
            `largest_wind_speed_m_s` or `largest_ground_velocity_m_s`, and the
            quantities of `laws`, such as `air_arrival_s`, for the first blast to
            arrive.
        skipped: Reason why a sensor has no file, by name.
        warnings: Positions outside a law's range, clipping, blasts outside the record.
    """

    seconds: float
    laws: Mapping[str, str]
    sensors: Mapping[str, RecordAnswer]
    skipped: Mapping[str, str]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class ListenAnswer(Document):
    """The answer of `jblast listen`.

    Attributes:
        scene: The scene's file.
        seed: Seed of all random draws.
        recordings: The records.
    """

    scene: str
    seed: int
    recordings: Recordings = field(metadata=AMONG)


def recordings_answer(
    listening: Listening, records: Sequence[SensorRecord], notes: Sequence[str] = ()
) -> Recordings:
    """Return the records as a part of a document.

    With several blasts, the arrivals and peak of a sensor are those of its first one.

    Args:
        listening: The simulated recording.
        records: The records.
        notes: Further notes.
    """
    return Recordings(
        listening.seconds,
        listening.truth.laws,
        {
            record.sensor.name: _record(listening.truth, number, record)
            for number, record in enumerate(records)
        },
        listening.skipped,
        (*notes, *listening.notes, *warnings_of(listening, records)),
    )


def _record(truth: Truth, number: int, record: SensorRecord) -> RecordAnswer:
    blasts = {
        name: BlastAtSensor(
            {
                quantity: float(rows[number, n])
                for quantity, rows in truth.values.items()
            },
            bool(record.clipped[n]),
        )
        for n, name in enumerate(truth.shots)
    }
    first = _first_shot(truth, number)
    return RecordAnswer(
        kind=record.sensor.kind,
        file=record.file,
        rate_hz=record.rate_hz,
        samples=record.samples,
        values={
            name: float(rows[number, first]) for name, rows in truth.values.items()
        },
        clipped=record.clipped_samples > 0,
        clipped_samples=record.clipped_samples,
        largest={f"largest_{record.column}": record.largest},
        full_scale_pa=record.full_scale if record.is_sound else None,
        blasts=blasts if len(blasts) > 1 else None,
    )


def _first_shot(truth: Truth, number: int) -> int:
    """Return the number of the blast that arrives first at a sensor."""
    # argmin would select a NaN
    times = truth.values["air_arrival_s"][number]
    return int(np.nan_to_num(times, nan=np.inf).argmin())


def warnings_of(listening: Listening, records: Sequence[SensorRecord]) -> list[str]:
    """Return warnings on the use of the records."""
    truth = listening.truth
    notes = [f"sensor {name!r}: {why}" for name, why in listening.skipped.items()]
    for name, valid in truth.valid.items():
        rows = zip(records, valid, strict=True)
        wrong = [record.sensor.name for record, row in rows if not row.all()]
        if wrong:
            notes.append(
                f"{name} by {law_words(truth.laws[name])} is extrapolated at "
                f"{', '.join(wrong)}"
            )
    for record, arrivals in zip(records, truth.values["air_arrival_s"], strict=True):
        who = f"sensor {record.sensor.name!r}"
        if record.clipped_samples:
            notes.append(
                f"{who}: {record.clipped_samples:,} of {record.samples:,} samples are "
                "clipped; a peak read from them is a lower bound"
            )
        end = record.samples / record.rate_hz
        notes += [
            f"{who}: the blast{f' {shot!r}' if shot else ''} arrives at "
            f"{arrival:.6g} s, outside the record of {end:g} s"
            for shot, arrival in zip(truth.shots, arrivals, strict=True)
            if np.isfinite(arrival) and not 0.0 <= arrival < end
        ]
    return notes


def truth_csv(
    listening: Listening, records: Sequence[SensorRecord], comments: Sequence[str]
) -> str:
    """Return a row for each sensor and blast: predictions of the laws, and clipping."""
    truth = listening.truth
    head = ["sensor", "kind", "shot", "east_m", "north_m", "up_m", *truth.values]
    head += ["law_valid", "clipped", "file", "rate_hz", "samples", "full_scale_pa"]
    rows: list[list[str]] = [head]
    for number, record in enumerate(records):
        for n, shot in enumerate(truth.shots):
            values = [f"{column[number, n]:.12g}" for column in truth.values.values()]
            valid = all(held[number, n] for held in truth.valid.values())
            place = [
                f"{x:.12g}" for x in truth.places["air_arrival_s"][number, n].tolist()
            ]
            row = [record.sensor.name, record.sensor.kind, shot, *place, *values]
            row += [_word(valid), _word(record.clipped[n]), record.file]
            row += [f"{record.rate_hz:g}", str(record.samples)]
            rows.append([*row, f"{record.full_scale:.12g}" if record.is_sound else ""])
    return commented(comments) + comma_separated(rows)


def _word(flag: Any) -> str:
    return "true" if flag else "false"


class Envelope:
    """Smallest and largest sample of every column of a segment of a record.

    Attributes:
        low: Smallest sample of each column; NaN before the first sample.
        high: Largest sample.
    """

    def __init__(
        self, start: int, stop: int, rate_hz: float, columns: int = DRAWN_COLUMNS
    ):
        self.start, self.stop, self.rate_hz = start, stop, rate_hz
        columns = max(1, min(columns, stop - start))
        # integers: each sample is in one column, for packets of any size
        self.edges = start + (stop - start) * np.arange(columns + 1) // columns
        self.low = np.full(columns, np.nan)
        self.high = np.full(columns, np.nan)

    def push(self, samples: Float[np.ndarray, " n"], at: int) -> None:
        """Add samples, of which the first is number `at` of the record."""
        begin, end = max(at, self.start), min(at + samples.size, self.stop)
        if end <= begin:
            return
        inside = samples[begin - at : end - at]
        first = int(np.searchsorted(self.edges, begin, side="right")) - 1
        last = int(np.searchsorted(self.edges, end, side="left"))
        # the first column may have begun in an earlier packet
        cuts = np.maximum(self.edges[first:last], begin) - begin
        low, high = self.low[first:last], self.high[first:last]
        # fmin and fmax ignore the NaN of a column without samples so far
        np.fmin(low, np.minimum.reduceat(inside, cuts), out=low)
        np.fmax(high, np.maximum.reduceat(inside, cuts), out=high)

    @property
    def time_s(self) -> Float[np.ndarray, " column"]:
        """Middle of each column [s]."""
        return (self.edges[:-1] + self.edges[1:] - 1) / (2.0 * self.rate_hz)


def _near(
    first: Float[np.ndarray, " shot"],
    values: dict[str, Float[np.ndarray, " shot"]],
    samples: int,
    rate_hz: float,
) -> Envelope | None:
    """Return the envelope around the arrivals of the first blast; None without one."""
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


def write_samples(
    path: str | os.PathLike[str],
    packets: Iterable[Float[np.ndarray, "sample component"]],
    rate_hz: float,
    columns: Sequence[str],
    comments: Sequence[str],
) -> int:
    """Write samples against time as CSV, in constant memory.

    If the packets end with an error or an interrupt, the file with the samples so far
    is kept, and the error is raised.

    Args:
        path: Output file; an existing one is replaced.
        packets: Packets of consecutive samples.
        rate_hz: Sampling rate [1/s]; the first sample is at 0.
        columns: Names of the components, with units.
        comments: Comment lines, such as the provenance.

    Returns:
        Number of samples.
    """
    written = 0
    broken: BaseException | None = None
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(commented(comments))
        file.write(comma_separated([["time_s", *columns]]))
        try:
            for packet in packets:
                times = (written + np.arange(len(packet))) / rate_hz
                rows = np.column_stack([times, packet]).tolist()
                # a time to the nanosecond, and samples with the digits of 32 bits
                cells = (
                    [f"{time:.9f}", *(f"{sample:.9g}" for sample in samples)]
                    for time, *samples in rows
                )
                file.write(comma_separated(cells))
                written += len(packet)
        except BaseException as error:
            # without a sample the error leaves `replacing`, and an old file stays
            if not written:
                raise
            broken = error
    if broken is not None:
        raise broken
    return written


class Spectrogram:
    """Power density of a record against time, by overlapping Hann windows.

    Attributes:
        frequency_hz: Frequency of each row, without 0.
        time_s: Edges of the columns.
    """

    def __init__(self, samples: int, rate_hz: float):
        self.rate_hz, self.samples = rate_hz, samples
        # a power of two, for which the Fourier transform is fastest
        size = 2 ** round(math.log2(max(WINDOW_S * rate_hz, 16.0)))
        while size > max(samples, 16):
            size //= 2
        least, most = (size // overlap for overlap in reversed(OVERLAPS))
        self.size, self.step = size, max(1, least, min(most, samples // MAX_INSTANTS))
        # the periodic window: overlapping copies have a constant sum
        self.window = np.hanning(size + 1)[:-1]
        frames = max(1, (samples - size) // self.step + 1)
        self.frames, columns = frames, min(frames, MAX_INSTANTS)
        self.power = np.zeros((columns, size // 2))
        self.count = np.zeros(columns)
        self.frequency_hz = np.arange(1, size // 2 + 1) * rate_hz / size
        first = np.arange(columns + 1) * frames / columns * self.step
        self.time_s = (first + self.size / 2 - self.step / 2) / rate_hz
        self._left = np.zeros(0)
        self._done = 0

    def push(self, samples: Float[np.ndarray, " n"]) -> None:
        """Add the next samples."""
        for start in range(0, samples.size, CHUNK):
            self._take(samples[start : start + CHUNK])

    def _take(self, samples: Float[np.ndarray, " n"]) -> None:
        waiting = np.concatenate([self._left, samples])
        frames = max(0, (waiting.size - self.size) // self.step + 1)
        frames = min(frames, self.frames - self._done)
        if frames > 0:
            windows = np.lib.stride_tricks.sliding_window_view(waiting, self.size)
            spectra = np.fft.rfft(windows[:: self.step][:frames] * self.window)[:, 1:]
            # one-sided: twice the power, but for the Nyquist row, which occurs once
            power = 2.0 * np.abs(spectra) ** 2
            power[:, -1] /= 2.0
            columns = (self._done + np.arange(frames)) * len(self.count) // self.frames
            np.add.at(self.power, columns, power)
            np.add.at(self.count, columns, 1.0)
            self._done += frames
        # the next window starts here, and may need samples of the next packet
        self._left = waiting[frames * self.step :]

    def density(self) -> Float[np.ndarray, "instant frequency"]:
        """Return mean power by frequency [unit^2/Hz]; NaN without samples."""
        scale = self.rate_hz * np.sum(self.window**2)
        with np.errstate(invalid="ignore"):
            return self.power / (scale * self.count[:, None])
