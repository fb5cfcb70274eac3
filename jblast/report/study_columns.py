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
"""Schema of the stores that this version reads."""
RESUME = "jblast study --resume continues it."
INCOMPLETE = f"The study is not complete; these are its samples so far. {RESUME}"


def found_in(
    kind: str, state: Any, which: Any, quantiles: Sequence[float] = QUANTILES
) -> dict[str, Any]:
    """Return the statistics of some cells of a lane together.

    Args:
        kind: "number" or "yes_no".
        state: Statistics of each variant and cell.
        which: Cells, as an index of an array.
        quantiles: Requested quantiles.

    Returns:
        Results of `statistics`; for numbers with `q05`, `q50`, `q95`.
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
    """Return the middles of the bins of several cells, sorted, and their counts."""
    edges = bin_edges()
    middle = 0.5 * (np.clip(edges[:-1], -1e300, None) + np.clip(edges[1:], None, 1e300))
    group, place = np.nonzero(sketch.counts)
    values = np.clip(np.asarray(sketch.origin)[group] + middle[place], low, high)
    order = np.argsort(values, kind="stable")
    return values[order], np.asarray(sketch.counts)[group, place][order]


@dataclass(frozen=True)
class Lane:
    """An outcome at one sensor, or without a sensor.

    Attributes:
        name: Name of the outcome.
        sensor: Name of the sensor; "" for none.
        units: Unit of the values; "1" for none.
        kind: "number" or "yes_no".
        long_name: Description.
        values: Value of each sample, NaN for a failed one.
        state: Statistics of each variant and cell, instead of values.
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
        """Name of outcome and sensor."""
        return f"{self.name}, {self.sensor}" if self.sensor else self.name

    @property
    def label(self) -> str:
        """Description and unit, for an axis of a figure."""
        unit = "" if self.units in ("", "1") else f" [{self.units}]"
        words = (self.long_name or self.name).partition(",")[0]
        return textwrap.fill(f"{words}{unit}", 34)


@dataclass(frozen=True)
class StudyAxis:
    """An axis of the study.

    Attributes:
        name: Parameter of the scene, or key of its file.
        units: Unit of the values.
        values: Distinct values in ascending order; codes if it has words.
        words: Words of the codes; () for numbers.
        at: Index of the value of each sample.
    """

    name: str
    units: str
    values: Float[np.ndarray, " value"]
    words: tuple[str, ...]
    at: np.ndarray

    @property
    def label(self) -> str:
        """Name and unit, for an axis of a figure."""
        unit = "" if self.units in ("", "1") else f" [{self.units}]"
        return f"{self.name}{unit}"

    def shown(self, index: int) -> str:
        """Return one of its values as text."""
        return self.words[index] if self.words else f"{self.values[index]:.4g}"


@dataclass(frozen=True)
class StudyColumns:
    """The stored samples or statistics of a study.

    Attributes:
        lanes: The outcomes.
        inputs: Sampled parameters, by name.
        input_units: Their units.
        axes: Axes of the study, in the order of the store.
        attributes: Attributes of the store.
        samples: Number of samples; number of variants and cells for statistics only.
        notes: Notes, as sentences.
        counted: Number of samples in the statistics, if only these were stored.
        course: Statistics of each lane after some numbers of samples, likewise.
        rows: Samples that were stored in addition to statistics.
    """

    lanes: tuple[Lane, ...]
    inputs: Mapping[str, Float[np.ndarray, " sample"]]
    input_units: Mapping[str, str]
    axes: tuple[StudyAxis, ...]
    attributes: Mapping[str, Any]
    samples: int
    notes: list[str] = field(default_factory=list)
    counted: int | None = None
    course: tuple[tuple[int, Mapping[str, Mapping[str, Any]]], ...] = ()
    rows: "StudyColumns | None" = None

    @property
    def total(self) -> int:
        """Number of samples."""
        return self.samples if self.counted is None else self.counted

    @property
    def numeric_axes(self) -> list[StudyAxis]:
        """Axes over numbers, with two or more values."""
        return [one for one in self.axes if not one.words and one.values.size > 1]

    @property
    def word_axes(self) -> list[StudyAxis]:
        """Axes over words, with two or more values."""
        return [one for one in self.axes if one.words and one.values.size > 1]

    def cells(self) -> Iterator[tuple[tuple[str, ...], Bool[np.ndarray, " sample"]]]:
        """Yield each combination of the axes' values, as text, and its samples."""
        places = [range(axis.values.size) for axis in self.axes]
        for chosen in itertools.product(*places):
            mask = np.ones(self.samples, bool)
            for axis, place in zip(self.axes, chosen, strict=True):
                mask &= axis.at == place
            if mask.any():
                values = zip(self.axes, chosen, strict=True)
                yield tuple(axis.shown(n) for axis, n in values), mask


def columns_of(dataset: "xarray.Dataset", source: str = "study") -> StudyColumns:
    """Return the columns of a data set in the layout of a study.

    Raises:
        InputError: It has another layout or schema, or no samples.
    """
    schema = dataset.attrs.get("jblast_study_schema")
    if schema is None:
        raise InputError(
            f"{source}: expected the store of a study, got one without "
            "jblast_study_schema"
        )
    if int(schema) != SCHEMA:
        raise InputError(
            f"{source}: expected schema {SCHEMA} of a study, got {schema}: use the "
            "version of jblast that wrote it"
        )
    if "sample" not in dataset.sizes:
        raise InputError(f"{source}: expected samples, got a data set without any")
    lanes: list[Lane] = []
    inputs, units, axes = {}, {}, []
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
        else:
            raise InputError(
                f"{source}: {name}: expected the role outcome, input or axis, "
                f"got {role}"
            )
    found = StudyColumns(
        tuple(lanes),
        inputs,
        units,
        tuple(axes),
        dict(dataset.attrs),
        int(dataset.sizes["sample"]),
    )
    if not dataset.attrs.get("complete", False):
        found.notes.append(
            f"The study is not complete: missing samples count as failed. {RESUME}"
        )
    return found


def _lanes(name: str, variable: Any, sensors: list[str]) -> list[Lane]:
    """Return the lanes of an outcome, one for each sensor."""
    kind = str(variable.attrs.get("kind", "number"))
    values = np.asarray(variable.values, float)
    if kind == "yes_no":
        values = np.where(values < 0, np.nan, values)
    common = {
        "units": str(variable.attrs.get("units", "1")),
        "kind": kind,
        "long_name": str(variable.attrs.get("long_name", name)),
    }
    if values.ndim == 1:
        return [Lane(name, "", values=values, **common)]
    return [
        Lane(name, sensor, values=values[:, n], **common)
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
