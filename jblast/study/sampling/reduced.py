"""Tiles of a study of which statistics alone are kept."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.study.engine.launch import Launcher
from jblast.study.engine.summary.by_cell import anchors_of, states_by_group
from jblast.study.engine.summary.states import (
    MOST_COUNTS,
    Anchor,
    State,
    counts_in,
    empty_states,
    merged_states,
    outcomes_of,
)
from jblast.study.engine.summary.tally import ANCHORS, COUNTERS, reduce_of, states_of
from jblast.study.sampling.work import Work

MOST_TILES = 256
"""Parts that a study is cut into, whatever its size."""
PART, PART_OF_POINTS = 1 << 26, 1 << 24
"""Samples whose blocks are summed at once, fewer where the host makes their points;
parts are merged in their order."""
AHEAD = 4
"""Parts, or tiles, that devices and host are at together."""
PILOT = 16
"""Samples of each cell that tell what its numbers are counted from."""
ANCHOR_SEED = 0
"""Of those samples, so that studies of other seeds can be merged."""


class Reduced:
    """What calculates the statistics of tiles.

    Attributes:
        work: What calculates samples.
        tile: Samples of a part that is done or not.
        groups: Variants and cells of the study, as one number.
        anchors: What numbers are counted from.
    """

    def __init__(self, work: Work, anchors: Mapping[str, Anchor] | None = None) -> None:
        self.work, numbering = work, work.numbering
        self.groups = numbering.variants * numbering.cells
        counts = counts_in(work.variables, self.groups)
        if counts > MOST_COUNTS:
            raise InputError(
                f"{work.study.source}: keep: expected at most {MOST_COUNTS:,} counts "
                "of sketches, of all numbers, sensors, cells and variants together, "
                f'got {counts:,}; keep = "all", or ask for less'
            )
        self.tile = numbering.tile
        while numbering.samples > MOST_TILES * self.tile:
            self.tile *= 2
        self.anchors = self._anchors() if anchors is None else dict(anchors)
        host = any(p.prepared.finish is not None for part in work.parts for p in part)
        self._on_device = numbering.cells == 1 and not host
        self._outcomes = outcomes_of(work.variables)
        self._launchers: dict[int, Launcher] = {}
        if self._on_device:
            reduce = reduce_of(self._outcomes, 1 if work.kind == "cpu" else COUNTERS)
            self._launchers = {
                n: work.launcher(n, reduce) for n in range(numbering.variants)
            }

    @property
    def tiles(self) -> int:
        """How many tiles there are."""
        return -(-self.work.numbering.samples // self.tile)

    @property
    def ahead(self) -> int:
        """How many tiles are worth calculating at a time."""
        return AHEAD if self._on_device else 1

    def samples_of(self, tile: int) -> int:
        """Return how many samples a tile has."""
        return min(self.tile, self.work.numbering.samples - tile * self.tile)

    def states(self, tile: int) -> dict[str, State]:
        """Return the states of a tile's outcomes."""
        begin = tile * self.tile
        end = begin + self.samples_of(tile)
        whole = self.empty()
        reduce, step = self._host, self.work.numbering.tile * self.work.at_once
        if self._on_device:
            reduce = self._device
            step = PART if self.work.points is None else PART_OF_POINTS
        parts = [(at, min(at + step, end)) for at in range(begin, end, step)]
        with ThreadPoolExecutor(self.ahead) as pool:
            for own in pool.map(lambda part: reduce(*part), parts):
                whole = merged_states(self.work.variables, whole, own)
        return whole

    def empty(self) -> dict[str, State]:
        """Return the states of no samples."""
        return empty_states(self.work.variables, self.groups, self.anchors)

    def _host(self, begin: int, end: int) -> dict[str, State]:
        """Reduce the columns of samples."""
        numbering = self.work.numbering
        tiles = range(begin // numbering.tile, -(-end // numbering.tile))
        parts = self.work.several(tiles)
        columns = {n: np.concatenate([part[n] for part in parts]) for n in parts[0]}
        variant, cell = numbering.of_samples(begin, end)
        which = variant * numbering.cells + cell
        return states_by_group(
            self.work.variables, columns, which, self.groups, self.anchors
        )

    def _device(self, begin: int, end: int) -> dict[str, State]:
        """Reduce samples where they are calculated."""
        work, numbering = self.work, self.work.numbering
        blocks = np.arange(begin // numbering.block, -(-end // numbering.block))
        variants = numbering.variant_of(blocks)
        found: dict[int, dict[str, State]] = {}
        for variant in range(numbering.variants):
            own = blocks[variants == variant]
            if not len(own):
                continue
            mine = {
                name: Anchor(*(x[variant : variant + 1] for x in anchor))
                for name, anchor in self.anchors.items()
            }
            shared, each = work.given(own)
            shared[ANCHORS] = {
                name: tuple(jnp.asarray(x.reshape(-1)) for x in anchor)
                for name, anchor in mine.items()
            }
            kept, counts = self._launchers[variant].reduced(shared, each)
            found[variant] = states_of(self._outcomes, kept, counts, mine)
        return self._beside(found)

    def _beside(self, found: dict[int, dict[str, State]]) -> dict[str, State]:
        """Return states of variants as one."""
        if self.groups == 1:
            return found[0]
        empty = self.empty()
        whole: dict[str, State] = {}
        for v in self._outcomes:
            whole[v.name] = _filled(
                empty[v.name], {n: states[v.name] for n, states in found.items()}
            )
        return whole

    def _anchors(self) -> dict[str, Anchor]:
        """Return what numbers are counted from, by the first samples of each cell."""
        work, numbering = self.work, self.work.numbering
        count = -(-PILOT * numbering.cells // numbering.block)
        columns, which = [], []
        for variant in range(numbering.variants):
            blocks = variant + numbering.variants * np.arange(count)
            answers = work.launcher(variant)(*work.given(blocks, ANCHOR_SEED))
            found = work.finished(variant, answers)
            columns.append(
                {name: x.reshape(-1, *x.shape[2:]) for name, x in found.items()}
            )
            begin = numbering.begins_at(blocks)[:, None] + np.arange(numbering.block)
            which.append(variant * numbering.cells + begin.ravel() % numbering.cells)
        whole = {
            name: np.concatenate([one[name] for one in columns]) for name in columns[0]
        }
        return anchors_of(work.variables, whole, np.concatenate(which), self.groups)


def _filled(empty: State, parts: Mapping[int, State]) -> State:
    """Return a state with those of single groups in their places."""
    if hasattr(empty, "_fields"):
        return type(empty)(
            *(
                _filled(
                    getattr(empty, name),
                    {n: getattr(s, name) for n, s in parts.items()},
                )
                for name in empty._fields
            )
        )
    whole = np.array(empty)
    for n, part in parts.items():
        whole[n] = part[0]
    return whole
