"""The answer of `jblast listen`: the records of a scene's sensors.

Figures read the finished files, so that writing needs no memory for them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
PICTURES = ("waveforms.png", "spectrograms.png")
"""Files of the figures."""
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
            {quantity: float(of[number, n]) for quantity, of in truth.values.items()}
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
        def cell(row: tuple[str, RecordAnswer]) -> str:
            value = row[1].values.get(name, np.nan)
            return printed_number(name, value) if np.isfinite(value) else "never"

        return Column(head, cell, right=True)

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
    return [
        Picture(
            PICTURES[0],
            partial(waveform_figure, recordings, directory),
            "Waveforms",
            "Whole, and around the first blast. Dashed: arrival of the wave in air; "
            "dotted: in the ground.",
            "Samples of each sensor against time.",
        ),
        Picture(
            PICTURES[1],
            partial(spectrogram_figure, recordings, directory),
            "Spectrograms",
            "Power density by time and frequency.",
            "Power density of each record against time and frequency.",
        ),
    ]


def read_samples(directory: Path, record: Any) -> Float[np.ndarray, " sample"]:
    """Return the samples of a record's file; of a vector its magnitude.

    Args:
        directory: Folder of the file.
        record: Numbers of the record, as `RecordAnswer`.

    Raises:
        InputError: The file is missing or broken.
    """
    path, kind = directory / record.file, SENSOR_KINDS.named(record.kind)
    if kind.file != ".wav":
        table = read_table(path)[list(kind.columns)].to_numpy(np.float32)
        return table[:, 0] if table.shape[1] == 1 else np.linalg.norm(table, axis=1)
    import soundfile

    try:
        samples, _ = soundfile.read(path, dtype="float32", always_2d=True)
    except (OSError, soundfile.LibsndfileError) as error:
        raise InputError(f"{path}: expected sound ({error})") from None
    return samples[:, 0] * (record.full_scale_pa or 1.0)


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


def waveform_figure(recordings: Recordings, directory: Path) -> "Figure":
    """Draw each record whole, and around its first blast."""
    from jblast.report.figures import envelope, new_figure, quiet, titled

    drawn = list(recordings.sensors.items())[:MAX_DRAWN]
    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(drawn))
    grid = figure.subplots(len(drawn), 2, squeeze=False)
    for (name, record), (left, right) in zip(drawn, grid, strict=True):
        column, rate = SENSOR_KINDS[record.kind].column, record.rate_hz
        unit = unit_for(column, *record.largest.values())
        samples = read_samples(directory, record)
        for axes, (start, stop) in (
            (left, (0, samples.size)),
            (right, _near(record, samples.size)),
        ):
            quiet(axes)
            if stop <= start:
                axes.set_axis_off()
                continue
            some = samples[start:stop] / unit.size
            envelope(axes, some, rate, start_s=start / rate)
            _mark_arrivals(axes, record)
        words = split_name(column)[0].replace("_", " ")
        left.set_ylabel(f"{words} [{unit.symbol}]")
        titled(left, name, _note(record))
    titled(grid[0][1], "Around the arrivals")
    for axes in grid[-1]:
        axes.set_xlabel("time by the sensor's clock [s]")
    return figure


def _note(record: RecordAnswer) -> str:
    clipped = record.clipped_samples
    return record.kind + (f"; {clipped:,} samples clipped" if clipped else "")


def _near(record: RecordAnswer, samples: int) -> tuple[int, int]:
    """Return the range of samples around the first blast; empty without one."""
    duration = record.values["positive_duration_s"]
    arrivals = [record.values.get(name, np.nan) for name in ARRIVALS]
    begin, end = np.nanmin([*arrivals, np.inf]), arrivals[-1] + duration
    if not np.isfinite([begin, end]).all():
        return 0, 0
    span = begin - BEFORE * (end - begin), end + AFTER * duration
    start, stop = (int(np.clip(t * record.rate_hz, 0, samples)) for t in span)
    return start, stop


def spectrogram_figure(recordings: Recordings, directory: Path) -> "Figure":
    """Draw the power density of each record against time and frequency."""
    from jblast.report.figures import new_figure, spectrogram, titled

    drawn = list(recordings.sensors.items())[:MAX_DRAWN]
    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(drawn))
    grid = figure.subplots(len(drawn), 1, squeeze=False)[:, 0]
    for (name, record), axes in zip(drawn, grid, strict=True):
        column = SENSOR_KINDS[record.kind].column
        unit, reference = unit_for(column, 1.0).symbol, 1.0
        if column.endswith("_pa"):  # levels of sound in air: ISO 1683
            unit, reference = "20 µPa", 20e-6
        samples = read_samples(directory, record)
        titled(axes, name, _note(record))
        spectrogram(axes, samples, record.rate_hz, unit=unit, reference=reference)
        _mark_arrivals(axes, record, colour="white")
    grid[-1].set_xlabel("time by the sensor's clock [s]")
    return figure


def _mark_arrivals(axes: "Axes", record: RecordAnswer, colour: str = "#222222") -> None:
    """Mark the arrivals of the waves of every blast within the axes."""
    low, high = axes.get_xlim()
    blasts = [one.values for one in (record.blasts or {}).values()] or [record.values]
    for name, style in ARRIVALS.items():
        for arrival in (values.get(name, np.nan) for values in blasts):
            if low <= arrival <= high:
                axes.axvline(arrival, color=colour, linewidth=1.0, linestyle=style)
