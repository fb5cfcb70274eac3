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

MOST_ROWS = 200
"""Rows of a table on the page; the document has all."""
REASONS = {
    "interaction": "acts together with others",
    "range": "does more over its whole range than its slope at the middle says",
    "nonlinearity": "is steep at the middle, and levels off",
}
MOST_LANES = 12
"""Lanes whose scatter is looked into."""


def numbers(found: dict[str, Any]) -> dict[str, Any]:
    """Return arrays of one element as numbers; counts as whole ones."""
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
        numbers: Columns that end below one another.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()


def printed(value: float, digits: int = 4) -> str:
    """Return a number, a dash where there is none."""
    return "-" if math.isnan(value) else f"{value:.{digits}g}"


def printed_share(share: float, digits: int = 3) -> str:
    """Print a share; one that is nearly one by the digits of what it lacks."""
    lacks = 1.0 - float(share)
    if 0.0 < lacks < 0.01:
        digits = max(digits, 2 + math.ceil(-math.log10(lacks)))
    return printed(share, digits)


@dataclass(frozen=True)
class LaneSummary:
    """A lane, of some samples.

    Attributes:
        lane: Which.
        cell: Values of the axes in words; () of all samples.
        found: As `statistics` finishes it; of a number with `q05`, `q50`, `q95`.
    """

    lane: Lane
    cell: tuple[str, ...]
    found: dict[str, Any]


def number_table(
    summaries: Sequence[LaneSummary], axes: Sequence[str] = ()
) -> Table | None:
    """Return the table of numbers; None where there are none."""
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
    return Table(head, rows[:MOST_ROWS], range(first, len(head))) if rows else None


def share_table(
    summaries: Sequence[LaneSummary], axes: Sequence[str] = ()
) -> Table | None:
    """Return the table of shares; None where there are none."""
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
    return Table(head, rows[:MOST_ROWS], range(first, len(head))) if rows else None


@dataclass(frozen=True)
class LaneShares:
    """Of one lane.

    Attributes:
        lane: Which.
        indices: Sobol's.
        elasticity: By name, of the plane through the samples at the middle.
        reasons: By name why slope and index differ, in words.
    """

    lane: Lane
    indices: SobolIndices
    elasticity: dict[str, float]
    reasons: dict[str, str]


def sensitivity_table(shares: Sequence[LaneShares]) -> Table | None:
    """Return indices and elasticities side by side; None where there are none."""
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
        "Number",
        "Alone",
        "With others",
        "Elasticity",
        "They differ as it",
    )
    return Table(head, rows[:MOST_ROWS], (2, 3, 4)) if rows else None


def text_lines(columns: StudyColumns, overall: Sequence[LaneSummary]) -> list[str]:
    """Return the text for a terminal: a line for each outcome."""
    width = max((len(one.lane.title) for one in overall), default=0)
    said = []
    for one in overall:
        found, name = one.found, one.lane.title.ljust(width)
        if one.lane.kind == "yes_no":
            said.append(
                f"{name}  {printed_share(found['share'], 4)}, 90 % interval "
                f"{printed_share(found['low'])} to {printed_share(found['high'])}"
            )
        else:
            unit = "" if one.lane.units == "1" else f" {one.lane.units}"
            said.append(
                f"{name}  mean {printed(found['mean'])} ± "
                f"{printed(found['standard_error'], 2)}{unit}, 90 % of samples "
                f"{printed(found['q05'])} to {printed(found['q95'])}"
            )
        if found["lost"]:
            said[-1] += f"; {found['lost']:,} failed"
    return [*columns.notes, *said]


@dataclass(frozen=True)
class OutcomeAnswer:
    """What an outcome amounts to.

    Attributes:
        outcome: Its name.
        sensor: Whose it is; null where it is no sensor's.
        axes: Value of each axis in words; empty of all samples.
        units: Of a number; "1" of none.
        kind: "number" or "yes_no".
        found: Of a number `count`, `infinite`, `lost`, `effective_size`, `mean`,
            `standard_error`, `variance`, `sd`, `minimum`, `maximum`, `q05`, `q50`,
            `q95`; of yes or no `count`, `yes`, `lost`, `effective_size`,
            `equivalent_size`, `share`, `standard_error`, `low`, `high` (Wilson, 90 %).
    """

    outcome: str
    sensor: str | None
    axes: Mapping[str, str]
    units: str
    kind: str
    found: Mapping[str, float | int]


@dataclass(frozen=True)
class InputShare:
    """What a number has to do with an outcome's scatter.

    Attributes:
        name: Of the number.
        first: Sobol' index: share of the variance that it explains alone.
        first_interval: 90 % interval of it.
        total: Share of all in which it takes part.
        total_interval: 90 % interval of it.
        elasticity: Per cent of the outcome for one per cent of the number, about the
            middle of the samples.
        differs: Why slope and index disagree; null where they agree.
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
    """What an outcome's scatter comes from.

    Attributes:
        outcome: Its name.
        sensor: Whose it is; null where it is no sensor's.
        explained: Share of the variance that the method accounts for.
        method: In words.
        rows: Samples that it was found from.
        numbers: Each number that varies.
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
        samples: In the store.
        complete: Whether it has all.
        seed: Of the study.
        design: How its draws fill what the priors allow.
        study_sha256: Of the study's file.
        scene_sha256: Of the scene's.
        axes: Values of each axis, in words.
        outcomes: Each over all samples.
        cells: Each in each combination of the values of the axes.
        sensitivity: Contributions to the scatter of each, where samples identify them.
        notes: Remarks, a sentence each.
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
    """Return the document; what is not known, or infinite, is null."""
    said, names = columns.attributes, [axis.name for axis in columns.axes]

    def word(name: str) -> str | None:
        return None if said.get(name) is None else str(said[name])

    return StudyReportAnswer(
        columns.total,
        bool(said.get("complete", False)),
        None if said.get("seed") is None else int(said["seed"]),
        word("design"),
        word("study_sha256"),
        word("scene_sha256"),
        {
            axis.name: tuple(axis.said(n) for n in range(axis.values.size))
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
    """Return what some samples of a lane amount to.

    Quantiles are those of the samples themselves where they have no weights.
    """
    if lane.state is not None:
        which = slice(None) if mask is None else np.flatnonzero(mask)
        return LaneSummary(lane, cell, numbers(found_in(lane.kind, lane.state, which)))
    values = lane.values if mask is None else lane.values[mask]
    weights = columns.weights
    if weights is not None and mask is not None:
        weights = weights[mask]
    if lane.kind == "yes_no":
        flags = np.where(np.isnan(values), -1, values).astype(np.int8)
        state = YES_NO.add(YES_NO.empty(), flags, weights)
        return LaneSummary(lane, cell, numbers(YES_NO.finish(state)))
    state = NUMBER.add(NUMBER.empty(weighted=weights is not None), values, weights)
    found = NUMBER.finish(state, QUANTILES)
    quantiles = found.pop("quantiles")
    known = values[~np.isnan(values)]
    if weights is None and known.size:
        quantiles = np.quantile(known, QUANTILES, method="inverted_cdf")
    named = zip(NAMES, quantiles, strict=True)
    return LaneSummary(lane, cell, numbers(found | dict(named)))


def summaries_of(columns: StudyColumns) -> list[LaneSummary]:
    """Return each lane over all samples."""
    return [summary_of(columns, lane) for lane in columns.lanes]


def cell_summaries(columns: StudyColumns) -> list[LaneSummary]:
    """Return each lane in each cell of the axes; none where there are no axes."""
    if not columns.axes:
        return []
    return [
        summary_of(columns, lane, mask, cell)
        for lane in columns.lanes
        for cell, mask in columns.cells()
    ]


def shares_of(columns: StudyColumns) -> list[LaneShares]:
    """Return the shares of the first lanes that vary, and of which samples tell some.

    Axes over numbers count as drawn evenly from their values.
    """
    inputs: dict[str, Float[np.ndarray, " sample"]] = dict(columns.inputs)
    inputs |= {axis.name: axis.values[axis.at] for axis in columns.numeric_axes}
    found = []
    if columns.counted is not None:
        return [] if columns.rows is None else shares_of(columns.rows)
    for lane in columns.lanes[:MOST_LANES]:
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
