"""One question, one panel: the law we take, those that coincide with it, the others."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.calculator.header import title
from jblast.report.calculator.law_curves import draw_curve
from jblast.report.calculator.law_groups import (
    Curves,
    draw_key,
    group_words,
    groups,
    holding,
)
from jblast.report.figure_style import (
    COLOURS,
    INK,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.numbers import printed_number, unit_for
from jblast.report.words import capitalised, quantity_words
from jblast.sensors.calculator.forward import calculate, only
from jblast.sensors.calculator.question import Question, charge_radius
from jblast.sensors.calculator.recommended import Recommended

POINTS = 512
AROUND = 5.0
"""How far a panel reaches past an answer, as a factor of the range."""
STYLES = ("-", (0, (6, 2.5)), (0, (2.5, 1.5)), (0, (8, 2, 2, 2)))
"""Of colours in turn, so that one that lies on another shows what is below it."""


def question_figure(
    question: Question, quantity: str, recommended: Recommended | None, law: str = ""
) -> Figure:
    """Draw one quantity against range, or against mass where that is asked for.

    Laws that hold in sight have a colour each, those that coincide one between them;
    the others are grey, and named in the key.

    Args:
        question: What was asked; of one mass, or of one range and no mass.
        quantity: What is drawn.
        recommended: The answer, which is marked; None where several were asked for.
        law: This one alone; "" for all.
    """
    x, ranges, masses = _along(question, recommended)
    by_law = only(calculate(question.scene, ranges, masses), quantity, law)[quantity]
    first = recommended.law if recommended else ""
    held = holding(by_law, first)
    figure = new_figure(8.0, 5.4)
    axes = figure.subplots()
    seen = [by_law[name].value[by_law[name].valid] for name in held]
    seen = np.concatenate(seen or [one.value for one in by_law.values()])
    unit = unit_for(quantity, float(np.median(np.abs(seen))), system=question.units)
    _draw(axes, x, by_law, groups(by_law, held), unit.size)
    _frame(axes, seen / unit.size)
    if recommended is not None:
        value = question.target if question.quantity else recommended.value
        at = recommended.value if question.quantity else question.slant_range[0]
        _mark(axes, at / _size(question), value / unit.size)
    axes.set_xlabel(_label(question))
    axes.set_ylabel(unit.symbol)
    titled(axes, capitalised(quantity_words(quantity)))
    burst = question.scene.charge.burst or "surface or free-air"
    figure.suptitle(
        f"{_words(question, recommended)}, {burst} burst",
        x=0.01, ha="left", fontsize=13, color=INK,
    )  # fmt: skip
    return figure


def _draw(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    by_law: Curves,
    together: list[list[str]],
    size: float,
) -> None:
    """Draw grey what does not hold, then a colour a group, and the key."""
    lines = {name for group in together for name in group}
    for name, of_law in by_law.items():
        if name not in lines:
            draw_curve(axes, x, of_law.value / size, of_law.valid, MUTED)
    palette = (INK, *COLOURS)
    for i, group in enumerate(together):
        look = {
            "color": palette[i % len(palette)],
            "linewidth": 1.8 if i else 2.6,
            "linestyle": STYLES[i % len(STYLES)],
        }
        for name in group:
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
    axes.autoscale_view(scaley=False)
    log_ticks(axes.xaxis, axes.get_xlim())


def _mark(axes: Axes, x: float, y: float) -> None:
    axes.axvline(x, color=MUTED, linewidth=0.8, zorder=1)
    axes.axhline(y, color=MUTED, linewidth=0.8, zorder=1)
    axes.plot([x], [y], "o", color=INK, markersize=7, zorder=5)


def _along(
    question: Question, recommended: Recommended | None
) -> tuple[Float[np.ndarray, " point"], ...]:
    """Return what is drawn along, in its unit, and the ranges and masses there."""
    if question.quantity and not question.charge_mass and recommended is not None:
        masses = recommended.value * np.geomspace(AROUND**-3, AROUND**3, POINTS)
        ranges = np.full_like(masses, question.slant_range[0])
        return masses / _size(question), ranges, masses
    asked = question.slant_range or ((recommended.value,) if recommended else (1.0,))
    low, high = min(asked), max(asked)
    if high < 1.5 * low:
        low, high = low / AROUND, high * AROUND
    radius = float(charge_radius(question.charge_mass[0]))
    ranges = np.geomspace(max(low, 1.01 * radius), high, POINTS)
    masses = np.full_like(ranges, question.charge_mass[0])
    return ranges / _size(question), ranges, masses


def _of_mass(question: Question) -> bool:
    return bool(question.quantity) and not question.charge_mass


def _size(question: Question) -> float:
    name = "_kg" if _of_mass(question) else "_m"
    return unit_for(name, 1.0, system=question.units).size


def _label(question: Question) -> str:
    name = "_kg" if _of_mass(question) else "_m"
    unit = unit_for(name, 1.0, system=question.units).symbol
    return f"{'charge mass' if _of_mass(question) else 'slant range'} ({unit})"


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
