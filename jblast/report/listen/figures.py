"""Pictures of records: the wave form, whole and around the arrivals; the spectrum."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.listen.overview import Envelope
from jblast.report.listen.sensor_record import SensorRecord
from jblast.report.numbers import Unit, unit_for
from jblast.report.words import split_name
from jblast.sensors.listening.plan import Listening

MOST_DRAWN = 8
"""Sensors in a picture."""
ROW_INCHES = 2.2
SPAN_DB = 90.0
"""What a spectrogram shows below its loudest tone."""
REFERENCE = {"_pa": (20e-6, "(20 µPa)²/Hz"), "_m_s": (1.0, "(m/s)²/Hz")}
"""What power densities are told against, by unit."""
ARRIVALS = {"ground_arrival_s": (VERMILLION, "ground"), "air_arrival_s": (INK, "air")}


def waveform_figure(listening: Listening, records: Sequence[SensorRecord]) -> Figure:
    """Draw each record whole, and around the first blast that comes."""
    drawn = records[:MOST_DRAWN]
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


def spectrogram_figure(listening: Listening, records: Sequence[SensorRecord]) -> Figure:
    """Draw the power density of each record against time and frequency."""
    drawn = records[:MOST_DRAWN]
    figure = new_figure(11.0, 0.8 + ROW_INCHES * len(drawn))
    grid = figure.subplots(len(drawn), 1, squeeze=False)[:, 0]
    for number, (record, axes) in enumerate(zip(drawn, grid, strict=True)):
        quiet(axes)
        axes.grid(False)
        spectrogram = record.spectrogram
        reference, words = REFERENCE[split_name(record.column)[1]]
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
            axes.set_facecolor(colormaps["cividis"](0.0))  # where no window fits
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
            bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]  a spine, whose stub says it is called
        else:
            axes.text(0.5, 0.5, "silent", transform=axes.transAxes, color=MUTED)
        _arrivals(axes, listening, number, light=True)
    grid[-1].set_xlabel("time by the sensor's clock [s]")
    return figure


def _draw(axes: Axes, envelope: Envelope, unit: Unit) -> None:
    """Draw smallest and largest sample of each column as a band with an edge."""
    low, high = envelope.low / unit.size, envelope.high / unit.size
    time = envelope.time_s
    axes.fill_between(time, low, high, color=BLUE, alpha=0.35, linewidth=0.0)
    axes.plot(time, low, color=BLUE, linewidth=0.9)
    axes.plot(time, high, color=BLUE, linewidth=0.9)
    axes.set_xlim(envelope.start / envelope.rate_hz, envelope.stop / envelope.rate_hz)


def _arrivals(
    axes: Axes, listening: Listening, number: int, *, light: bool = False
) -> None:
    """Mark when the waves of every blast arrive, where that is in the picture."""
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
    """Say beside the pictures what the two lines are."""
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
