"""What each outcome's scatter comes from: indices and slopes, and how they differ."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.report.study.page.columns import Lane, StudyColumns
from jblast.study.sensitivity import (
    SobolIndices,
    disagreement,
    fitted_slopes,
    indices_from_samples,
)

REASONS = {
    "interaction": "acts together with others",
    "range": "does more over its whole range than its slope at the middle says",
    "nonlinearity": "is steep at the middle, and levels off",
}
MOST_LANES = 12
"""Lanes whose scatter is looked into."""


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
