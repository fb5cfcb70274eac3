"""Files and figures of `jblast listen`."""

import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import jblast
from jblast.files import write_text
from jblast.progress import each
from jblast.report.figure_files import write_drawn
from jblast.report.figures import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.listen import CLOCK, Envelope, SensorRecord, truth_csv
from jblast.report.words import Unit, split_name, unit_for
from jblast.scene import Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.listening import Listening, packets

JSON, TRUTH = "listen.json", "truth.csv"
LONGEST_NAME = 80
"""Largest number of characters of a file name from a sensor's name: file systems allow
255 bytes, and a character has up to three."""
MAX_DRAWN = 8
"""Largest number of sensors in a figure: 18 inches high."""
ROW_INCHES = 2.2
SPAN_DB = 90.0
"""Dynamic range of a spectrogram: about that of 16 bits."""
HEARING_PA = 20e-6
"""Reference of levels of sound in air (ISO 1683)."""
ARRIVALS = {"ground_arrival_s": (VERMILLION, "ground"), "air_arrival_s": (INK, "air")}


def spectrogram_figure(listening: Listening, records: Sequence[SensorRecord]) -> Figure:
    """Draw the power density of each record against time and frequency."""
    drawn = records[:MAX_DRAWN]
    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(drawn))
    grid = figure.subplots(len(drawn), 1, squeeze=False)[:, 0]
    for number, (record, axes) in enumerate(zip(drawn, grid, strict=True)):
        quiet(axes)
        axes.grid(False)
        spectrogram = record.spectrogram
        reference, words = 1.0, f"({unit_for(record.column, 1.0).symbol})²/Hz"
        if record.kind.unit == "pa":
            reference, words = HEARING_PA, "(20 µPa)²/Hz"
        density = spectrogram.density().T
        with np.errstate(divide="ignore"):
            level = 10.0 * np.log10(density / reference**2)
        titled(axes, record.sensor.name, _clipping(record))
        axes.set_ylabel("frequency [Hz]")
        axes.set_yscale("log")
        step = spectrogram.frequency_hz[0]
        edges = step * (0.5 + np.arange(spectrogram.frequency_hz.size + 1))
        axes.set_ylim(step, record.rate_hz / 2)
        log_ticks(axes.yaxis, axes.get_ylim())
        axes.set_xlim(0.0, record.whole.stop / record.rate_hz)
        loudest = float(np.max(level, where=np.isfinite(level), initial=-np.inf))
        if np.isfinite(loudest):
            # the colour of silence, for the ends of the record without a whole window
            axes.set_facecolor(colormaps["cividis"](0.0))
            image = axes.pcolormesh(
                spectrogram.time_s,
                edges,
                np.maximum(level, loudest - SPAN_DB),
                vmin=loudest - SPAN_DB,
                vmax=loudest,
                cmap="cividis",
                rasterized=True,
            )
            bar = figure.colorbar(image, ax=axes, pad=0.01)
            bar.set_label(f"dB re {words}", size=9, color=INK)
            bar.ax.tick_params(labelsize=9, color=MUTED)
            bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]  the stub of a spine lacks its type
        else:
            axes.text(0.5, 0.5, "silent", transform=axes.transAxes, color=MUTED)
        _arrivals(axes, listening, number, light=True)
    grid[-1].set_xlabel("time by the sensor's clock [s]")
    return figure


def waveform_figure(listening: Listening, records: Sequence[SensorRecord]) -> Figure:
    """Draw each record whole, and around its first blast."""
    drawn = records[:MAX_DRAWN]
    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(drawn))
    grid = figure.subplots(len(drawn), 2, squeeze=False, width_ratios=[1.0, 1.0])
    for number, (record, (left, right)) in enumerate(zip(drawn, grid, strict=True)):
        unit = unit_for(record.column, record.largest)
        for axes, envelope in ((left, record.whole), (right, record.near)):
            quiet(axes)
            if envelope is None:
                axes.set_axis_off()
                continue
            _draw(axes, envelope, unit)
            _arrivals(axes, listening, number)
        left.set_ylabel(f"{_words(record)} [{unit.symbol}]")
        titled(left, record.sensor.name, _clipping(record))
    titled(grid[0][1], "Around the arrivals")
    for axes in grid[-1]:
        axes.set_xlabel("time by the sensor's clock [s]")
    _legend(figure)
    return figure


FIGURES: dict[str, Callable[[Listening, Sequence[SensorRecord]], Figure]] = {
    "waveforms.png": waveform_figure,
    "spectrograms.png": spectrogram_figure,
}


Written = Callable[[Iterable[Float[np.ndarray, "sample component"]]], None]
"""Function that writes the packets of a sensor's samples as they arrive."""


def write_tracks(
    listening: Listening,
    directory: Path,
    comments: Sequence[str],
    packets_hz: float | None = None,
) -> list[SensorRecord]:
    """Write the record of every sensor, and the truth behind it, into a directory.

    Args:
        listening: Plan of the records.
        directory: Output directory; created if missing.
        comments: Provenance of the records.
        packets_hz: Packets per second, for constant memory; None: each record at once.

    Raises:
        InputError: A record cannot be made. Earlier ones are kept, and of a broken one
            the part before the error.
        OSError: The directory cannot be written to.
    """
    started = started_tracks(listening, directory, comments)
    for record, write in each(started, "sensors"):
        write(packets(listening, record.sensor, packets_hz))
    records = [record for record, _ in started]
    write_text(directory / TRUTH, truth_csv(listening, records, comments))
    return records


def started_tracks(
    listening: Listening, directory: Path, comments: Sequence[str]
) -> list[tuple[SensorRecord, Written]]:
    """Return the record of every sensor, and the function that writes its file.

    Files of an earlier run are removed.

    Args:
        listening: Plan of the records.
        directory: Output directory; created if missing.
        comments: Provenance of the records.
    """
    directory.mkdir(parents=True, exist_ok=True)
    names = file_names(listening.sensors)
    for name in (JSON, TRUTH, *FIGURES, *names.values()):  # would mislead
        (directory / name).unlink(missing_ok=True)
    started: list[tuple[SensorRecord, Written]] = []
    for sensor in listening.sensors:
        record = SensorRecord(listening, sensor, names[sensor.name])
        place, directions = sensor.position_m, "east, north, up"
        if sensor.mount:
            place = sensor.offset_m
            directions = f"forward, left, up from the middle of the {sensor.mount}"
        at = ", ".join(f"{x:g}" for x in np.asarray(place).tolist())
        own = f"{sensor.kind} {sensor.name!r} at ({at}) m {directions}"
        path = directory / record.file
        started.append((record, partial(record.write, path, comments=[*comments, own])))
    return started


def write_pictures(
    listening: Listening, records: Sequence[SensorRecord], directory: Path
) -> list[str]:
    """Draw the records; return the names of the files.

    A figure that cannot be drawn is left out, with a warning.
    """
    return [
        name
        for name, draw in FIGURES.items()
        if write_drawn(partial(draw, listening, records), directory / name) is not None
    ]


def provenance(listening: Listening, source: str, seed: int) -> list[str]:
    """Return the provenance of the records, for the comments of every table."""
    laws = ", ".join(f"{name} by {law}" for name, law in listening.truth.laws.items())
    return [
        f"SIMULATED, not measured: jblast {jblast.__version__}, {source}, seed {seed}",
        f"laws: {laws}",
        CLOCK,
        *listening.notes,
    ]


def file_names(sensors: Sequence[Sensor]) -> dict[str, str]:
    """Return the file name of each sensor: its name with safe characters only.

    Names are unique even without regard to case, and differ from the other files'.
    """
    taken = {name.lower() for name in (JSON, TRUTH, *FIGURES)}
    names: dict[str, str] = {}
    for sensor in sensors:
        suffix = SENSOR_KINDS[sensor.kind].file
        stem = re.sub(r"[^\w .+-]", "_", sensor.name)[:LONGEST_NAME].strip(" .") or "_"
        name, number = f"{stem}{suffix}", 2
        while name.lower() in taken:
            name, number = f"{stem}_{number}{suffix}", number + 1
        taken.add(name.lower())
        names[sensor.name] = name
    return names


def _draw(axes: Axes, envelope: Envelope, unit: Unit) -> None:
    """Draw smallest and largest sample of each column as a band with outlines."""
    low, high = envelope.low / unit.size, envelope.high / unit.size
    time = envelope.time_s
    axes.fill_between(time, low, high, color=BLUE, alpha=0.35, linewidth=0.0)
    axes.plot(time, low, color=BLUE, linewidth=0.9)
    axes.plot(time, high, color=BLUE, linewidth=0.9)
    axes.set_xlim(envelope.start / envelope.rate_hz, envelope.stop / envelope.rate_hz)


def _arrivals(
    axes: Axes, listening: Listening, number: int, *, light: bool = False
) -> None:
    """Mark the arrivals of the waves of every blast within the axes."""
    low, high = axes.get_xlim()
    for name, (colour, _) in ARRIVALS.items():
        for arrival in listening.truth.values[name][number]:
            if low <= arrival <= high:
                line = (0, (4, 3)) if name == "air_arrival_s" else (0, (1, 1.5))
                axes.axvline(
                    float(arrival),
                    color="white" if light else colour,
                    linewidth=1.0,
                    linestyle=line,
                )


def _legend(figure: Figure) -> None:
    """Add the legend of the two arrival lines below the figure."""
    from matplotlib.lines import Line2D

    lines = [
        Line2D([], [], color=colour, linewidth=1.0, linestyle=style)
        for (colour, _), style in zip(
            ARRIVALS.values(), ((0, (1, 1.5)), (0, (4, 3))), strict=True
        )
    ]
    names = [f"{words} wave arrives" for _, words in ARRIVALS.values()]
    figure.legend(
        lines, names, loc="outside lower center", ncols=2, frameon=False, fontsize=9
    )


def _words(record: SensorRecord) -> str:
    return split_name(record.column)[0].replace("_", " ")


def _clipping(record: SensorRecord) -> str:
    if not record.clipped_samples:
        return record.sensor.kind
    return f"{record.sensor.kind}; {record.clipped_samples:,} samples clipped"
