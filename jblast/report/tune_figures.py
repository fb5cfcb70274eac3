"""Figures of `jblast tune`: a record with its predictions, and tuned gains."""

from typing import Any

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


Curves = tuple[np.ndarray, np.ndarray, list[np.ndarray], list[np.ndarray], tuple]
"""Times, record, predictions, residuals, and labels of time, record and residual."""


def tune_figure(tuned: Tuned) -> Figure:
    """Draw a record, its prediction before and after tuning, and the residuals.

    At the right are the noise of a sound, the brightest frame of a film, or the
    distributions of events.
    """
    evidence = tuned.problem.evidence
    figure = new_figure(11.0, 6.8)
    (above, right), (below, under) = figure.subplots(2, 2, width_ratios=[1.5, 1.0])
    style: dict[str, Any] = {}
    if isinstance(evidence, SoundEvidence):
        curves = _sound(tuned, evidence, right, under)
    elif isinstance(evidence, FramesEvidence):
        curves = _frames(tuned, evidence, right, under)
    else:
        curves = _events(tuned, evidence, right, under)
        style = {"linestyle": "", "marker": ".", "markersize": 2.0}
    time, record, expected, residuals, labels = curves
    above.plot(time, record, color=GREY, linewidth=4.0, label="record", **style)
    names = ("expected before", "expected after")
    for *values, colour, name in zip(expected, residuals, COLOURS, names, strict=True):
        for axes, curve in zip((above, below), values, strict=True):
            axes.plot(time, curve, color=colour, linewidth=1.2, label=name, **style)
    for axes, label in zip((below, above), labels[1:][::-1], strict=True):
        axes.set_ylabel(label)
        axes.set_xlim(time[0], time[-1])
        quiet(axes)
    below.set_xlabel(labels[0])
    titled(above, "Record and predictions")
    titled(below, "Residuals", "record minus expected")
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
    envelope(under, np.asarray(evidence.time_residuals(tuned.scene)), instrument.rate)
    under.set_xlabel("time by the sensor's clock [s]")
    titled(under, "Whole record", "residual in standard deviations")
    quiet(under)
    label = f"overpressure [{symbol}]"
    return (
        np.arange(record.size)[near] / instrument.rate,
        scale * record[near],
        [scale * one[near] for one in expected],
        [scale * (record - one)[near] for one in expected],
        ("time by the sensor's clock [s]", label, label),
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
    return (
        times,
        seen.mean(axis=1),
        [one.mean(axis=1) for one in expected],
        [np.sqrt(np.square(seen - one).mean(axis=1)) for one in expected],
        ("time [ms]", "mean grey value", "rms over the pixels"),
    )


def _events(tuned: Tuned, evidence: EventsEvidence, right: Axes, under: Axes) -> Curves:
    scenes = (tuned.before, tuned.scene)
    changes = [np.asarray(evidence.changes(scene)) for scene in scenes]
    rests = [np.clip(np.asarray(evidence.left(s)), -1.0, 1.0) for s in scenes]
    brighter, darker = np.asarray(camera_of(tuned.scene).threshold)
    limit = 2.5 * max(brighter, darker)
    for axes, values, bins, title in (
        (right, changes, np.linspace(-limit, limit, 161).tolist(), "Changes"),
        (under, rests, np.linspace(-1.0, 1.0, 81).tolist(), "Residuals"),
    ):
        for one, colour in zip(values, COLOURS, strict=True):
            axes.hist(one, bins, color=colour, alpha=0.6)
        titled(axes, title, f"{changes[0].size:,} events")
        quiet(axes)
    return (
        1e3 * np.asarray(evidence.events.time),
        np.where(np.asarray(evidence.events.sign) > 0, brighter, -darker),
        [np.clip(one, -limit, limit) for one in changes],
        rests,
        ("time [ms]", "change of ln of light", "thresholds, at most 1"),
    )


def gains_figure(tuned: TunedGains) -> Figure:
    """Draw the peak deviation of each unseen blast, after against before."""
    figure = new_figure(6.4, 5.8)
    axes = figure.subplots()
    draw_each(axes, tuned)
    model, unseen = tuned.vehicle.model.capitalize(), tuned.settings.unseen
    note = f"{cut_words(tuned)}; cross: does not fly on"
    titled(axes, f"{model}: {unseen} unseen blasts", note)
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
