"""What was heard, drawn: recording, filter's output, threshold, arrivals."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.detect.search import Searched
from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)

COLUMNS = 2000
"""Of an envelope: more than a screen shows."""
MOST_CHANNELS = 8
MOST_LABELS = 5
"""Of arrivals, the loudest: more would hide each other."""


def detection_figure(searched: Sequence[Searched]) -> Figure:
    """Draw each channel's recording above what the filter made of it."""
    shown = searched[:MOST_CHANNELS]
    figure = new_figure(10.0, 0.4 + 3.6 * len(shown))
    grid = figure.subplots(2 * len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for one, above, below in zip(shown, grid[::2], grid[1::2], strict=True):
        rate = one.channel.rate_hz
        _envelope(above, one.channel.samples, rate, MUTED)
        _envelope(below, one.statistic, rate, BLUE)
        for found in one.detections:
            above.axvline(found.time_s, color=VERMILLION, linewidth=0.9, zorder=0)
            below.plot(found.time_s, found.statistic, "v", color=VERMILLION, ms=6)
        loudest = sorted(one.detections, key=lambda found: -found.statistic)
        for found in loudest[:MOST_LABELS]:
            below.annotate(
                f"{found.time_s:.4f} s, {found.snr_db:.0f} dB",
                (found.time_s, found.statistic),
                xytext=(6, 0),
                textcoords="offset points",
                fontsize=8,
                color=INK,
                va="center",
            )
        below.axhline(one.threshold, color=INK, linewidth=0.9, linestyle="--")
        quiet(above)
        quiet(below)
        above.set_ylabel("recording")
        below.set_ylabel("output [sigma]")
        count = len(one.detections)
        heard = f"{count} arrival{'' if count == 1 else 's'}" if count else "nothing"
        titled(above, f"{one.channel.sensor}: {heard} found")
        note = f"dashed: threshold, {one.threshold_snr_db:.1f} dB"
        below.set_title(note, loc="right", fontsize=9, color=MUTED)
    grid[-1].set_xlabel("time of the recording [s]")
    left = len(searched) - len(shown)
    if left:
        figure.supxlabel(f"{left} channels more are not drawn", fontsize=9)
    return figure


def _envelope(
    axes: Axes, samples: Float[np.ndarray, " sample"], rate_hz: float, colour: str
) -> None:
    """Draw samples, or of many the lowest and highest of each column."""
    if samples.size <= 2 * COLUMNS:
        axes.plot(np.arange(samples.size) / rate_hz, samples, color=colour, lw=0.7)
        return
    starts = np.linspace(0, samples.size, COLUMNS, endpoint=False).astype(int)
    low = np.minimum.reduceat(samples, starts)
    high = np.maximum.reduceat(samples, starts)
    axes.fill_between(starts / rate_hz, low, high, color=colour, linewidth=0.3)
