"""The answer of `jblast bound` on a planned layout."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import ClassVar, Literal

import numpy as np
from jaxtyping import Float

from jblast.inference.design.added_data import AddedDatum
from jblast.inference.design.cramer_rao import Bound, BoundSummary
from jblast.inference.posterior.parameters import NORMAL_Q95, Estimate, Spread
from jblast.quantities import ADDITIVE
from jblast.report.estimates import printed_estimate
from jblast.report.fit.document import WORDED, determined_lines
from jblast.report.fit.terminal import (
    law_lines,
    not_identified,
    quantities_by_law,
    section,
)
from jblast.report.messages import sentences_of
from jblast.report.words import (
    aligned,
    capitalised,
    finite,
    hanging,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
)
from jblast.results import AMONG, Document, Words, among

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


def bound_text(
    bound: Bound, plot: str | Path | None = None, *, verbose: bool = False
) -> str:
    """Return the parameters that a layout constrains, for the terminal.

    Args:
        bound: The bound of the layout.
        plot: File of the map, if it was drawn.
        verbose: Whether to add the reasons for the laws and their scatter.
    """
    found, estimates = bound.summary, _estimates(bound.summary)
    lines = [*hanging(_title(bound), indent=0), "", *_table(found, estimates)]
    identified = ["All free parameters are identified."]
    unknown = not_identified(found, estimates) or identified
    lines += section("Identifiability", unknown)
    lines += section("Identified combinations", determined_lines(found.determined))
    lines += section("Influence of other parameters", _influences(found))
    lines += data_lines(found.help, found.parameters)
    lines += section("Warnings", sentences_of(found.warnings))
    lines += section("Assumptions", _assumptions(bound))
    if verbose:
        lines += law_lines(found, bound.plan.parameters.scene.scatter)
    if plot is not None:
        lines += ["", f"Map: {plot}"]
    return "\n".join(line.rstrip() for line in lines) + "\n"


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


def _table(found: BoundSummary, estimates: Mapping[str, Estimate]) -> list[str]:
    rows = [("Parameters", "assumed", "smallest sd", "90 % interval")]
    for name, estimate in estimates.items():
        sd = shown_sd(name, estimate.spread)
        rows.append(
            (
                f"  {parameter_words(name)}",
                printed_number(name, found.at[name]),
                sd,
                printed_estimate(name, estimate).interval,
            )
        )
    return aligned(rows)


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


def data_lines(
    data: Sequence[AddedDatum], parameters: Mapping[str, Spread]
) -> list[str]:
    """Return a table of the best additional datum of each quantity, the best first.

    Args:
        data: Data that could be added.
        parameters: Spread of each parameter without them.
    """
    if not data:
        return []
    best: dict[str, AddedDatum] = {}
    for datum in data:
        # the first datum of a quantity is its best: data are sorted by their gain
        best.setdefault(datum.quantity, datum)
    target = data[0].parameter
    now = parameters[target]
    rows, idle = [], []
    for datum in sorted(best.values(), key=lambda datum: _width(datum.left))[
        :MAX_ADDED
    ]:
        before = now.sd if math.isnan(datum.left.log_sd) else now.log_sd
        # any finite sd helps a parameter that is not identified yet
        limit = LITTLE_HELP * before if math.isfinite(before) else math.inf
        if _width(datum.left) < limit:
            rows.append(_row(datum))
        else:
            idle.append(quantity_words(datum.quantity))
    title = f"sd of the {parameter_words(target)} with one more datum"
    lines = ["", f"{capitalised(title)}, now {shown_sd(target, now)}"]
    for row in aligned(rows):
        lines += hanging(row)
    if idle:
        lines += hanging(f"No improvement by {joined(idle)}.")
    return lines


def _width(left: Spread) -> float:
    """Return the sd with a datum; infinite if the parameter is not identified then."""
    return left.width if math.isfinite(left.width) else math.inf


def _row(datum: AddedDatum) -> tuple[str, str, str]:
    quantity = datum.quantity
    error = (
        printed_number(quantity, datum.sigma, 2)
        if quantity in ADDITIVE
        else f"{100 * datum.sigma:.2g} %"
    )
    # the assumed error decides how much a datum helps
    source = "default" if datum.is_default else "as planned"
    place = where(datum)
    # a sensor of the layout is known by its name; a new position needs numbers
    if datum.position is not None and not datum.sensor:
        east, north, _ = datum.position
        place = f"at east {east:.4g}, north {north:.4g} m"
    of = f" of {datum.charge}" if datum.charge else ""
    mark = "" if datum.law_valid else "; law out of range"
    return (
        f"{quantity_words(quantity)}{of} {place}",
        shown_sd(datum.parameter, datum.left),
        f"(error {error}, {source}{mark})",
    )


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
