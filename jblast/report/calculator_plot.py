"""All laws against range: one panel a quantity, solid where a law holds."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.calculator_header import title
from jblast.report.figure_style import (
    COLOURS,
    INK,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.numbers import unit_for
from jblast.report.recordings import runs
from jblast.report.words import capitalised, quantity_words
from jblast.sensors.calculate import Calculated, calculate
from jblast.sensors.question import Question, charge_radius

POINTS = 512
NOT_DRAWN = ("flash_time_s",)
"""Light is there at once."""
LAW_COLOURS = (
    *(*COLOURS, INK, "#882255", "#117733", "#332288", "#999933", "#AA4499"),
    *("#8C510A", "#44AA99", "#661100", "#888888"),
)
"""One a law, as long as they last: Okabe and Ito's, then mostly Tol's muted ones."""
LABEL_GAP = 0.062
"""Between two labels, as a fraction of a panel's height."""


def calculator_figure(question: Question) -> Figure:
    """Draw every quantity against range; a lone range is marked, a decade to each side.

    Args:
        question: Of one mass and one or more ranges.
    """
    ranges = _ranges(question)
    masses = np.full_like(ranges, question.charge_mass[0])
    answer = calculate(question.scene, ranges, masses)
    panels = [
        (quantity, by_law)
        for quantity, by_law in answer.items()
        if quantity not in NOT_DRAWN
    ]
    names = dict.fromkeys(name for _, by_law in panels for name in by_law)
    colours = {
        name: LAW_COLOURS[i % len(LAW_COLOURS)] for i, name in enumerate(sorted(names))
    }
    columns = 2 if len(panels) <= 8 else 3
    rows = -(-len(panels) // columns)
    figure = new_figure(6.0 * columns, 3.7 * rows + 0.6)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (quantity, by_law) in zip(grid.flat, panels, strict=False):
        _panel(axes, quantity, by_law, ranges, colours)
        if len(question.slant_range) == 1:
            axes.axvline(question.slant_range[0], color=MUTED, linewidth=0.8, zorder=1)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    burst = question.scene.charge.burst
    figure.suptitle(
        f"{title(question)}, {burst} burst", x=0.01, ha="left", fontsize=13, color=INK
    )
    key = "solid: where the law holds    dashed: outside its range"
    figure.supxlabel(key, fontsize=9, color=MUTED)
    return figure


def _ranges(question: Question) -> Float[np.ndarray, " point"]:
    low, high = min(question.slant_range), max(question.slant_range)
    if high < 1.5 * low:
        low, high = low / 10.0, high * 10.0
    radius = float(charge_radius(question.charge_mass[0]))
    return np.geomspace(max(low, 1.01 * radius), high, POINTS)


def _panel(
    axes: Axes,
    quantity: str,
    by_law: Mapping[str, Calculated],
    ranges: Float[np.ndarray, " point"],
    colours: Mapping[str, str],
) -> None:
    drawn = [of_law.value[of_law.valid] for of_law in by_law.values()]
    seen = np.concatenate(drawn)
    if not len(seen):  # no law holds anywhere here
        seen = np.concatenate([of_law.value for of_law in by_law.values()])
    logarithmic = bool(np.all(seen > 0))
    unit = unit_for(quantity, float(np.median(np.abs(seen))))
    for name, of_law in by_law.items():
        value = of_law.value / unit.size
        for start, stop, valid in runs(of_law.valid):
            part = slice(start, stop)
            axes.plot(
                ranges[part],
                value[part],
                color=colours[name],
                linewidth=1.7 if valid else 1.0,
                linestyle="-" if valid else (0, (3, 2.5)),
                alpha=1.0 if valid else 0.55,
                zorder=3 if valid else 2,
            )
    quiet(axes)
    axes.set_xscale("log")
    axes.set_xlim(ranges[0], ranges[-1])
    low, high = float(seen.min()) / unit.size, float(seen.max()) / unit.size
    if logarithmic:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.5, high * 1.5)
        log_ticks(axes.yaxis, axes.get_ylim())
    else:
        margin = 0.08 * max(high - low, 1e-9)
        axes.set_ylim(low - margin, high + margin)
    log_ticks(axes.xaxis, axes.get_xlim())
    axes.set_xlabel("slant range (m)")
    axes.set_ylabel(unit.symbol)
    titled(axes, capitalised(quantity_words(quantity)))
    _labels(axes, by_law, unit.size, colours)


def _labels(
    axes: Axes,
    by_law: Mapping[str, Calculated],
    unit: float,
    colours: Mapping[str, str],
) -> None:
    """Name each curve at its right end, names pushed apart where ends meet."""
    names = list(by_law)
    ends = np.array([[1.0, by_law[name].value[-1] / unit] for name in names])
    heights = axes.transAxes.inverted().transform(
        axes.transData.transform(np.nan_to_num(ends))
    )[:, 1]
    heights = np.clip(np.nan_to_num(heights), 0.0, 1.0)
    for name, end, place in zip(names, heights, spread(heights), strict=True):
        valid = bool(by_law[name].valid.any())
        axes.annotate(
            name,
            xy=(1.0, end),
            xytext=(1.05, place),
            xycoords="axes fraction",
            textcoords="axes fraction",
            fontsize=8.5,
            color=colours[name],
            alpha=1.0 if valid else 0.7,
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
