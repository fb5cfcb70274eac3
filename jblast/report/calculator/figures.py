"""Figures of `jblast calc`: curves of the laws around the answer."""

import textwrap
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jblast.quantities import BY_VEHICLE, DIRECTIONS, FIREBALL_RADII
from jblast.registry import LAWS
from jblast.report.calculator.answer import title
from jblast.report.figures import (
    COLOURS,
    INK,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.figures import runs
from jblast.report.words import (
    System,
    Unit,
    capitalised,
    printed_number,
    quantity_words,
    unit_for,
)
from jblast.sensors.calculator import (
    Calculated,
    Question,
    Recommended,
    calculate,
    charge_radius,
    only,
)

POINTS = 512
"""Points of a curve: about one a pixel of a panel."""
AROUND = 5.0
"""Extent of a panel on either side of an answer, as a factor of the range."""
STYLES = ("-", (0, (6, 2.5)), (0, (2.5, 1.5)), (0, (8, 2, 2, 2)))
"""Line styles in turn: a curve below another one shows through its gaps."""
WIDTHS = (3.4, 2.0, 1.2)
"""Line widths of the groups of a panel [point], each thinner than the one below."""
COINCIDE = 0.02
"""Relative difference below which laws are drawn as one line, if it holds wherever both
are valid: 2 % of a decade-wide panel is a line's width."""
FIRST = "kingery_bulmash"
"""First law of its group, as it is the reference of the choice of laws."""
KEY_WIDTH = 40
"""Characters of a line of the key."""
Curves = Mapping[str, Calculated]
NOT_DRAWN = ("flash_time_s", *FIREBALL_RADII, *DIRECTIONS, *BY_VEHICLE)
"""Quantities that are not of waves in the air or the ground."""
LAW_COLOURS = (
    *(*COLOURS, INK, "#882255", "#E8308A", "#332288", "#999933", "#AA4499"),
    *("#8C510A", "#44AA99", "#661100", "#888888", "#117733", "#B8860B"),
    *("#3B6FB6", "#5E8C31"),
)
"""Colours of laws: those of Okabe and Ito, then mostly Tol's muted ones."""
LABEL_GAP = 0.062
"""Least distance of two labels, as a fraction of a panel's height: one line of text."""


def question_figure(
    question: Question, quantity: str, recommended: Recommended | None, law: str = ""
) -> Figure:
    """Draw one quantity against range, or against mass if that is the unknown.

    Valid laws have one colour each, and laws that coincide share one. Laws that are
    valid nowhere in the panel are grey.

    Args:
        question: The question, with one mass, or with one range and no mass.
        quantity: The drawn quantity.
        recommended: The answer, which is marked; None for several rows.
        law: Only this law; "" for all.
    """
    of_mass, across = _across(question)
    ranges, masses = _along(question, recommended)
    x = (masses if of_mass else ranges) / across.size
    by_law = only(calculate(question.scene, ranges, masses), quantity, law)[quantity]
    first = recommended.law if recommended else ""
    valid = holding(by_law, first)
    figure = new_figure(8.0, 5.4)
    axes = figure.subplots()
    seen = [by_law[name].value[by_law[name].valid] for name in valid]
    # without a valid law the panel still needs limits, here those of all laws
    seen = np.concatenate(seen or [one.value for one in by_law.values()])
    unit = unit_for(quantity, float(np.median(np.abs(seen))), system=question.units)
    _draw_question(axes, x, by_law, groups(by_law, valid), unit.size)
    _frame(axes, seen / unit.size)
    if recommended is not None:
        value = question.target if question.quantity else recommended.value
        at = recommended.value if question.quantity else question.slant_range[0]
        at, value = at / across.size, value / unit.size
        axes.axvline(at, color=MUTED, linewidth=0.8, zorder=1)
        axes.axhline(value, color=MUTED, linewidth=0.8, zorder=1)
        axes.plot([at], [value], "o", color=INK, markersize=7, zorder=5)
    axes.set_xlabel(f"{'charge mass' if of_mass else 'slant range'} ({across.symbol})")
    axes.set_ylabel(unit.symbol)
    titled(axes, capitalised(quantity_words(quantity)))
    burst = question.scene.charge.burst or "surface or free-air"
    figure.suptitle(
        f"{_words(question, recommended)}, {burst} burst",
        x=0.01, ha="left", fontsize=13, color=INK,
    )  # fmt: skip
    return figure


def _draw_question(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    by_law: Curves,
    together: list[list[str]],
    size: float,
) -> None:
    """Draw invalid laws in grey, then each group in its colour, and the key."""
    lines = {name for group in together for name in group}
    for name, of_law in by_law.items():
        if name not in lines:
            draw_curve(axes, x, of_law.value / size, of_law.valid, MUTED)
    # the recommended law is the first one: its line is black and the widest
    palette = (INK, *COLOURS)
    for i, group in enumerate(together):
        look = {
            "color": palette[i % len(palette)],
            "linewidth": 1.8 if i else 2.6,
            "linestyle": STYLES[i % len(STYLES)],
        }
        for name in group:
            # NaN ends the line at the limit of validity
            value = np.where(by_law[name].valid, by_law[name].value / size, np.nan)
            axes.plot(x, value, zorder=4, **look)
        axes.plot([], [], label=group_words(group), **look)
    draw_key(axes, by_law, 9)


def _frame(axes: Axes, seen: Float[np.ndarray, " value"]) -> None:
    quiet(axes)
    axes.set_xscale("log")
    low, high = float(seen.min()), float(seen.max())
    if low > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.3, high * 1.3)
        log_ticks(axes.yaxis, axes.get_ylim())
    axes.margins(x=0.0)
    # x only: grey curves of invalid laws must not stretch the panel upwards
    axes.autoscale_view(scaley=False)
    log_ticks(axes.xaxis, axes.get_xlim())


def _along(
    question: Question, recommended: Recommended | None
) -> tuple[Float[np.ndarray, " point"], ...]:
    """Return the ranges and masses of the curves."""
    if question.quantity and not question.charge_mass and recommended is not None:
        # Z goes with the cube root of the mass: the cube gives the same extent in Z as
        # a panel against range has
        masses = recommended.value * np.geomspace(AROUND**-3, AROUND**3, POINTS)
        ranges = np.full_like(masses, question.slant_range[0])
        return ranges, masses
    ranges = question.slant_range or ((recommended.value,) if recommended else (1.0,))
    ranges = _spaced(ranges, question.charge_mass[0], AROUND)
    return ranges, np.full_like(ranges, question.charge_mass[0])


def _spaced(
    ranges: Sequence[float], mass: float, around: float
) -> Float[np.ndarray, " point"]:
    """Return ranges evenly spaced in ln, from outside the charge on.

    Args:
        ranges: Ranges of the question [m].
        mass: Charge mass [kg].
        around: Factor added on either side if the ranges are nearly equal.
    """
    low, high = min(ranges), max(ranges)
    if high < 1.5 * low:
        low, high = low / around, high * around
    # inside the charge there is no shock in air, and no law applies
    return np.geomspace(max(low, 1.01 * float(charge_radius(mass))), high, POINTS)


def _across(question: Question) -> tuple[bool, Unit]:
    """Return whether the abscissa is the mass, not the range, and its unit."""
    of_mass = bool(question.quantity) and not question.charge_mass
    return of_mass, unit_for("_kg" if of_mass else "_m", 1.0, system=question.units)


def _words(question: Question, recommended: Recommended | None) -> str:
    if recommended is None:
        return title(question)
    value = printed_number(
        recommended.quantity, recommended.value, system=question.units
    )
    if not question.quantity:
        return f"{title(question)}: {value}"
    given = question.charge_mass or question.slant_range
    name = "_kg" if question.charge_mass else "_m"
    beside = printed_number(name, given[0], system=question.units)
    target = printed_number(question.quantity, question.target, system=question.units)
    return f"{target} {'from' if question.charge_mass else 'at'} {beside}: {value}"


def calculator_figure(question: Question, law: str = "") -> Figure:
    """Draw every quantity against range; a single range is marked in a decade around.

    Laws that coincide are one line, in the same colour in all panels. Laws that are
    valid nowhere in a panel are grey.

    Args:
        question: The question, with one mass and one or more ranges.
        law: Only this law; "" for all.
    """
    ranges = _spaced(question.slant_range, question.charge_mass[0], 10.0)
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
    # two columns of four panels fit a page; with more panels it takes three
    columns = 2 if len(panels) <= 8 else 3
    rows = -(-len(panels) // columns)
    figure = new_figure(6.0 * columns, 3.7 * rows + 0.6)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (quantity, by_law) in zip(grid.flat, panels, strict=False):
        of_panel = together[quantity]
        _panel(axes, quantity, by_law, of_panel, ranges, colours, question.units)
        if len(question.slant_range) == 1:
            at = question.slant_range[0] / _across(question)[1].size
            axes.axvline(at, color=MUTED, linewidth=0.8, zorder=1)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    burst = question.scene.charge.burst or "surface or free-air"
    figure.suptitle(
        f"{title(question)}, {burst} burst", x=0.01, ha="left", fontsize=13, color=INK
    )
    key = "solid: within the law's range of validity    dashed: outside"
    figure.supxlabel(key, fontsize=9, color=MUTED)
    return figure


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
    # without any valid law the panel still needs limits
    if not len(seen):
        seen = np.concatenate([of_law.value for of_law in by_law.values()])
    # a quantity that is 0 or negative somewhere has no logarithm
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
    """Draw the groups, each thinner than the one before, so that all stay visible."""
    for of_law in by_law.values():
        if not of_law.valid.any():
            draw_curve(axes, x, of_law.value / size, of_law.valid, MUTED)
    for i, group in enumerate(together):
        colour, width = colours[group[0]], WIDTHS[min(i, len(WIDTHS) - 1)]
        for name in group:
            of_law = by_law[name]
            draw_curve(axes, x, of_law.value / size, of_law.valid, colour, width)
        # an empty line makes one entry of the key for the group: its curves are many
        # lines, split at the limits of validity
        axes.plot([], [], color=colour, linewidth=width, label=group_words(group))


def groups(by_law: Curves, names: Iterable[str]) -> list[list[str]]:
    """Return laws in groups that coincide with the group's first law.

    Laws whose ranges of validity do not overlap are in different groups.
    """
    found: list[list[str]] = []
    for name in names:
        # compared with the first law of a group, not the last: a chain of laws that
        # differ by 2 % each would drift apart
        for group in found:
            if _coincide(by_law[group[0]], by_law[name]):
                group.append(name)
                break
        else:
            found.append([name])
    return found


def holding(by_law: Curves, first: str = FIRST) -> list[str]:
    """Return the laws that are valid somewhere, those with the widest range first.

    Args:
        by_law: Value of each law.
        first: The law that precedes all, if it is valid somewhere.
    """
    return sorted(
        (name for name, of_law in by_law.items() if of_law.valid.any()),
        key=lambda name: (name != first, -int(by_law[name].valid.sum())),
    )


def leader_colours(panels: Iterable[Sequence[Sequence[str]]]) -> dict[str, str]:
    """Return a colour for the first law of every group, the same in all panels."""
    leaders = dict.fromkeys(group[0] for groups in panels for group in groups)
    # LAW_COLOURS begins with COLOURS: a repeated colour would stand for two laws
    palette = tuple(dict.fromkeys((INK, *COLOURS, *LAW_COLOURS)))
    return {name: palette[i % len(palette)] for i, name in enumerate(leaders)}


def group_words(group: Sequence[str]) -> str:
    """Return the entry of a key: the first law, and those that coincide with it."""
    if len(group) == 1:
        return group[0]
    # no-break spaces keep the number and its unit on one line of the key
    same = f"= {', '.join(group[1:])} (within\xa0{100 * COINCIDE:g}\xa0%)"
    lines = textwrap.wrap(same, KEY_WIDTH, break_on_hyphens=False)
    return "\n  ".join([group[0], *lines])


def outside_entry(by_law: Curves) -> Line2D | None:
    """Return the key's entry for laws that are valid nowhere here; None without any."""
    names = [name for name, of_law in by_law.items() if not of_law.valid.any()]
    if not names:
        return None
    whose = "its" if len(names) == 1 else "their"
    words = f"outside {whose} range: {', '.join(names)}"
    lines = textwrap.wrap(words, KEY_WIDTH, break_on_hyphens=False)
    look = {"color": MUTED, "linewidth": 1.0, "linestyle": (0, (3, 2.5)), "alpha": 0.7}
    return Line2D([], [], label="\n  ".join(lines), **look)


def draw_key(axes: Axes, by_law: Curves, size: int) -> None:
    """Draw the key of a panel where it covers least, with invalid laws at its end."""
    handles, _ = axes.get_legend_handles_labels()
    outside = outside_entry(by_law)
    handles += [] if outside is None else [outside]
    axes.legend(handles=handles, fontsize=size, frameon=False, loc="best")


def _coincide(one: Calculated, other: Calculated) -> bool:
    both: Bool[np.ndarray, " point"] = one.valid & other.valid
    if not both.any():
        return False
    a, b = one.value[both], other.value[both]
    return bool(np.all(np.abs(a - b) <= COINCIDE * np.abs(a)))


def law_colours() -> dict[str, str]:
    """Return a colour for each drawn law, the same in every figure."""
    # sorted, so that colours do not depend on the order of registration
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
    """Draw a law, solid within its range of validity and thin and dashed outside."""
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
    """Write names of curves to the right of a panel, without overlaps.

    Args:
        axes: The panel, with its limits set.
        ends: End point of each curve, in the units of the panel.
        colours: Colour of each curve.
        quieter: Names that are written fainter.
    """
    corner = axes.transAxes.inverted()
    places = corner.transform(axes.transData.transform(np.array(list(ends.values()))))
    # a curve may end above the panel, or in NaN: its name stays at the edge
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
    """Return heights at least `LABEL_GAP` apart, in the same order, near the input.

    Blocks of labels that touch are centred on the mean of their curves.
    """
    # stable: curves that end at one height keep the order of the caller
    order = np.argsort(heights, kind="stable")
    blocks: list[list[float]] = []  # wanted heights of the labels of each block
    for wanted in heights[order]:
        blocks.append([float(wanted)])
        # merging moves a block, which may then touch the next one below
        while len(blocks) > 1 and _top(blocks[-2]) > _bottom(blocks[-1]):
            upper = blocks.pop()
            blocks[-1] = blocks[-1] + upper
    places = [_bottom(b) + LABEL_GAP * (i + 0.5) for b in blocks for i in range(len(b))]
    result = np.empty_like(heights)
    result[order] = places
    return result


def _bottom(block: list[float]) -> float:
    """Return the lower edge of a block of labels, moved to lie within the panel."""
    height = LABEL_GAP * len(block)
    middle = float(np.mean(block))
    return min(max(middle - 0.5 * height, 0.0), max(1.0 - height, 0.0))


def _top(block: list[float]) -> float:
    return _bottom(block) + LABEL_GAP * len(block)
