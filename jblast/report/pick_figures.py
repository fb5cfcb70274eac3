"""Files of `jblast pick --report`: figures of records and their pulses, and a page."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import jblast
from jblast.files import write_text
from jblast.observations import write
from jblast.report.figure_files import picture_of, write_drawn
from jblast.report.figures import (
    BLUE,
    COLOURS,
    DPI,
    INK,
    MUTED,
    VERMILLION,
    quiet,
    titled,
)
from jblast.report.pages import page
from jblast.report.picks import (
    RECORDS_ALT,
    RECORDS_CAPTION,
    PicksAnswer,
    estimate_words,
    note_words,
)
from jblast.report.provenance import Provenance, provenance_lines
from jblast.report.words import Unit, capitalised, quantity_words, unit_for
from jblast.signals.picks import NAMES, Gathered, PickLog, RecordPick

JSON, LOG, PAGE = "picks.json", "picks.csv", "report.html"
PICTURE = "records_{}.png"
MAX_PICTURES = 10
"""Largest number of figures on a page, 240 records: nobody reads more of them."""
MAX_RECORDS = 24
"""Largest number of records in one figure: twelve rows are about three screens."""
COLUMNS = 2
CLIPPED_WITHIN = 1e-3
"""A sample within this share of the full scale is clipped: far above the rounding of a
16-bit recorder, 3e-5, and below any error that the figure shows."""
UNSCALED = Unit("sample", 1.0)
BINS = 320
"""Largest number of points of a drawn record: about one a pixel of its panel."""
BEFORE, AFTER = 0.6, 1.4
"""Drawn part before the front [positive durations], and after it [wave durations]."""
TITLES = {"decay": "Decay", "rise_time_s": "Rise time"}
"""Column titles of values that are not quantities of a log."""


def write_picks(
    directory: Path,
    found: Gathered,
    log: PickLog,
    answer: PicksAnswer,
    lines: Sequence[str],
    made: Provenance,
) -> list[str]:
    """Write answer, log, figures and page, in this order; return the file names.

    A figure that cannot be drawn is left out, with a warning.

    Args:
        directory: Output directory; created if missing.
        found: Picks that keep their samples.
        log: Rows of the picks.
        answer: The document of `picks_answer`.
        lines: Further notes for the page.
        made: Provenance.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    stale = [directory / name for name in (JSON, LOG, PAGE)]
    for path in (*stale, *directory.glob(PICTURE.format("*"))):
        path.unlink(missing_ok=True)
    write_text(directory / JSON, answer.to_json())
    written = [JSON]
    if len(log.observations):
        write(directory / LOG, log.observations)
        written.append(LOG)
    names, pictures = found.named(), []
    firsts = range(0, len(found.picks), MAX_RECORDS)[:MAX_PICTURES]
    for number, first in enumerate(firsts, start=1):
        part = slice(first, first + MAX_RECORDS)
        name = PICTURE.format(number)
        draw = partial(records_figure, names[part], found.picks[part])
        figure = write_drawn(draw, directory / name)
        if figure is not None:
            pictures.append(figure)
            written.append(name)
    page = picks_page(found, pictures, lines, made, log.observations.comments)
    write_text(directory / PAGE, page)
    return [*written, PAGE]


def records_figure(names: Sequence[str], picks: Sequence[RecordPick]) -> Figure:
    """Draw picks in two columns, each record above its residual.

    Args:
        names: Titles of the panels.
        picks: Picks that keep their samples; the first `MAX_RECORDS` are drawn.
    """
    shown = picks[:MAX_RECORDS]
    rows = -(-len(shown) // COLUMNS)
    columns = min(COLUMNS, len(shown))
    width, height = 5.4 * columns, 0.5 + 2.9 * rows
    # the grid is computed here: constrained layout would take seconds
    figure = Figure(figsize=(width, height), dpi=DPI)
    outer = figure.add_gridspec(
        rows,
        columns,
        left=0.75 / width,
        right=1 - 0.15 / width,
        bottom=0.6 / height,
        top=1 - 0.35 / height,
        wspace=0.2,
        hspace=0.24,
    )
    for nth, (name, one) in enumerate(zip(names, shown, strict=False)):
        row, column = divmod(nth, columns)
        inner = outer[row, column].subgridspec(2, 1, height_ratios=[2.6, 1], hspace=0.1)
        above, below = (figure.add_subplot(part) for part in inner)
        _draw(above, below, name, one, curve_of(one))
        if nth + columns >= len(shown):
            below.set_xlabel("time [s]")
    if len(picks) > MAX_RECORDS:
        figure.supxlabel(f"{len(picks) - MAX_RECORDS} more are not drawn", fontsize=9)
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


def _draw(above: Axes, below: Axes, name: str, one: RecordPick, curve: Curve) -> None:
    """Draw one record."""
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
    words = [estimate_words(one, "peak_overpressure_pa") or "uncalibrated"]
    words.append(estimate_words(one, "positive_duration_s"))
    note = "onset alone" if alone else ", ".join(filter(None, words))
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


def picks_page(
    found: Gathered,
    pictures: Sequence[Figure],
    lines: Sequence[str],
    made: Provenance,
    comments: Sequence[str],
) -> str:
    """Return the page.

    Args:
        found: Picks.
        pictures: Figures of their records.
        lines: Further notes, as sentences.
        made: Provenance.
        comments: Comments of the log.
    """
    rows = [
        {
            "name": name,
            "numbers": [estimate_words(one, quantity) for quantity in NAMES],
            "quality": one.quality,
            "notes": "; ".join(note_words(one)),
        }
        for name, one in zip(found.named(), found.picks, strict=True)
    ]
    count, channels = len(found.picks), found.channels
    return page(
        "templates/picks.html",
        title=f"{count} {'pick' if count == 1 else 'picks'}",
        subtitle=f"{channels} {'record' if channels == 1 else 'records'} read",
        columns=[TITLES.get(q) or capitalised(quantity_words(q)) for q in NAMES],
        rows=rows,
        pictures=[
            {"source": picture.source, "alt": RECORDS_ALT, "width": picture.width}
            for picture in map(picture_of, pictures)
        ],
        caption=RECORDS_CAPTION,
        lines=lines,
        provenance=provenance_lines(made, "File"),
        comments="\n".join(comments),
        version=jblast.__version__,
    )
