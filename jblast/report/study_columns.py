"""A study's axes and outcomes, column by column."""

import itertools
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError
from jblast.study.statistics import (
    YES_NO,
    Moments,
    ShareState,
    bin_edges,
    finish_moments,
    merge_moments,
    sketch_quantiles,
)

QUANTILES = (0.05, 0.5, 0.95)
NAMES = ("q05", "q50", "q95")
if TYPE_CHECKING:
    import xarray
SCHEMA = 1
"""Of a store that this version reads."""
GO_ON = "--resume of jblast study goes on with it."
INCOMPLETE = f"The study is not complete: this is what there is so far. {GO_ON}"


def found_in(
    kind: str, state: Any, which: Any, quantiles: Sequence[float] = QUANTILES
) -> dict[str, Any]:
    """Return what some cells of a lane amount to together.

    Args:
        kind: "number" or "yes_no".
        state: Of each variant and cell.
        which: Cells, as an index of an array.
        quantiles: That are wanted.

    Returns:
        As `statistics` finishes it, of a number with `q05`, `q50`, `q95`.
    """
    if kind == "yes_no":
        return YES_NO.finish(ShareState(*(np.sum(x[which], axis=0) for x in state)))
    parts = [np.asarray(x)[which] for x in state.moments]
    whole = Moments(*(x[0] for x in parts))
    for n in range(1, len(parts[0])):
        whole = merge_moments(whole, Moments(*(x[n] for x in parts)))
    found: dict[str, Any] = finish_moments(whole)
    if not quantiles:
        return found
    sketch = type(state.sketch)(*(np.asarray(x)[which] for x in state.sketch))
    low, high = found["minimum"], found["maximum"]
    if len(sketch.origin) == 1:
        one = type(sketch)(sketch.counts[0], sketch.origin[0])
        at = sketch_quantiles(one, np.asarray(quantiles), low, high)
    else:
        values, counts = pooled(sketch, float(low), float(high))
        at = np.full(len(quantiles), np.nan)
        if len(values):
            upto = np.cumsum(counts)
            rank = np.asarray(quantiles) * upto[-1]
            at = values[np.minimum(np.searchsorted(upto, rank), len(values) - 1)]
    return found | dict(zip(NAMES, at, strict=True))


def pooled(
    sketch: Any, low: float, high: float
) -> tuple[Float[np.ndarray, " value"], np.ndarray]:
    """Return the middles of bins of several cells, in order, and what is in each."""
    edges = bin_edges()
    middle = 0.5 * (np.clip(edges[:-1], -1e300, None) + np.clip(edges[1:], None, 1e300))
    group, place = np.nonzero(sketch.counts)
    values = np.clip(np.asarray(sketch.origin)[group] + middle[place], low, high)
    order = np.argsort(values, kind="stable")
    return values[order], np.asarray(sketch.counts)[group, place][order]


@dataclass(frozen=True)
class Lane:
    """An outcome, of one sensor where it has several.

    Attributes:
        name: As it was asked for.
        sensor: Whose it is; "" of none.
        units: Of its values; "1" of none.
        kind: "number" or "yes_no".
        long_name: In words.
        values: Of each sample, NaN where it failed.
        state: In place of values, statistics of each variant and cell.
    """

    name: str
    sensor: str
    units: str
    kind: str
    long_name: str
    values: Float[np.ndarray, " sample"]
    state: Any = None

    @property
    def title(self) -> str:
        """Its name, and its sensor's."""
        return f"{self.name}, {self.sensor}" if self.sensor else self.name

    @property
    def label(self) -> str:
        """What it is, and its unit, for an axis of a figure."""
        unit = "" if self.units in ("", "1") else f" [{self.units}]"
        words = (self.long_name or self.name).partition(",")[0]
        return textwrap.fill(f"{words}{unit}", 34)


@dataclass(frozen=True)
class StudyAxis:
    """What was varied.

    Attributes:
        name: A number of the scene, or a key of its file.
        units: Of its values.
        values: Its different values, from the least; codes where it has words.
        words: What the codes stand for; () of numbers.
        at: Which of them each sample has.
    """

    name: str
    units: str
    values: Float[np.ndarray, " value"]
    words: tuple[str, ...]
    at: np.ndarray

    @property
    def label(self) -> str:
        """Its name and unit, for an axis of a figure."""
        unit = "" if self.units in ("", "1") else f" [{self.units}]"
        return f"{self.name}{unit}"

    def said(self, place: int) -> str:
        """Return one of its values in words."""
        return self.words[place] if self.words else f"{self.values[place]:.4g}"


@dataclass(frozen=True)
class StudyColumns:
    """All that was kept of a study's samples.

    Attributes:
        lanes: The outcomes.
        inputs: What was drawn, by name.
        input_units: Their units.
        axes: What was varied, in the order of the store.
        weights: Of the samples; None where they have none.
        attributes: Attributes of the store.
        samples: How many there are; of statistics alone how many variants and cells.
        notes: Remarks, a sentence each.
        counted: How many samples statistics are of, where they alone were kept.
        course: What was known of each lane after so many samples, likewise.
        rows: The samples that were kept beside statistics.
    """

    lanes: tuple[Lane, ...]
    inputs: Mapping[str, Float[np.ndarray, " sample"]]
    input_units: Mapping[str, str]
    axes: tuple[StudyAxis, ...]
    weights: Float[np.ndarray, " sample"] | None
    attributes: Mapping[str, Any]
    samples: int
    notes: list[str] = field(default_factory=list)
    counted: int | None = None
    course: tuple[tuple[int, Mapping[str, Mapping[str, Any]]], ...] = ()
    rows: "StudyColumns | None" = None

    @property
    def total(self) -> int:
        """How many samples all this is of."""
        return self.samples if self.counted is None else self.counted

    @property
    def numeric_axes(self) -> list[StudyAxis]:
        """Axes whose values are numbers, of two or more."""
        return [one for one in self.axes if not one.words and one.values.size > 1]

    @property
    def word_axes(self) -> list[StudyAxis]:
        """Axes over words."""
        return [one for one in self.axes if one.words and one.values.size > 1]

    def cells(self) -> Iterator[tuple[tuple[str, ...], Bool[np.ndarray, " sample"]]]:
        """Yield each combination of the axes' values, in words, and its samples."""
        places = [range(axis.values.size) for axis in self.axes]
        for chosen in itertools.product(*places):
            mask = np.ones(self.samples, bool)
            for axis, place in zip(self.axes, chosen, strict=True):
                mask &= axis.at == place
            if mask.any():
                said = (axis.said(n) for axis, n in zip(self.axes, chosen, strict=True))
                yield tuple(said), mask


def columns_of(dataset: "xarray.Dataset", source: str = "study") -> StudyColumns:
    """Return the columns of a data set in the layout of a study.

    Raises:
        InputError: It is not, or of a newer schema, or keeps no samples.
    """
    schema = dataset.attrs.get("jblast_study_schema")
    if schema is None:
        raise InputError(
            f"{source}: expected the store of a study, got one without "
            "jblast_study_schema"
        )
    if int(schema) != SCHEMA:
        raise InputError(
            f"{source}: expected schema {SCHEMA} of a study, got {schema}: this is "
            "read by another version of jblast"
        )
    if "sample" not in dataset.sizes:
        raise InputError(
            f"{source}: expected samples to report on, got a data set without any"
        )
    lanes: list[Lane] = []
    inputs, units, axes, weights = {}, {}, [], None
    sensors = (
        [str(one) for one in dataset["sensor"].values]
        if ("sensor" in dataset.sizes)
        else []
    )
    for name, variable in dataset.data_vars.items():
        role, own = variable.attrs.get("role"), str(variable.attrs.get("units", "1"))
        if role == "outcome":
            lanes += _lanes(str(name), variable, sensors)
        elif role == "input":
            inputs[str(name)] = np.asarray(variable.values, float)
            units[str(name)] = own
        elif role == "axis":
            axes.append(_axis(str(name), variable))
        elif role == "weight":
            weights = np.asarray(variable.values, float)
    found = StudyColumns(
        tuple(lanes),
        inputs,
        units,
        tuple(axes),
        weights,
        dict(dataset.attrs),
        int(dataset.sizes["sample"]),
    )
    if not dataset.attrs.get("complete", False):
        found.notes.append(
            "The study is not complete: what is not there yet counts as failed. "
            f"{GO_ON}"
        )
    return found


def _lanes(name: str, variable: Any, sensors: list[str]) -> list[Lane]:
    """Return an outcome, once for each sensor it has."""
    kind = str(variable.attrs.get("kind", "number"))
    values = np.asarray(variable.values, float)
    if kind == "yes_no":
        values = np.where(values < 0, np.nan, values)
    said = {
        "units": str(variable.attrs.get("units", "1")),
        "kind": kind,
        "long_name": str(variable.attrs.get("long_name", name)),
    }
    if values.ndim == 1:
        return [Lane(name, "", values=values, **said)]
    return [
        Lane(name, sensor, values=values[:, n], **said)
        for n, sensor in enumerate(sensors)
    ]


def _axis(name: str, variable: Any) -> StudyAxis:
    words = tuple(str(one) for one in variable.attrs.get("names", ()))
    values, at = np.unique(np.asarray(variable.values, float), return_inverse=True)
    if words:
        words = tuple(words[int(n)] if n >= 0 else "-" for n in values)
    return StudyAxis(
        name, str(variable.attrs.get("units", "1")), values, words, at.reshape(-1)
    )
