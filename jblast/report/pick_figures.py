"""Figures of `jblast pick --report`: records with their pulses and residuals."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.colours import BLUE, COLOURS, INK, MUTED, VERMILLION
from jblast.report.figures import fixed_figure, quiet, titled
from jblast.report.numbers import Unit, unit_for
from jblast.signals.picks import RecordPick

COLUMNS = 2
CLIPPED_WITHIN = 1e-3
"""A sample within this share of the full scale is clipped: far above the rounding of a
16-bit recorder, 3e-5, and below any error that the figure shows."""
UNSCALED = Unit("sample", 1.0)
BINS = 320
"""Largest number of points of a drawn record: about one a pixel of its panel."""
BEFORE, AFTER = 0.6, 1.4
"""Drawn part before the front [positive durations], and after it [wave durations]."""


def records_figure(
    names: Sequence[str],
    picks: Sequence[RecordPick],
    words: Callable[[RecordPick, str], str] = lambda one, quantity: "",
) -> Figure:
    """Draw picks in two columns, each record above its residual.

    Args:
        names: Titles of the panels.
        picks: Picks that keep their samples.
        words: Function that prints a value of a pick.
    """
    rows, columns = -(-len(picks) // COLUMNS), min(COLUMNS, len(picks))
    figure = fixed_figure(5.4 * columns, 0.5 + 2.9 * rows, (0.75, 0.15, 0.6, 0.35))
    outer = figure.add_gridspec(rows, columns, wspace=0.2, hspace=0.24)
    for nth, (name, one) in enumerate(zip(names, picks, strict=True)):
        row, column = divmod(nth, columns)
        inner = outer[row, column].subgridspec(2, 1, height_ratios=[2.6, 1], hspace=0.1)
        above, below = (figure.add_subplot(part) for part in inner)
        shown = [words(one, q) for q in ("peak_overpressure_pa", "positive_duration_s")]
        _draw(above, below, name, one, ", ".join(filter(None, shown)))
        if nth + columns >= len(picks):
            below.set_xlabel("time [s]")
    return figure


class Curve(NamedTuple):
    """Samples and pulse of a pick, one value for each bin.

    Attributes:
        time: Middle of each bin [s].
        samples: Mean of its samples.
        low: Least sample.
        high: Largest sample.
        fitted: Mean of the fitted pulse, above the baseline at the arrival.
    """

    time: Float[np.ndarray, " bin"]
    samples: Float[np.ndarray, " bin"]
    low: Float[np.ndarray, " bin"]
    high: Float[np.ndarray, " bin"]
    fitted: Float[np.ndarray, " bin"]


def _draw(above: Axes, below: Axes, name: str, one: RecordPick, words: str) -> None:
    """Draw one record."""
    curve = curve_of(one)
    unit, alone = UNSCALED, "onset_alone" in one.notes
    if one.record.calibrated:
        largest = np.abs([curve.low, curve.high]).max()
        size = largest if alone else one.pick.peak_overpressure_pa
        unit = unit_for("peak_overpressure_pa", float(size))
    low, high, fitted = (x / unit.size for x in (curve.low, curve.high, curve.fitted))
    residual = (curve.samples - curve.fitted) / unit.size
    for axes in (above, below):
        quiet(axes)
        axes.set_xlim(curve.time[0], curve.time[-1])
        axes.axhline(0.0, color=MUTED, linewidth=0.7)
    above.fill_between(curve.time, low, high, color="#9a9a9a", linewidth=0.8)
    above.plot(curve.time, fitted, color=BLUE, linewidth=1.4)
    arrival = one.pick.air_arrival_s
    end = arrival + one.pick.positive_duration_s
    above.axvline(arrival, color=VERMILLION, linewidth=1.0, zorder=0)
    above.axvline(end, color=VERMILLION, linewidth=1.0, linestyle=":", zorder=0)
    if np.isfinite(one.pick.later_arrival_s):
        above.axvline(one.pick.later_arrival_s, color=COLOURS[4], linewidth=1, zorder=0)
    clipped = one.pick.clipped_at_pa
    if np.isfinite(clipped):
        level = (clipped - one.pick.baseline_pa) / unit.size
        above.axhline(level, color=INK, linewidth=0.8, linestyle="--")
        # a clipped sample is a lower bound, so that it has no residual
        residual[high >= (1.0 - CLIPPED_WITHIN) * level] = np.nan
    below.plot(curve.time, residual, color=INK, linewidth=0.7)
    largest = float(np.abs(residual[np.isfinite(residual)]).max(initial=0.0))
    below.set_ylim(-1.15 * largest or -1.0, 1.15 * largest or 1.0)
    above.tick_params(labelbottom=False)
    above.set_ylabel(f"[{unit.symbol}]")
    above.yaxis.set_label_coords(-0.095, 0.5)
    note = "onset alone" if alone else words
    titled(above, name, note, y=1.0)


def _edges(one: RecordPick) -> Int[np.ndarray, " edge"]:
    """Return the first samples of bins of equal size, at most `BINS`, and the end."""
    pick, record = one.pick, one.record
    arrival, duration = pick.air_arrival_s, pick.positive_duration_s
    # an onset without a pulse has no duration: the whole record is drawn
    if np.isnan(duration):
        arrival, duration = record.start_s, record.seconds
    wave = duration + np.nan_to_num(pick.negative_duration_s)
    first = int((arrival - BEFORE * duration - record.start_s) * record.rate_hz) - 1
    last = int((arrival + AFTER * wave - record.start_s) * record.rate_hz) + 2
    first, last = max(first, 0), min(last, record.samples.size)
    first = max(min(first, last - 2), 0)
    size = -(-(last - first) // BINS)
    return np.arange(first, last + 1, size)


def curve_of(one: RecordPick) -> Curve:
    """Return the curve of a pick that keeps its samples."""
    record, edges = one.record, _edges(one)
    own = record.samples[edges[0] : edges[-1]] - one.pick.baseline_pa
    # bins of equal size are means over one axis of a reshaped array
    bins = own.reshape(edges.size - 1, -1)
    middle = 0.5 * (edges[:-1] + edges[1:] - 1)
    # sample i covers i - 1/2 to i + 1/2
    ends_s = record.start_s + (edges - 0.5) / record.rate_hz
    pulse = one.pick.pulse
    return Curve(
        record.start_s + middle / record.rate_hz,
        bins.mean(axis=1),
        bins.min(axis=1),
        bins.max(axis=1),
        np.zeros(len(bins)) if pulse is None else pulse.means(ends_s),
    )
