"""Files of `jblast detect --out`: the log, and figures of the detections."""

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from jblast.files import write_text
from jblast.observations import write
from jblast.observations.records.sound import write_sound
from jblast.report.figures import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
    write_figure,
)
from jblast.signals.detect_files import (
    ClipDetections,
    Film,
    FilmDetections,
    SoundDetections,
)
from jblast.signals.flash.search import Flash
from jblast.signals.sound_watch import Searched

MAX_DRAWN = 4
"""Largest number of flashes in a figure."""
JSON, PICTURE, LOG, FILTERED = (
    *("detect.json", "detection.png", "observations.csv", "filtered.wav"),
)
COLUMNS = 2000
"""Columns of a drawn envelope: about two a pixel of the figure."""
MAX_CHANNELS = 8
"""Largest number of channels in a figure: 29 inches high."""
MAX_LABELS = 5
"""Largest number of labelled arrivals, the loudest: more labels would overlap."""


def write_detection(
    directory: Path,
    text: str,
    found: SoundDetections | FilmDetections | ClipDetections,
) -> list[str]:
    """Write document, filter output, figures and log; return the names of the files.

    Args:
        directory: Output directory; created if missing.
        text: The document.
        found: The detections. Without rows an older log is removed.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / JSON, text)
    names = [JSON]
    if isinstance(found, SoundDetections):
        log = found.log and found.log.observations
        names += _write_outputs(directory, found.searched)
        figures = {PICTURE: partial(detection_figure, found.searched)}
    elif isinstance(found, ClipDetections):
        log, figures = (
            found.log,
            {
                f"{Path(clip.film.path).stem}.{PICTURE}": partial(flash_figure, clip)
                for clip in found.clips
            },
        )
    else:
        log, figures = found.log, {PICTURE: partial(flash_figure, found)}
    for name, draw in figures.items():
        write_figure(draw(), directory / name)
        names.append(name)
    (directory / LOG).unlink(missing_ok=True)
    if log is not None and len(log):
        write(directory / LOG, log)
        names.append(LOG)
    return names


def _write_outputs(directory: Path, searched: Sequence[Searched]) -> list[str]:
    """Write the filter output of channels of sound, one file a recording."""
    names, several = [], len({one.channel.record for one in searched}) > 1
    for record, members in groupby(searched, lambda one: one.channel.record):
        name = f"{Path(record).stem}.{FILTERED}" if several else FILTERED
        every = [*members]
        outputs = np.array([one.statistic for one in every])
        write_sound(directory / name, outputs, every[0].channel.rate_hz)
        names.append(name)
    return names


def flash_figure(found: FilmDetections) -> Figure:
    """Draw each flash, and the statistic of the search below."""
    watched = found.flashes
    shown = watched.flashes[:MAX_DRAWN]
    figure = new_figure(10.0, 2.4 + 3.4 * len(shown))
    grid = figure.add_gridspec(
        len(shown) + 1, 2, height_ratios=[*([1.4] * len(shown)), 1.0]
    )
    for row, flash in enumerate(shown):
        _picture(figure.add_subplot(grid[row, 0]), flash, found.film)
        _growth(figure.add_subplot(grid[row, 1]), flash)
    axes = figure.add_subplot(grid[-1, :])
    axes.plot(watched.times, watched.statistic, color=BLUE, linewidth=1.0)
    axes.axhline(watched.threshold, color=INK, linewidth=0.9, linestyle="--")
    for flash in watched.flashes:
        axes.axvline(flash.growth.time_s, color=VERMILLION, linewidth=0.9, zorder=0)
    axes.set(xlabel="time [s]", ylabel="statistic", ylim=(0, None))
    quiet(axes)
    count = len(watched.flashes)
    title = f"{count} detected" if count else "no flash detected"
    titled(axes, title, f"dashed: threshold, {watched.threshold:.1f}")
    return figure


def _picture(axes: Axes, flash: Flash, film: Film) -> None:
    extent = (-0.5, film.width - 0.5, film.height - 0.5, -0.5)
    if flash.picture is None:
        axes.set_facecolor("#cccccc")
    else:
        # linear light is drawn with the gamma of a display, 1 / 2.2
        shown = np.clip(flash.picture, 0.0, 1.0) ** 0.45
        axes.imshow(shown, cmap="gray", vmin=0.0, vmax=1.0, extent=extent)
    grown = flash.growth
    last = flash.silhouettes[min(15, len(flash.silhouettes) - 1)]
    axes.add_patch(
        Circle((last.x_px, grown.y_px), last.radius_px, fill=False, ec=VERMILLION)
    )
    axes.plot(grown.x_px, grown.y_px, "+", color=BLUE, ms=12, mew=1.6)
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal", xlabel="x [px]")
    axes.set_ylabel("y [px]")
    titled(axes, f"{1e3 * (last.time_s - grown.time_s):.0f} ms after first light")


def _growth(axes: Axes, flash: Flash) -> None:
    grown = flash.growth
    time = np.array([one.time_s for one in flash.silhouettes])
    radius = np.array([one.radius_px for one in flash.silhouettes])
    cut = np.array([one.cut for one in flash.silhouettes])
    since = 1e3 * (time - grown.time_s)
    axes.plot(since[~cut], radius[~cut], "o", color=INK, ms=3)
    if cut.any():
        axes.plot(since[cut], radius[cut], "o", mfc="none", mec=MUTED, ms=3)
    if grown.radius_px is not None and grown.growth_s is not None:
        fine = np.linspace(0.0, since.max(), 200)
        law = -grown.radius_px * np.expm1(-1e-3 * fine / grown.growth_s)
        axes.plot(fine, law, color=BLUE, linewidth=1.2)
    axes.set(xlabel="since first light [ms]", ylabel="radius [px]", ylim=(0, None))
    quiet(axes)
    note = "open: cut by an edge" if cut.any() else ""
    titled(
        axes, f"first light {grown.time_s:.5f} s ± {1e3 * grown.sigma_s:.2g} ms", note
    )


def detection_figure(searched: Sequence[Searched]) -> Figure:
    """Draw the recording of each channel above its filter output."""
    shown = searched[:MAX_CHANNELS]
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
        for found in loudest[:MAX_LABELS]:
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
        found = f"{count} arrival{'' if count == 1 else 's'}" if count else "no arrival"
        titled(above, f"{one.channel.sensor}: {found}")
        note = f"dashed: threshold, {one.threshold_snr_db:.1f} dB"
        below.set_title(note, loc="right", fontsize=9, color=MUTED)
    grid[-1].set_xlabel("time of the recording [s]")
    left = len(searched) - len(shown)
    if left:
        figure.supxlabel(f"{left} more channels are not drawn", fontsize=9)
    return figure


def _envelope(
    axes: Axes, samples: Float[np.ndarray, " sample"], rate_hz: float, colour: str
) -> None:
    """Draw samples; of a long recording the least and largest of each column."""
    if samples.size <= 2 * COLUMNS:
        axes.plot(np.arange(samples.size) / rate_hz, samples, color=colour, lw=0.7)
        return
    # with over two samples a column the starts differ, as reduceat requires
    starts = np.linspace(0, samples.size, COLUMNS, endpoint=False).astype(int)
    low = np.minimum.reduceat(samples, starts)
    high = np.maximum.reduceat(samples, starts)
    axes.fill_between(starts / rate_hz, low, high, color=colour, linewidth=0.3)
