"""Computation of a study: prepared outcome families, and samples by tiles.

Each family of outcomes is prepared for every variant of the scene by a few pilot
samples; `outcomes` is then a pure function of one sample's key. Tiles of which only
statistics are stored are reduced where they were calculated.

Fits run from Python on whole batches. On a CPU they finish one block at a time, so that
a result does not depend on the number of blocks, with as many blocks in parallel as
there are devices. A GPU finishes all its samples together, in its own memory: only
columns of the study leave it.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh
from jaxtyping import Array, ArrayLike, Float, Int, Key, PRNGKeyArray

from jblast.errors import InputError, nearest
from jblast.scene import parameter_named
from jblast.study.engine.launch import Blocks, Launcher, Reduce, mesh_of
from jblast.study.engine.store import NO_ANSWER, Variable
from jblast.study.engine.summary import (
    ANCHORS,
    COUNTERS,
    MAX_COUNTS,
    VALID,
    Anchor,
    State,
    anchors_of,
    empty_states,
    merged_states,
    outcomes_of,
    reduce_of,
    states_by_group,
    states_of,
)
from jblast.study.engine.tiles import numbered
from jblast.study.file import Study
from jblast.study.outcome.family import Answers, Family, Finish, Prepared, Setting
from jblast.study.outcome.registry import families_of, outcomes_named
from jblast.study.sampling.draws import (
    allowed,
    folded,
    normal_scores,
    numbers_at,
    part_of,
    points_of,
)
from jblast.study.statistics import BINS

MAX_TILES = 256
"""Largest number of tiles of a summary: a killed run loses less than 0.4 % of its work,
and the histograms of all tiles stay small on disk."""
PART, PART_OF_POINTS = 1 << 26, 1 << 24
"""Samples of a launch of statistics; fewer if the host computes their points, whose
memory is 8 bytes for each parameter."""
AHEAD = 4
"""Parts or tiles in computation, so that devices do not wait for the host."""
ANCHOR_SAMPLES = 16
"""Samples of each cell that determine the origins of its histograms: only their order
of magnitude matters."""
ANCHOR_SEED = 0
"""Seed of these samples, a constant."""
LAUNCH = {"cpu": 1 << 15, "gpu": 1 << 20}
"""Samples of a device in one launch: enough to hide its overhead, within its memory."""
GROUP = 1 << 19
"""Largest number of samples, in whole blocks, that a GPU computes together."""
REDUCED = {"cpu": 1 << 20, "gpu": 1 << 24}
"""Samples of a device in one launch that stores statistics only."""
Columns = dict[str, np.ndarray]
MIN_PILOTS, MAX_PILOTS = 256, 4096
"""Pilot samples that families are prepared with: at least those that show the range of
inputs, and no more than the time of a preparation allows."""


class Work:
    """Computation of the samples of a study.

    Attributes:
        study: Study.
        variables: Columns: sampled parameters, axes, outcomes.
        numbering: Numbering of the samples.
        notes: Remarks on the calculation.
        kind: Kind of the devices: "cpu" or "gpu".
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
        self.points = points_of(study.design, len(study.drawn), study.seed)
        notes = [note for part in self.parts[0] for note in part.prepared.notes]
        self.notes = tuple(dict.fromkeys(notes))
        self._launchers: dict[int, Launcher] = {}
        # a study without axes has one cell with no values
        self._table = np.array(study.cells, float).reshape(cells, -1)

    def cut_as(self, tile: int) -> None:
        """Set the tile size, to that of an existing store."""
        self.numbering = self.numbering._replace(tile=tile)

    @property
    def at_once(self) -> int:
        """Number of tiles that are computed together."""
        if self.kind == "cpu":
            return 1
        return max(1, LAUNCH["gpu"] * self.mesh.size // self.numbering.tile)

    @property
    def places(self) -> dict[str, tuple[float, ...]]:
        """Positions of sensors by name, east, north, up [m]; empty if unused."""
        if not any(variable.sensors for variable in self.variables):
            return {}
        return {
            s.name: tuple(np.asarray(s.position_m).tolist())
            for s in self.study.uncertain.scene.sensors
        }

    def tile(self, tile: int) -> Columns:
        """Return the columns of a tile, one value for each sample."""
        return self.several([tile])[0]

    def several(self, tiles: Sequence[int]) -> list[Columns]:
        """Return the columns of tiles that are computed together (`at_once`)."""
        numbering = self.numbering
        each = [numbering.blocks_of(tile) for tile in tiles]
        blocks = np.concatenate(each)
        columns: Columns = {
            v.name: np.empty((len(blocks), *v.shape(numbering.block)), v.dtype)
            for v in self.variables
        }
        variants = numbering.variant_of(blocks)
        # a key serves 2^32 samples: blocks beyond that have another one
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
            # mixed radix: the last axis varies fastest, as in `itertools.product`
            each //= len(axis.values)
            found[axis.key] = (variant // each % len(axis.values)).astype(np.int16)
        return found

    def _blocks(self, variant: int, blocks: np.ndarray) -> Columns:
        """Return the columns of blocks of one variant."""
        if variant not in self._launchers:
            self._launchers[variant] = self.launcher(variant)
        launcher, given = self._launchers[variant], self.given(blocks)
        finishes = self._finishes(variant)
        if finishes and self.kind == "gpu":
            names = [v.name for v in self.variables]
            return finished_on_devices(finishes, launcher.pieces(*given), names)
        return self.finished(variant, launcher(*given))

    def launcher(self, variant: int, reduce: Reduce | None = None) -> Launcher:
        """Return the launcher of blocks of a variant, with or without a reduction."""
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
            # independent of the number of devices: the last digit of sums depends on it
            group=min(together // block, 1 << (blocks - 1).bit_length()),
            reduce=reduce,
        )

    def given(
        self, blocks: np.ndarray, seed: int | None = None
    ) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Return the shared arrays of blocks of one variant, and those of each block.

        Args:
            blocks: Numbers of the blocks.
            seed: Seed of random samples, in place of the study's design.
        """
        numbering = self.numbering
        first = blocks * numbering.block
        within = numbering.begins_at(blocks)
        each: dict[str, np.ndarray] = {
            # 32 bits are folded into a sample's key, the bits above into this one
            "index": (first % 2**32).astype(np.uint32),
            "cell": (within % numbering.cells).astype(np.int32),
            "valid": np.clip(numbering.samples - first, 0, numbering.block).astype(
                np.int32
            ),
        }
        if self.points is not None and seed is None:
            each["scores"] = np.stack([self._scores(int(at)) for at in within])
        elif self.points is not None:
            # anchors: random points suffice, and need no engine of the design
            shape = len(blocks), numbering.block, len(self.study.drawn)
            each["scores"] = np.random.default_rng(seed).standard_normal(shape)
        key = jax.random.key(self.study.seed if seed is None else seed)
        if high := int(first[0]) >> 32:
            key = jax.random.fold_in(key, high)
        shared = {"key": jax.random.key_data(key), "table": jnp.asarray(self._table)}
        return shared, each

    def _scores(self, at: int) -> np.ndarray:
        """Return the points of a block."""
        assert self.points is not None
        draws = np.arange(at, at + self.numbering.block) // self.numbering.cells
        points = self.points(int(draws[0]), int(draws[-1] - draws[0]) + 1)
        return points[draws - draws[0]]

    def _blocks_of(self, variant: int) -> Blocks:
        """Return the pure function of arrays that computes blocks.

        The samples of all blocks are one batch axis, because flights of one batch
        evaluate their branches (is a blast near?) together.
        """
        study, numbering = self.study, self.numbering

        def blocks(shared: dict[str, Any], each: dict[str, Array]) -> dict[str, Array]:
            lanes = jnp.arange(numbering.block)[None]

            def flat(x: Array) -> Array:
                return x.reshape(-1, *x.shape[2:])

            index = flat(each["index"][:, None] + lanes.astype(jnp.uint32))
            keys = folded(jax.random.wrap_key_data(shared["key"]), index)
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
        """Return the columns after the part of a calculation that runs from Python."""
        found = dict(answers)
        for finish in self._finishes(variant):
            found |= by_block(finish, found, list(self.mesh.devices.flat))
        return {v.name: found[v.name] for v in self.variables if v.name in found}

    def _finishes(self, variant: int) -> list[Finish]:
        parts = (part.prepared.finish for part in self.parts[variant])
        return [finish for finish in parts if finish is not None]


class Reduced:
    """Computation of the statistics of tiles.

    Attributes:
        work: Computation of samples.
        tile: Samples of a tile.
        groups: Number of variants times cells.
        anchors: Reference values by outcome.
    """

    def __init__(self, work: Work, anchors: Mapping[str, Anchor] | None = None) -> None:
        self.work, numbering = work, work.numbering
        self.groups = numbering.variants * numbering.cells
        self._outcomes = outcomes_of(work.variables)
        numbers = [v for v in self._outcomes if v.kind == "number"]
        counts = BINS * sum(int(np.prod(v.shape(self.groups))) for v in numbers)
        if counts > MAX_COUNTS:
            raise InputError(
                f"{work.study.source}: keep: expected at most {MAX_COUNTS:,} histogram "
                "bins of all numbers, sensors, cells and variants together, "
                f'got {counts:,}; set keep = "all", or request fewer outcomes'
            )
        self.tile = numbering.tile
        while numbering.samples > MAX_TILES * self.tile:
            self.tile *= 2
        self.anchors = self._anchors() if anchors is None else dict(anchors)
        host = any(p.prepared.finish is not None for part in work.parts for p in part)
        # with several cells a block has samples of several groups; fits run from
        # Python
        self._on_device = numbering.cells == 1 and not host
        self._launchers: dict[int, Launcher] = {}
        if self._on_device:
            reduce = reduce_of(self._outcomes, 1 if work.kind == "cpu" else COUNTERS)
            self._launchers = {
                n: work.launcher(n, reduce) for n in range(numbering.variants)
            }

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return -(-self.work.numbering.samples // self.tile)

    @property
    def ahead(self) -> int:
        """Number of tiles in computation at a time."""
        return AHEAD if self._on_device else 1

    def samples_of(self, tile: int) -> int:
        """Return the number of samples of a tile."""
        return min(self.tile, self.work.numbering.samples - tile * self.tile)

    def states(self, tile: int) -> dict[str, State]:
        """Return the states of a tile's outcomes."""
        begin = tile * self.tile
        end = begin + self.samples_of(tile)
        whole = self.empty()
        reduce, step = self._host, self.work.numbering.tile * self.work.at_once
        # statistics of cells, and fits, are reduced on the host
        if self._on_device:
            reduce = self._device
            step = PART if self.work.points is None else PART_OF_POINTS
        parts = [(at, min(at + step, end)) for at in range(begin, end, step)]
        with ThreadPoolExecutor(self.ahead) as pool:
            for own in pool.map(lambda part: reduce(*part), parts):
                whole = merged_states(self.work.variables, whole, own)
        return whole

    def empty(self) -> dict[str, State]:
        """Return the states without samples."""
        return empty_states(self.work.variables, self.groups, self.anchors)

    def _host(self, begin: int, end: int) -> dict[str, State]:
        """Return the states of samples, reduced on the host."""
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
        """Return the states of samples, reduced on the devices that compute them."""
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
        return self._combined(found)

    def _combined(self, found: dict[int, dict[str, State]]) -> dict[str, State]:
        """Return the states of all variants as one, with the group as first axis."""
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
        """Return reference values from the first samples of each cell."""
        work, numbering = self.work, self.work.numbering
        count = -(-ANCHOR_SAMPLES * numbering.cells // numbering.block)
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
    """Return a state with the states of single groups inserted."""
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


def draw(
    key: PRNGKeyArray, study: Study, *, cell: int = 0
) -> dict[str, Float[Array, ""]]:
    """Return the parameters of a sample, from its key or from axes.

    Args:
        key: Key of the sample: `jax.random.fold_in(jax.random.key(study.seed), index)`.
        study: Study.
        cell: Number of the combination of axes in `Study.cells`.
    """
    scores = normal_scores(key[None], len(study.drawn))
    cells = jnp.full((1,), cell)
    found = numbers_at(study.uncertain, scores, study.numbers, _table(study), cells)
    return {name: values[0] for name, values in found.items()}


def outcomes(
    key: PRNGKeyArray,
    study: Study,
    numbers: Mapping[str, Float[ArrayLike, ""]] | None = None,
    *,
    variant: int = 0,
    cell: int = 0,
) -> dict[str, Array]:
    """Return the outcomes of one sample; works under `jit`, `vmap` and `grad`.

    Args:
        key: Key of the sample, as in `draw`.
        study: Study; its design is ignored, and the key gives the sample.
        numbers: Parameters by name, in place of sampled ones; outcomes are
            differentiable by them.
        variant: Number of the variant in `Study.variants`.
        cell: Number of the combination of axes in `Study.cells`.

    Returns:
        One value by outcome, or one for each sensor.

    Raises:
        InputError: An outcome is not available for the scene, or for whole batches
            only, or a parameter is unknown.

    Example:
        `jax.vmap(lambda key: jblast.study.outcomes(key, study))(keys)`
    """
    found = draw(key, study, cell=cell)
    given = {name: jnp.asarray(value) for name, value in (numbers or {}).items()}
    for name in given:
        if name not in found:
            raise InputError(
                f"numbers: expected names of {', '.join(found) or '(none)'}, got "
                f"{name!r}{nearest(name, found)}"
            )
    for part in parts_of(study, variant):
        if part.prepared.finish is not None:
            raise InputError(
                f"{study.source}: expected outcomes of single samples, got "
                f"{part.names[0]}, which jblast.study.run computes for whole batches"
            )
    answers = answers_of(
        study,
        variant,
        key[None],
        normal_scores(key[None], len(study.drawn)),
        _table(study),
        jnp.full((1,), cell),
        {name: value[None] for name, value in given.items()},
    )
    return {name: answers[name][0] for name in study.outcomes}


def _table(study: Study) -> Float[Array, "cell axis"]:
    return jnp.asarray(study.cells, float).reshape(len(study.cells), -1)


def _tile_samples(variables: tuple[Variable, ...]) -> int:
    """Return the samples of a chunk, of which the largest column has 8 MiB at most.

    Larger chunks would lose more work of a killed run; smaller ones are too many files.
    """
    widest = max(v.dtype.itemsize * max(1, len(v.sensors)) for v in variables)
    return (8 << 20) // widest


class Part(NamedTuple):
    """Family of outcomes, prepared for one variant of the scene."""

    family: Family
    names: tuple[str, ...]
    prepared: Prepared


def parts_of(study: Study, variant: int) -> tuple[Part, ...]:
    """Return the prepared families of a variant, which the study caches.

    Raises:
        InputError: An outcome or option is unknown, or the scene lacks a requirement of
            an outcome.
    """
    if variant not in study.prepared:
        families = families_of(
            outcomes_named(study.outcomes, study.source, allow_code=study.allow_code)
        ).values()
        _check_options(study, [family for family, _ in families])
        with jax.ensure_compile_time_eval():  # also while JAX traces a caller
            study.prepared[variant] = tuple(
                Part(family, tuple(names), prepared)
                for family, names in families
                for prepared in (
                    family.prepare(
                        Setting(
                            study.variants[variant],
                            study.believed[variant],
                            tuple(names),
                            study.options,
                            _pilot(study, variant),
                        )
                    ),
                )
            )
    return study.prepared[variant]


def _pilot(study: Study, variant: int) -> dict[str, np.ndarray]:
    """Return the parameters of pilot samples, which include each cell of the axes."""
    cells = np.array(study.cells, float).reshape(len(study.cells), -1)
    count = min(max(MIN_PILOTS, len(cells)), MAX_PILOTS)
    # a fixed seed: preparation must not depend on the seed of the study
    scores = np.random.default_rng(0).standard_normal((count, len(study.drawn)))
    which = np.linspace(0, len(cells) - 1, min(count, len(cells))).round().astype(int)
    numbers = numbers_at(
        study.variants[variant],
        jnp.asarray(scores),
        study.numbers,
        jnp.asarray(cells),
        jnp.asarray(np.resize(which, count)),
    )
    return {name: np.asarray(values) for name, values in numbers.items()}


def answers_of(
    study: Study,
    variant: int,
    keys: Key[Array, " sample"],
    scores: Float[Array, "sample drawn"],
    table: Float[Array, "cell axis"],
    cell: Int[Array, " sample"],
    numbers: dict[str, Array] | None = None,
) -> dict[str, Array]:
    """Return parameters and outcomes of samples of one variant.

    Args:
        study: Study.
        variant: Number of the variant.
        keys: Keys of the samples.
        scores: Standard normal coordinates of the samples.
        table: Values of the axes by cell.
        cell: Cell of each sample.
        numbers: Parameters in place of sampled or listed ones.
    """
    uncertain = study.variants[variant]
    found = numbers_at(uncertain, scores, study.numbers, table, cell)
    found |= numbers or {}
    good, whole = allowed(found), dict(found)
    for part in parts_of(study, variant):
        answers = part.prepared.batched(part_of(keys, part.family.number), found)
        whole |= {name: _failed_where(good, values) for name, values in answers.items()}
    return whole


def input_variables(study: Study) -> tuple[Variable, ...]:
    """Return the columns of sampled parameters and of axes."""

    def number(name: str, role: Any) -> Variable:
        parameter = parameter_named(name)
        return Variable(name, role, parameter.unit, parameter.words)

    drawn = [number(name, "input") for name in study.drawn]
    axes = [number(axis.key, "axis") for axis in study.numbers]
    words = [
        Variable(
            axis.key,
            "axis",
            "1",
            f"{axis.key} of the scene",
            names=tuple(str(value) for value in axis.values),
        )
        for axis in study.words
    ]
    return (*drawn, *axes, *words)


def outcome_variables(study: Study) -> tuple[Variable, ...]:
    """Return the columns of the outcomes."""
    sensors = tuple(s.name for s in study.uncertain.scene.sensors)
    requested = outcomes_named(
        study.outcomes, study.source, allow_code=study.allow_code
    )
    names = {tuple(s.name for s in one.scene.sensors) for one in study.variants}
    if len(names) > 1 and any(outcome.per_sensor for outcome in requested):
        raise InputError(
            f"{study.source}: [axes]: expected the same sensors in each variant of the "
            f"scene for outcomes at sensors, got {len(names)} different sets"
        )
    return tuple(
        Variable(
            o.name,
            "outcome",
            o.units,
            o.long_name,
            o.kind,
            sensors if o.per_sensor else (),
        )
        for o in requested
    )


def _failed_where(good: Array | None, values: Any) -> Array:
    """Return answers, marked as failed for samples with invalid parameters."""
    if good is None:
        return values
    good = good.reshape(good.shape + (1,) * (values.ndim - 1))
    if jnp.issubdtype(values.dtype, jnp.inexact):
        return jnp.where(good, values, jnp.nan)
    return jnp.where(good, values.astype(jnp.int8), jnp.int8(NO_ANSWER))


def _check_options(study: Study, families: list[Family]) -> None:
    """Check that each option belongs to a requested outcome."""
    known = sorted({key for family in families for key in family.options})
    for key in study.options:
        if key not in known:
            raise InputError(
                f"{study.source}: [options] {key}: unknown key{nearest(key, known)}; "
                f"expected one of {', '.join(known) or '(none of these outcomes)'}"
            )


def by_block(
    finish: Finish, answers: Mapping[str, np.ndarray], devices: Sequence[Any]
) -> dict[str, np.ndarray]:
    """Return the answers of blocks after `finish`, one block on each device at a time.

    Args:
        finish: Part of the calculation that runs from Python.
        answers: Values by name, with axes block and sample.
        devices: Devices of this process.
    """
    blocks = len(next(iter(answers.values())))

    def some(nth: int) -> list[tuple[int, dict[str, np.ndarray]]]:
        with jax.default_device(devices[nth]):
            return [
                (n, _on_host(finish({k: x[n] for k, x in answers.items()})))
                for n in range(nth, blocks, len(devices))
            ]

    with ThreadPoolExecutor(len(devices)) as pool:
        parts = [done for part in pool.map(some, range(len(devices))) for done in part]
    # by number only: dictionaries have no order
    rows = [columns for _, columns in sorted(parts, key=lambda one: one[0])]
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def finished_on_devices(
    finishes: Sequence[Finish],
    pieces: Sequence[Mapping[str, Array]],
    names: Sequence[str],
) -> dict[str, np.ndarray]:
    """Return columns after `finishes`, each chunk on the device that has it.

    Args:
        finishes: Parts of the calculation that run from Python.
        pieces: Chunks of blocks in their order, each on one device.
        names: Names of the returned columns.
    """

    def one(piece: Mapping[str, Array]) -> dict[str, np.ndarray]:
        shape = next(iter(piece.values())).shape[:2]
        rows = shape[0] * shape[1]  # not -1: a column may have no width
        found: dict[str, Any] = {
            name: x.reshape(rows, *x.shape[2:]) for name, x in piece.items()
        }
        (device,) = next(iter(piece.values())).devices()
        with jax.default_device(device):
            for finish in finishes:
                found |= finish(found)
        kept = {name: found[name] for name in names if name in found}
        for x in kept.values():
            # all copies begin before the first one is waited for
            x.copy_to_host_async()
        return {n: x.reshape(*shape, *x.shape[1:]) for n, x in _on_host(kept).items()}

    with ThreadPoolExecutor(len(pieces)) as pool:
        parts = list(pool.map(one, pieces))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _on_host(answers: Answers) -> dict[str, np.ndarray]:
    return {name: np.asarray(x) for name, x in answers.items()}
