"""The answer of `jblast bound` on a planned layout, and its map."""

import math
import textwrap
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from jaxtyping import Float

from jblast.inference.design.added_data import AddedDatum
from jblast.inference.design.cramer_rao import Bound, BoundSummary
from jblast.inference.design.sensor_map import BoundMap
from jblast.inference.posterior.parameters import NORMAL_Q95, Estimate, Spread
from jblast.quantities import ADDITIVE
from jblast.report.colours import INK, MUTED
from jblast.report.estimates import printed_estimate
from jblast.report.fit_report import (
    WORDED,
    determined_lines,
    law_table,
    not_identified,
    quantities_by_law,
)
from jblast.report.messages import sentences_of
from jblast.report.numbers import (
    capitalised,
    finite,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
)
from jblast.report.output import Answer
from jblast.report.view import Column, Lines, Table, View
from jblast.results import AMONG, Document, Words, among

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SCALED_QUANTITIES = {"air_arrival_s": "the air shock's travel time"}
"""Quantities whose slope in the mass is that of a part of them."""
MAX_ADDED = 6
"""Largest number of quantities in the table of additional data: one screen."""
LITTLE_HELP = 0.99
"""A datum that leaves more than this share of the sd is listed as no help: a gain below
1 % is not visible in the two digits that are printed."""
NOT = "not identified"
FACTOR_FROM = 1.0
"""Standard deviation of ln from which it is printed as a factor, not in per cent."""


def bound_answer(bound: Bound) -> Answer:
    """Return the answer on a layout."""
    view = bound_view(bound)
    return Answer(BoundAnswer(bound.summary), view, code=bound.exit_code)


def bound_view(bound: Bound) -> View:
    """Return the parameters that a layout constrains, and what would help them."""
    found, estimates = bound.summary, _estimates(bound.summary)
    columns = [
        Column("", parameter_words),
        Column("assumed", lambda name: printed_number(name, found.at[name])),
        Column("smallest sd", lambda name: shown_sd(name, estimates[name].spread)),
        Column(
            "90 % interval",
            lambda name: printed_estimate(name, estimates[name]).interval,
        ),
    ]
    unknown = not_identified(found, estimates)
    return View(
        _title(bound),
        [
            Table(columns, list(estimates), "Parameters"),
            Lines(
                "Identifiability", unknown or ["All free parameters are identified."]
            ),
            Lines("Identified combinations", determined_lines(found.determined)),
            Lines("Influence of other parameters", _influences(found)),
            *_added_table(found),
            Lines("Warnings", sentences_of(found.warnings)),
            Lines("Assumptions", _assumptions(bound)),
            law_table(found, bound.plan.parameters.scene.scatter),
        ],
    )


def _title(bound: Bound) -> str:
    found, log = bound.summary, bound.log
    name = PurePosixPath(log.source.replace("\\", "/")).name
    sensors, n = len(set(log.sensor)), found.n_observations
    return (
        f"Bound of {name}: {n} planned recording{'s' * (n > 1)} of {sensors} "
        f"sensor{'s' * (sensors > 1)}, "
        f"{joined([parameter_words(name) for name in found.free])} free"
    )


def _estimates(found: BoundSummary) -> dict[str, Estimate]:
    """Return the bounds as estimates of a fit to the expected log."""
    estimates = {}
    for name, spread in found.parameters.items():
        if not spread.is_known:
            estimates[name] = Estimate()
            continue
        value, sd, log_sd = found.at[name], spread.sd, spread.log_sd
        # a positive parameter is uncertain by a factor, so its interval is symmetric in
        # ln; it overflows to infinity if the layout hardly constrains the parameter
        step = NORMAL_Q95 * np.array([-1.0, 1.0])
        with np.errstate(over="ignore"):
            ends = (
                value + step * sd if np.isnan(log_sd) else value * np.exp(step * log_sd)
            )
        q05, q95 = map(float, ends)
        estimates[name] = Estimate(value, sd, log_sd, q05, value, q95)
    return estimates


def _assumptions(bound: Bound) -> list[str]:
    """Return the laws, the distribution of errors and the slopes in the mass."""
    found = bound.summary
    laws = quantities_by_law(found.law, bound.plan.parameters.scene.scatter)
    noise = found.noise.capitalize().replace("Student", "Student-t")
    lines = [f"Laws: {laws}", f"{noise} errors"]
    slopes = [
        f"{SCALED_QUANTITIES.get(quantity, quantity_words(quantity))} as W^"
        + " to W^".join(dict.fromkeys(f"{end:.2g}" for end in ends))
        for quantity, ends in found.mass_exponents.items()
    ]
    if slopes:
        lines.append(f"Dependence on the mass W: {joined(slopes)}")
    if not found.law_valid:
        lines.append("Some recordings lie outside the range of their law")
    return lines


def _influences(found: BoundSummary) -> list[str]:
    """Return a sentence for each parameter whose sd depends on another one."""
    sentences = []
    for entry in found.leans_on:
        name, on = entry.parameter, parameter_words(entry.on)
        words, now = parameter_words(name), found.parameters[name]
        known, without = shown_sd(name, entry.if_known), entry.without_prior
        text = f"With a known {on} the sd of the {words} would be {known}"
        if now.is_known:
            text += f" instead of {shown_sd(name, now)}"
        if without is not None:
            left = shown_sd(name, without)
            text += f"; without the prior of the {on}: {left}"
        sentences.append(f"{text}.")
    return sentences


def shown_sd(name: str, spread: Spread) -> str:
    """Return an sd; for positive parameters in per cent, or as a factor if wide."""
    log_sd, sd = finite(spread.log_sd), finite(spread.sd)
    if log_sd is None:
        return NOT if sd is None else printed_number(name, sd, 2)
    if log_sd > FACTOR_FROM:
        # exp overflows past 709, so that an sd of ln that large is printed as exp(700)
        with np.errstate(over="ignore"):
            return f"a factor of {significant(float(np.exp(min(log_sd, 700.0))))}"
    return f"{significant(100 * log_sd)} %"


def _added_table(found: BoundSummary) -> list[Table]:
    """Return a table of the best additional datum of each quantity, the best first."""
    best: dict[str, AddedDatum] = {}
    for datum in found.help:
        # the first datum of a quantity is its best: data are sorted by their gain
        best.setdefault(datum.quantity, datum)
    if not best:
        return []
    target = found.help[0].parameter
    now = found.parameters[target]
    ranked = sorted(best.values(), key=lambda datum: _width(datum.left))[:MAX_ADDED]
    rows = []
    for datum in ranked:
        before = now.sd if math.isnan(datum.left.log_sd) else now.log_sd
        # any finite sd helps a parameter that is not identified yet
        limit = LITTLE_HELP * before if math.isfinite(before) else math.inf
        if _width(datum.left) < limit:
            rows.append(datum)
    idle = [quantity_words(one.quantity) for one in ranked if one not in rows]
    return [
        Table(
            [
                Column("", _datum_words),
                Column("sd", lambda one: shown_sd(one.parameter, one.left)),
                # the assumed error decides how much a datum helps
                Column("error", _error_words),
            ],
            rows,
            f"{capitalised(f'sd of the {parameter_words(target)} with one more datum')}"
            f", now {shown_sd(target, now)}",
            caption=f"No improvement by {joined(idle)}." if idle else "",
        )
    ]


def _width(left: Spread) -> float:
    """Return the sd with a datum; infinite if the parameter is not identified then."""
    return left.width if math.isfinite(left.width) else math.inf


def _datum_words(datum: AddedDatum) -> str:
    place = where(datum)
    # a sensor of the layout is known by its name; a new position needs numbers
    if datum.position is not None and not datum.sensor:
        # in full: coordinates of a map are millions of metres
        east, north = (
            f"{x:.0f}" if abs(x) >= 1e3 else f"{x:.4g}" for x in datum.position[:2]
        )
        place = f"at east {east}, north {north} m"
    of = f" of {datum.charge}" if datum.charge else ""
    return f"{quantity_words(datum.quantity)}{of} {place}"


def _error_words(datum: AddedDatum) -> str:
    error = f"{100 * datum.sigma:.2g} %"
    if datum.quantity in ADDITIVE:
        error = printed_number(datum.quantity, datum.sigma, 2)
    source = "default" if datum.is_default else "as planned"
    return f"{error}, {source}" + ("" if datum.law_valid else "; law out of range")


def where(datum: AddedDatum) -> str:
    """Return the position of a datum, as text."""
    return f"at sensor {datum.sensor}" if datum.sensor else "off the sensors' line"


@dataclass(frozen=True)
class AddedRow:
    """A row that could be added to a layout, with the resulting uncertainty.

    Attributes:
        of: The quantity, its law, and the parameter that it would constrain.
        where: Its position, as text.
        position_m: Its position; null in a scene without positions.
        charge: Name of the charge; null for a single one.
        sigma: Its error: seconds, or relative.
        sigma_from: Source of the error.
        left: Spread of the parameter with this row.
    """

    of: AddedDatum = field(metadata=among("quantity", "law", "law_valid", "parameter"))
    where: str
    position_m: Float[np.ndarray, "3"] | None
    charge: str | None
    sigma: float
    sigma_from: Literal["default", "layout"]
    left: Spread = field(metadata=AMONG)


def _added(of: AddedDatum) -> AddedRow:
    source = "default" if of.is_default else "layout"
    charge = of.charge or None
    return AddedRow(of, where(of), of.position, charge, of.sigma, source, of.left)


@dataclass(frozen=True)
class BoundAnswer(Document):
    """The answer of `jblast bound`.

    Attributes:
        summary: Results of the bound.
    """

    words: ClassVar[Words] = {**WORDED, AddedDatum: _added}
    summary: BoundSummary = field(metadata=AMONG)


def bound_figure(drawn: BoundMap) -> "Figure":
    """Draw the sd of ln mass and of the position over the position of a next sensor."""
    from jblast.report.figures import new_figure, titled
    from jblast.report.map_figures import write_names

    panels = []
    if drawn.log_sd_mass is not None:
        percent, now = 100.0 * drawn.log_sd_mass, 100.0 * drawn.now["mass"]
        panels.append((parameter_words(drawn.mass), "", percent, now))
    if drawn.place_sd is not None:
        # with one free coordinate the panel shows that coordinate
        one = len(drawn.place) != 2
        name = parameter_words(drawn.place[-1]) if one else "position"
        panels.append((name, "_m", drawn.place_sd, drawn.now["place"]))
    figure = new_figure(6.2 * len(panels), 6.4)
    grid = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, (name, unit, values, now) in zip(grid, panels, strict=True):
        _panel(axes, drawn, values, unit)
        titled(axes, f"Sd of {name}", f"now {_sd(unit, now, 2)}")
    records = joined([quantity_words(q) for q in drawn.records])
    hatched = "" if drawn.valid.all() else " Hatched: outside the range of a law."
    caption = (
        f"One more sensor at this position, {drawn.up:g} m up, that records {records} "
        f"like {drawn.like}. Circles: sensors. Star: charge.{hatched}"
    )
    lines = textwrap.wrap(caption, 92 * len(panels))
    figure.supxlabel("\n".join(lines), fontsize=9, color=MUTED)
    for axes in grid:
        write_names(figure, axes, _features(drawn))
    return figure


def _features(drawn: BoundMap) -> list[Any]:
    from jblast.report.maps import point

    sensors = [
        point("sensor", name, at, label=name, colour="#ffffff")
        for name, at in drawn.sensors.items()
    ]
    return [*sensors, *(point("charge", "", at) for at in drawn.charges)]


def _sd(unit: str, value: float, digits: int = 4) -> str:
    if not np.isfinite(value):
        return NOT
    return printed_number(unit, value, digits) if unit else f"{value:.{digits}g} %"


def _panel(axes: "Axes", drawn: BoundMap, values: Any, unit: str) -> None:
    """Shade an sd, dark where a sensor adds much, with contours at round numbers."""
    from matplotlib.colors import LinearSegmentedColormap, LogNorm
    from matplotlib.ticker import LogLocator, MaxNLocator
    from matplotlib.transforms import Bbox

    from jblast.report.map_figures import draw_features

    east, north = drawn.east, drawn.north
    view = Bbox([[east[0], north[0]], [east[-1], north[-1]]])
    draw_features(axes, _features(drawn), view)
    axes.grid(False)  # its lines would look like contours
    if not np.isfinite(values).any():
        axes.text(
            0.5, 0.03, f"{NOT} at any position", transform=axes.transAxes, ha="center"
        )
    else:
        values = np.ma.masked_invalid(values)
        # quantiles: near the charge and far off a few values would take the whole scale
        low, high = np.quantile(values.compressed(), [0.005, 0.995])
        norm = LogNorm(low, max(high, 1.001 * low))
        shades = LinearSegmentedColormap.from_list(
            "paper", ["#3d84b8", "#b7d4e8", "#fff"]
        )
        axes.pcolormesh(
            east, north, values, norm=norm, cmap=shades, shading="gouraud", zorder=0
        )
        # below a factor of 2.5 there are only two or three of the round numbers
        near = high < 2.5 * low
        locator = (
            MaxNLocator(6)
            if near
            else LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0), numticks=6)
        )
        levels = [
            level for level in locator.tick_values(low, high) if low < level < high
        ]
        if levels and high > 1.01 * low:
            lines = axes.contour(
                east, north, values, levels, colors=INK, linewidths=0.8
            )
            axes.clabel(lines, fmt=lambda level: _sd(unit, level), fontsize=9)
    if not drawn.valid.all():
        # hatched, not hidden: the bound there rests on an extrapolated law
        outside = (~drawn.valid).astype(float)
        hatched = axes.contourf(
            east, north, outside, levels=[0.5, 1.5], colors="none", hatches=["//"]
        )
        hatched.set(edgecolor="#c4c4c4", linewidth=0.0)
