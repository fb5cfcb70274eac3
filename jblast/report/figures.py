"""Mechanisms of all figures: style, files, and what several figures draw alike.

Axes are light, and colours are safe for colour-blind readers. A figure has no pyplot
state, and its file is the same each time it is drawn.
"""

import io
import math
import os
import warnings
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from jblast.files import replacing
from jblast.report.colours import BLUE, GRID, INK, MUTED

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
HALO = [withStroke(linewidth=2.5, foreground="white")]
"""White outline that separates text from lines below it."""

DPI = 144
"""Pixels per inch: 1.5 per CSS pixel, sharp on common screens with small files."""
PACKED = 3
"""Compression level of PNG: line figures are as small as at Matplotlib's 6, in two
thirds of the time."""
COLUMNS = 1600
"""Columns of a drawn record: about one a pixel."""
INSTANTS = 400
"""Largest number of columns of a spectrogram: about two pixels each."""
WINDOW_S = 0.04
"""Length of a window of the spectrogram, about [s]: it resolves 25 Hz, and a front to
0.04 s."""
SPAN_DB = 90.0
"""Dynamic range of a spectrogram: about that of 16 bits."""
MOVES = 200
"""Steps in which names are moved apart: 40 names need about 100."""


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure without pyplot state; width and height [inch]."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)
    engine.set(w_pad=0.12, h_pad=0.1)
    return figure


def fixed_figure(
    width: float, height: float, margins: tuple[float, float, float, float]
) -> Figure:
    """Return a figure of many panels, whose constrained layout would take seconds.

    Args:
        width: Width [inch].
        height: Height [inch].
        margins: Distance of the panels from left, right, lower and upper side [inch].
    """
    left, right, low, high = margins
    figure = Figure(figsize=(width, height), dpi=DPI)
    figure.subplots_adjust(
        left / width, low / height, 1 - right / width, 1 - high / height
    )
    return figure


def quiet(axes: Axes) -> None:
    """Hide the top and right spines, and draw the remaining ones and the grid light."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(MUTED)
    axes.tick_params(which="both", color=MUTED, labelcolor=INK, labelsize=9)
    axes.grid(True, which="major", color=GRID, linewidth=0.8)
    # Matplotlib draws the grid above bars and shaded areas by default
    axes.set_axisbelow(True)
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set(size=10, color=INK)


def titled(axes: Axes, title: str, note: str = "", y: float | None = None) -> None:
    """Write a title at the upper left of a plot, and a note at the upper right.

    Args:
        axes: The plot.
        title: The title.
        note: The note.
        y: Height of both [heights of the plot]; None computes it from the tick labels,
            which is slow.
    """
    axes.set_title(title, loc="left", y=y, fontsize=11, color=INK, fontweight="bold")
    if note:
        axes.set_title(note, loc="right", y=y, fontsize=9, color=MUTED)


def log_ticks(axis: Axis, limits: Iterable[float]) -> None:
    """Label a log axis with plain numbers: 20, 50, 100 rather than powers of ten."""
    low, high = limits
    # short axes have room for more multiples of powers of ten: 4 to 9 labels
    ratio, subs = high / low, (1.0,)
    if ratio < 3:
        subs = (1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, *np.arange(3.0, 10.0))
    elif ratio < 12:
        subs = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
    elif ratio < 300:
        subs = (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def runs(flags: Bool[np.ndarray, " n"]) -> list[tuple[int, int, bool]]:
    """Split flags into segments (start, stop, flag) that share their end points."""
    edges = np.flatnonzero(np.diff(flags.astype(int))) + 1
    bounds = [0, *(int(e) for e in edges), len(flags)]
    return [
        (start, min(stop + 1, len(flags)), bool(flags[start]))
        for start, stop in pairwise(bounds)
        if stop > start
    ]


def extremes(
    samples: Float[np.ndarray, " sample"], columns: int = COLUMNS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return first sample, least and largest value of each column of a record."""
    columns = max(1, min(columns, samples.size))
    # integers: with at most a column a sample the starts differ, as reduceat requires
    starts = samples.size * np.arange(columns) // columns
    low, high = (f.reduceat(samples, starts) for f in (np.minimum, np.maximum))
    return starts, low, high


def envelope(
    axes: Axes,
    samples: Float[np.ndarray, " sample"],
    rate_hz: float,
    *,
    start_s: float = 0.0,
    colour: str = BLUE,
    columns: int = COLUMNS,
) -> None:
    """Draw a record as a line, and a long one as the band between its extremes.

    A line through all samples looks the same, and takes seconds. Samples may be mapped
    from a file: each is read once.

    Args:
        axes: The plot, whose time axis is set to the record.
        samples: The samples, in the unit of the axis.
        rate_hz: Samples per second.
        start_s: Time of the first sample [s].
        colour: Colour.
        columns: Largest number of columns.
    """
    axes.set_xlim(start_s, start_s + max(samples.size - 1, 1) / rate_hz)
    if samples.size <= 2 * columns:
        time = start_s + np.arange(samples.size) / rate_hz
        axes.plot(time, samples, color=colour, linewidth=0.8)
        return
    starts, low, high = extremes(samples, columns)
    time = start_s + starts / rate_hz
    axes.fill_between(time, low, high, color=colour, linewidth=0.4)


def spectrogram(
    axes: Axes,
    samples: Float[np.ndarray, " sample"],
    rate_hz: float,
    *,
    reference: float = 1.0,
    unit: str = "",
) -> None:
    """Draw the power density of a record against time and frequency.

    Args:
        axes: The plot; a colour bar is put beside it.
        samples: The samples, which may be mapped from a file.
        rate_hz: Samples per second.
        reference: Reference of the levels, in the unit of the samples.
        unit: Text of the reference, such as "20 µPa".
    """
    time, frequency, density = power_density(samples, rate_hz)
    with np.errstate(divide="ignore"):
        level = 10.0 * np.log10(density.T / reference**2)
    edges = frequency[0] * (0.5 + np.arange(frequency.size + 1))
    quiet(axes)
    axes.grid(False)
    axes.set(yscale="log", ylabel="frequency [Hz]", ylim=(frequency[0], rate_hz / 2))
    log_ticks(axes.yaxis, axes.get_ylim())
    axes.set_xlim(0.0, samples.size / rate_hz)
    top = float(np.max(level, where=np.isfinite(level), initial=-np.inf))
    if not np.isfinite(top):
        axes.text(0.5, 0.5, "silent", transform=axes.transAxes, color=MUTED)
        return
    # the colour of silence, for the ends of the record without a whole window
    axes.set_facecolor(colormaps["cividis"](0.0))
    image = axes.pcolormesh(
        time, edges, np.maximum(level, top - SPAN_DB), vmin=top - SPAN_DB, vmax=top,
        cmap="cividis", rasterized=True,
    )  # fmt: skip
    assert axes.figure is not None
    bar = axes.figure.colorbar(image, ax=axes, pad=0.01)
    bar.set_label(f"dB re ({unit})²/Hz", size=9, color=INK)
    bar.ax.tick_params(labelsize=9, color=MUTED)


def power_density(
    samples: Float[np.ndarray, " sample"], rate_hz: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the power density of a record by overlapping Hann windows.

    Returns:
        Edges of the instants [s], frequencies without 0 [Hz], and the mean density of
        the windows of each instant [unit^2/Hz].
    """
    # a power of two, for which the Fourier transform is fastest
    size = 2 ** round(math.log2(max(WINDOW_S * rate_hz, 16.0)))
    while size > max(samples.size, 16):
        size //= 2
    step = max(1, size // 16, min(size // 2, samples.size // INSTANTS))
    windows = max(1, (samples.size - size) // step + 1)
    # the periodic window: overlapping copies have a constant sum
    window = np.hanning(size + 1)[:-1]
    firsts = windows * np.arange(min(windows, INSTANTS) + 1) // min(windows, INSTANTS)
    density = []
    for first, last in pairwise(firsts):
        # an instant at a time: this bounds the memory for a record of any length
        part = np.zeros((last - 1 - first) * step + size)
        own = samples[first * step : first * step + part.size]
        part[: own.size] = own
        every = np.lib.stride_tricks.sliding_window_view(part, size)[::step]
        power = np.square(np.abs(np.fft.rfft(every * window)[:, 1:])).mean(axis=0)
        # one-sided: twice the power, but for the Nyquist row, which occurs once
        power[:-1] *= 2.0
        density.append(power / (rate_hz * np.sum(window**2)))
    time = (firsts * step + size / 2 - step / 2) / rate_hz
    return time, np.arange(1, size // 2 + 1) * rate_hz / size, np.array(density)


def place_names(
    axes: Axes,
    names: Sequence[str],
    points: Float[np.ndarray, "name 2"],
    colours: Sequence[str] | str = INK,
    *,
    longest: int = 24,
    avoid: Float[np.ndarray, "point 2"] | None = None,
    size: float = 8.5,
) -> None:
    """Write names beside their points, apart from each other and from the points.

    Call it last: the limits of the axes and the layout of the figure must be set. A
    name far from its point is connected to it.

    Args:
        axes: The plot.
        names: The names.
        points: Their points, in data coordinates.
        colours: Colour of each name, or of all.
        longest: Longest name that is written in full [characters].
        avoid: Further points that names must not hide.
        size: Size of the font [point].
    """
    from adjustText import adjust_text  # imports pyplot: for figures with names only

    each = [colours] * len(names) if isinstance(colours, str) else colours
    texts = [
        axes.text(
            x, y, name if len(name) <= longest else name[: longest - 1] + "…",
            color=colour, fontsize=size, path_effects=HALO, parse_math=False, zorder=6,
        )
        for name, (x, y), colour in zip(names, points, each, strict=True)
    ]  # fmt: skip
    for text in texts:
        text.set_in_layout(False)
    marks = points if avoid is None else np.concatenate([points, avoid])
    # a box about each marker, which has a diameter of up to 14 points
    half = 7.0 * DPI / 72
    pixels = axes.transData.transform(marks)
    to_data = axes.transData.inverted().transform
    boxes = [Bbox(to_data([at - half, at + half])) for at in pixels]
    # a number of steps, not a time: the same figure each time it is drawn
    line = {"arrowstyle": "-", "color": MUTED, "linewidth": 0.6}
    adjust_text(
        texts,
        ax=axes,
        iter_lim=MOVES,
        objects=boxes,
        expand=(1.05, 1.1),
        arrowprops=line,
        min_arrow_len=20,
    )


def figure_bytes(figure: Figure, kind: str = "png") -> bytes:
    """Return the content of a figure's file, the same each time it is drawn."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # names of sensors may have characters that the font lacks, drawn as boxes
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .*missing from font")
        # the layout is executed once here; Matplotlib does it twice for each file
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        # a date would make files of equal figures differ
        dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
        packed: dict[str, Any] = {"metadata": dates.get(kind)}
        if kind == "png":
            packed["pil_kwargs"] = {"compress_level": PACKED}
        figure.savefig(buffer, format=kind, facecolor="white", **packed)
    return buffer.getvalue()


def write_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure in the format of the suffix.

    Raises:
        OSError: It cannot be written; an existing file is unchanged.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(figure_bytes(figure, Path(path).suffix[1:].lower()))
