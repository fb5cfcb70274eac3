"""Tiles one after another on this machine: calculated, written, taken in.

While the devices are at one tile the one before is written by a thread of its own.
"""

import contextlib
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from jblast.study.engine.estimates import Estimates
from jblast.study.engine.numbering import Numbering
from jblast.study.engine.store import Store
from jblast.study.engine.variable import Variable

Columns = Mapping[str, np.ndarray]
T = TypeVar("T")


@runtime_checkable
class Source(Protocol):
    """What calculates tiles; the same numbers whenever it is asked."""

    @property
    def variables(self) -> Sequence[Variable]:
        """The columns."""
        ...

    @property
    def numbering(self) -> Numbering:
        """Which sample is which."""
        ...

    @property
    def at_once(self) -> int:
        """How many tiles are worth calculating together."""
        ...

    def several(self, tiles: Sequence[int]) -> Sequence[Columns]:
        """Return the columns of tiles."""
        ...


def calculated(source: Source, tiles: Iterable[int]) -> Iterator[tuple[int, Columns]]:
    """Calculate tiles in their order, by this process alone.

    Where several are calculated together, as on a GPU, the next are while these are
    taken in.
    """
    wanted, size = list(tiles), source.at_once
    batches = [wanted[n : n + size] for n in range(0, len(wanted), size)]
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
    """Calculate tiles, so many at a time, and give them in their order.

    While the devices are at one the host is at another. Who stops waits for those that
    are begun.
    """
    with ThreadPoolExecutor(most) as pool:
        left = iter(tiles)
        begun = [(n, pool.submit(calculate, n)) for n in itertools.islice(left, most)]
        while begun:
            tile, coming = begun.pop(0)
            yield tile, coming.result()
            begun += [(n, pool.submit(calculate, n)) for n in itertools.islice(left, 1)]


class Writer(contextlib.AbstractContextManager["Writer"]):
    """Writes tiles while others are calculated; an error comes with the next call."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._pool = ThreadPoolExecutor(1)
        self._last: Future[None] | None = None

    def write(self, tile: int, columns: Columns) -> None:
        """Write a tile once the one before is written."""
        self.wait()
        self._last = self._pool.submit(self._store.write_tile, tile, columns)

    def wait(self) -> None:
        """Wait until all is written.

        Raises:
            OSError: It cannot be written.
        """
        if self._last is not None:
            last, self._last = self._last, None
            last.result()

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(wait=True)
        if error[0] is None:
            self.wait()


class InOrder:
    """Takes tiles in as they come, and hands them on in the order of their numbers."""

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
        """Take in a tile; nothing is taken in any more when the targets are reached."""
        self._early[tile] = columns
        while self.next in self._early and not self.reached:
            now = self._early.pop(self.next)
            size = len(next(iter(now.values())))
            self._estimates.add(self.samples, now)
            self.next += 1
            self.samples += size
            self.reached = self._estimates.reached(self._targets)
        self._heard(self.samples, self._estimates)
