"""All laws against range: one panel a quantity, solid where a law holds."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.calculator.header import title
from jblast.report.calculator.law_curves import NOT_DRAWN, draw_curve
from jblast.report.calculator.law_groups import (
    Curves,
    draw_key,
    group_words,
    groups,
    holding,
    leader_colours,
)
from jblast.report.figure_style import (
    INK,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.numbers import System, unit_for
from jblast.report.words import capitalised, quantity_words
from jblast.sensors.calculator.forward import calculate, only
from jblast.sensors.calculator.question import Question, charge_radius

POINTS = 512
WIDTHS = (3.4, 2.0, 1.2)
"""Of the groups of a panel."""


def calculator_figure(question: Question, law: str = "") -> Figure:
    """Draw every quantity against range; a lone range is marked, a decade to each side.

    Laws that coincide are one line, of a colour that their first one has in all panels;
    those that hold nowhere in sight are grey.

    Args:
        question: Of one mass and one or more ranges.
        law: This one alone; "" for all.
    """
    ranges = _ranges(question)
    masses = np.full_like(ranges, question.charge_mass[0])
    answer = only(calculate(question.scene, ranges, masses), law=law)
    panels = [
        (quantity, by_law)
        for quantity, by_law in answer.items()
        if quantity not in NOT_DRAWN
    ]
    together = {
        quantity: groups(by_law, holding(by_law)) for quantity, by_law in panels
    }
    colours = leader_colours(together.values())
    columns = 2 if len(panels) <= 8 else 3
    rows = -(-len(panels) // columns)
    figure = new_figure(6.0 * columns, 3.7 * rows + 0.6)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (quantity, by_law) in zip(grid.flat, panels, strict=False):
        of_panel = together[quantity]
        _panel(axes, quantity, by_law, of_panel, ranges, colours, question.units)
        if len(question.slant_range) == 1:
            axes.axvline(_x(question), color=MUTED, linewidth=0.8, zorder=1)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    burst = question.scene.charge.burst or "surface or free-air"
    figure.suptitle(
        f"{title(question)}, {burst} burst", x=0.01, ha="left", fontsize=13, color=INK
    )
    key = "solid: where the law holds    dashed: outside its range"
    figure.supxlabel(key, fontsize=9, color=MUTED)
    return figure


def _x(question: Question) -> float:
    return question.slant_range[0] / unit_for("_m", 1.0, system=question.units).size


def _ranges(question: Question) -> Float[np.ndarray, " point"]:
    low, high = min(question.slant_range), max(question.slant_range)
    if high < 1.5 * low:
        low, high = low / 10.0, high * 10.0
    radius = float(charge_radius(question.charge_mass[0]))
    return np.geomspace(max(low, 1.01 * radius), high, POINTS)


def _panel(
    axes: Axes,
    quantity: str,
    by_law: Curves,
    together: Sequence[Sequence[str]],
    ranges: Float[np.ndarray, " point"],
    colours: Mapping[str, str],
    system: System,
) -> None:
    across = unit_for("_m", 1.0, system=system)
    x = ranges / across.size
    drawn = [of_law.value[of_law.valid] for of_law in by_law.values()]
    seen = np.concatenate(drawn)
    if not len(seen):  # no law holds anywhere here
        seen = np.concatenate([of_law.value for of_law in by_law.values()])
    logarithmic = bool(np.all(seen > 0))
    unit = unit_for(quantity, float(np.median(np.abs(seen))), system=system)
    _draw(axes, x, by_law, together, colours, unit.size)
    quiet(axes)
    axes.set_xscale("log")
    axes.set_xlim(x[0], x[-1])
    low, high = float(seen.min()) / unit.size, float(seen.max()) / unit.size
    if logarithmic:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.5, high * 1.5)
        log_ticks(axes.yaxis, axes.get_ylim())
    else:
        margin = 0.08 * max(high - low, 1e-9)
        axes.set_ylim(low - margin, high + margin)
    log_ticks(axes.xaxis, axes.get_xlim())
    axes.set_xlabel(f"slant range ({across.symbol})")
    axes.set_ylabel(unit.symbol)
    titled(axes, capitalised(quantity_words(quantity)))
    draw_key(axes, by_law, 8)


def _draw(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    by_law: Curves,
    together: Sequence[Sequence[str]],
    colours: Mapping[str, str],
    size: float,
) -> None:
    """Draw group upon group, each thinner, so that what lies below is seen."""
    for of_law in by_law.values():
        if not of_law.valid.any():
            draw_curve(axes, x, of_law.value / size, of_law.valid, MUTED)
    for i, group in enumerate(together):
        colour, width = colours[group[0]], WIDTHS[min(i, len(WIDTHS) - 1)]
        for name in group:
            of_law = by_law[name]
            draw_curve(axes, x, of_law.value / size, of_law.valid, colour, width)
        axes.plot([], [], color=colour, linewidth=width, label=group_words(group))
