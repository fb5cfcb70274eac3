"""Files of `jblast tune --gains --out`: the scene, and figures of both controllers."""

import copy
import tomllib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import jblast
from jblast.report.figures import (
    BLUE,
    INK,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.gains import gains_answer, keys_of_gains
from jblast.report.tune_files import moved, scene_text, write_scene_and_answer
from jblast.study.gains import TunedGains, known_peaks

BEFORE_S, AFTER_S = 0.2, 3.0
"""Drawn interval before and after a blast's arrival [s]: a vehicle recovers in 1 to 2
seconds."""


def gains_figure(tuned: TunedGains) -> Figure:
    """Draw peak deviations after against before, and the path error of one blast."""
    figure = new_figure(10.5, 4.6)
    each, over_time = figure.subplots(1, 2)
    draw_each(each, tuned)
    draw_middle(over_time, tuned)
    titled(
        each,
        f"{tuned.vehicle.model.capitalize()}: {tuned.settings.unseen} unseen blasts",
        f"{cut_words(tuned)}; cross: does not fly on",
    )
    titled(over_time, "Example", "the blast with the median peak before tuning")
    return figure


def cut_words(tuned: TunedGains) -> str:
    """Return the change of the median peak deviation, as text."""
    cut = tuned.cut()
    return f"median {100 * abs(cut):.0f} % {'less' if cut >= 0 else 'more'}"


def draw_each(axes: Axes, tuned: TunedGains) -> None:
    """Draw the peak deviation of each unseen blast, after against before."""
    before, after = known_peaks(tuned.before), known_peaks(tuned.after)
    # infinite peaks have no place on the axes
    both = np.isfinite(before) & np.isfinite(after)
    on = both & tuned.before.outcomes.flies_on & tuned.after.outcomes.flies_on
    axes.plot(before[on], after[on], ".", color=BLUE, markersize=5, alpha=0.6)
    off = both & ~on
    axes.plot(before[off], after[off], "x", color=VERMILLION, markersize=5)
    known = np.concatenate([before[both], after[both]])
    # one range for both axes, so that no change is the diagonal
    ends = np.array([0.8 * known.min(), 1.25 * known.max()])
    axes.plot(ends, ends, color=INK, linewidth=0.9)
    axes.plot(ends, 0.8 * ends, color=INK, linewidth=0.9, linestyle=(0, (3, 3)))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(*ends)
    axes.set_ylim(*ends)
    for axis in (axes.xaxis, axes.yaxis):
        log_ticks(axis, tuple(ends))
    axes.set_xlabel("peak deviation before [m]")
    axes.set_ylabel("after [m]; dashed: 20 % less")
    quiet(axes)


def draw_middle(axes: Axes, tuned: TunedGains) -> None:
    """Draw the path error over time for the median blast, before and after tuning."""
    peaks = known_peaks(tuned.before)
    # one blast, not the median over blasts at each time, which no vehicle flew
    middle = int(np.argsort(peaks)[peaks.size // 2])
    for tried, colour, label in (
        (tuned.before, VERMILLION, "before"),
        (tuned.after, BLUE, "after"),
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


def write_gains(tuned: TunedGains, directory: Path, scene: str) -> tuple[str, ...]:
    """Write tuned gains into a directory; return the names of the files.

    A figure that cannot be drawn is left out, with a warning.

    Args:
        tuned: The tuned gains.
        directory: Output directory; created if missing.
        scene: File of the scene, which is read again.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    document = moved(tomllib.loads(Path(scene).read_text("utf-8")), scene, directory)
    comment = f"gains tuned by jblast {jblast.__version__} to the blasts of this scene"
    text = scene_text(with_gains(document, tuned), [comment])
    return write_scene_and_answer(
        directory,
        text,
        partial(gains_figure, tuned),
        partial(gains_answer, tuned, scene),
    )


def with_gains(document: dict[str, Any], tuned: TunedGains) -> dict[str, Any]:
    """Return the tables of a scene with the tuned gains."""
    changed = copy.deepcopy(document)
    control = changed["vehicle"].setdefault("control", {})
    found = keys_of_gains(tuned.after.gains)
    control["integral"] = "ki_pos" in found
    for key, value in found.items():
        control[key] = list(value) if isinstance(value, tuple) else value
    return changed
