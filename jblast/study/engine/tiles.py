"""Tiles of samples: their computation, writing and running estimates.

While the devices calculate one tile, a separate thread writes the previous one.

Samples are numbered from 0 to the end of the study. They come in blocks of one fixed
size. Each block belongs to one variant of the scene, variants alternate, and within a
variant the cells of the axes alternate. So any completed part of a study has the same
number of samples of each variant and cell, to within a block.

The running estimates are mean and standard error of each outcome by cell. Sums of
values and of squares about the mean are merged by Chan, Golub and LeVeque (1983), eqs.
2.1; the order of merging matters only by rounding.
"""

import contextlib
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from jblast.study.engine.store import Store, Variable

Columns = Mapping[str, np.ndarray]
T = TypeVar("T")
MIN_FILLED_BLOCK = 2048
"""Smallest block to which blocks of several variants are halved, so that the padding of
the last ones is less than an eighth of the samples. Smaller blocks would be slow."""


class Numbering(NamedTuple):
    """Numbering of the samples of a study.

    Attributes:
        block: Samples that a program computes together, a power of two.
        variants: Number of scenes that differ in more than numeric parameters.
        cells: Number of combinations of the listed values of the axes.
        samples: Number of all samples.
        tile: Samples of a chunk of the store, the unit of progress: a power of two
            times the block.
    """

    block: int
    variants: int
    cells: int
    samples: int
    tile: int

    @property
    def tiles(self) -> int:
        """Number of tiles; the last one is padded."""
        return -(-self.samples // self.tile)

    def blocks_of(self, tile: int) -> Int[np.ndarray, " block"]:
        """Return the numbers of a tile's blocks."""
        each = self.tile // self.block
        last = -(-self.samples // self.block)
        return np.arange(tile * each, min((tile + 1) * each, last), dtype=np.int64)

    def variant_of(self, blocks: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
        """Return the variant of each block."""
        return blocks % self.variants

    def begins_at(self, blocks: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
        """Return the first number of each block among those of its variant."""
        return blocks // self.variants * self.block

    def of_samples(
        self, begin: int, end: int
    ) -> tuple[Int[np.ndarray, " sample"], Int[np.ndarray, " sample"]]:
        """Return variant and cell of samples."""
        index = np.arange(begin, end, dtype=np.int64)
        blocks = index // self.block
        within = self.begins_at(blocks) + index % self.block
        return self.variant_of(blocks), within % self.cells


@runtime_checkable
class Source(Protocol):
    """Source of tiles, with the same values at each call."""

    @property
    def variables(self) -> Sequence[Variable]:
        """Columns of the study."""
        ...

    @property
    def numbering(self) -> Numbering:
        """Numbering of the samples."""
        ...

    @property
    def at_once(self) -> int:
        """Number of tiles that are computed together."""
        ...

    def several(self, tiles: Sequence[int]) -> Sequence[Columns]:
        """Return the columns of tiles."""
        ...


def calculated(source: Source, tiles: Iterable[int]) -> Iterator[tuple[int, Columns]]:
    """Yield tiles in their order, computed by this process.

    If several are computed together, as on a GPU, the next ones are computed while
    these are consumed.
    """
    numbers, size = list(tiles), source.at_once
    batches = [numbers[n : n + size] for n in range(0, len(numbers), size)]
    if size == 1:
        for (tile,) in batches:
            yield tile, source.several([tile])[0]
        return
    with ThreadPoolExecutor(1) as pool:
        coming = [pool.submit(source.several, batch) for batch in batches[:1]]
        for n, batch in enumerate(batches):
            found = coming.pop().result()
            coming += [pool.submit(source.several, b) for b in batches[n + 1 : n + 2]]
            yield from zip(batch, found, strict=True)


def ahead(
    calculate: Callable[[int], T], tiles: Iterable[int], most: int
) -> Iterator[tuple[int, T]]:
    """Yield tiles in their order, with up to `most` in computation.

    Devices and host then work on different tiles. A consumer that stops waits for the
    tiles in computation.
    """
    with ThreadPoolExecutor(most) as pool:
        left = iter(tiles)
        # a bounded queue: results of all tiles would not fit into memory
        begun = [(n, pool.submit(calculate, n)) for n in itertools.islice(left, most)]
        while begun:
            tile, coming = begun.pop(0)
            yield tile, coming.result()
            begun += [(n, pool.submit(calculate, n)) for n in itertools.islice(left, 1)]


class Writer(contextlib.AbstractContextManager["Writer"]):
    """Writer of tiles in a thread; its errors are raised by the next call."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._pool = ThreadPoolExecutor(1)
        self._last: Future[None] | None = None

    def write(self, tile: int, columns: Columns) -> None:
        """Write a tile after the previous one."""
        # one pending write: at most two tiles are in memory
        self.wait()
        self._last = self._pool.submit(self._store.write_tile, tile, columns)

    def wait(self) -> None:
        """Wait for the last write.

        Raises:
            OSError: The tile cannot be written.
        """
        if self._last is not None:
            last, self._last = self._last, None
            last.result()

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(wait=True)
        if error[0] is None:
            self.wait()


class Estimates:
    """Running estimates of the outcomes of a study.

    Attributes:
        moments: Moments by name of the outcome.
    """

    def __init__(self, variables: Sequence[Variable], numbering: Numbering) -> None:
        self._numbering = numbering
        self._outcomes = [v for v in variables if v.role == "outcome"]
        cells = numbering.variants * numbering.cells
        self.moments = {
            v.name: Moments(
                *(np.zeros((cells, *v.shape(0)[1:]), kind) for kind in (int, int)),
                *(np.zeros((cells, *v.shape(0)[1:])) for _ in range(2)),
            )
            for v in self._outcomes
        }

    def add(self, begin: int, columns: Mapping[str, np.ndarray]) -> None:
        """Add consecutive samples, the first of which has the number `begin`."""
        numbering = self._numbering
        count = len(columns[self._outcomes[0].name]) if self._outcomes else 0
        cells = numbering.variants * numbering.cells
        which = None
        if cells > 1:
            variant, cell = numbering.of_samples(begin, begin + count)
            which = variant * numbering.cells + cell
        for variable in self._outcomes:
            # failed samples are -1 for yes or no; numbers without a mean are failed too
            values = np.asarray(columns[variable.name])
            good = values >= 0 if variable.kind == "yes_no" else np.isfinite(values)
            more = _moments(values, good, which, cells)
            self.moments[variable.name] = merged(self.moments[variable.name], more)

    def reached(self, targets: Mapping[str, float]) -> bool:
        """Return whether each standard error is at its target, by cell and sensor.

        That of a share is taken with one yes and one no added: without them a share of
        0 or 1 would have an error of zero from the first tile on.
        """
        # `all` of no targets is true, but such a study runs to its last sample
        return bool(targets) and all(
            (
                _share_error(self.moments[v.name])
                if v.kind == "yes_no"
                else self.moments[v.name].standard_error()
            ).max()
            <= targets[v.name]
            for v in self._outcomes
            if v.name in targets
        )


class InOrder:
    """Running estimates of tiles in any order, added in the order of numbers."""

    def __init__(
        self,
        estimates: Estimates,
        targets: Mapping[str, float],
        heard: Callable[[int, Estimates], None],
    ) -> None:
        self._estimates, self._targets, self._heard = estimates, targets, heard
        self._early: dict[int, Columns] = {}
        self.next = 0
        self.samples = 0
        self.reached = False

    def take(self, tile: int, columns: Columns) -> None:
        """Add a tile, unless the targets are reached."""
        self._early[tile] = columns
        # in the order of numbers: the study ends at the same sample on any number of
        # workers
        while self.next in self._early and not self.reached:
            now = self._early.pop(self.next)
            size = len(next(iter(now.values())))
            self._estimates.add(self.samples, now)
            self.next += 1
            self.samples += size
            self.reached = self._estimates.reached(self._targets)
        self._heard(self.samples, self._estimates)


class Moments(NamedTuple):
    """Moments of samples by variant and cell, and by sensor for such outcomes.

    Attributes:
        answers: Number of samples with a value.
        failed: Number of samples without a value.
        mean: Mean of the values.
        square: Sum of the squares about the mean.
    """

    answers: Int[np.ndarray, "..."]
    failed: Int[np.ndarray, "..."]
    mean: Float[np.ndarray, "..."]
    square: Float[np.ndarray, "..."]

    def standard_error(self) -> Float[np.ndarray, "..."]:
        """Return the standard error of each mean; infinite below two values."""
        # infinite: no target is reached before the scatter has an estimate
        few = self.answers < 2
        count = np.where(few, 2, self.answers)
        return np.where(few, np.inf, np.sqrt(self.square / (count - 1) / count))

    def whole(self) -> "Moments":
        """Return the moments of all cells together, by sensor."""
        together = self
        # merged in pairs: rounding errors grow with the logarithm of the cells
        while len(together.answers) > 1:
            half = len(together.answers) // 2
            two = Moments(*(x[: 2 * half] for x in together))
            rest = Moments(*(x[2 * half :] for x in together))
            pairs = merged(
                Moments(*(x[0::2] for x in two)), Moments(*(x[1::2] for x in two))
            )
            together = Moments(
                *(np.concatenate(x) for x in zip(pairs, rest, strict=True))
            )
        return together


def _share_error(moments: Moments) -> Float[np.ndarray, "..."]:
    """Return the standard error of each share, with one yes and one no added."""
    count = moments.answers + 2
    share = (moments.mean * moments.answers + 1) / count
    return np.sqrt(share * (1 - share) / count)


def merged(a: Moments, b: Moments) -> Moments:
    """Return the moments of two sets of samples together."""
    count = a.answers + b.answers
    # guard the division of cells without samples
    there = np.where(count > 0, count, 1)
    apart = b.mean - a.mean
    mean = a.mean + apart * (b.answers / there)
    square = a.square + b.square + apart**2 * (a.answers * (b.answers / there))
    return Moments(count, a.failed + b.failed, mean, square)


def _moments(
    values: np.ndarray, good: np.ndarray, which: np.ndarray | None, cells: int
) -> Moments:
    """Return the moments of some samples."""
    number = np.where(good, values, 0.0).astype(float)
    if which is None:
        count = good.sum(axis=0, keepdims=True)
        there = np.where(count > 0, count, 1)
        mean = number.sum(axis=0, keepdims=True) / there
        square = (np.where(good, number - mean, 0.0) ** 2).sum(axis=0, keepdims=True)
        return Moments(count, len(values) - count, mean, square)
    flat, good_flat = number.reshape(len(values), -1), good.reshape(len(values), -1)

    def by_cell(column: np.ndarray) -> np.ndarray:
        return np.stack(
            [np.bincount(which, c, minlength=cells) for c in column.T.astype(float)],
            axis=-1,
        )

    count, all_of = by_cell(good_flat), by_cell(np.ones_like(flat))
    mean = by_cell(flat) / np.where(count > 0, count, 1)
    square = by_cell(np.where(good_flat, flat - mean[which], 0.0) ** 2)
    shape = (cells, *values.shape[1:])
    return Moments(
        count.astype(int).reshape(shape),
        (all_of - count).astype(int).reshape(shape),
        mean.reshape(shape),
        square.reshape(shape),
    )


def numbered(
    draws: int, cells: int, variants: int, *, block: int, tile_samples: int
) -> Numbering:
    """Return the numbering of the samples of a study.

    Args:
        draws: Samples of each cell of each variant; several variants are padded to
            whole blocks.
        cells: Number of combinations of the listed values of the axes.
        variants: Number of scenes that differ in more than numeric parameters.
        block: Largest number of samples computed together, a power of two.
        tile_samples: Largest number of samples of a chunk of the store.
    """
    each = draws * cells
    # a small study does not compute a whole large block
    block = min(block, 1 << (each - 1).bit_length())
    while variants > 1 and block > MIN_FILLED_BLOCK and -each % block > each / 8:
        block //= 2
    samples = each if variants == 1 else variants * block * -(-each // block)
    tile = block
    # doubled only: a tile of statistics is a whole number of these tiles
    while 2 * tile <= min(tile_samples, samples):
        tile *= 2
    return Numbering(block, variants, cells, samples, tile)
