"""Pictures of a record, what was expected of it before and after, and what is left."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.sight import FramesEvidence
from jblast.inference.tuning.sound import SoundEvidence
from jblast.report.figure_style import (
    BLUE,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)

GREY = "#b0b0b0"
BEFORE_PART, AFTER_PART = 0.5, 3.0
"""What is drawn about the blast: of the time in which half of its energy comes."""


def tune_figure(tuned: Tuned) -> Figure:
    """Draw a record, its prediction before and after, and what is left."""
    evidence = tuned.problem.evidence
    if isinstance(evidence, SoundEvidence):
        return sound_figure(tuned, evidence)
    from jblast.report.tune.sight_figure import events_figure, frames_figure

    if isinstance(evidence, FramesEvidence):
        return frames_figure(tuned, evidence)
    return events_figure(tuned, evidence)


def sound_figure(tuned: Tuned, evidence: SoundEvidence) -> Figure:
    """Draw the wave form about the blast, the spectrum, and what is left over time."""
    before, after = tuned.before, tuned.scene
    unit = float(evidence.unit(after))
    record = unit * np.asarray(evidence.samples)
    expected = [
        float(evidence.unit(scene)) * np.asarray(evidence.predicted(scene))
        for scene in (before, after)
    ]
    instrument = after.sensors[evidence.index].instrument
    assert instrument is not None
    rate = instrument.rate
    figure = new_figure(11.0, 7.6)
    (wave, spectrum), (left, rest) = figure.subplots(2, 2)
    near = _near(expected[1], record.size)
    time = np.arange(record.size) / rate
    scale, symbol = (1e-3, "kPa") if np.abs(record[near]).max() > 2e3 else (1.0, "Pa")
    drawn = (
        (record, GREY, 3.0),
        (expected[0], VERMILLION, 1.0),
        (expected[1], BLUE, 1.2),
    )
    for samples, colour, width in drawn:
        wave.plot(time[near], scale * samples[near], color=colour, linewidth=width)
    titled(wave, "The blast", "record, expected before and after")
    for samples, colour in zip(expected, (VERMILLION, BLUE), strict=True):
        left.plot(
            time[near], scale * (record - samples)[near], color=colour, linewidth=0.9
        )
    titled(left, "What is left", "record less expected")
    for axes in (wave, left):
        axes.set_ylabel(f"overpressure [{symbol}]")
        axes.set_xlabel("time by the sensor's clock [s]")
        axes.set_xlim(time[near][0], time[near][-1])
    _spectra(spectrum, evidence, tuned, rate)
    white = np.asarray(evidence.time_residuals(after))
    _envelope(rest, time, white)
    titled(rest, "What is left of the whole record", "over the noise, in its sd")
    rest.set_xlabel("time by the sensor's clock [s]")
    for axes in (wave, spectrum, left, rest):
        quiet(axes)
    _legend(figure)
    return figure


def _near(expected: Float[np.ndarray, " sample"], count: int) -> slice:
    """Return where most of what is expected comes; all of it where nothing is."""
    energy = np.cumsum(np.square(expected))
    if not energy[-1] > 0:
        return slice(0, count)
    first, last = np.searchsorted(energy, np.array([1e-4, 0.98]) * energy[-1])
    length = max(int(last - first), 32)
    start = max(int(first - BEFORE_PART * length), 0)
    return slice(start, min(int(first + AFTER_PART * length), count))


def _spectra(axes: Axes, evidence: SoundEvidence, tuned: Tuned, rate: float) -> None:
    """Draw the powers of what is left, and the noise before and after."""
    bands, scale = np.asarray(evidence.bands), np.asarray(evidence.counts)
    frequency = np.linspace(0.0, 0.5 * rate, bands.size)
    middle = np.array(
        [np.exp(np.log(frequency[bands == one]).mean()) for one in range(scale.size)]
    )
    used = bands >= 0
    power = np.asarray(evidence.weights(tuned.scene).power)
    unit = float(evidence.unit(tuned.scene))
    weight = float(np.square(np.asarray(evidence._taper())).sum()) * 0.5 * rate

    def level(values: Any, one: float) -> Float[np.ndarray, " band"]:
        total = np.bincount(bands[used], np.asarray(values)[used], scale.size)
        return 10.0 * np.log10(one**2 * total / scale / weight / (20e-6) ** 2)

    axes.plot(middle, level(power, unit), "o", color=GREY, markersize=5.0)
    for scene, colour in ((tuned.before, VERMILLION), (tuned.scene, BLUE)):
        one = float(evidence.unit(scene))
        axes.plot(
            middle, level(evidence.noise(scene), one), color=colour, linewidth=1.2
        )
    axes.set_xscale("log")
    axes.set_xlim(middle[0], middle[-1])
    log_ticks(axes.xaxis, axes.get_xlim())
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("dB re (20 µPa)²/Hz")
    titled(axes, "Noise", "powers of what is left, expected before and after")


def _envelope(
    axes: Axes,
    time: Float[np.ndarray, " sample"],
    white: Float[np.ndarray, " sample"],
) -> None:
    """Draw the smallest and largest of many samples."""
    columns = min(white.size, 800)
    edges = np.linspace(0, white.size, columns + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(white, edges), np.maximum.reduceat(white, edges)
    axes.fill_between(time[edges], low, high, color=BLUE, alpha=0.5, linewidth=0.0)
    axes.set_xlim(0.0, float(time[-1]))
    axes.set_ylabel("standard deviations")


def _legend(figure: Figure) -> None:
    from matplotlib.lines import Line2D

    names = {"record": GREY, "expected before": VERMILLION, "after": BLUE}
    lines = [Line2D([], [], color=colour, linewidth=2.0) for colour in names.values()]
    figure.legend(
        lines,
        [*names],
        loc="outside lower center",
        ncols=3,
        frameon=False,
        fontsize=9,
    )
