"""Laws as curves: a colour each, solid where they hold, named at the right."""

from collections.abc import Collection, Mapping

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes

from jblast.quantities import BY_VEHICLE, DIRECTIONS, FIREBALL_RADII
from jblast.registry import LAWS
from jblast.report.figure_style import COLOURS, INK
from jblast.report.fit.figures.recordings import runs

NOT_DRAWN = ("flash_time_s", *FIREBALL_RADII, *DIRECTIONS, *BY_VEHICLE)
"""No waves of the air or the ground."""
LAW_COLOURS = (
    *(*COLOURS, INK, "#882255", "#E8308A", "#332288", "#999933", "#AA4499"),
    *("#8C510A", "#44AA99", "#661100", "#888888", "#117733", "#B8860B"),
    *("#3B6FB6", "#5E8C31"),
)
"""One a law, as long as they last: Okabe and Ito's, then mostly Tol's muted ones."""
LABEL_GAP = 0.062
"""Between two labels, as a fraction of a panel's height."""


def law_colours() -> dict[str, str]:
    """Return a colour for each law that is drawn, the same in every figure."""
    ordered = sorted({name for quantity, name in LAWS if quantity not in NOT_DRAWN})
    return {name: LAW_COLOURS[i % len(LAW_COLOURS)] for i, name in enumerate(ordered)}


def draw_curve(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    value: Float[np.ndarray, " point"],
    valid: Bool[np.ndarray, " point"],
    colour: str,
    width: float = 1.7,
) -> None:
    """Draw a law, solid where it holds and thin and dashed elsewhere."""
    for start, stop, holds in runs(valid):
        part = slice(start, stop)
        axes.plot(
            x[part],
            value[part],
            color=colour,
            linewidth=width if holds else 1.0,
            linestyle="-" if holds else (0, (3, 2.5)),
            alpha=1.0 if holds else 0.55,
            zorder=3 if holds else 2,
        )


def name_curves(
    axes: Axes,
    ends: Mapping[str, tuple[float, float]],
    colours: Mapping[str, str],
    quieter: Collection[str] = (),
) -> None:
    """Name curves to the right of a panel, names pushed apart where ends meet.

    Args:
        axes: The panel, its limits set.
        ends: Where each curve ends, in the units of the panel.
        colours: By name.
        quieter: Names that are written fainter.
    """
    corner = axes.transAxes.inverted()
    places = corner.transform(axes.transData.transform(np.array(list(ends.values()))))
    places = np.clip(np.nan_to_num(places), 0.0, 1.0)
    for name, (x, y), height in zip(ends, places, spread(places[:, 1]), strict=True):
        axes.annotate(
            name,
            xy=(x, y),
            xytext=(1.05, height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            fontsize=8.5,
            color=colours[name],
            alpha=0.7 if name in quieter else 1.0,
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": colours[name],
                "linewidth": 0.6,
                "alpha": 0.6,
                "relpos": (0.0, 0.5),
                "shrinkA": 1,
                "shrinkB": 0,
            },
        )


def spread(heights: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return places at least `LABEL_GAP` apart, in the same order, near the heights.

    Blocks of labels that touch are centred on the mean of what they name.
    """
    order = np.argsort(heights, kind="stable")
    blocks: list[list[float]] = []  # each: wanted heights of its labels
    for wanted in heights[order]:
        blocks.append([float(wanted)])
        while len(blocks) > 1 and _top(blocks[-2]) > _bottom(blocks[-1]):
            upper = blocks.pop()
            blocks[-1] = blocks[-1] + upper
    places = [_bottom(b) + LABEL_GAP * (i + 0.5) for b in blocks for i in range(len(b))]
    result = np.empty_like(heights)
    result[order] = places
    return result


def _bottom(block: list[float]) -> float:
    """Return where a block of labels starts, the whole of it beside its panel."""
    height = LABEL_GAP * len(block)
    middle = float(np.mean(block))
    return min(max(middle - 0.5 * height, 0.0), max(1.0 - height, 0.0))


def _top(block: list[float]) -> float:
    return _bottom(block) + LABEL_GAP * len(block)
