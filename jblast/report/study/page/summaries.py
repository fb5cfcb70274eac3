"""What each outcome amounts to, over all samples and in each cell of the axes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool

from jblast.report.study.page.columns import Lane, StudyColumns
from jblast.report.study.page.lane_states import NAMES, QUANTILES, found_in
from jblast.study.statistics import NUMBER, YES_NO


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


def numbers(found: dict[str, Any]) -> dict[str, Any]:
    """Return arrays of one element as numbers; counts as whole ones."""
    return {
        name: int(value) if np.asarray(value).dtype.kind == "i" else float(value)
        for name, value in found.items()
    }


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
