"""Columns of a study, read from its store: samples or statistics."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from jblast.errors import InputError, needed
from jblast.report.study_columns import (
    INCOMPLETE,
    Lane,
    StudyAxis,
    StudyColumns,
    columns_of,
    found_in,
)
from jblast.study.engine.merge import opened_intact, summary_of
from jblast.study.engine.store import Store, Variable
from jblast.study.engine.summary import State, merged_states, outcomes_of
from jblast.study.file import study_from_text
from jblast.study.sampling.run import scenes_of

MAX_POINTS = 40
"""Largest number of points of a convergence curve: each one merges all statistics."""
NOTE = (
    "Only statistics of the samples were stored: the error of a quantile is below "
    "0.8 % of its distance from the origin of its cell's sketch."
)


def read_columns(path: str) -> StudyColumns:
    """Read a store.

    Raises:
        InputError: There is no store, it has another layout or schema, or it is
            damaged, or zarr is not installed.
    """
    import xarray

    needed("zarr", "study", path, "a study is read")
    store = opened_intact(path)
    try:
        with warnings.catch_warnings():
            # zarr warns of our files in the store that are not arrays: lock, statistics
            warnings.filterwarnings("ignore", message=".*not recognized as a component")
            dataset = xarray.open_zarr(path, consolidated=False)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: expected the store of a study, as `jblast study` writes it: "
            f"{error}"
        ) from None
    # the order of the study: xarray lists arrays as the file system does
    ordered = [v.name for v in store.variables if v.name in dataset.data_vars]
    found = columns_of(dataset[ordered], path)
    if dataset.attrs.get("keep", "all") == "all":
        return found
    return summary_columns(store, found if found.samples else None, INCOMPLETE)


def summary_columns(
    store: Store, rows: StudyColumns | None, incomplete: str
) -> StudyColumns:
    """Return the statistics of a store.

    Args:
        store: The store.
        rows: The samples that it contains, if any, for the sensitivity analysis.
        incomplete: Note on a store that is not complete.

    Raises:
        InputError: There are no statistics.
    """
    summary, attributes = summary_of(store), store.attributes
    anchors, done = summary.anchors(), summary.written()
    states: dict[str, State] | None = None
    ends = np.unique(np.geomspace(1, max(1, len(done)), MAX_POINTS).astype(int))
    course: list[tuple[int, dict[str, dict[str, Any]]]] = []
    number = 0
    while number in done:
        own = summary.read(number, anchors)
        states = own if states is None else merged_states(store.variables, states, own)
        number += 1
        if number in ends:
            lanes = _lanes(store, states)
            whole = {
                lane.title: found_in(lane.kind, lane.state, slice(None), quantiles=())
                for lane in lanes
            }
            course.append((_counted(lanes), whole))
    axes = _axes(store, summary.groups)
    lanes = () if states is None else _lanes(store, states)
    notes = [NOTE] if attributes["complete"] else [NOTE, incomplete]
    return StudyColumns(
        lanes,
        {},
        {},
        axes,
        dict(attributes),
        summary.groups,
        notes,
        counted=_counted(lanes),
        course=tuple(course),
        rows=rows,
    )


def _counted(lanes: tuple[Lane, ...]) -> int:
    """Return the number of samples in the statistics."""
    if not lanes:
        return 0
    kinds = {"yes_no": lambda x: (x.known, x.lost)}
    parts = kinds.get(lanes[0].kind, lambda x: x.moments[:3])(lanes[0].state)
    return int(sum(np.sum(part) for part in parts))


def _lanes(store: Store, states: dict[str, State]) -> tuple[Lane, ...]:
    found: list[Lane] = []
    for v in outcomes_of(store.variables):
        for n, sensor in enumerate(v.sensors or ("",)):
            state = _lane_of(states[v.name], n) if v.sensors else states[v.name]
            empty = np.full(len(_first(state)), np.nan)
            lane = Lane(v.name, sensor, v.units, v.kind, v.long_name, empty)
            found.append(replace(lane, state=state))
    return tuple(found)


def _lane_of(state: State, sensor: int) -> State:
    """Return the part of a state that belongs to a sensor."""
    if hasattr(state, "_fields"):
        return type(state)(*(_lane_of(part, sensor) for part in state))
    return np.asarray(state)[:, sensor]


def _first(state: State) -> np.ndarray:
    while hasattr(state, "_fields"):
        state = state[0]
    return np.asarray(state)


def _axes(store: Store, groups: int) -> tuple[StudyAxis, ...]:
    """Return the axes, with the value of each variant and cell."""
    kept = store.attributes
    study = study_from_text(
        kept["study"], scenes_of(kept), allow_code=kept["allow_code"]
    )
    variant, cell = np.divmod(np.arange(groups), len(study.cells))
    found: list[StudyAxis] = []
    columns: dict[str, Any] = {}
    for n, axis in enumerate(study.numbers):
        columns[axis.key] = np.array([values[n] for values in study.cells])[cell]
    each = len(study.variants)
    for axis in study.words:
        # variants count in mixed radix, the last axis fastest
        each //= len(axis.values)
        columns[axis.key] = (variant // each % len(axis.values)).astype(float)
    for v in store.variables:
        if v.role == "axis":
            found.append(_axis(v, columns[v.name]))
    return tuple(found)


def _axis(v: Variable, column: np.ndarray) -> StudyAxis:
    values, at = np.unique(column, return_inverse=True)
    words = tuple(v.names[int(n)] for n in values) if v.names else ()
    return StudyAxis(v.name, v.units, values, words, at.reshape(-1))
