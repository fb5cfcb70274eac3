"""Columns of a study: its axes, inputs and outcomes, from samples or statistics.

A store has all samples, or only statistics of each cell of the axes. Both have one
interface: `Lane.statistics` of chosen elements, and `Lane.distribution`.
"""

import itertools
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.errors import InputError
from jblast.study.engine.merge import opened_intact, summary_of
from jblast.study.engine.store import SCHEMA, Kind, Store, Variable
from jblast.study.engine.summary import State, merged_states, outcomes_of
from jblast.study.file import study_from_text
from jblast.study.sampling.run import scenes_of
from jblast.study.statistics import (
    Moments,
    QuantileSketch,
    bin_edges,
    blocks,
    empty_moments,
    finish_moments,
    finish_share,
    fold,
    merge_moments,
    merge_shares,
    moments_of,
    share_of,
    sketch_quantiles,
)

if TYPE_CHECKING:
    import xarray

QUANTILES = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
MAX_POINTS = 40
"""Largest number of points of a course: each one merges all statistics."""
SKETCHED = (
    "Only statistics of the samples were stored: the error of a quantile is below "
    "0.8 % of its distance from the origin of its cell's sketch."
)
Which = Bool[np.ndarray, " element"] | slice
ALL = slice(None)


@dataclass(frozen=True)
class Lane(ABC):
    """An outcome at one sensor, or without a sensor.

    Attributes:
        name: Name of the outcome.
        sensor: Name of the sensor; "" for none.
        units: Unit of the values; "1" for none.
        kind: "number" or "yes_no".
        long_name: Description.
        values: Value of each sample, NaN for a failed one; empty for statistics.
    """

    name: str
    sensor: str
    units: str
    kind: Kind
    long_name: str
    values: Float[np.ndarray, " sample"]

    @property
    def title(self) -> str:
        """Name of outcome and sensor."""
        return f"{self.name}, {self.sensor}" if self.sensor else self.name

    @abstractmethod
    def state(self, which: Which = ALL) -> State:
        """Return `Moments` or `ShareState` of some elements: samples or cells."""

    @abstractmethod
    def distribution(
        self, which: Which = ALL
    ) -> tuple[Float[np.ndarray, " value"], Int[np.ndarray, " value"]]:
        """Return distinct or repeated values in ascending order, and their counts."""

    @abstractmethod
    def course(self) -> list[dict[str, Any]]:
        """Return `finished` after growing numbers of samples, all of them last."""

    def statistics(self, which: Which = ALL) -> dict[str, Any]:
        """Return the results of `finished`, for numbers with `QUANTILES`."""
        found = self.finished(self.state(which))
        if self.kind == "number":
            at = self.quantiles(which, np.array([*QUANTILES.values()]))
            found |= dict(zip(QUANTILES, map(float, at), strict=True))
        return found

    def quantiles(
        self, which: Which, shares: Float[np.ndarray, " quantile"]
    ) -> Float[np.ndarray, " quantile"]:
        """Return quantiles of the distribution; NaN without values."""
        values, counts = self.distribution(which)
        if not len(values):
            return np.full(len(shares), math.nan)
        return np.quantile(values, shares, weights=counts, method="inverted_cdf")

    def finished(self, state: State) -> dict[str, Any]:
        """Return `finish_share` or `finish_moments` of a state, as plain numbers."""
        found = (finish_share if self.kind == "yes_no" else finish_moments)(state)
        return {name: value.item() for name, value in found.items()}


class SampledLane(Lane):
    """A lane with all samples."""

    def state(self, which: Which = ALL) -> State:
        """Return the state of some samples."""
        values = self.values[which]
        if self.kind == "yes_no":
            flags = np.where(np.isnan(values), -1, values).astype(np.int8)
            return share_of(flags)
        parts = [moments_of(values[part]) for part in blocks(len(values))]
        return fold(empty_moments(), parts, merge_moments)

    def distribution(self, which: Which = ALL):
        """Return the values of some samples, each counted once."""
        values = self.values[which]
        known = np.sort(values[~np.isnan(values)])
        return known, np.ones(known.size, int)

    def course(self) -> list[dict[str, Any]]:
        """Return the statistics of the first samples."""
        ends = points(10, len(self.values))
        return [self.finished(self.state(slice(end))) for end in ends]


@dataclass(frozen=True)
class CountedLane(Lane):
    """A lane with statistics of each variant and cell.

    Attributes:
        cells: Statistics of each variant and cell.
        after: Statistics of all cells together after growing numbers of samples.
    """

    cells: State
    after: list[dict[str, Any]] = field(default_factory=list)

    def state(self, which: Which = ALL) -> State:
        """Return the merged state of some cells."""
        yes_no = self.kind == "yes_no"
        state, merge = (
            (self.cells, merge_shares)
            if yes_no
            else (self.cells.moments, merge_moments)
        )
        parts = [np.asarray(part)[which] for part in state]
        first, *others = (type(state)(*one) for one in zip(*parts, strict=True))
        return fold(first, others, merge)

    def quantiles(
        self, which: Which, shares: Float[np.ndarray, " quantile"]
    ) -> Float[np.ndarray, " quantile"]:
        """Return quantiles, for a single cell interpolated within its bins."""
        sketch = QuantileSketch(*(np.asarray(x)[which] for x in self.cells.sketch))
        if len(sketch.origin) > 1:
            return super().quantiles(which, shares)
        found: Moments = self.state(which)
        ends = np.asarray(found.minimum), np.asarray(found.maximum)
        return sketch_quantiles(sketch, shares, *ends)[:, 0]

    def distribution(self, which: Which = ALL):
        """Return the middles of the bins of some cells, and their counts."""
        found: Moments = self.state(which)
        counts, origin = (np.asarray(part)[which] for part in self.cells.sketch)
        edges = np.clip(bin_edges(), -1e300, 1e300)
        middle = 0.5 * (edges[:-1] + edges[1:])
        group, place = np.nonzero(counts)
        values = np.clip(origin[group] + middle[place], found.minimum, found.maximum)
        order = np.argsort(values, kind="stable")
        return values[order], counts[group, place][order]

    def course(self) -> list[dict[str, Any]]:
        """Return the statistics after growing numbers of tiles."""
        return self.after


@dataclass(frozen=True)
class StudyAxis:
    """An axis of the study.

    Attributes:
        name: Parameter of the scene, or key of its file.
        units: Unit of the values.
        values: Distinct values in ascending order; codes if it has words.
        words: Words of the codes; () for numbers.
        at: Index of the value of each element of a lane.
    """

    name: str
    units: str
    values: Float[np.ndarray, " value"]
    words: tuple[str, ...]
    at: Int[np.ndarray, " element"]

    def shown(self, index: int) -> str:
        """Return one of its values as text."""
        return self.words[index] if self.words else f"{self.values[index]:.4g}"


@dataclass(frozen=True)
class StudyColumns:
    """The stored samples or statistics of a study.

    Attributes:
        lanes: The outcomes.
        inputs: Sampled parameters, by name.
        axes: Axes of the study, in the order of the store.
        attributes: Attributes of the store.
        samples: Number of computed samples.
        missing: Number of samples that are not computed yet.
        rows: Samples that were stored in addition to statistics.
    """

    lanes: tuple[Lane, ...]
    inputs: Mapping[str, Float[np.ndarray, " sample"]]
    axes: tuple[StudyAxis, ...]
    attributes: Mapping[str, Any]
    samples: int
    missing: int = 0
    rows: "StudyColumns | None" = None

    @property
    def notes(self) -> list[str]:
        """Notes on precision and missing samples, as sentences."""
        notes = [SKETCHED] if any(not lane.values.size for lane in self.lanes) else []
        if self.missing:
            notes.append(
                f"The study is not complete: {self.missing:,} of "
                f"{self.missing + self.samples:,} samples are missing. A resumed study "
                "computes them."
            )
        return notes

    @property
    def numeric_axes(self) -> list[StudyAxis]:
        """Axes over numbers, with two or more values."""
        return [one for one in self.axes if not one.words and one.values.size > 1]

    @property
    def word_axes(self) -> list[StudyAxis]:
        """Axes over words, with two or more values."""
        return [one for one in self.axes if one.words and one.values.size > 1]

    def cells(self) -> Iterator[tuple[dict[str, str], Bool[np.ndarray, " element"]]]:
        """Yield the values of each cell of the axes, as text, and its elements."""
        for chosen in itertools.product(*(range(a.values.size) for a in self.axes)):
            pairs = list(zip(self.axes, chosen, strict=True))
            mask = np.all([axis.at == place for axis, place in pairs], axis=0)
            if self.axes and mask.any():
                yield {axis.name: axis.shown(place) for axis, place in pairs}, mask


def read_columns(path: str | os.PathLike[str]) -> StudyColumns:
    """Read a store: its samples, or its statistics.

    Raises:
        InputError: There is no store, it has another layout or schema, or it is
            damaged.
    """
    store = opened_intact(path)
    tiles = [store.read_tile(tile) for tile in sorted(store.written())]
    rows = None
    if tiles:
        names = [v.name for v in store.variables]
        columns = {
            name: np.concatenate([tile[name] for tile in tiles]) for name in names
        }
        rows = _columns(store.variables, columns, store.attributes, store.samples)
    if store.attributes.get("keep", "all") != "all":
        return _counted(store, rows)
    if rows is None:
        raise InputError(f"{path}: expected samples, got a store without any")
    return rows


def columns_of(dataset: "xarray.Dataset", source: str = "study") -> StudyColumns:
    """Return the columns of a data set of `run`.

    Raises:
        InputError: It has another layout or schema, or no samples.
    """
    schema = dataset.attrs.get("jblast_study_schema")
    if schema != SCHEMA or "sample" not in dataset.sizes:
        raise InputError(
            f"{source}: expected samples and jblast_study_schema {SCHEMA}, "
            f"got {schema} and the dimensions {', '.join(map(str, dataset.sizes))}"
        )
    sensors = (
        tuple(str(one) for one in dataset["sensor"].values)
        if "sensor" in dataset
        else ()
    )
    variables, columns = [], {}
    for name, column in dataset.data_vars.items():
        own: dict[str, Any] = {"units": "1", "long_name": str(name)} | column.attrs
        own["names"] = tuple(own.get("names", ()))
        own["sensors"] = sensors if column.ndim > 1 else ()
        variables.append(Variable(str(name), **own))
        columns[str(name)] = column.values
    samples = int(dataset.sizes["sample"])
    return _columns(variables, columns, dict(dataset.attrs), samples)


def _columns(
    variables: Sequence[Variable],
    columns: Mapping[str, np.ndarray],
    attributes: Mapping[str, Any],
    whole: int,
) -> StudyColumns:
    """Return the columns of samples, some of `whole` requested ones."""
    lanes: list[Lane] = []
    for v in outcomes_of(variables):
        values = np.asarray(columns[v.name], float)
        if v.kind == "yes_no":
            values = np.where(values < 0, np.nan, values)
        for n, sensor in enumerate(v.sensors or ("",)):
            own = values[:, n] if v.sensors else values
            lanes.append(SampledLane(v.name, sensor, v.units, v.kind, v.long_name, own))
    by_role = {r: [v for v in variables if v.role == r] for r in ("input", "axis")}
    samples = len(next(iter(columns.values())))
    return StudyColumns(
        tuple(lanes),
        {v.name: np.asarray(columns[v.name], float) for v in by_role["input"]},
        tuple(_axis(v, columns[v.name]) for v in by_role["axis"]),
        attributes,
        samples,
        whole - samples,
    )


def _axis(v: Variable, column: np.ndarray) -> StudyAxis:
    values, at = np.unique(np.asarray(column, float), return_inverse=True)
    words = tuple(v.names[int(n)] if n >= 0 else "-" for n in values) if v.names else ()
    return StudyAxis(v.name, v.units, values, words, at.reshape(-1))


def points(first: int, last: int) -> list[int]:
    """Return at most `MAX_POINTS` growing numbers of samples or tiles."""
    ends = np.geomspace(min(first, last), last, MAX_POINTS) if last else np.zeros(0)
    return [int(end) for end in np.unique(ends.astype(int))]


def _counted(store: Store, rows: StudyColumns | None) -> StudyColumns:
    """Return the statistics of a store.

    Raises:
        InputError: There are no statistics.
    """
    summary, attributes = summary_of(store), store.attributes
    anchors, done = summary.anchors(), summary.written()
    # the order of merging is that of the run, which stops at the first missing tile
    tiles = list(itertools.takewhile(done.__contains__, range(summary.tiles)))
    ends = points(1, len(tiles))
    states: dict[str, State] = {}
    lanes: list[CountedLane] = []
    for number in tiles:
        own = summary.read(number, anchors)
        states = merged_states(store.variables, states, own) if states else own
        if number + 1 in ends:
            # of earlier points only the totals are kept, as sketches may take gigabytes
            before = [lane.after for lane in lanes] or itertools.repeat([])
            lanes = [
                replace(lane, after=[*after, lane.finished(lane.state())])
                for lane, after in zip(
                    _counted_lanes(store, states), before, strict=False
                )
            ]
    samples = total(lanes[0].after[-1]) if lanes else 0
    missing = int(attributes["samples"]) - samples
    axes = _axes(store, summary.groups)
    return StudyColumns(tuple(lanes), {}, axes, attributes, samples, missing, rows)


def total(found: Mapping[str, int]) -> int:
    """Return the number of samples of some statistics, failed ones included."""
    return sum(found.get(name, 0) for name in ("count", "infinite", "lost"))


def _counted_lanes(store: Store, states: Mapping[str, State]) -> Iterator[CountedLane]:
    for v in outcomes_of(store.variables):
        for n, sensor in enumerate(v.sensors or ("",)):
            state = _at_sensor(states[v.name], n if v.sensors else None)
            none = np.empty(0)
            yield CountedLane(v.name, sensor, v.units, v.kind, v.long_name, none, state)


def _at_sensor(state: State, sensor: int | None) -> State:
    """Return the part of a state that belongs to a sensor; all of it for None."""
    if hasattr(state, "_fields"):
        return type(state)(*(_at_sensor(part, sensor) for part in state))
    return np.asarray(state) if sensor is None else np.asarray(state)[:, sensor]


def _axes(store: Store, groups: int) -> tuple[StudyAxis, ...]:
    """Return the axes, with the value of each variant and cell."""
    kept = store.attributes
    study = study_from_text(
        kept["study"], scenes_of(kept), allow_code=kept["allow_code"]
    )
    variant, cell = np.divmod(np.arange(groups), len(study.cells))
    columns: dict[str, Any] = {}
    for n, axis in enumerate(study.numbers):
        columns[axis.key] = np.array([values[n] for values in study.cells])[cell]
    each = len(study.variants)
    for axis in study.words:
        # variants count in mixed radix, the last axis fastest
        each //= len(axis.values)
        columns[axis.key] = variant // each % len(axis.values)
    return tuple(_axis(v, columns[v.name]) for v in store.variables if v.role == "axis")
