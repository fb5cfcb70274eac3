"""The answer of `jblast bound` on a planned layout."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import ClassVar, Literal

import numpy as np
from jaxtyping import Float

from jblast.inference.design.cramer_rao import (
    AddedDatum,
    Bound,
    BoundSummary,
)
from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.inference.posterior.parameters import Estimate, Spread
from jblast.quantities import ADDITIVE
from jblast.registry import LAWS
from jblast.report.choice import law_reason
from jblast.report.estimates import printed_estimate
from jblast.report.fit.document import WORDED, determined_lines
from jblast.report.fit.findings import all_words
from jblast.report.fit.terminal import cannot_tell, section
from jblast.report.words import (
    aligned,
    finite,
    hanging,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
)
from jblast.results import AMONG, Document, Words, among

SAID_OF_THE_MASS = {"air_arrival_s": "the air shock's travel time"}
MOST_HELP = 6
LITTLE = 0.99
"""A datum that leaves more of the sd than this is no help."""
NOT = "not identified"
PER_CENT = 1.0
"""A larger sd of ln is printed as a factor."""


def bound_text(bound: Bound, plot: str | Path | None = None) -> str:
    """Return what a layout constrains, for the terminal.

    Args:
        bound: The layout.
        plot: Where the map was drawn, if it was.
    """
    found, estimates = bound.summary, _estimates(bound.summary)
    lines = [*hanging(_title(bound), indent=0), "", *_table(found, estimates)]
    lines += ["", "Laws", *_laws(bound)]
    nothing = ["nothing: the recordings, or a prior, identify every open number"]
    untold = cannot_tell(found, estimates) or nothing
    lines += section("What the recordings cannot tell", untold)
    lines += section("What they do tell", determined_lines(found.determined))
    lines += section("What it leans on", _leans(found))
    lines += data_lines(found.help, found.parameters)
    lines += section("Warnings", all_words(found.warnings))
    if plot is not None:
        lines += ["", f"Map: {plot}"]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _title(bound: Bound) -> str:
    found, log = bound.summary, bound.log
    name = PurePosixPath(log.source.replace("\\", "/")).name
    sensors, n = len(set(log.sensor)), found.n_observations
    return (
        f"Bound of {name}: {n} recording{'s' * (n > 1)} planned of {sensors} "
        f"sensor{'s' * (sensors > 1)}, "
        f"{joined([parameter_words(name) for name in found.free])} open, "
        f"{found.noise.capitalize()} errors".replace("Student", "Student-t")
    )


def _estimates(found: BoundSummary) -> dict[str, Estimate]:
    """Return the bounds as a fit of the expected log would print its estimates."""
    estimates = {}
    for name, spread in found.parameters.items():
        if not spread.is_known:
            estimates[name] = Estimate()
            continue
        value, sd, log_sd = found.at[name], spread.sd, spread.log_sd
        step = NORMAL_Q95 * np.array([-1.0, 1.0])
        with np.errstate(over="ignore"):
            ends = (
                value + step * sd if np.isnan(log_sd) else value * np.exp(step * log_sd)
            )
        q05, q95 = map(float, ends)
        estimates[name] = Estimate(value, sd, log_sd, q05, value, q95)
    return estimates


def _table(found: BoundSummary, estimates: Mapping[str, Estimate]) -> list[str]:
    rows = [("Parameters", "taken as", "sd", "90 % interval")]
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


def _laws(bound: Bound) -> list[str]:
    found, lines = bound.summary, []
    scatter = bound.posterior.parameters.scene.scatter
    column = max(len(quantity_words(q)) for q in found.law) + 2
    for quantity, name in found.law.items():
        law = LAWS[quantity, name]
        words = law.scatter_words() if scatter else "taken as exact"
        text = "; ".join(
            p for p in (law_reason(found.law_reason[quantity]), words) if p
        )
        lines += hanging(
            f"{quantity_words(quantity).ljust(column)}{name}: {text}", column
        )
    slopes = [
        f"{SAID_OF_THE_MASS.get(quantity, quantity_words(quantity))} as W^"
        + " to W^".join(dict.fromkeys(f"{end:.2g}" for end in ends))
        for quantity, ends in found.mass_exponents.items()
    ]
    if slopes:
        lines += hanging(f"With the mass W here go {joined(slopes)}.")
    if not found.law_valid:
        lines += hanging("Some recordings lie outside the range of their law.")
    return lines


def _leans(found: BoundSummary) -> list[str]:
    said = []
    for entry in found.leans_on:
        name, on = entry.parameter, parameter_words(entry.on)
        words, now = parameter_words(name), found.parameters[name]
        known, without = entry.if_known, entry.without_prior
        if not now.is_known:
            sd = shown_sd(name, known)
            said.append(f"Were the {on} known, the {words} would be told: sd {sd}.")
            continue
        text = f"The {words} (sd {shown_sd(name, now)}) leans on the "
        if without is None:
            text += f"{on}: were that known, sd {shown_sd(name, known)}."
        else:
            left = shown_sd(name, without)
            left = left if left == NOT else f"sd {left}"
            text += (
                f"prior of the {on}: without it {left}; were that known, sd "
                f"{shown_sd(name, known)}."
            )
        said.append(text)
    return said


def shown_sd(name: str, spread: Spread) -> str:
    """Return an sd: of what is positive in per cent, or a factor where it is wide."""
    log_sd, sd = finite(spread.log_sd), finite(spread.sd)
    if log_sd is None:
        return NOT if sd is None else printed_number(name, sd, 2)
    if log_sd > PER_CENT:
        with np.errstate(over="ignore"):
            return f"a factor of {significant(float(np.exp(min(log_sd, 700.0))))}"
    return f"{significant(100 * log_sd)} %"


def data_lines(
    data: Sequence[AddedDatum], parameters: Mapping[str, Spread]
) -> list[str]:
    """Say what the best datum of each quantity leaves, those first that help most.

    Args:
        data: What could be added.
        parameters: How far each number may be off without it.
    """
    if not data:
        return []
    best: dict[str, AddedDatum] = {}
    for datum in data:
        best.setdefault(datum.quantity, datum)
    target = data[0].parameter
    now = parameters[target]
    rows, idle = [], []
    for datum in sorted(best.values(), key=lambda datum: _width(datum.left))[
        :MOST_HELP
    ]:
        if _helps(datum.left, now):
            rows.append(_row(datum))
        else:
            idle.append(quantity_words(datum.quantity))
    title = f"One more datum: sd of the {parameter_words(target)}"
    lines = ["", f"{title}, now {shown_sd(target, now)}"]
    for row in aligned(rows):
        lines += hanging(row)
    if idle:
        alone = "No one of these tells it" if not now.is_known else "No help"
        lines += hanging(f"{alone}: {joined(idle)}.")
    return lines


def _helps(left: Spread, now: Spread) -> bool:
    before = now.sd if math.isnan(left.log_sd) else now.log_sd
    return _width(left) < (LITTLE * before if math.isfinite(before) else math.inf)


def _width(left: Spread) -> float:
    """Return the sd that a datum leaves; infinite if nothing is known then."""
    return left.width if math.isfinite(left.width) else math.inf


def _row(datum: AddedDatum) -> tuple[str, str, str]:
    quantity = datum.quantity
    error = (
        printed_number(quantity, datum.sigma, 2)
        if quantity in ADDITIVE
        else f"{100 * datum.sigma:.2g} %"
    )
    whose = "our guess" if datum.is_default else "as planned"
    place = where(datum)
    if datum.position is not None and not datum.sensor:
        east, north, _ = datum.position
        place = f"at east {east:.4g}, north {north:.4g} m"
    of = f" of {datum.charge}" if datum.charge else ""
    mark = "" if datum.law_valid else "; law out of range"
    return (
        f"{quantity_words(quantity)}{of} {place}",
        shown_sd(datum.parameter, datum.left),
        f"(read to {error}, {whose}{mark})",
    )


def where(datum: AddedDatum) -> str:
    """Say where a datum would be recorded."""
    return f"at sensor {datum.sensor}" if datum.sensor else "off the sensors' line"


@dataclass(frozen=True)
class AddedRow:
    """A row that could be added to a layout, and what it would leave unknown.

    Attributes:
        of: The quantity, its law, and the number that it would constrain.
        where: Its position, in words.
        position_m: Its position; null in a scene without places.
        charge: Name of the charge; null for a single one.
        sigma: Its error: seconds, or relative.
        sigma_from: Source of the error.
        left: How far that may be off then.
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
