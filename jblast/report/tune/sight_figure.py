"""Pictures of what a camera saw, what was expected before and after, what is left."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.sight import EventsEvidence, FramesEvidence, camera_of
from jblast.report.figure_style import (
    BLUE,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)

GREY = "#b0b0b0"
SHOWN = 4
"""Frames in the picture."""


def frames_figure(tuned: Tuned, evidence: FramesEvidence) -> Figure:
    """Draw some frames, what is left of them before and after, and their means."""
    camera = camera_of(tuned.scene)
    size = camera.height, camera.width
    seen = np.asarray(evidence.values)
    expected = [np.asarray(evidence.predicted(s)) for s in (tuned.before, tuned.scene)]
    times = 1e3 * np.asarray(evidence.times)
    chosen = np.linspace(0, len(times) - 1, min(SHOWN, len(times))).round().astype(int)
    figure = new_figure(11.0, 6.8)
    grid = figure.subplots(3, len(chosen) + 1, squeeze=False)
    rows = (
        ("seen", seen, "gray"),
        ("left before", seen - expected[0], "RdBu"),
        ("left after", seen - expected[1], "RdBu"),
    )
    for axes_row, (name, values, colours) in zip(grid, rows, strict=True):
        low, high, scale = 0.0, 255.0, ""
        if name != "seen":
            high = max(float(np.abs(values[chosen]).max()), 1.0)
            low, scale = -high, f"colours to ±{high:.2g}"
        for axes, number in zip(axes_row, chosen, strict=False):
            image = np.full(size, np.nan).ravel()
            image[np.asarray(evidence.pixels)] = values[number]
            # behind what is not looked at, as it stays as it was, is no grey of a film
            axes.imshow(np.ones(size), cmap="Pastel1", vmin=0.0, vmax=8.0)
            axes.imshow(image.reshape(size), cmap=colours, vmin=low, vmax=high)
            axes.set_axis_off()
            titled(axes, f"{name}, {times[number]:.3g} ms")
        below: dict[str, Any] = {
            "transform": axes_row[0].transAxes,
            "fontsize": 8,
            "color": MUTED,
        }
        axes_row[0].text(0.0, -0.04, scale, va="top", **below)
    top, *rest = grid[:, -1]
    for values, colour, width in (
        (seen, GREY, 4.0),
        (expected[0], VERMILLION, 1.0),
        (expected[1], BLUE, 1.2),
    ):
        top.plot(times, values.mean(axis=1), color=colour, linewidth=width)
    titled(top, "mean grey value")
    for axes, values, colour in zip(rest, expected, (VERMILLION, BLUE), strict=True):
        rms = np.sqrt(np.square(seen - values).mean(axis=1))
        axes.plot(times, rms, color=colour, linewidth=1.2)
        axes.set_ylim(0.0)
        titled(axes, "rms of what is left")
    for axes in grid[:, -1]:
        quiet(axes)
        axes.set_xlabel("time [ms]")
    return figure


def events_figure(tuned: Tuned, evidence: EventsEvidence) -> Figure:
    """Draw the change of light from event to event, and what no threshold explains."""
    sign = np.asarray(evidence.events.sign)
    time = 1e3 * np.asarray(evidence.events.time)
    figure = new_figure(11.0, 6.4)
    grid = figure.subplots(2, 2)
    drawn = ((tuned.before, VERMILLION, "before"), (tuned.scene, BLUE, "after"))
    for (left, right), (scene, colour, name) in zip(grid, drawn, strict=True):
        change = np.asarray(evidence.changes(scene))
        threshold = np.asarray(camera_of(scene).threshold)
        limit = 2.5 * float(threshold.max())
        left.hist(change, np.linspace(-limit, limit, 161), color=colour, alpha=0.7)
        for one in (threshold[0], -threshold[1]):
            left.axvline(float(one), color=GREY, linewidth=1.0)
        left.set_xlabel("change of the logarithm of light")
        titled(left, f"From event to event, {name}", "grey: thresholds")
        rest = _clipped(np.asarray(evidence.left(scene)))
        right.plot(time, rest, ".", color=colour, markersize=2.0, alpha=0.4)
        right.set_ylim(-1.05, 1.05)
        right.set_xlabel("time [ms]")
        right.set_ylabel("thresholds, at most 1")
        titled(right, f"What is left, {name}", f"{sign.size:,} events")
    for axes in grid.ravel():
        quiet(axes)
    return figure


def _clipped(values: Any) -> Float[np.ndarray, " event"]:
    return np.clip(values, -1.0, 1.0)
