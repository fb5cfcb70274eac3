"""Figures of `jblast tune`: a record with its predictions, and tuned gains."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.sound import SoundEvidence
from jblast.inference.tuning.tune_sight import EventsEvidence, FramesEvidence, camera_of
from jblast.report.figures import (
    BLUE,
    INK,
    VERMILLION,
    envelope,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.study.gains import TunedGains, known_peaks

GREY = "#b0b0b0"
COLOURS = (VERMILLION, BLUE)
"""Of predictions before and after tuning."""
BEFORE_PART, AFTER_PART = 0.5, 3.0
"""Drawn interval before and after the blast's first energy, in units of the time in
which 98 % of its energy arrives."""
BEFORE_S, AFTER_S = 0.2, 3.0
"""Drawn interval before and after a blast's arrival [s]: a vehicle recovers in 1 to 2
seconds."""


class Curves(NamedTuple):
    """A record over time with two predictions and their residuals, before and after.

    Attributes:
        time: Times, in the unit of their label.
        record: The record.
        expected: The predictions.
        residuals: The residuals.
        labels: Labels of time, record and residuals.
        style: Style of the curves.
    """

    time: np.ndarray
    record: np.ndarray
    expected: list[np.ndarray]
    residuals: list[np.ndarray]
    labels: tuple[str, str, str]
    style: dict[str, Any]


def tune_figure(tuned: Tuned) -> Figure:
    """Draw a record, its prediction before and after tuning, and the residuals.

    At the right is what the kind of record shows beside: the noise of a sound, the
    brightest frame of a film, the distributions of events.
    """
    evidence = tuned.problem.evidence
    figure = new_figure(11.0, 6.8)
    (above, right), (below, under) = figure.subplots(2, 2, width_ratios=[1.5, 1.0])
    if isinstance(evidence, SoundEvidence):
        curves = _sound(tuned, evidence, right, under)
    elif isinstance(evidence, FramesEvidence):
        curves = _frames(tuned, evidence, right, under)
    else:
        curves = _events(tuned, evidence, right, under)
    when, what, rest = curves.labels
    style = {"color": GREY, "linewidth": 4.0, **curves.style}
    above.plot(curves.time, curves.record, label="record", **style)
    labels = ("expected before", "expected after")
    for expected, residual, colour, label in zip(
        curves.expected, curves.residuals, COLOURS, labels, strict=True
    ):
        style = {"color": colour, "linewidth": 1.2, **curves.style, "label": label}
        above.plot(curves.time, expected, **style)
        below.plot(curves.time, residual, **style)
    above.set_ylabel(what)
    below.set_ylabel(rest)
    below.set_xlabel(when)
    titled(above, "Record and predictions")
    titled(below, "Residuals", "record minus expected")
    for axes in (above, below):
        axes.set_xlim(curves.time[0], curves.time[-1])
        quiet(axes)
    place = {"loc": "outside lower left", "ncols": 3, "frameon": False}
    figure.legend(*above.get_legend_handles_labels(), fontsize=9, **place)
    return figure


def _sound(tuned: Tuned, evidence: SoundEvidence, right: Axes, under: Axes) -> Curves:
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
    # a near blast has tens of kPa, and far ones a few Pa
    scale, symbol = (1e-3, "kPa") if np.abs(record[near]).max() > 2e3 else (1.0, "Pa")
    _spectra(right, evidence, tuned, instrument.rate)
    envelope(under, np.asarray(evidence.time_residuals(tuned.scene)), instrument.rate)
    under.set_xlabel("time by the sensor's clock [s]")
    titled(under, "Whole record", "residual in standard deviations")
    quiet(under)
    return Curves(
        np.arange(record.size)[near] / instrument.rate,
        scale * record[near],
        [scale * one[near] for one in expected],
        [scale * (record - one)[near] for one in expected],
        (
            "time by the sensor's clock [s]",
            *[f"overpressure [{symbol}]"] * 2,
        ),
        {},
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


def _spectra(axes: Axes, evidence: SoundEvidence, tuned: Tuned, rate: float) -> None:
    """Draw the power of the residuals, and the noise before and after tuning."""
    bands, scale = np.asarray(evidence.bands), np.asarray(evidence.counts)
    frequency = np.linspace(0.0, 0.5 * rate, bands.size)
    middle = np.array(
        [np.exp(np.log(frequency[bands == one]).mean()) for one in range(scale.size)]
    )
    used = bands >= 0
    # one-sided density: 2 |X|^2 over the sample rate and the energy of the taper
    weight = float(np.square(np.asarray(evidence._taper())).sum()) * 0.5 * rate

    def level(values: Any, scene: Any) -> Float[np.ndarray, " band"]:
        power = float(evidence.unit(scene)) ** 2 * np.asarray(values)[used]
        total = np.bincount(bands[used], power, scale.size)
        return 10.0 * np.log10(total / scale / weight / (20e-6) ** 2)

    power = level(evidence.weights(tuned.scene).power, tuned.scene)
    axes.plot(middle, power, "o", color=GREY, markersize=5.0)
    for scene, colour in zip((tuned.before, tuned.scene), COLOURS, strict=True):
        axes.plot(middle, level(evidence.noise(scene), scene), color=colour)
    axes.set_xscale("log")
    axes.set_xlim(middle[0], middle[-1])
    log_ticks(axes.xaxis, axes.get_xlim())
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("dB re (20 µPa)²/Hz")
    titled(axes, "Noise", "grey: power of the residual")
    quiet(axes)


def _frames(tuned: Tuned, evidence: FramesEvidence, right: Axes, under: Axes) -> Curves:
    seen = np.asarray(evidence.values)
    expected = [np.asarray(evidence.predicted(s)) for s in (tuned.before, tuned.scene)]
    times, camera = 1e3 * np.asarray(evidence.times), camera_of(tuned.scene)
    brightest = int(seen.mean(axis=1).argmax())
    rest = (seen - expected[1])[brightest]
    most = max(float(np.abs(rest).max()), 1.0)
    at = f"{times[brightest]:.3g} ms"
    for axes, values, title, note, style in (
        (
            right,
            seen[brightest],
            "Brightest frame",
            at,
            {"cmap": "gray", "vmax": 255.0},
        ),
        # symmetric about 0, so that no residual is white
        (
            under,
            rest,
            "Its residual after",
            f"±{most:.2g}",
            {"cmap": "RdBu", "vmax": most},
        ),
    ):
        image = np.full(camera.height * camera.width, np.nan)
        image[np.asarray(evidence.pixels)] = values
        low = 0.0 if axes is right else -most
        axes.imshow(image.reshape(camera.height, camera.width), vmin=low, **style)
        # unused pixels have a colour that no grey frame contains
        axes.set_facecolor("#fbb4ae")
        axes.set_xticks([])
        axes.set_yticks([])
        titled(axes, title, note)
    return Curves(
        times,
        seen.mean(axis=1),
        [one.mean(axis=1) for one in expected],
        [np.sqrt(np.square(seen - one).mean(axis=1)) for one in expected],
        ("time [ms]", "mean grey value", "rms over the pixels"),
        {},
    )


def _events(tuned: Tuned, evidence: EventsEvidence, right: Axes, under: Axes) -> Curves:
    scenes = (tuned.before, tuned.scene)
    changes = [np.asarray(evidence.changes(scene)) for scene in scenes]
    rests = [np.clip(np.asarray(evidence.left(s)), -1.0, 1.0) for s in scenes]
    brighter, darker = np.asarray(camera_of(tuned.scene).threshold)
    limit = 2.5 * max(brighter, darker)
    for axes, values, bins, title in (
        (right, changes, np.linspace(-limit, limit, 161), "Changes"),
        (under, rests, np.linspace(-1.0, 1.0, 81), "Residuals"),
    ):
        for one, colour in zip(values, COLOURS, strict=True):
            axes.hist(one, bins, color=colour, alpha=0.6)
        titled(axes, title, f"{changes[0].size:,} events")
        quiet(axes)
    return Curves(
        1e3 * np.asarray(evidence.events.time),
        np.where(np.asarray(evidence.events.sign) > 0, brighter, -darker),
        [np.clip(one, -limit, limit) for one in changes],
        rests,
        ("time [ms]", "change of ln of light", "thresholds, at most 1"),
        {"linestyle": "", "marker": ".", "markersize": 2.0},
    )


def gains_figure(tuned: TunedGains) -> Figure:
    """Draw peak deviations after against before, and the path error of one blast."""
    figure = new_figure(10.5, 4.6)
    each, over_time = figure.subplots(1, 2)
    draw_each(each, tuned)
    draw_middle(over_time, tuned)
    model, unseen = tuned.vehicle.model.capitalize(), tuned.settings.unseen
    note = f"{cut_words(tuned)}; cross: does not fly on"
    titled(each, f"{model}: {unseen} unseen blasts", note)
    titled(over_time, "Example", "the blast with the median peak before tuning")
    return figure


def cut_words(tuned: TunedGains) -> str:
    """Return the change of the median peak deviation, as text."""
    cut = tuned.cut()
    if not np.isfinite(cut):
        return "median peak deviation not comparable"
    return f"median {100 * abs(cut):.0f} % {'less' if cut >= 0 else 'more'}"


def draw_each(axes: Axes, tuned: TunedGains) -> None:
    """Draw the peak deviation of each unseen blast, after against before."""
    before, after = known_peaks(tuned.before), known_peaks(tuned.after)
    # infinite peaks, and 0 without an effect, have no place on the axes
    both = np.isfinite(before) & np.isfinite(after) & (before > 0) & (after > 0)
    on = both & tuned.before.outcomes.flies_on & tuned.after.outcomes.flies_on
    axes.plot(before[on], after[on], ".", color=BLUE, markersize=5, alpha=0.6)
    off = both & ~on
    axes.plot(before[off], after[off], "x", color=VERMILLION, markersize=5)
    known = np.concatenate([before[both], after[both], [1.0] * (not both.any())])
    # one range for both axes, so that no change is the diagonal
    ends = np.array([0.8 * known.min(), 1.25 * known.max()])
    axes.plot(ends, ends, color=INK, linewidth=0.9)
    axes.plot(ends, 0.8 * ends, color=INK, linewidth=0.9, linestyle=(0, (3, 3)))
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    for axis in (axes.xaxis, axes.yaxis):
        log_ticks(axis, ends)
    axes.set_xlabel("peak deviation before [m]")
    axes.set_ylabel("after [m]; dashed: 20 % less")
    quiet(axes)


def draw_middle(axes: Axes, tuned: TunedGains) -> None:
    """Draw the path error over time for the median blast, before and after tuning."""
    peaks = known_peaks(tuned.before)
    # one blast, not the median over blasts at each time, which no vehicle flew
    middle = int(np.argsort(peaks)[peaks.size // 2])
    for tried, colour, label in zip(
        (tuned.before, tuned.after), COLOURS, ("before", "after"), strict=True
    ):
        outcomes = tried.outcomes
        error, time = outcomes.error_m[middle], outcomes.time_s
        # the arrival is not stored: it is the time of the peak minus the peak time
        peak = time[np.nanargmax(np.where(time > 0, error, 0.0))]
        since = peak - float(np.asarray(outcomes.metrics.peak_time_s)[middle])
        axes.plot(time - since, error, color=colour, linewidth=1.6, label=label)
    axes.set_xlim(-BEFORE_S, AFTER_S)
    axes.set_ylim(0.0, None)
    axes.set_xlabel("time after the blast's arrival [s]")
    axes.set_ylabel("path error [m]")
    axes.legend(frameon=False, fontsize=9)
    quiet(axes)
