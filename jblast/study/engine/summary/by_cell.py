"""Columns reduced on the host, by cell of the axes."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from jblast.study.engine.summary.states import (
    Anchor,
    Anchors,
    State,
    moments_from,
    outcomes_of,
    shape_of,
    share_from,
)
from jblast.study.engine.variable import Variable
from jblast.study.statistics.number import NumberState
from jblast.study.statistics.quantile_sketch import (
    BINS,
    QuantileSketch,
    bin_of,
    origin_of,
)


def states_by_group(
    variables: Sequence[Variable],
    columns: Mapping[str, np.ndarray],
    which: Int[np.ndarray, " sample"],
    groups: int,
    anchors: Anchors,
) -> dict[str, State]:
    """Return the states of samples.

    Args:
        variables: The columns.
        columns: Their values.
        which: Variant and cell of each sample, as one number.
        groups: How many of those there are.
        anchors: What numbers are counted from.
    """
    found: dict[str, State] = {}
    for v in outcomes_of(variables):
        values = np.asarray(columns[v.name]).reshape(len(which), -1)
        shape = shape_of(v, groups)
        if v.kind == "yes_no":
            parts = values >= 0, values > 0, values < 0
            found[v.name] = share_from(
                *(_by(which, x, groups).astype(np.int64).reshape(shape) for x in parts)
            )
            continue
        numbers = _numbers(values, which, groups)
        origin = np.broadcast_to(anchors[v.name].origin, shape)
        away = origin.reshape(groups, -1)[which]
        counts = np.stack(
            [
                np.bincount(
                    which[known] * BINS + np.asarray(bin_of(own[known])),
                    minlength=groups * BINS,
                ).reshape(groups, BINS)
                for own, known in zip((values - away).T, ~np.isnan(values).T)  # noqa: B905
            ],
            axis=1,
        )
        found[v.name] = NumberState(
            moments_from(numbers.reshape(*shape, 7)),
            QuantileSketch(counts.reshape(*shape, BINS), origin),
        )
    return found


def _by(
    which: Int[np.ndarray, " sample"], values: np.ndarray, groups: int
) -> Float[np.ndarray, "group lane"]:
    """Return sums by group, lane after lane."""
    return np.stack(
        [np.bincount(which, lane, minlength=groups) for lane in values.T.astype(float)],
        axis=-1,
    )


def _numbers(
    values: Float[np.ndarray, "sample lane"],
    which: Int[np.ndarray, " sample"],
    groups: int,
) -> Float[np.ndarray, "group lane 7"]:
    """Return the seven numbers that make moments, in two passes."""
    finite, nan = np.isfinite(values), np.isnan(values)
    count = _by(which, finite, groups)
    total = _by(which, np.where(finite, values, 0.0), groups)
    mean = total / np.maximum(count, 1)
    off = np.where(finite, values - mean[which], 0.0)
    low = np.full((groups, values.shape[1]), np.inf)
    high = -low
    order = np.argsort(which, kind="stable")
    begins = np.flatnonzero(np.diff(which[order], prepend=-1))
    there = which[order][begins]
    if len(which):
        sorted_values = values[order]
        low[there] = np.fmin.reduceat(
            np.where(np.isnan(sorted_values), np.inf, sorted_values), begins
        )
        high[there] = np.fmax.reduceat(
            np.where(np.isnan(sorted_values), -np.inf, sorted_values), begins
        )
    parts = (
        count,
        _by(which, ~finite & ~nan, groups),
        _by(which, nan, groups),
        mean,
        _by(which, off**2, groups),
        low,
        high,
    )
    return np.stack(parts, -1)


def anchors_of(
    variables: Sequence[Variable],
    columns: Mapping[str, np.ndarray],
    which: Int[np.ndarray, " sample"],
    groups: int,
) -> dict[str, Anchor]:
    """Return what numbers should be counted from, by some samples of each group."""
    found = {}
    for v in outcomes_of(variables):
        if v.kind == "yes_no":
            continue
        shift, origin = np.zeros(shape_of(v, groups)), np.zeros(shape_of(v, groups))
        for group in range(groups):
            own = np.asarray(columns[v.name], float)[which == group]
            if not len(own):
                continue
            origin[group] = origin_of(own)
            known = np.where(np.isfinite(own), own, 0.0)
            shift[group] = known.sum(0) / np.maximum(np.isfinite(own).sum(0), 1)
        found[v.name] = Anchor(shift, origin)
    return found
