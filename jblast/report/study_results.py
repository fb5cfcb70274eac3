"""Results of a study as numbers and tables."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jblast.report.study_columns import NAMES, QUANTILES, Lane, StudyColumns, found_in
from jblast.results import Document
from jblast.study.sensitivity import (
    SobolIndices,
    disagreement,
    fitted_slopes,
    indices_from_samples,
)
from jblast.study.statistics import NUMBER, YES_NO

MAX_ROWS = 200
"""Largest number of rows of a table on the page; the JSON has all of them."""
REASONS = {
    "interaction": "acts together with others",
    "range": "has a larger effect over its whole range than its slope at the middle",
    "nonlinearity": "is steep at the middle, and levels off",
}
MAX_LANES = 12
"""Largest number of lanes with a sensitivity analysis, which takes seconds for each."""


def numbers(found: dict[str, Any]) -> dict[str, Any]:
    """Return arrays of one element as numbers; counts as integers."""
    return {
        name: int(value) if np.asarray(value).dtype.kind == "i" else float(value)
        for name, value in found.items()
    }


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        head: Titles of the columns.
        rows: Cells.
        numbers: Columns that are aligned right.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()


def printed(value: float, digits: int = 4) -> str:
    """Return a number as text, a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.{digits}g}"


def printed_share(share: float, digits: int = 3) -> str:
    """Return a share as text; near one with two digits of its difference from one."""
    # 0.99987 and 0.9991 differ by a factor of seven in what a reader looks for
    difference = 1.0 - float(share)
    if 0.0 < difference < 0.01:
        digits = max(digits, 2 + math.ceil(-math.log10(difference)))
    return printed(share, digits)


@dataclass(frozen=True)
class LaneSummary:
    """Statistics of some samples of a lane.

    Attributes:
        lane: The lane.
        cell: Values of the axes, as text; () for all samples.
        found: Results of `statistics`; for numbers with `q05`, `q50`, `q95`.
    """

    lane: Lane
    cell: tuple[str, ...]
    found: dict[str, Any]


def number_table(
    summaries: Sequence[LaneSummary], axes: Sequence[str] = ()
) -> Table | None:
    """Return the table of numbers; None without any."""
    head = (
        *("Outcome", *axes, "Unit", "Mean", "± s.e.", "5 %", "Median", "95 %"),
        *("Samples", "Infinite", "Failed"),
    )
    rows = [
        (
            one.lane.title,
            *one.cell,
            one.lane.units if one.lane.units != "1" else "",
            *(
                printed(one.found[name], 2 if name == "standard_error" else 4)
                for name in ("mean", "standard_error", "q05", "q50", "q95")
            ),
            *(f"{one.found[name]:,}" for name in ("count", "infinite", "lost")),
        )
        for one in summaries
        if one.lane.kind == "number"
    ]
    first = 2 + len(axes)
    return Table(head, rows[:MAX_ROWS], range(first, len(head))) if rows else None


def share_table(
    summaries: Sequence[LaneSummary], axes: Sequence[str] = ()
) -> Table | None:
    """Return the table of shares; None without any."""
    head = ("Outcome", *axes, "Share", "90 % interval", "Yes", "Samples", "Failed")
    rows = [
        (
            one.lane.title,
            *one.cell,
            printed_share(one.found["share"], 4),
            f"{printed_share(one.found['low'])} to {printed_share(one.found['high'])}",
            *(f"{one.found[name]:,}" for name in ("yes", "count", "lost")),
        )
        for one in summaries
        if one.lane.kind == "yes_no"
    ]
    first = 1 + len(axes)
    return Table(head, rows[:MAX_ROWS], range(first, len(head))) if rows else None


@dataclass(frozen=True)
class LaneShares:
    """Sensitivity of one lane.

    Attributes:
        lane: The lane.
        indices: Sobol' indices.
        elasticity: Elasticity by parameter, from a plane through the middle samples.
        reasons: Reason by parameter for a difference of slope and index, as text.
    """

    lane: Lane
    indices: SobolIndices
    elasticity: dict[str, float]
    reasons: dict[str, str]


def sensitivity_table(shares: Sequence[LaneShares]) -> Table | None:
    """Return the table of indices and elasticities; None without any."""
    rows = []
    for one in shares:
        of = one.indices
        for n, name in enumerate(of.names):
            first, total = of.first_interval[:, n], of.total_interval[:, n]
            rows.append(
                (
                    one.lane.title,
                    name,
                    f"{of.first[n]:.2f} ({first[0]:.2f} to {first[1]:.2f})",
                    f"{of.total[n]:.2f} ({total[0]:.2f} to {total[1]:.2f})",
                    printed(one.elasticity[name], 3),
                    one.reasons.get(name, ""),
                )
            )
    head = (
        "Outcome",
        "Parameter",
        "First order",
        "Total",
        "Elasticity",
        "Remark: the parameter",
    )
    return Table(head, rows[:MAX_ROWS], (2, 3, 4)) if rows else None


def text_lines(columns: StudyColumns, overall: Sequence[LaneSummary]) -> list[str]:
    """Return one line for each outcome, then the notes, for the terminal."""
    width = max((len(one.lane.title) for one in overall), default=0)
    lines = []
    for one in overall:
        found, name = one.found, one.lane.title.ljust(width)
        if one.lane.kind == "yes_no":
            lines.append(
                f"{name}  {printed_share(found['share'], 4)}, 90 % interval "
                f"{printed_share(found['low'])} to {printed_share(found['high'])}"
            )
        else:
            unit = "" if one.lane.units == "1" else f" {one.lane.units}"
            lines.append(
                f"{name}  mean {printed(found['mean'])} ± "
                f"{printed(found['standard_error'], 2)}{unit}, 90 % of samples "
                f"{printed(found['q05'])} to {printed(found['q95'])}"
            )
        if found["lost"]:
            lines[-1] += f"; {found['lost']:,} failed"
    return [*lines, *columns.notes]


@dataclass(frozen=True)
class OutcomeAnswer:
    """Statistics of an outcome.

    Attributes:
        outcome: Name of the outcome.
        sensor: Name of the sensor; null for none.
        axes: Value of each axis, as text; empty for all samples.
        units: Unit of a number; "1" for none.
        kind: "number" or "yes_no".
        found: For a number `count`, `infinite`, `lost`, `mean`, `standard_error`,
            `variance`, `sd`, `minimum`, `maximum`, `q05`, `q50`, `q95`; for yes or no
            `count`, `yes`, `lost`, `share`, `standard_error`, `low`, `high` (Wilson, 90
            %).
    """

    outcome: str
    sensor: str | None
    axes: Mapping[str, str]
    units: str
    kind: str
    found: Mapping[str, float | int]


@dataclass(frozen=True)
class InputShare:
    """Contribution of a parameter to the scatter of an outcome.

    Attributes:
        name: Name of the parameter.
        first: First-order Sobol' index: share of the variance that it explains alone.
        first_interval: 90 % interval of it.
        total: Total Sobol' index: share of the variance with its interactions.
        total_interval: 90 % interval of it.
        elasticity: Change of the outcome in per cent for one per cent of the parameter,
            at the middle of the samples.
        differs: Reason for a disagreement of slope and index; null if they agree.
    """

    name: str
    first: float
    first_interval: tuple[float, float]
    total: float
    total_interval: tuple[float, float]
    elasticity: float
    differs: str | None


@dataclass(frozen=True)
class SharesAnswer:
    """Sources of the scatter of an outcome.

    Attributes:
        outcome: Name of the outcome.
        sensor: Name of the sensor; null for none.
        explained: Share of the variance that the method explains.
        method: Description of the method.
        rows: Number of samples of the analysis.
        numbers: Contribution of each sampled parameter.
    """

    outcome: str
    sensor: str | None
    explained: float
    method: str
    rows: int
    numbers: tuple[InputShare, ...]


@dataclass(frozen=True)
class StudyReportAnswer(Document):
    """A report on a study.

    Attributes:
        samples: Number of samples in the store.
        complete: Whether the study is complete.
        seed: Seed of the study.
        design: Design of the sampling.
        study_sha256: SHA-256 of the study's file.
        scene_sha256: SHA-256 of the scene's file.
        axes: Values of each axis, as text.
        outcomes: Statistics of each outcome over all samples.
        cells: Statistics of each outcome in each combination of the axes' values.
        sensitivity: Sources of the scatter of each outcome, if samples identify them.
        notes: Notes, as sentences.
    """

    samples: int
    complete: bool
    seed: int | None
    design: str | None
    study_sha256: str | None
    scene_sha256: str | None
    axes: Mapping[str, tuple[str, ...]]
    outcomes: tuple[OutcomeAnswer, ...]
    cells: tuple[OutcomeAnswer, ...]
    sensitivity: tuple[SharesAnswer, ...]
    notes: tuple[str, ...]


def study_report_answer(
    columns: StudyColumns,
    overall: list[LaneSummary],
    cells: list[LaneSummary],
    shares: list[LaneShares],
) -> StudyReportAnswer:
    """Return the document; unknown or infinite numbers are null."""
    attributes, names = columns.attributes, [axis.name for axis in columns.axes]

    def word(name: str) -> str | None:
        return None if attributes.get(name) is None else str(attributes[name])

    return StudyReportAnswer(
        columns.total,
        bool(attributes.get("complete", False)),
        None if attributes.get("seed") is None else int(attributes["seed"]),
        word("design"),
        word("study_sha256"),
        word("scene_sha256"),
        {
            axis.name: tuple(axis.shown(n) for n in range(axis.values.size))
            for axis in columns.axes
        },
        tuple(_outcome(one, names) for one in overall),
        tuple(_outcome(one, names) for one in cells),
        tuple(_shares(one) for one in shares),
        tuple(columns.notes),
    )


def _outcome(one: LaneSummary, names: list[str]) -> OutcomeAnswer:
    lane = one.lane
    axes = dict(zip(names, one.cell, strict=True)) if one.cell else {}
    return OutcomeAnswer(
        lane.name, lane.sensor or None, axes, lane.units, lane.kind, one.found
    )


def _shares(one: LaneShares) -> SharesAnswer:
    of = one.indices
    numbers = tuple(
        InputShare(
            name,
            float(of.first[n]),
            (float(of.first_interval[0, n]), float(of.first_interval[1, n])),
            float(of.total[n]),
            (float(of.total_interval[0, n]), float(of.total_interval[1, n])),
            one.elasticity[name],
            one.reasons.get(name),
        )
        for n, name in enumerate(of.names)
    )
    lane = one.lane
    return SharesAnswer(
        lane.name, lane.sensor or None, of.explained, of.method, of.rows, numbers
    )


def summary_of(
    columns: StudyColumns,
    lane: Lane,
    mask: Bool[np.ndarray, " sample"] | None = None,
    cell: tuple[str, ...] = (),
) -> LaneSummary:
    """Return the statistics of some samples of a lane.

    The quantiles are those of the samples, not of the sketch.
    """
    if lane.state is not None:
        which = slice(None) if mask is None else np.flatnonzero(mask)
        return LaneSummary(lane, cell, numbers(found_in(lane.kind, lane.state, which)))
    values = lane.values if mask is None else lane.values[mask]
    if lane.kind == "yes_no":
        flags = np.where(np.isnan(values), -1, values).astype(np.int8)
        state = YES_NO.add(YES_NO.empty(), flags)
        return LaneSummary(lane, cell, numbers(YES_NO.finish(state)))
    state = NUMBER.add(NUMBER.empty(), values)
    found = NUMBER.finish(state, QUANTILES)
    quantiles = found.pop("quantiles")
    known = values[~np.isnan(values)]
    if known.size:
        quantiles = np.quantile(known, QUANTILES, method="inverted_cdf")
    named = zip(NAMES, quantiles, strict=True)
    return LaneSummary(lane, cell, numbers(found | dict(named)))


def shares_of(columns: StudyColumns) -> list[LaneShares]:
    """Return the sensitivity of the first lanes, if their samples identify it.

    Axes over numbers count as sampled evenly from their values.
    """
    inputs: dict[str, Float[np.ndarray, " sample"]] = dict(columns.inputs)
    inputs |= {axis.name: axis.values[axis.at] for axis in columns.numeric_axes}
    found = []
    if columns.counted is not None:
        return [] if columns.rows is None else shares_of(columns.rows)
    for lane in columns.lanes[:MAX_LANES]:
        indices = indices_from_samples(inputs, lane.values)
        if indices is None:
            continue
        good = np.isfinite(lane.values)
        elastic, by_slope = fitted_slopes(
            {name: of[good] for name, of in inputs.items()}, lane.values[good]
        )
        why = disagreement(indices, by_slope)
        reasons = {name: REASONS[one] for name, one in why.items()}
        found.append(LaneShares(lane, indices, elastic, reasons))
    return found
