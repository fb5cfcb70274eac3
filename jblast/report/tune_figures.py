"""Figures of `jblast tune`: a record with its predictions, and tuned gains."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.sound import SoundEvidence
from jblast.inference.tuning.tune_sight import EventsEvidence, FramesEvidence, camera_of
from jblast.report.colours import BLUE, INK, VERMILLION
from jblast.report.figures import log_ticks, new_figure, quiet, titled
from jblast.report.tune import cut_words
from jblast.study.gains import TunedGains, known_peaks

GREY = "#b0b0b0"
COLOURS = (VERMILLION, BLUE)
NAMES = ("expected before", "expected after")
"""Of predictions before and after tuning."""
BEFORE_PART, AFTER_PART = 0.5, 3.0
"""Drawn interval before and after the blast's first energy, in units of the time in
which 98 % of its energy arrives."""


class Curves(NamedTuple):
    """Curves over time.

    Attributes:
        time: Times.
        record: The record.
        expected: Its predictions before and after tuning.
        residuals: Their residuals.
        labels: Labels of time, record and residual.
    """

    time: Float[np.ndarray, " row"]
    record: Float[np.ndarray, " row"]
    expected: list[Float[np.ndarray, " row"]]
    residuals: list[Float[np.ndarray, " row"]]
    labels: tuple[str, str, str]


def tune_figure(tuned: Tuned) -> Figure:
    """Draw a record, its prediction before and after tuning, and the residuals.

    At the right are the noise of a sound, the residual of a film's brightest frame, or
    the distribution of the residuals of events.
    """
    evidence = tuned.problem.evidence
    figure = new_figure(11.0, 6.8)
    panels = figure.subplot_mosaic(
        [["record", "right"], ["residual", "right"]], width_ratios=[1.5, 1.0]
    )
    above, below, right = panels["record"], panels["residual"], panels["right"]
    style: dict[str, Any] = {}
    if isinstance(evidence, SoundEvidence):
        drawn = _sound(tuned, evidence, right)
    elif isinstance(evidence, FramesEvidence):
        drawn = _frames(tuned, evidence, right)
    else:
        drawn = _events(tuned, evidence, right)
        style = {"linestyle": "", "marker": ".", "markersize": 2.0}
    time = drawn.time
    above.plot(time, drawn.record, color=GREY, linewidth=4.0, label="record", **style)
    for axes, curves in ((above, drawn.expected), (below, drawn.residuals)):
        for curve, colour, name in zip(curves, COLOURS, NAMES, strict=True):
            axes.plot(time, curve, color=colour, linewidth=1.2, label=name, **style)
        axes.set_xlim(time[0], time[-1])
        quiet(axes)
    label, above_label, below_label = drawn.labels
    above.set_ylabel(above_label)
    below.set(xlabel=label, ylabel=below_label)
    titled(above, "Record and predictions")
    titled(below, "Residuals", "record minus expected")
    place: dict[str, Any] = {"loc": "outside lower left", "ncols": 3, "frameon": False}
    figure.legend(*above.get_legend_handles_labels(), fontsize=9, **place)
    return figure


def _sound(tuned: Tuned, evidence: SoundEvidence, right: Axes) -> Curves:
    scenes = (tuned.before, tuned.scene)
    units = [float(evidence.unit(scene)) for scene in scenes]
    record = units[1] * np.asarray(evidence.samples)
    expected = [
        unit * np.asarray(evidence.predicted(scene))
        for unit, scene in zip(units, scenes, strict=True)
    ]
    instrument = tuned.scene.sensors[evidence.index].instrument
    assert instrument is not None
    near = _near(expected[1], record.size)
    for scene, colour in zip(scenes, COLOURS, strict=True):
        noise = evidence.band_densities(evidence.noise(scene), scene, instrument.rate)
        right.plot(noise[0], _decibels(noise[1]), color=colour)
    power = evidence.weights(tuned.scene).power
    middle, density = evidence.band_densities(power, tuned.scene, instrument.rate)
    right.plot(middle, _decibels(density), "o", color=GREY, markersize=5.0, zorder=1)
    right.set(xscale="log", xlabel="frequency [Hz]", ylabel="dB re (20 µPa)²/Hz")
    right.set_xlim(middle[0], middle[-1])
    log_ticks(right.xaxis, right.get_xlim())
    titled(right, "Noise", "grey: power of the residual")
    quiet(right)
    return Curves(
        np.arange(record.size)[near] / instrument.rate,
        record[near],
        [one[near] for one in expected],
        [(record - one)[near] for one in expected],
        ("time by the sensor's clock [s]", "overpressure [Pa]", "residual [Pa]"),
    )


def _near(expected: Float[np.ndarray, " sample"], count: int) -> slice:
    """Return the samples around the expected blast; all samples without one."""
    energy = np.cumsum(np.square(expected))
    if not energy[-1] > 0:
        return slice(0, count)
    # the last 2 % of the energy arrive in a long, flat tail
    first, last = np.searchsorted(energy, np.array([1e-4, 0.98]) * energy[-1])
    # a pulse of a few samples needs some more around it to be seen
    length = max(int(last - first), 32)
    start = max(int(first - BEFORE_PART * length), 0)
    return slice(start, min(int(first + AFTER_PART * length), count))


def _decibels(density: Float[np.ndarray, " band"]) -> Float[np.ndarray, " band"]:
    # 20 uPa is the reference pressure of sound levels in air (ISO 1683)
    return 10.0 * np.log10(density / (20e-6) ** 2)


def _frames(tuned: Tuned, evidence: FramesEvidence, right: Axes) -> Curves:
    seen = np.asarray(evidence.values)
    expected = [np.asarray(evidence.predicted(s)) for s in (tuned.before, tuned.scene)]
    times, camera = 1e3 * np.asarray(evidence.times), camera_of(tuned.scene)
    brightest = int(seen.mean(axis=1).argmax())
    rest = (seen - expected[1])[brightest]
    most = max(float(np.abs(rest).max()), 1.0)
    image = np.full(camera.height * camera.width, np.nan)
    image[np.asarray(evidence.pixels)] = rest
    # symmetric about 0, so that no residual is white
    limits = {"cmap": "RdBu", "vmin": -most, "vmax": most}
    right.imshow(image.reshape(camera.height, camera.width), **limits)
    # unused pixels have a colour that no residual has
    right.set_facecolor(GREY)
    right.set(xticks=[], yticks=[])
    at = f"at {times[brightest]:.3g} ms, ±{most:.2g} grey values"
    titled(right, "Residual of the brightest frame", at)
    return Curves(
        times,
        seen.mean(axis=1),
        [one.mean(axis=1) for one in expected],
        [np.sqrt(np.square(seen - one).mean(axis=1)) for one in expected],
        ("time [ms]", "mean grey value", "rms over the pixels"),
    )


def _events(tuned: Tuned, evidence: EventsEvidence, right: Axes) -> Curves:
    scenes = (tuned.before, tuned.scene)
    rests = [np.clip(np.asarray(evidence.left(s)), -1.0, 1.0) for s in scenes]
    brighter, darker = np.asarray(camera_of(tuned.scene).threshold)
    limit = 2.5 * max(brighter, darker)
    for rest, colour in zip(rests, COLOURS, strict=True):
        right.hist(rest, np.linspace(-1.0, 1.0, 81).tolist(), color=colour, alpha=0.6)
    right.set(xlabel="residual [thresholds]", ylabel="events")
    titled(right, "Residuals", f"{rests[0].size:,} events")
    quiet(right)
    return Curves(
        1e3 * np.asarray(evidence.events.time),
        np.where(np.asarray(evidence.events.sign) > 0, brighter, -darker),
        [np.clip(np.asarray(evidence.changes(s)), -limit, limit) for s in scenes],
        rests,
        ("time [ms]", "change of ln of light", "thresholds, at most 1"),
    )


def gains_figure(tuned: TunedGains) -> Figure:
    """Draw the peak deviation of each unseen blast, after against before."""
    figure = new_figure(6.4, 5.8)
    draw_gains(figure.subplots(), tuned)
    return figure


def draw_gains(axes: Axes, tuned: TunedGains) -> None:
    """Draw the peak deviation of each unseen blast, after against before."""
    peaks = np.stack([known_peaks(one) for one in (tuned.before, tuned.after)])
    # infinite peaks, and 0 without an effect, have no place on the axes
    peaks = peaks[:, (np.isfinite(peaks) & (peaks > 0)).all(axis=0)]
    axes.plot(*peaks, ".", color=BLUE, markersize=5, alpha=0.6)
    # one range for both axes, so that no change is the diagonal
    low, high = (peaks.min(), peaks.max()) if peaks.size else (1.0, 1.0)
    ends = (0.8 * low, 1.25 * high)
    axes.plot(ends, ends, color=INK, linewidth=0.9)
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    for axis in (axes.xaxis, axes.yaxis):
        log_ticks(axis, ends)
    axes.set(xlabel="peak deviation before [m]", ylabel="after [m]")
    model, unseen = tuned.vehicle.model.capitalize(), tuned.settings.unseen
    titled(axes, f"{model}: {unseen} unseen blasts", cut_words(tuned))
    quiet(axes)
