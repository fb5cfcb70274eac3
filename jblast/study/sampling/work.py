"""A study made ready: its columns, and what calculates a tile of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh
from jaxtyping import Array

from jblast.study.engine.launch import Blocks, Launcher, Reduce
from jblast.study.engine.mesh import mesh_of
from jblast.study.engine.numbering import numbered
from jblast.study.engine.summary.tally import VALID
from jblast.study.engine.variable import Variable
from jblast.study.file.study import Study
from jblast.study.outcome.family import Finish
from jblast.study.sampling.draws import key_of_study, normal_scores, sample_keys
from jblast.study.sampling.finishing import by_block, where_they_are
from jblast.study.sampling.parts import (
    answers_of,
    input_variables,
    outcome_variables,
    parts_of,
)
from jblast.study.sampling.points import points_of

LAUNCH = {"cpu": 1 << 15, "gpu": 1 << 20}
"""Samples that a device is given at a time, by platform."""
GROUP = 1 << 19
"""Samples, in whole blocks, that a GPU takes together at most."""
REDUCED = {"cpu": 1 << 20, "gpu": 1 << 24}
"""Samples of a launch of which statistics alone are kept."""

Columns = dict[str, np.ndarray]


class Work:
    """What calculates the samples of a study.

    Attributes:
        study: The study.
        variables: Its columns: what was drawn, what axes set, outcomes.
        numbering: Which sample is which.
        notes: What there is to say of how it is calculated.
        kind: Of the devices: "cpu" or "gpu".
    """

    def __init__(self, study: Study, mesh: Mesh | None = None) -> None:
        self.study = study
        self.mesh = mesh_of() if mesh is None else mesh
        self.kind = "cpu" if self.mesh.devices.flat[0].platform == "cpu" else "gpu"
        self.parts = [parts_of(study, n) for n in range(len(study.variants))]
        self.variables = (*input_variables(study), *outcome_variables(study))
        families = [part.family for part in self.parts[0]]
        cells = len(study.cells)
        self.numbering = numbered(
            study.samples,
            cells,
            len(study.variants),
            block=min(family.block for family in families),
            tile_samples=min(
                _tile_samples(self.variables),
                *(family.tile for family in families),
            ),
        )
        each = -(-self.numbering.samples // len(study.variants))
        self.points = points_of(
            study.design, len(study.drawn), -(-each // cells), study.seed, study.source
        )
        said = [note for part in self.parts[0] for note in part.prepared.notes]
        self.notes = tuple(dict.fromkeys(said))
        self._launchers: dict[int, Launcher] = {}
        self._table = np.array(study.cells, float).reshape(cells, -1)

    def cut_as(self, tile: int) -> None:
        """Cut samples into tiles of another size, as a store has them."""
        self.numbering = self.numbering._replace(tile=tile)

    @property
    def at_once(self) -> int:
        """How many tiles are worth calculating together."""
        if self.kind == "cpu":
            return 1
        return max(1, LAUNCH["gpu"] * self.mesh.size // self.numbering.tile)

    @property
    def places(self) -> dict[str, tuple[float, ...]]:
        """East, north, up [m] of the sensors by name, if any outcome is theirs."""
        if not any(variable.sensors for variable in self.variables):
            return {}
        return {
            s.name: tuple(np.asarray(s.position_m).tolist())
            for s in self.study.uncertain.scene.sensors
        }

    def tile(self, tile: int) -> Columns:
        """Calculate a tile: a value of every column for each of its samples."""
        return self.several([tile])[0]

    def several(self, tiles: Sequence[int]) -> list[Columns]:
        """Calculate tiles together; as many as `at_once` are worth it."""
        numbering = self.numbering
        each = [numbering.blocks_of(tile) for tile in tiles]
        blocks = np.concatenate(each)
        columns: Columns = {
            v.name: np.empty((len(blocks), *v.shape(numbering.block)), v.dtype)
            for v in self.variables
        }
        variants = numbering.variant_of(blocks)
        # a key is that of 2^32 samples: blocks before and after have others
        kinds = variants + numbering.variants * (blocks * numbering.block >> 32)
        for kind in np.unique(kinds):
            rows = np.flatnonzero(kinds == kind)
            variant = kind % numbering.variants
            for name, values in self._blocks(int(variant), blocks[rows]).items():
                columns[name][rows] = values
        found, done = [], 0
        for tile, own in zip(tiles, each, strict=True):
            begin = tile * numbering.tile
            count = min(numbering.tile, numbering.samples - begin)
            whole = {
                name: x[done : done + len(own)].reshape(-1, *x.shape[2:])[:count]
                for name, x in columns.items()
            }
            found.append(whole | self._words(begin, begin + count))
            done += len(own)
        return found

    def _words(self, begin: int, end: int) -> Columns:
        """Return the columns of axes over words."""
        variant, _ = self.numbering.of_samples(begin, end)
        found, each = {}, len(self.study.variants)
        for axis in self.study.words:
            each //= len(axis.values)
            found[axis.key] = (variant // each % len(axis.values)).astype(np.int16)
        return found

    def _blocks(self, variant: int, blocks: np.ndarray) -> Columns:
        """Calculate blocks of one variant."""
        if variant not in self._launchers:
            self._launchers[variant] = self.launcher(variant)
        launcher, given = self._launchers[variant], self.given(blocks)
        finishes = self._finishes(variant)
        if finishes and self.kind == "gpu":
            wanted = [v.name for v in self.variables]
            return where_they_are(finishes, launcher.pieces(*given), wanted)
        return self.finished(variant, launcher(*given))

    def launcher(self, variant: int, reduce: Reduce | None = None) -> Launcher:
        """Return what runs blocks of a variant, or reduces them."""
        block = self.numbering.block
        at_once = (REDUCED if reduce else LAUNCH)[self.kind]
        blocks = -(-self.numbering.samples // block)
        families = [part.family for part in self.parts[variant]]
        if self.kind == "gpu":
            together = min(GROUP, *(family.together for family in families))
        else:
            widest = max(1, *(len(v.sensors) for v in self.variables))
            together = min(family.on_core for family in families) // widest
        return Launcher(
            self._blocks_of(variant),
            self.mesh,
            at_once // block,
            # the same on any number of devices: sums depend on it in the last digit
            group=min(together // block, 1 << (blocks - 1).bit_length()),
            reduce=reduce,
        )

    def given(
        self, blocks: np.ndarray, seed: int | None = None
    ) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Return what blocks of one variant share, and what is of each.

        Args:
            blocks: Their numbers.
            seed: In place of the study's; its draws are random ones.
        """
        numbering = self.numbering
        first = blocks * numbering.block
        within = numbering.begins_at(blocks)
        each: dict[str, np.ndarray] = {
            "index": (first % 2**32).astype(np.uint32),
            "cell": (within % numbering.cells).astype(np.int32),
            "valid": np.clip(numbering.samples - first, 0, numbering.block).astype(
                np.int32
            ),
        }
        if self.points is not None and seed is None:
            each["scores"] = np.stack([self._scores(int(at)) for at in within])
        elif self.points is not None:
            shape = len(blocks), numbering.block, len(self.study.drawn)
            each["scores"] = np.random.default_rng(seed).standard_normal(shape)
        key = key_of_study(
            self.study.seed if seed is None else seed, int(first[0]) >> 32
        )
        shared = {"key": jax.random.key_data(key), "table": jnp.asarray(self._table)}
        return shared, each

    def _scores(self, at: int) -> np.ndarray:
        """Return the points of a block."""
        assert self.points is not None
        draws = np.arange(at, at + self.numbering.block) // self.numbering.cells
        points = self.points(int(draws[0]), int(draws[-1] - draws[0]) + 1)
        return points[draws - draws[0]]

    def _blocks_of(self, variant: int) -> Blocks:
        """Return what calculates blocks: pure, of arrays.

        Samples of all of them stand side by side, not block beside block: of flights
        those that go together ask together whether a blast is near.
        """
        study, numbering = self.study, self.numbering

        def blocks(shared: dict[str, Any], each: dict[str, Array]) -> dict[str, Array]:
            lanes = jnp.arange(numbering.block)[None]

            def flat(x: Array) -> Array:
                return x.reshape(-1, *x.shape[2:])

            index = flat(each["index"][:, None] + lanes.astype(jnp.uint32))
            keys = sample_keys(jax.random.wrap_key_data(shared["key"]), index)
            scores = each.get("scores")
            if scores is None:
                scores = normal_scores(keys, len(study.drawn))
            else:
                scores = flat(scores)
            step = lanes.astype(jnp.int32)
            cell = flat((each["cell"][:, None] + step) % numbering.cells)
            found = answers_of(study, variant, keys, scores, shared["table"], cell)
            shape = each["index"].shape[0], numbering.block
            whole = {name: x.reshape(*shape, *x.shape[1:]) for name, x in found.items()}
            return whole | {VALID: step < each["valid"][:, None]}

        return blocks

    def finished(self, variant: int, answers: Mapping[str, np.ndarray]) -> Columns:
        """Finish what only runs from Python, and keep the columns."""
        found = dict(answers)
        for finish in self._finishes(variant):
            found |= by_block(finish, found, list(self.mesh.devices.flat))
        return {v.name: found[v.name] for v in self.variables if v.name in found}

    def _finishes(self, variant: int) -> list[Finish]:
        parts = (part.prepared.finish for part in self.parts[variant])
        return [finish for finish in parts if finish is not None]


def _tile_samples(variables: tuple[Variable, ...]) -> int:
    """Return how many samples a chunk holds, so that the largest stays below 8 MiB."""
    widest = max(v.dtype.itemsize * max(1, len(v.sensors)) for v in variables)
    return (8 << 20) // widest
