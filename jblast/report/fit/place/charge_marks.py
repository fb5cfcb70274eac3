"""A charge on a map: where it stood, where else it may have, how far its shock went."""

import math

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle, PathPatch
from matplotlib.path import Path

from jblast.inference.fitting.place.shock_rings import ShockRing
from jblast.report.figure_style import BLUE, INK, MUTED, VERMILLION
from jblast.report.fit.place.ground_map import ChargePlace
from jblast.report.fit.place.view import View
from jblast.report.numbers import printed_number

MOST_DRAWS = 600
PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.6}
TINY = 0.05
"""A ring smaller than this share of the map is not labelled."""


def draw_charge(
    axes: Axes,
    charge: ChargePlace,
    view: View,
    *,
    close: bool = False,
    with_accepted: bool = True,
) -> None:
    """Draw a charge's place, its ellipses or regions, and its rings.

    Args:
        axes: Of a map.
        charge: The charge.
        view: What the axes show.
        close: Whether they show the place alone, and draws of it.
        with_accepted: Whether to mark the accepted place.
    """
    east, north, _ = charge.position
    for ring in charge.rings:
        _ring(axes, ring, (float(east), float(north)), view)
    if close and charge.draws is not None:
        few = charge.draws[:: max(len(charge.draws) // MOST_DRAWS, 1)]
        axes.plot(*few.T, ".", color=BLUE, markersize=2.5, alpha=0.35, zorder=2)
    for ellipse in charge.ellipses:
        # beside a region that says it better it is a thin line alone
        style = (0, (2, 2)) if charge.regions else "-"
        outline = _closed(ellipse.outline(120))
        width = 0.8 if charge.regions else 1.4
        axes.plot(*outline.T, color=BLUE, linewidth=width, linestyle=style, zorder=3)
        if not charge.regions:
            axes.fill(*outline.T, color=BLUE, alpha=0.10, linewidth=0, zorder=2)
    for region in charge.regions:
        axes.add_patch(
            PathPatch(
                _path(region.parts),
                facecolor=BLUE,
                edgecolor="none",
                alpha=0.22,
                zorder=2,
            )
        )
    axes.plot(
        east, north, "*", color=VERMILLION, markersize=13, markeredgecolor="white",
        markeredgewidth=0.8, zorder=5,
    )  # fmt: skip
    for there in charge.elsewhere:
        if view.holds(*there):
            axes.plot(*there, "X", color=VERMILLION, markersize=8, alpha=0.6, zorder=5)
    if with_accepted and charge.accepted is not None and view.holds(*charge.accepted):
        axes.plot(*charge.accepted, "+", color=INK, markersize=12, mew=2, zorder=6)


def _ring(axes: Axes, ring: ShockRing, centre: tuple[float, float], view: View) -> None:
    style = "-" if ring.valid else (0, (4, 3))
    thick = ring.range_q95_m - ring.range_q05_m
    if thick > 0.004 * view.width:
        band = (
            _circle(centre, ring.range_q95_m),
            _circle(centre, ring.range_q05_m)[::-1],
        )
        path = _path(((band[0], (band[1],)),))
        axes.add_patch(PathPatch(path, facecolor=MUTED, edgecolor="none", alpha=0.12))
    axes.add_patch(
        Circle(centre, ring.range_m, fill=False, ec=MUTED, lw=1.0, ls=style, zorder=1)
    )
    if ring.range_m < TINY * view.width:
        return
    # where the ring is in view: first to the north, then round by the east
    for turn in np.deg2rad(np.arange(60.0, -300.0, -15.0)):
        x = centre[0] + ring.range_m * math.cos(turn)
        y = centre[1] + ring.range_m * math.sin(turn)
        edge = 0.04 * view.width
        inner = View(
            view.west + 2 * edge,
            view.east - 2 * edge,
            view.south + edge,
            view.north - edge,
        )
        if inner.holds(x, y):
            axes.text(
                x, y, printed_number("_pa", ring.peak_overpressure_pa),
                ha="center", va="center", fontsize=8, color=MUTED, zorder=3.5,
                bbox=PAPER,
            )  # fmt: skip
            return


def _circle(
    centre: tuple[float, float], radius: float
) -> Float[np.ndarray, "corner 2"]:
    turn = np.linspace(0.0, 2 * np.pi, 180, endpoint=False)
    return np.array(centre) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def _closed(ring: Float[np.ndarray, "corner 2"]) -> Float[np.ndarray, "corner_ 2"]:
    return np.concatenate([ring, ring[:1]])


def _path(parts) -> Path:
    """Return areas with their holes as one path."""
    rings = [ring for outer, holes in parts for ring in (outer, *holes)]
    return Path.make_compound_path(
        *(Path(_closed(ring), closed=True) for ring in rings)
    )
