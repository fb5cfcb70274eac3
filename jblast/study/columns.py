"""Columns of a study: its axes, inputs and outcomes, from samples and moments.

Statistics of chosen cases are the merged moments of all their samples. Quantiles and
distributions are those of the stored samples, which are the first ones.
"""

import itertools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.errors import InputError, require
from jblast.study.statistics import (
    Moments,
    finish_moments,
    finish_share,
    merged_moments,
    moments,
    over_cases,
)
from jblast.study.store import SCHEMA, Kind, opened_store

if TYPE_CHECKING:
    import xarray

QUANTILES = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
MAX_POINTS = 40
"""Largest number of points of a course."""
Which = Bool[np.ndarray, " case"] | slice
ALL = slice(None)


@dataclass(frozen=True)
class Lane:
    """An outcome at one sensor, or without a sensor.

    Attributes:
        name: Name of the outcome.
        sensor: Name of the sensor; "" for none.
        units: Unit of the values; "1" for none.
        kind: "number" or "yes_no".
        long_name: Description.
        values: Values of the stored samples, NaN for a failed one.
        moments: Moments of all samples by case.
        after: Moments of all cases together after growing numbers of samples.
    """

    name: str
    sensor: str
    units: str
    kind: Kind
    long_name: str
    values: Float[np.ndarray, "draw case"]
    moments: Moments
    after: tuple[Moments, ...]

    @property
    def title(self) -> str:
        """Name of outcome and sensor."""
        return f"{self.name}, {self.sensor}" if self.sensor else self.name

    def statistics(self, which: Which = ALL) -> dict[str, Any]:
        """Return the statistics of some cases, of numbers with `QUANTILES`."""
        found = self.finished(over_cases(self.moments, which))
        if self.kind == "number":
            known, at = self.distribution(which), np.array([*QUANTILES.values()])
            quantiles = np.full(at.size, math.nan)
            if known.size:
                quantiles = np.quantile(known, at, method="inverted_cdf")
            found |= dict(zip(QUANTILES, map(float, quantiles), strict=True))
        return found

    def finished(self, state: Moments) -> dict[str, Any]:
        """Return `finish_share` or `finish_moments` of a state, as plain numbers."""
        found = (finish_share if self.kind == "yes_no" else finish_moments)(state)
        return {name: value.item() for name, value in found.items()}

    def distribution(self, which: Which = ALL) -> Float[np.ndarray, " value"]:
        """Return the values of the stored samples of some cases, in ascending order."""
        values = self.values[:, which].ravel()
        return np.sort(values[~np.isnan(values)])

    def course(self) -> list[dict[str, Any]]:
        """Return `finished` after growing numbers of samples, all of them last."""
        return [self.finished(state) for state in self.after]


@dataclass(frozen=True)
class StudyAxis:
    """An axis of the study.

    Attributes:
        name: Parameter of the scene, or key of its file.
        units: Unit of the values.
        values: Values; their numbers if the axis has words.
        words: Words; () for numbers.
        at: Index of the value of each case.
    """

    name: str
    units: str
    values: Float[np.ndarray, " value"]
    words: tuple[str, ...]
    at: Int[np.ndarray, " case"]

    def shown(self, index: int) -> str:
        """Return one of its values as text."""
        return self.words[index] if self.words else f"{self.values[index]:.4g}"


@dataclass(frozen=True)
class StudyColumns:
    """The stored samples and moments of a study.

    Attributes:
        lanes: The outcomes.
        inputs: Sampled parameters of the stored samples, by name.
        axes: Axes of the study, in the order of the store.
        attributes: Attributes of the store.
        samples: Number of computed samples.
        missing: Number of samples that are not computed yet.
    """

    lanes: tuple[Lane, ...]
    inputs: Mapping[str, Float[np.ndarray, "draw case"]]
    axes: tuple[StudyAxis, ...]
    attributes: Mapping[str, Any]
    samples: int
    missing: int = 0

    @property
    def notes(self) -> list[str]:
        """Notes on precision and missing samples, as sentences."""
        notes = []
        stored = self.lanes[0].values.size if self.lanes else self.samples
        if stored < self.samples:
            notes.append(
                f"Quantiles, distributions and sources of scatter are those of the "
                f"first {stored:,} samples."
            )
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

    def cells(self) -> Iterator[tuple[dict[str, str], Bool[np.ndarray, " case"]]]:
        """Yield the values of each case of the axes, as text, and its mask."""
        for chosen in itertools.product(*(range(a.values.size) for a in self.axes)):
            pairs = list(zip(self.axes, chosen, strict=True))
            mask = np.all([axis.at == place for axis, place in pairs], axis=0)
            if self.axes:
                yield {axis.name: axis.shown(place) for axis, place in pairs}, mask


def read_columns(path: str | os.PathLike[str]) -> StudyColumns:
    """Read a store.

    Raises:
        InputError: There is no store, it has another layout or schema, it is damaged,
            or it has no samples.
    """
    import xarray

    store = opened_store(path)
    # the order of merging is that of the run, which stops at the first missing slab
    found = [store.states(n) for n in range(store.slabs)]
    states = list(itertools.takewhile(lambda state: state is not None, found))
    if store.faults or (store.attributes["complete"] and len(states) < len(found)):
        lost = len(states), "a chunk is missing"
        n, fault = min(store.faults.items(), default=lost)
        raise InputError(
            f"{path}: slab {n}: {fault}; a resumed study computes damaged slabs again"
        )
    require(states, path, "samples", "a store without any")
    rows = min(store.keep, len(states) * store.slab)
    with xarray.open_zarr(store.path, consolidated=False, chunks=None) as dataset:
        return columns_of(dataset.isel(draw=slice(rows)).load(), str(path), states)


def columns_of(
    dataset: "xarray.Dataset",
    source: str = "study",
    states: Sequence[Mapping[str, Moments] | None] = (),
) -> StudyColumns:
    """Return the columns of a data set of `run`.

    Args:
        dataset: Data set.
        source: Its name, for messages.
        states: Moments of slabs, in their order; empty for those of the samples.

    Raises:
        InputError: It has another layout or schema, or no samples.
    """
    schema = dataset.attrs.get("jblast_study_schema")
    right = schema == SCHEMA and "draw" in dataset.sizes
    got = f"{schema} and the dimensions {', '.join(map(str, dataset.sizes))}"
    require(right, source, f"samples and jblast_study_schema {SCHEMA}", got)
    names = dataset.attrs["columns"]
    columns = {name: dataset[name] for name in names}
    dims = next(iter(columns.values())).dims
    names = [str(name) for name in dims if name not in ("draw", "sensor")]
    sizes = [dataset.sizes[name] for name in names]
    places = np.unravel_index(np.arange(math.prod(sizes)), sizes) if sizes else ()
    axes = tuple(
        _axis(dataset[name], at) for name, at in zip(names, places, strict=True)
    )
    cases, lanes, draws = math.prod(sizes), [], dataset.sizes["draw"]
    for name, column in columns.items():
        if column.attrs["role"] != "outcome":
            continue
        sensors = dataset["sensor"].values if "sensor" in column.dims else [""]
        values = column.values.astype(float).reshape(draws, cases, len(sensors))
        kind = column.attrs["kind"]
        if kind == "yes_no":
            values = np.where(values < 0, np.nan, values)
        whole, after = _whole(values, [s[name] for s in states if s is not None])
        for n, sensor in enumerate(sensors):
            own, *points = (
                Moments(*(np.asarray(x).reshape(-1, len(sensors))[:, n] for x in one))
                for one in (whole, *after)
            )
            about = column.attrs["units"], kind, column.attrs["long_name"]
            points = tuple(Moments(*(x[0] for x in point)) for point in points)
            lanes.append(Lane(name, str(sensor), *about, values[:, :, n], own, points))
    samples = int(lanes[0].after[-1].samples)
    return StudyColumns(
        tuple(lanes),
        {
            name: column.values.reshape(draws, cases)
            for name, column in columns.items()
            if column.attrs["role"] == "input"
        },
        axes,
        dict(dataset.attrs),
        samples,
        int(dataset.attrs.get("draws", draws)) * cases - samples,
    )


def _whole(
    values: Float[np.ndarray, "draw case sensor"], states: Sequence[Moments]
) -> tuple[Moments, list[Moments]]:
    """Return moments by case, and those of all cases after growing numbers of draws."""
    draws = len(values)
    parts = [moments(part) for part in np.split(values, points(draws)[:-1])]
    growing = list(itertools.accumulate(parts, merged_moments))
    if states:
        slabs = list(itertools.accumulate(states, merged_moments))
        beyond = [s for s in slabs if np.max(s.samples) > draws]
        growing += [beyond[n - 1] for n in points(len(beyond))]
        # the sums of the run, to the last bit
        growing[-1] = slabs[-1]
    return growing[-1], [over_cases(one, ALL) for one in growing]


def _axis(column: "xarray.DataArray", at: Int[np.ndarray, " case"]) -> StudyAxis:
    words = column.dtype.kind not in "fi"
    values = np.arange(column.size, dtype=float) if words else column.values
    return StudyAxis(
        str(column.name),
        column.attrs["units"],
        np.asarray(values, float),
        tuple(map(str, column.values)) if words else (),
        at,
    )


def points(last: int) -> list[int]:
    """Return at most `MAX_POINTS` growing numbers of draws or slabs up to the last."""
    ends = np.geomspace(min(10, last), last, MAX_POINTS) if last else np.zeros(0)
    return [int(end) for end in np.unique(ends.astype(int))]
