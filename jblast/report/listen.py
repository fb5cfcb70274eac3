"""The answer of `jblast listen`: the records of a scene's sensors.

Figures read the finished files, so that writing needs no memory for them.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.registry import law_words
from jblast.report.numbers import printed_number, split_name, unit_for
from jblast.report.view import Column, Lines, Picture, Table, View
from jblast.results import ABSENT, AMONG, Document, filled
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.listening import Listening
from jblast.sensors.record_writer import RecordWriter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_LINES = 20
"""Largest number of printed sensors, half a screen; truth.csv has all of them."""
MAX_DRAWN, ROW_INCHES = 8, 2.2
"""Largest number of sensors in a figure, and the height of each: 18 inches in all."""
BEFORE, AFTER = 0.25, 6.0
"""Extent of the enlarged waveform: before the first arrival, as a share of the time to
the end of the positive phase; after that end, in positive durations."""
BLOCK = 2**16
"""Samples of a file that are read together."""
ARRIVALS = {"ground_arrival_s": (0, (1, 1.5)), "air_arrival_s": (0, (4, 3))}
"""Line of each arrival."""


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
    listening: Listening, records: Sequence[RecordWriter], notes: Sequence[str] = ()
) -> Recordings:
    """Return the records as a part of a document.

    Args:
        listening: The simulated recording.
        records: The records.
        notes: Further notes.
    """
    truth = listening.truth
    sensors = {}
    for number, record in enumerate(records):
        values = [
            {
                quantity: float(rows[number, n])
                for quantity, rows in truth.values.items()
            }
            for n in range(len(truth.shots))
        ]
        blasts = {
            name: BlastAtSensor(of, bool(clipped))
            for name, of, clipped in zip(
                truth.shots, values, record.clipped, strict=True
            )
        }
        # argmin would select a NaN
        arrivals = truth.values["air_arrival_s"][number]
        first = int(np.nan_to_num(arrivals, nan=np.inf).argmin())
        sensors[record.sensor.name] = filled(
            RecordAnswer,
            record,
            values=values[first],
            clipped=record.clipped_samples > 0,
            largest={f"largest_{SENSOR_KINDS[record.kind].column}": record.largest},
            blasts=blasts if len(blasts) > 1 else None,
        )
    warnings = (*notes, *listening.notes, *_warnings(listening, records))
    return filled(
        Recordings, listening, laws=truth.laws, sensors=sensors, warnings=warnings
    )


def _warnings(listening: Listening, records: Sequence[RecordWriter]) -> Iterator[str]:
    """Yield warnings on the use of the records."""
    truth = listening.truth
    for name, why in listening.skipped.items():
        yield f"sensor {name!r}: {why}"
    for name, valid in truth.valid.items():
        rows = zip(records, valid, strict=True)
        if wrong := [record.sensor.name for record, row in rows if not row.all()]:
            law = law_words(truth.laws[name])
            yield f"{name} by {law} is extrapolated at {', '.join(wrong)}"
    for record, arrivals in zip(records, truth.values["air_arrival_s"], strict=True):
        who = f"sensor {record.sensor.name!r}"
        if record.clipped_samples:
            yield (
                f"{who}: {record.clipped_samples:,} of {record.samples:,} samples are "
                "clipped; a peak read from them is a lower bound"
            )
        end = record.samples / record.rate_hz
        for shot, arrival in zip(truth.shots, arrivals, strict=True):
            if np.isfinite(arrival) and not 0.0 <= arrival < end:
                yield (
                    f"{who}: the blast{f' {shot!r}' if shot else ''} arrives at "
                    f"{arrival:.6g} s, outside the record of {end:g} s"
                )


def listen_view(recordings: Recordings, directory: Path) -> View:
    """Return the records as a table, with their figures."""
    sensors = recordings.sensors
    several = max((len(one.blasts or ()) for one in sensors.values()), default=0)
    count = "1 sensor" if len(sensors) == 1 else f"{len(sensors)} sensors"
    blasts = f"{several or 1} blast{'s' if several > 1 else ''}"
    notes = [note.removeprefix("note: ") for note in recordings.warnings]
    return View(
        f"Records of {count}, {blasts}",
        [
            sensors_table(recordings),
            Lines("Notes", notes),
            *pictures(recordings, directory),
        ],
        subtitle=f"{recordings.seconds:g} s each, from 0 on the sensor's own clock",
        footer="SIMULATED, not measured.",
    )


def sensors_table(recordings: Recordings) -> Table:
    """Return a row for each record."""

    def number(name: str, head: str) -> Column:
        def raw(row: tuple[str, RecordAnswer]) -> float:
            return row[1].values.get(name, np.nan)

        def cell(row: tuple[str, RecordAnswer]) -> str:
            value = raw(row)
            return printed_number(name, value) if np.isfinite(value) else "never"

        return Column(head, cell, raw, right=True)

    several = any(one.blasts for one in recordings.sensors.values())
    return Table(
        [
            Column("sensor", lambda row: row[0]),
            Column("kind", lambda row: row[1].kind),
            Column("file", lambda row: row[1].file),
            number("ground_arrival_s", "ground"),
            number("air_arrival_s", "air"),
            number("peak_overpressure_pa", "peak"),
        ],
        [*recordings.sensors.items()],
        title="Records",
        most=MAX_LINES,
        caption="Arrivals and peak of the first blast at each sensor."
        if several
        else "",
    )


def pictures(recordings: Recordings, directory: Path) -> list[Picture]:
    """Return the figures of records, which are read from their files."""
    if not recordings.sensors:
        return []
    drawn = partial(_drawn, recordings, directory)
    return [
        Picture(
            "waveforms.png",
            lambda: waveform_figure(drawn()),
            "Waveforms",
            "Whole, and around the first blast. Dashed: arrival of the wave in air; "
            "dotted: in the ground.",
            "Samples of each sensor against time.",
        ),
        Picture(
            "spectrograms.png",
            lambda: spectrogram_figure(drawn()),
            "Spectrograms",
            "Power density by time and frequency.",
            "Power density of each record against time and frequency.",
        ),
    ]


class Drawn(NamedTuple):
    """A record to draw.

    Attributes:
        name: Name of its sensor.
        answer: Its numbers.
        samples: Its samples; of a vector its magnitude.
    """

    name: str
    answer: RecordAnswer
    samples: Float[np.ndarray, " sample"]

    @property
    def column(self) -> str:
        """The drawn quantity with its unit."""
        return SENSOR_KINDS[self.answer.kind].column

    @property
    def note(self) -> str:
        """Kind, and number of clipped samples."""
        clipped = self.answer.clipped_samples
        return self.answer.kind + (f"; {clipped:,} samples clipped" if clipped else "")

    def arrivals(self, name: str) -> list[float]:
        """Return the arrivals of a wave of all blasts."""
        blasts = self.answer.blasts
        of = [one.values for one in blasts.values()] if blasts else [self.answer.values]
        return [values[name] for values in of if name in values]


def _drawn(recordings: Recordings, directory: Path) -> list[Drawn]:
    first = list(recordings.sensors.items())[:MAX_DRAWN]
    return [Drawn(name, of, read_samples(directory, of)) for name, of in first]


def read_samples(directory: Path, record: Any) -> Float[np.ndarray, " sample"]:
    """Return the samples of a record's file; of a vector its magnitude.

    They are mapped from a temporary file: a record of any length needs little memory.

    Args:
        directory: Folder of the file.
        record: Numbers of the record, as `RecordAnswer`.

    Raises:
        InputError: The file is missing or broken.
    """
    path, kind = directory / record.file, SENSOR_KINDS.named(record.kind)
    with tempfile.TemporaryFile() as file:
        for block in _blocks(path, kind.file == ".wav", list(kind.columns)):
            magnitude = block[:, 0]
            if block.shape[1] > 1:
                magnitude = np.linalg.norm(block, axis=1)
            scaled = magnitude * (record.full_scale_pa or 1.0)
            file.write(scaled.astype(np.float32).tobytes())
        file.flush()
        size = file.tell() // 4
        return np.memmap(file, np.float32, "r", shape=(size,)) if size else np.zeros(0)


def _blocks(
    path: Path, is_sound: bool, columns: list[str]
) -> Iterator[Float[np.ndarray, "sample component"]]:
    if is_sound:
        import soundfile

        try:
            yield from soundfile.blocks(path, BLOCK, dtype="float32", always_2d=True)
        except (OSError, soundfile.LibsndfileError) as error:
            raise InputError(f"{path}: expected sound ({error})") from None
        return
    for table in read_table(path, chunksize=BLOCK):
        yield table[columns].to_numpy(np.float32)


def read_table(path: Path, **options: Any) -> Any:
    """Return a CSV table without its leading comments, as pandas does.

    Raises:
        InputError: It is missing or broken.
    """
    import pandas as pd

    try:
        with path.open(encoding="utf-8") as lines:
            # `comment="#"` of pandas would also cut cells that contain the character
            comments = next(n for n, line in enumerate(lines) if line[:1] != "#")
        return pd.read_csv(path, skiprows=comments, **options)
    except (OSError, ValueError, StopIteration) as error:
        raise InputError(f"{path}: expected a table ({error})") from None


def waveform_figure(records: Sequence[Drawn]) -> "Figure":
    """Draw each record whole, and around its first blast."""
    from jblast.report.figures import envelope, new_figure, quiet, titled

    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(records))
    grid = figure.subplots(len(records), 2, squeeze=False)
    for record, (left, right) in zip(records, grid, strict=True):
        unit = unit_for(record.column, *record.answer.largest.values())
        rate = record.answer.rate_hz
        for axes, (start, stop) in (
            (left, (0, record.samples.size)),
            (right, _near(record)),
        ):
            quiet(axes)
            if stop <= start:
                axes.set_axis_off()
                continue
            some = record.samples[start:stop] / unit.size
            envelope(axes, some, rate, start_s=start / rate)
            _mark_arrivals(axes, record)
        words = split_name(record.column)[0].replace("_", " ")
        left.set_ylabel(f"{words} [{unit.symbol}]")
        titled(left, record.name, record.note)
    titled(grid[0][1], "Around the arrivals")
    for axes in grid[-1]:
        axes.set_xlabel("time by the sensor's clock [s]")
    return figure


def _near(record: Drawn) -> tuple[int, int]:
    """Return the range of samples around the first blast; empty without one."""
    duration, rate = record.answer.values["positive_duration_s"], record.answer.rate_hz
    arrivals = [record.answer.values.get(name, np.nan) for name in ARRIVALS]
    begin = min((one for one in arrivals if np.isfinite(one)), default=np.nan)
    end = arrivals[-1] + duration
    if not (np.isfinite(begin) and np.isfinite(end)):
        return 0, 0
    span = begin - BEFORE * (end - begin), end + AFTER * duration
    start, stop = (int(np.clip(t * rate, 0, record.samples.size)) for t in span)
    return start, stop


def spectrogram_figure(records: Sequence[Drawn]) -> "Figure":
    """Draw the power density of each record against time and frequency."""
    from jblast.report.figures import new_figure, spectrogram, titled

    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(records))
    grid = figure.subplots(len(records), 1, squeeze=False)[:, 0]
    for record, axes in zip(records, grid, strict=True):
        unit, reference = unit_for(record.column, 1.0).symbol, 1.0
        if record.column.endswith("_pa"):  # levels of sound in air: ISO 1683
            unit, reference = "20 µPa", 20e-6
        rate = record.answer.rate_hz
        titled(axes, record.name, record.note)
        spectrogram(axes, record.samples, rate, unit=unit, reference=reference)
        _mark_arrivals(axes, record, colour="white")
    grid[-1].set_xlabel("time by the sensor's clock [s]")
    return figure


def _mark_arrivals(axes: "Axes", record: Drawn, colour: str = "#222222") -> None:
    """Mark the arrivals of the waves of every blast within the axes."""
    low, high = axes.get_xlim()
    for name, style in ARRIVALS.items():
        for arrival in record.arrivals(name):
            if low <= arrival <= high:
                axes.axvline(arrival, color=colour, linewidth=1.0, linestyle=style)
