"""The style of all figures: light axes, and colours safe for colour-blind readers."""

from collections.abc import Iterable

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

INK = "#222222"
MUTED = "#666666"
GRID = "#e4e4e4"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
COLOURS = (BLUE, VERMILLION, "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Palette of Okabe and Ito (2008), safe for colour-blind readers."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")

DPI = 144
"""Pixels per inch: 1.5 per CSS pixel, sharp on common screens with small files."""


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure without pyplot state; width and height [inch]."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)
    engine.set(w_pad=0.12, h_pad=0.1)
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
    if high / low < 3:
        subs = (1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    elif high / low < 12:
        subs = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
    elif high / low < 300:
        subs = (1.0, 2.0, 5.0)
    else:
        subs = (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
