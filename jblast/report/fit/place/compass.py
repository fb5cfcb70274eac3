"""North, the wind, and how long a length is on a map."""

import math

from matplotlib.axes import Axes
from matplotlib.transforms import ScaledTranslation

from jblast.report.figure_style import BLUE, INK
from jblast.report.fit.place.labels import HALO
from jblast.report.fit.place.view import View, round_length
from jblast.report.numbers import printed_number

CALM = 0.05
"""Less wind than this is none [m/s]."""
HALF = 17.0
"""Half the length of an arrow [point]."""
EDGE = 26.0
"""From the sides of a map to the middle of what stands in its corner [point]."""
BESIDE = 52.0
"""From the arrow to the north to the wind's [point]."""


def draw_compass(
    axes: Axes, corner: tuple[float, float], wind: tuple[float, float]
) -> None:
    """Draw an arrow to the north, and one along the wind, in a corner.

    Args:
        axes: Of a map.
        corner: As shares of width and height.
        wind: Speed of the air towards east and north [m/s].
    """
    inward = 1.0 if corner[0] < 0.5 else -1.0
    upward = 1.0 if corner[1] < 0.5 else -1.0
    level = upward * EDGE + 5.0
    _arrow(axes, corner, (0.8 * inward * EDGE, level), (0.0, 1.0), "N", INK)
    speed = math.hypot(*wind)
    if speed >= CALM:
        said = f"wind {printed_number('_m_s', speed, 2)}"
        along = wind[0] / speed, wind[1] / speed
        _arrow(axes, corner, (inward * (EDGE + BESIDE), level), along, said, BLUE)


def _arrow(
    axes: Axes,
    corner: tuple[float, float],
    offset: tuple[float, float],
    along: tuple[float, float],
    said: str,
    colour: str,
) -> None:
    """Draw an arrow, of any direction, with words below it [point]."""
    assert axes.figure is not None
    inches = axes.figure.dpi_scale_trans
    place = axes.transAxes + ScaledTranslation(offset[0] / 72, offset[1] / 72, inches)
    ends = [
        place
        + ScaledTranslation(s * along[0] * HALF / 72, s * along[1] * HALF / 72, inches)
        for s in (-1.0, 1.0)
    ]
    axes.annotate(
        "",
        xy=corner,
        xycoords=ends[1],
        xytext=corner,
        textcoords=ends[0],
        arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.6},
        zorder=6,
    )
    below = place + ScaledTranslation(0.0, -(HALF + 3) / 72, inches)
    axes.text(
        *corner, said, transform=below, ha="center", va="top", fontsize=8.5,
        color=colour, path_effects=HALO, zorder=6,
    )  # fmt: skip


def draw_scale_bar(axes: Axes, view: View, corner: tuple[float, float]) -> None:
    """Draw a bar of a round length in a corner.

    Args:
        axes: Of a map.
        view: What they show.
        corner: As shares of width and height.
    """
    length = round_length(0.3 * view.width)
    edge = 0.04 * view.width
    left = view.west + edge if corner[0] < 0.5 else view.east - edge - length
    level = view.south if corner[1] < 0.5 else view.north
    assert axes.figure is not None
    rise = (10.0 if corner[1] < 0.5 else -22.0) / 72
    lifted = axes.transData + ScaledTranslation(0.0, rise, axes.figure.dpi_scale_trans)
    axes.plot(
        [left, left + length], [level] * 2, transform=lifted, color=INK, linewidth=3,
        solid_capstyle="butt", path_effects=HALO, zorder=6,
    )  # fmt: skip
    axes.annotate(
        f"{length / 1e3:g} km" if length >= 1e3 else printed_number("_m", length),
        (left + length / 2, level),
        xycoords=lifted,
        xytext=(0, 4),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=8.5,
        color=INK,
        path_effects=HALO,
        zorder=6,
    )
