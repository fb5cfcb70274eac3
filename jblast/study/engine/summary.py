"""Statistics of a study whose samples are too many to store.

A state holds the statistics of one outcome for a variant, cell and sensor
(`study.statistics`): moments and a quantile sketch of a number, counts
of yes and no. States of parts of a study, merged in the order of the samples, are the
state of the whole study, on whichever devices the parts were calculated.

Where a study has no cells, blocks are reduced on the device that calculated them. Sums
about a value near the mean are kept for a group of blocks, a few numbers for each
outcome and sensor, and bins are counted over a whole launch. So the data that leave a
device do not grow with the number of samples.

On disk the statistics are a Zarr group within the store of the study. Each tile and
outcome has a chunk, written completely or not at all; counts of sketches, most of which
are zero, are packed by gzip. A tile is done when all its chunks are intact.
"""

import functools
import gzip
import json
import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.errors import InputError
from jblast.files import write_bytes, write_text
from jblast.study.engine.launch import Reduce
from jblast.study.engine.store import (
    CHECKSUM,
    Tiled,
    Variable,
    as_json,
    described,
    read_chunk,
    sealed,
)
from jblast.study.statistics import (
    ACCUMULATORS,
    BINS,
    Moments,
    NumberState,
    QuantileSketch,
    ShareState,
    bin_of,
    origin_of,
)

FOLDER = "summary"
GROUP = "zarr.json"
PACKED = "counts"
ANCHOR = ".anchor"
GZIP = {"name": "gzip", "configuration": {"level": 1}}
NUMBERS = ("finite", "infinite", "lost", "mean", "squares", "minimum", "maximum")
SHARES = ("known", "yes", "lost")
PARTS = {
    "number": {"moments": ("float64", len(NUMBERS)), PACKED: ("int64", BINS)},
    "yes_no": {"share": ("int64", len(SHARES))},
}
LAST = {"moments": "moment", PACKED: "bin", "share": "count"}
VALID, ANCHORS = "_valid", "_anchors"
"""Keys of the mask of valid samples, and of the anchors, in shared arrays."""
SUMS = "samples", "infinite", "off", "squares off", "minimum", "maximum"
"""Sums of blocks, relative to a value near the mean; bins do not count lost samples."""
COUNTERS = 256
"""Counters of each bin, of all lanes, among which a GPU distributes samples, because
atomic additions to one address are serial."""
ROWS = 64
"""Rows of a block that are reduced together, in a fixed order (`_folded`)."""
State = Any
States = Mapping[str, State]
"""State by outcome; its arrays have the group (variant and cell) first, then
sensors."""
MAX_COUNTS = 1 << 26
"""Bins of all histograms of a study: half a gigabyte in int64."""


class Anchor(NamedTuple):
    """Reference values of a number, which keep the digits of its spread.

    Attributes:
        shift: Value among the samples, subtracted before sums.
        origin: Origin of the bins of the histogram.
    """

    shift: Float[np.ndarray, "..."]
    origin: Float[np.ndarray, "..."]


class SummaryStore(Tiled):
    """Statistics of the tiles of a study.

    Attributes:
        path: Folder of the Zarr group.
        variables: Columns of the study.
        groups: Number of variants times cells.
        tiles: Number of tiles.
        checksums: Whether the chunks have checksums.
    """

    def __init__(
        self,
        store: str | os.PathLike[str],
        variables: Sequence[Variable],
        groups: int,
        tiles: int,
    ) -> None:
        self.path = Path(store) / FOLDER
        self.variables, self.groups, self.tiles = tuple(variables), groups, tiles
        self.checksums = True
        if self.there:
            arrays = self._group()["consolidated_metadata"]["metadata"]
            self.checksums = CHECKSUM in next(iter(arrays.values()))["codecs"]

    def create(self, anchors: Mapping[str, Anchor], tile: int) -> None:
        """Create the group, without tiles.

        Args:
            anchors: Reference values by outcome.
            tile: Samples of a tile.

        Raises:
            OSError: The folder is not writable.
        """
        arrays = {}
        for v, part, shape, kind in self._arrays():
            name = f"{v.name}.{part}"
            arrays[name] = self._described(v, part, shape, kind)
            (self.path / name).mkdir(parents=True, exist_ok=True)
        for name, anchor in anchors.items():
            whole = np.stack(anchor, -1).astype("<f8")
            key = f"{name}{ANCHOR}"
            dims = ("group", "sensor", "anchor")[-whole.ndim :]
            if whole.ndim == 2:
                dims = ("group", "anchor")
            attributes = {
                "long_name": f"shift of the sums and origin of the bins of {name}"
            }
            arrays[key] = described(
                whole.shape, whole.shape, "float64", "NaN", dims, attributes
            )
            (self.path / key).mkdir(parents=True, exist_ok=True)
            data = sealed(whole.tobytes(), self.checksums)
            write_bytes(self.path / key / _chunk(0, whole.ndim), data)
        for name, array in arrays.items():
            if self.checksums:
                array["codecs"].append(CHECKSUM)
            write_text(self.path / name / GROUP, as_json(array))
        group = {
            "zarr_format": 3,
            "node_type": "group",
            "attributes": {
                "tile": tile,
                "moments": list(NUMBERS),
                "shares": list(SHARES),
            },
            "consolidated_metadata": {
                "kind": "inline",
                "must_understand": False,
                "metadata": arrays,
            },
        }
        # the group is last: without it a killed run has no statistics (`there`)
        write_text(self.path / GROUP, as_json(group))

    def _arrays(self):
        for v in outcomes_of(self.variables):
            for part, (kind, last) in PARTS[v.kind].items():
                yield v, part, (*v.shape(self.groups), last), kind

    def _described(
        self, v: Variable, part: str, shape: tuple[int, ...], kind: str
    ) -> dict[str, Any]:
        sensors = ("sensor",) if v.sensors else ()
        dims = ("tile", "group", *sensors, LAST[part])
        attributes = {
            "units": v.units,
            "long_name": f"{part} of {v.name}, tile by tile",
        }
        fill = "NaN" if kind == "float64" else 0
        array = described(
            (self.tiles, *shape), (1, *shape), kind, fill, dims, attributes
        )
        if part == PACKED:
            array["codecs"].append(GZIP)
        return array

    @property
    def there(self) -> bool:
        """True if the group exists."""
        return (self.path / GROUP).exists()

    def _group(self) -> dict[str, Any]:
        return json.loads((self.path / GROUP).read_text())

    def tile_samples(self) -> int:
        """Return the samples of a tile; the last of a study may have fewer."""
        return int(self._group()["attributes"]["tile"])

    def stored_tiles(self) -> int:
        """Return the number of tiles in the stored description."""
        arrays = self._group()["consolidated_metadata"]
        shapes = [
            array["shape"][0]
            for name, array in arrays["metadata"].items()
            if not name.endswith(ANCHOR)
        ]
        return int(shapes[0])

    def resized(self, tiles: int, tile: int) -> None:
        """Set the number of tiles, in the stored description too."""
        self.tiles = tiles
        self.create(self.anchors(), tile)

    def anchors(self) -> dict[str, Anchor]:
        """Return the stored reference values.

        Raises:
            InputError: They are damaged.
        """
        found = {}
        for v in outcomes_of(self.variables):
            if v.kind == "number":
                shape = (*v.shape(self.groups), 2)
                path = self.path / f"{v.name}{ANCHOR}" / _chunk(0, len(shape))
                data = read_chunk(path, self.checksums, 8 * int(np.prod(shape)))
                whole = np.frombuffer(data, "<f8").reshape(shape)
                found[v.name] = Anchor(whole[..., 0], whole[..., 1])
        return found

    def write(self, tile: int, states: Mapping[str, State]) -> None:
        """Write the states of a tile, each chunk completely or not at all.

        Raises:
            OSError: A chunk cannot be written.
        """
        for v in outcomes_of(self.variables):
            for part, array in packed(v, states[v.name]).items():
                kind = PARTS[v.kind][part][0]
                data = np.ascontiguousarray(array, f"<{kind[0]}8").tobytes()
                if part == PACKED:
                    # without a time stamp: equal counts are equal bytes
                    data = gzip.compress(data, 1, mtime=0)
                self.write_chunk(v, part, tile, data)

    def write_chunk(self, v: Variable, part: str, tile: int, data: bytes) -> None:
        """Write a chunk, of packed counts, completely or not at all."""
        whole = sealed(data, self.checksums)
        write_bytes(self.chunk_path(v, part, tile), whole, durable=False)

    def read_chunk(self, v: Variable, part: str, tile: int) -> bytes:
        """Return a chunk, counts still packed.

        Raises:
            InputError: The chunk is missing or damaged.
        """
        size = 8 * int(np.prod((*v.shape(self.groups), PARTS[v.kind][part][1])))
        path = self.chunk_path(v, part, tile)
        if part != PACKED:
            return read_chunk(path, self.checksums, size)
        data = read_chunk(path, self.checksums)
        try:
            unpacked_size = len(gzip.decompress(data))
        except (OSError, EOFError, zlib.error) as error:
            raise InputError(f"{path}: expected gzip data, got {error}") from None
        if unpacked_size != size:
            raise InputError(
                f"{path}: expected {size:,} bytes of gzip data, got {unpacked_size:,}"
            )
        return data

    def read(self, tile: int, anchors: Mapping[str, Anchor]) -> dict[str, State]:
        """Return the states of a complete tile.

        Raises:
            InputError: A chunk is missing or damaged.
        """
        found: dict[str, dict[str, np.ndarray]] = {}
        for v, part, shape, kind in self._arrays():
            data = self.read_chunk(v, part, tile)
            if part == PACKED:
                data = gzip.decompress(data)
            whole = np.frombuffer(data, f"<{kind[0]}8").reshape(shape)
            found.setdefault(v.name, {})[part] = whole
        return {
            v.name: unpacked(v, found[v.name], anchors)
            for v in outcomes_of(self.variables)
        }

    def parts(self) -> list[tuple[Path, Callable[[int], object]]]:
        """Return folder and reader of each part of an outcome."""
        return [
            (
                self.path / f"{v.name}.{part}",
                functools.partial(self.read_chunk, v, part),
            )
            for v, part, _, _ in self._arrays()
        ]

    def chunk_path(self, v: Variable, part: str, tile: int) -> Path:
        """Return the chunk file of a part of a tile."""
        dims = len(v.shape(self.groups)) + 2
        return self.path / f"{v.name}.{part}" / _chunk(tile, dims)


def _chunk(tile: int, dims: int) -> str:
    return ".".join([str(tile), *["0"] * (dims - 1)])


Anchors = Mapping[str, Anchor]


def states_by_group(
    variables: Sequence[Variable],
    columns: Mapping[str, np.ndarray],
    which: Int[np.ndarray, " sample"],
    groups: int,
    anchors: Anchors,
) -> dict[str, State]:
    """Return the states of samples.

    Args:
        variables: Columns of the study.
        columns: Values of the columns.
        which: Group (variant and cell) of each sample.
        groups: Number of groups.
        anchors: Reference values by outcome.
    """
    found: dict[str, State] = {}
    for v in outcomes_of(variables):
        values = np.asarray(columns[v.name]).reshape(len(which), -1)
        shape = v.shape(groups)
        if v.kind == "yes_no":
            parts = values >= 0, values > 0, values < 0
            found[v.name] = ShareState(
                *(_by(which, x, groups).astype(np.int64).reshape(shape) for x in parts)
            )
            continue
        numbers = _numbers(values, which, groups)
        origin = np.broadcast_to(anchors[v.name].origin, shape)
        away = origin.reshape(groups, -1)[which]
        # one count over pairs of group and bin, instead of a pass for each group
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
    """Return sums by group and lane."""
    return np.stack(
        [np.bincount(which, lane, minlength=groups) for lane in values.T.astype(float)],
        axis=-1,
    )


def _numbers(
    values: Float[np.ndarray, "sample lane"],
    which: Int[np.ndarray, " sample"],
    groups: int,
) -> Float[np.ndarray, "group lane 7"]:
    """Return the seven `NUMBERS` of moments, in two passes over the values."""
    finite, nan = np.isfinite(values), np.isnan(values)
    count = _by(which, finite, groups)
    total = _by(which, np.where(finite, values, 0.0), groups)
    mean = total / np.maximum(count, 1)
    # a second pass about the mean: squares about zero would cancel
    off = np.where(finite, values - mean[which], 0.0)
    low = np.full((groups, values.shape[1]), np.inf)
    high = -low
    # `reduceat` needs the samples of a group next to each other
    order = np.argsort(which, kind="stable")
    begins = np.flatnonzero(np.diff(which[order], prepend=-1))
    # groups without samples are absent: their extremes remain infinite
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
    """Return reference values from some samples of each group."""
    found = {}
    for v in outcomes_of(variables):
        if v.kind == "yes_no":
            continue
        shift, origin = np.zeros(v.shape(groups)), np.zeros(v.shape(groups))
        for group in range(groups):
            own = np.asarray(columns[v.name], float)[which == group]
            if not len(own):
                continue
            origin[group] = origin_of(own)
            known = np.where(np.isfinite(own), own, 0.0)
            # a rough mean suffices: `states_of` corrects the sums for its distance
            shift[group] = known.sum(0) / np.maximum(np.isfinite(own).sum(0), 1)
        found[v.name] = Anchor(shift, origin)
    return found


def reduce_of(outcomes: Sequence[Variable], counters: int = 1) -> Reduce:
    """Return the reduction of blocks of some outcomes.

    Args:
        outcomes: Outcomes of the study.
        counters: Counters of each bin (`COUNTERS`).
    """
    lanes = {v.name: max(1, len(v.sensors)) for v in outcomes}
    numbers = [v.name for v in outcomes if v.kind == "number"]
    each = {name: max(1, counters // lanes[name]) for name in numbers}

    def empty(_: Any) -> dict[str, Array]:
        # the last counter takes NaN and padding, so that no branch is needed
        return {
            name: jnp.zeros(BINS * each[name] * lanes[name] + 1, jnp.int32)
            for name in numbers
        }

    def step(
        shared: Mapping[str, Any], counts: dict[str, Array], answers: dict[str, Array]
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        valid, kept, counted = answers[VALID][..., None], {}, {}
        for v in outcomes:
            values = answers[v.name].reshape(*valid.shape[:-1], lanes[v.name])
            if v.kind == "yes_no":
                kept[v.name] = _shares(values, valid)
                continue
            shift, origin = (x[None, None] for x in shared[ANCHORS][v.name])
            kept[v.name] = _sums(values, valid, shift)
            several = counts[v.name]
            # 32 bits: all indices fit, and 64-bit indices would double the traffic
            place = bin_of(values - origin).astype(jnp.int32)
            if each[v.name] > 1:
                turn = jnp.arange(valid.shape[1], dtype=jnp.int32)[None, :, None]
                place = place * each[v.name] + turn % each[v.name]
            lane = jnp.arange(lanes[v.name], dtype=jnp.int32)[None, None]
            place = place * lanes[v.name] + lane
            place = jnp.where(valid & ~jnp.isnan(values), place, several.size - 1)
            counted[v.name] = several.at[place.reshape(-1)].add(
                1, mode="promise_in_bounds", wrap_negative_indices=False
            )
        return counted, kept

    def end(counts: dict[str, Array]) -> dict[str, Array]:
        return {
            name: several[:-1].reshape(BINS, each[name], -1).sum(axis=1).T
            for name, several in counts.items()
        }

    return Reduce(empty, step, end)


def _shares(values: Array, valid: Array) -> Array:
    """Return the numbers of known, true and lost samples of each lane."""
    known, yes = valid & (values >= 0), valid & (values > 0)
    parts = known, yes, valid & (values < 0)
    counts = [jnp.sum(x, axis=(0, 1), dtype=jnp.int32) for x in parts]
    return jnp.stack(counts, -1)[None]


def _sums(values: Array, valid: Array, shift: Array) -> Array:
    """Return the `SUMS` of each lane."""
    # zero for NaN and infinite values, which have counters of their own
    off = jnp.where(valid & jnp.isfinite(values), values - shift, 0.0)
    some = valid & ~jnp.isnan(values)
    low = _folded(jnp.where(some, values, jnp.inf), jnp.minimum, jnp.inf)
    high = _folded(jnp.where(some, values, -jnp.inf), jnp.maximum, -jnp.inf)

    def counted() -> Array:
        return jnp.sum(some & jnp.isinf(values), axis=(0, 1), dtype=values.dtype)

    # infinite values are rare: count them only if an extreme is infinite
    odd = jnp.isinf(low) | jnp.isinf(high)
    infinite = jax.lax.cond(odd.any(), counted, lambda: jnp.zeros_like(low))
    samples = jnp.sum(valid, axis=(0, 1), dtype=values.dtype)
    parts = (
        jnp.broadcast_to(samples, low.shape),
        infinite,
        _folded(off, jnp.add, 0.0),
        _folded(jnp.square(off), jnp.add, 0.0),
        low,
        high,
    )
    return jnp.stack(parts, -1)[None]


def _folded(x: Array, join: Callable[[Any, Any], Array], none: float) -> Array:
    """Return the reduction of samples (a power of two in a block) in a fixed order.

    Rows are combined elementwise first, which XLA compiles to one vectorised pass over
    the lanes.
    """
    rows = min(ROWS, x.shape[1])
    whole = x[:, :rows]
    for begin in range(rows, x.shape[1], rows):
        whole = join(whole, x[:, begin : begin + rows])
    start = jnp.asarray(none, x.dtype)
    return jax.lax.reduce(jax.lax.reduce(whole, start, join, (1,)), start, join, (0,))


def states_of(
    outcomes: Sequence[Variable],
    kept: Mapping[str, np.ndarray],
    counts: Mapping[str, np.ndarray],
    anchors: Anchors,
) -> dict[str, State]:
    """Return the states of reduced blocks of one variant.

    Args:
        outcomes: Outcomes of the study.
        kept: Sums of each group of blocks.
        counts: Counts of all blocks, by lane.
        anchors: Reference values of the variant, one for each lane.
    """
    found: dict[str, State] = {}
    for v in outcomes:
        shape = v.shape(1)
        if v.kind == "yes_no":
            whole = kept[v.name].sum(axis=0, dtype=np.int64)
            found[v.name] = ShareState(*(x.reshape(shape) for x in whole.T))
            continue
        parts = np.asarray(kept[v.name], float)
        samples, infinite, off, square = np.moveaxis(parts.sum(axis=0), -1, 0)[:4]
        low, high = parts[..., 4].min(axis=0), parts[..., 5].max(axis=0)
        whole = counts[v.name].astype(np.int64)
        # a launch counts in 32 bits, which merged launches would exceed
        known = whole.sum(axis=-1)
        finite, lost = known - infinite, samples - known
        shift = anchors[v.name].shift.reshape(-1)
        mean = np.where(finite > 0, shift + off / np.maximum(finite, 1.0), 0.0)
        # little cancellation, as the shift is near the mean; rounding may still leave
        # less than zero
        squares = np.maximum(square - off**2 / np.maximum(finite, 1.0), 0.0)
        numbers = np.stack([finite, infinite, lost, mean, squares, low, high], -1)
        moments = moments_from(numbers.reshape(*shape, len(NUMBERS)))
        whole = whole.reshape(*shape, -1)
        origin = anchors[v.name].origin.reshape(shape)
        found[v.name] = NumberState(moments, QuantileSketch(whole, origin))
    return found


def outcomes_of(variables: Sequence[Variable]) -> list[Variable]:
    """Return the columns of outcomes."""
    return [v for v in variables if v.role == "outcome"]


def empty_states(
    variables: Sequence[Variable], groups: int, anchors: Anchors
) -> dict[str, State]:
    """Return the states without samples."""
    found = {}
    for v in outcomes_of(variables):
        origin = anchors[v.name].origin if v.kind == "number" else 0.0
        found[v.name] = ACCUMULATORS[v.kind].empty(v.shape(groups), origin)
    return found


def merged_states(
    variables: Sequence[Variable], a: States, b: States
) -> dict[str, State]:
    """Return merged states, `a` before `b` in the order of the samples.

    Raises:
        ValueError: Their bins have different origins.
    """
    return {
        v.name: ACCUMULATORS[v.kind].merge(a[v.name], b[v.name])
        for v in outcomes_of(variables)
    }


def moments_from(array: Float[np.ndarray, "... 7"]) -> Moments:
    """Return moments from their `NUMBERS`."""
    finite, infinite, lost, mean, squares, low, high = np.moveaxis(array, -1, 0)
    whole = [x.astype(np.int64) for x in (finite, infinite, lost)]
    return Moments._make([*whole, mean, squares, low, high])


def packed(variable: Variable, state: State) -> dict[str, np.ndarray]:
    """Return the arrays of a state, by the suffix of their names."""
    if variable.kind == "yes_no":
        return {"share": np.stack([state.known, state.yes, state.lost], -1)}
    m = state.moments
    parts = m.finite, m.infinite, m.lost, m.mean, m.squares, m.minimum, m.maximum
    # counts below 2^53 are exact as floats: one array and one chunk
    numbers = np.stack([np.asarray(x, float) for x in parts], -1)
    return {"moments": numbers, "counts": np.asarray(state.sketch.counts, np.int64)}


def unpacked(
    variable: Variable, arrays: Mapping[str, np.ndarray], anchors: Anchors
) -> State:
    """Return the state of arrays of `packed`."""
    if variable.kind == "yes_no":
        return ShareState(*np.moveaxis(arrays["share"], -1, 0))
    sketch = QuantileSketch(arrays["counts"], anchors[variable.name].origin)
    return NumberState(moments_from(arrays["moments"]), sketch)
