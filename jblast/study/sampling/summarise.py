"""A study of which statistics are kept, and perhaps the first of its samples."""

import time
from collections.abc import Iterable, Mapping

import numpy as np

from jblast.study.engine.estimates import Estimates, Moments
from jblast.study.engine.store import Store
from jblast.study.engine.summary.states import State, merged_states, outcomes_of
from jblast.study.engine.summary.store import SummaryStore
from jblast.study.engine.tiles import ahead
from jblast.study.engine.variable import Variable
from jblast.study.file.study import Keep
from jblast.study.sampling.ran import Ran, Tiles, telling
from jblast.study.sampling.reduced import Reduced
from jblast.study.sampling.work import Work


def rows_of(keep: Keep, samples: int) -> int:
    """Return how many samples a store keeps themselves: the first ones."""
    if keep == "all":
        return samples
    return 0 if keep == "summary" else min(keep, samples)


def opened_summary(store: Store, work: Work) -> tuple[SummaryStore, Reduced]:
    """Return the statistics of a store, made where there are none, and what adds to it.

    Raises:
        InputError: They would take too much memory.
        OSError: They cannot be written.
    """
    groups = work.numbering.variants * work.numbering.cells
    summary = SummaryStore(store.path, store.variables, groups, 0)
    reduced = Reduced(work, summary.anchors() if summary.there else None)
    summary.tiles = reduced.tiles
    if not summary.there:
        summary.create(reduced.anchors, reduced.tile)
    return summary, reduced


def summarised(work: Work, store: Store, limit: int | None, tiles: Tiles | None) -> Ran:
    """Calculate what a store lacks: rows that are kept, then statistics of all.

    Args:
        work: What calculates samples.
        store: The store.
        limit: How many samples to calculate at most, rounded up to whole tiles.
        tiles: What calculates them in place of this process.
    """
    summary, reduced = opened_summary(store, work)
    run = _Run(work, summary, reduced)
    if store.attributes["complete"]:
        summary.tiles = summary.tiles_said()
        run.take(summary.done())
        reached = run.samples < work.numbering.samples
        return Ran(store, run.estimates, run.samples, 0, 0.0, True, reached, work.notes)
    begun = time.monotonic()
    left = _rows(work, store, limit, tiles)
    done = summary.done()
    run.take(done)
    missing = [tile for tile in range(reduced.tiles) if tile not in done]
    if left is not None:
        missing = missing[: -(-left // reduced.tile)]
    new, reached = 0, run.reached
    if not reached:

        def written(tile: int) -> None:
            summary.write(tile, reduced.states(tile))

        # whoever may stop at a target begins nothing that lies beyond
        most = 1 if work.study.sd_target else reduced.ahead
        here = ahead(written, missing, most)
        for number, _ in tiles(missing, summary=True) if tiles else here:
            new += reduced.samples_of(number)
            run.take({number})
            if run.reached:
                break
    complete = run.reached or run.next == reduced.tiles
    if complete:
        summary.resized(run.next, reduced.tile)
        failed = {n: int(m.failed.sum()) for n, m in run.estimates.moments.items()}
        store.finish(run.samples, min(store.samples, run.samples), failed=failed)
    return Ran(
        store,
        run.estimates,
        run.samples,
        new,
        time.monotonic() - begun,
        complete,
        run.reached,
        work.notes,
    )


def _rows(
    work: Work, store: Store, limit: int | None, tiles: Tiles | None
) -> int | None:
    """Calculate the samples that are kept; return how many more may be calculated."""
    done = store.done()
    missing = [tile for tile in range(store.tiles) if tile not in done]
    if limit is not None:
        missing = missing[: -(-limit // store.tile)]
    if tiles is not None and missing:
        for _ in tiles(missing):
            pass
    elif missing:
        for tile in missing:
            store.write_tile(tile, work.tile(tile))
    return None if limit is None else max(0, limit - len(missing) * store.tile)


class _Run:
    """Takes statistics in in the order of their tiles, as these come."""

    def __init__(self, work: Work, summary: SummaryStore, reduced: Reduced) -> None:
        self._summary, self._reduced = summary, reduced
        self._targets = work.study.sd_target
        self._heard = telling(work.numbering)
        self._there: set[int] = set()
        self._state: Mapping[str, State] = reduced.empty()
        self.estimates = Estimates(work.variables, work.numbering)
        self.next = self.samples = 0
        self.reached = False

    def take(self, tiles: Iterable[int]) -> None:
        """Take in tiles that are written."""
        self._there |= set(tiles)
        variables = self._summary.variables
        while self.next in self._there and not self.reached:
            own = self._summary.read(self.next, self._reduced.anchors)
            self._state = merged_states(variables, self._state, own)
            self.samples += self._reduced.samples_of(self.next)
            self.next += 1
            for v in outcomes_of(variables):
                self.estimates.moments[v.name] = moments_of(v, self._state[v.name])
            self.reached = self.estimates.reached(self._targets)
        self._heard(self.samples, self.estimates)


def moments_of(variable: Variable, state: State) -> Moments:
    """Return what running estimates tell of a state."""
    if variable.kind == "yes_no":
        share = state.yes / np.maximum(state.known, 1)
        square = state.yes * (1.0 - share)
        return Moments(state.known, state.lost, share, square)
    m = state.moments
    return Moments(m.finite, m.lost + m.infinite, m.mean, m.squares)
