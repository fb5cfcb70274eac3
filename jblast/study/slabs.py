"""Computation of a study: an array with the dimensions draw, axes and sensor, in slabs.

A slab is some draws of every combination of the axes, which are called cases. It is the
unit of launch, of storage and of progress: calls of one program on one device for each
scene, one chunk of each column and one row of moments. Sample n of a slab has its
own key, so that its numbers depend on nothing but the seed and its place in the array:
draw times number of cells of the axes, plus cell. Scenes that differ in words share
random numbers, so that their differences have less noise.

Within a slab batches of draws follow one another: as many as stay in the cache of a
core, or fill a GPU. A loop within one program would be three times as slow on a CPU.
Their moments are merged where they are calculated, by a program of their own (fused
into the outcomes they would change the last digit of these), and samples leave the
device only if they are stored or fitted. Fits run from Python on a whole slab.
"""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, Key, PRNGKeyArray

from jblast.errors import InputError, argument, require, shown, whole_number
from jblast.kept_programs import WIDE
from jblast.scene import parameter_named
from jblast.scene.values import known
from jblast.study.draws import (
    allowed,
    folded,
    normal_scores,
    numbers_at,
    points_of,
)
from jblast.study.file import Study
from jblast.study.outcome.family import Family, Prepared, Setting
from jblast.study.outcome.registry import families_of, outcomes_named
from jblast.study.statistics import NO_ANSWER, Moments, merged_moments, moments
from jblast.study.store import Role, Variable

SLABS = 64
"""Largest number of slabs, unless all samples are stored: a killed run loses a
sixty-fourth of its work for each device, and many more would wait for the disk."""
STORED_BYTES = 8 << 20
"""Largest chunk if all samples are stored: they are in memory at once."""
MIN_PILOTS, MAX_PILOTS = 256, 4096
"""Pilot samples that families are prepared with: at least those that show the range of
inputs, and no more than the time of a preparation allows."""
Columns = dict[str, np.ndarray]


def devices_of(devices: int | str | None = None) -> list[Any]:
    """Return all local devices, or the first `devices` of them.

    Args:
        devices: Their number, which may be text; None or "all" for all.

    Raises:
        InputError: It is no number, or the machine has fewer devices.
    """
    there = jax.local_devices()
    count = len(there)
    if devices not in (None, "all"):
        count = whole_number(str(devices))
    if count is None or not 1 <= count <= len(there):
        raise InputError(
            f"{argument('devices')}: expected all, or a whole number from 1 to "
            f"{len(there)}, the devices of this machine, got {shown(str(devices))}"
        )
    return there[:count]


class Slabs:
    """Slabs of a study.

    Attributes:
        study: Study.
        inputs: Columns of the sampled parameters.
        axes: Axes, in the order of the dimensions.
        outcomes: Columns of the outcomes.
        cases: Number of combinations of the axes.
        slab: Draws of a slab.
        keep: Draws of which samples are stored, the first ones.
        notes: Remarks on the calculation.
    """

    def __init__(self, study: Study, slab: int | None = None) -> None:
        self.study = study
        self.parts = [parts_of(study, n) for n in range(len(study.variants))]
        self.inputs = tuple(_parameter(name, "input") for name in study.drawn)
        self.axes, self.outcomes = axis_variables(study), outcome_variables(study)
        self.cells = len(study.cells)
        self.cases = self.cells * len(study.variants)
        rows = study.samples * self.cases
        most = rows if study.keep == "all" else study.keep
        self.keep = -(-min(most, rows) // self.cases)
        widths = {v.name: max(1, len(v.sensors)) for v in self.outcomes}
        width = max(widths.values())
        on_cpu = jax.default_backend() == "cpu"

        def at_once(part: Part) -> int:
            family = part.family
            values = family.on_core if on_cpu else family.together
            return max(family.block, values // max(widths[q] for q in part.names))

        together = min(map(at_once, self.parts[0]))
        # powers of two: loops over batches and slabs have no remainder
        draws = max(1, together // self.cells)
        self.batch = 1 << min(draws.bit_length() - 1, (study.samples - 1).bit_length())
        self.slab = self.batch if slab is None else slab
        stored = STORED_BYTES // (8 * width * self.cases)
        fits = self.keep < study.samples and not self._finished
        while slab is None and study.samples > SLABS * self.slab:
            if not fits and 2 * self.slab > stored:
                break
            self.slab *= 2
        self.batch = min(self.batch, self.slab)
        if self.slab < self.keep:  # whole slabs have rows, or none
            self.keep = min(-(-self.keep // self.slab) * self.slab, study.samples)
        self._points = points_of(study.design, len(study.drawn), study.seed)
        self._table = study.table
        notes = [note for part in self.parts[0] for note in part.prepared.notes]
        self.notes = tuple(dict.fromkeys(notes))

    @property
    def slabs(self) -> int:
        """Number of slabs; the last one may be shorter."""
        return -(-self.study.samples // self.slab)

    @property
    def places(self) -> dict[str, tuple[float, ...]]:
        """Positions of sensors by name, east, north, up [m]; empty if unused."""
        if not any(variable.sensors for variable in self.outcomes):
            return {}
        return {
            s.name: tuple(np.asarray(s.position_m).tolist())
            for s in self.study.uncertain.scene.sensors
        }

    @functools.cached_property
    def _finished(self) -> set[str]:
        """Names of the outcomes that run from Python."""
        parts = [part for part in self.parts[0] if part.prepared.finish is not None]
        return {name for part in parts for name in part.names}

    def draws_of(self, n: int) -> int:
        """Return the number of draws of a slab."""
        return min(self.slab, self.study.samples - n * self.slab)

    def compute(self, n: int, device: Any = None) -> tuple[Columns, dict[str, Moments]]:
        """Return the stored columns of a slab, and the moments of each outcome.

        Args:
            n: Number of the slab.
            device: Device; None for the default.

        Returns:
            Values by name, shape (draw, case) or (draw, case, sensor), and moments of
            shape (case,) or (case, sensor).
        """
        draws = self.draws_of(n)
        rows = min(draws, max(0, self.keep - n * self.slab))
        needed = draws if self._finished else rows
        found: list[Columns] = []
        states: list[dict[str, Moments]] = []
        with jax.default_device(device):
            for variant, parts in enumerate(self.parts):
                state, columns = self._answered(variant, n, needed)
                for part in parts:
                    if part.prepared.finish is not None:
                        flat = {q: _joined(x) for q, x in columns.items()}
                        done = part.prepared.finish(flat)
                        columns |= {
                            q: jnp.reshape(x, (-1, self.cells, *x.shape[1:]))
                            for q, x in done.items()
                        }
                host = {
                    v.name: np.asarray(columns[v.name][:needed])
                    for v in (*self.inputs, *self.outcomes)
                    if v.name in columns
                }
                state |= {q: moments(host[q]) for q in self._finished}
                states.append(jax.tree.map(np.asarray, state))
                found.append(host)
        whole = {
            v.name: Moments(
                *map(np.concatenate, zip(*(s[v.name] for s in states), strict=True))
            )
            for v in self.outcomes
        }
        if not rows:
            return {}, whole
        names = found[0]
        return {
            q: np.concatenate([f[q][:rows] for f in found], 1) for q in names
        }, whole

    def _given(self, n: int, draws: int) -> dict[str, np.ndarray]:
        """Return the arrays of the batches of a slab."""
        batches = -(-draws // self.batch)
        first = n * self.slab + self.batch * np.arange(batches)
        index = first * self.cells
        keys = {int(high): self._keys(int(high)) for high in np.unique(index >> 32)}
        each = {
            # 32 bits are folded into a sample's key, the bits above into this one
            "index": (index % 2**32).astype(np.uint32),
            "keys": np.stack([keys[int(high)] for high in index >> 32]),
            "valid": np.clip(n * self.slab + draws - first, 0, self.batch),
        }
        if self._points is not None:
            points = self._points(n * self.slab, batches * self.batch)
            each["scores"] = points.reshape(batches, self.batch, -1)
        return each

    def _keys(self, high: int) -> np.ndarray:
        """Return the key of samples with the upper word `high`, and the next one."""
        key = jax.random.key(self.study.seed)
        both = (jax.random.fold_in(key, n) if n else key for n in (high, high + 1))
        return np.stack([np.asarray(jax.random.key_data(one)) for one in both])

    def _answered(
        self, variant: int, n: int, needed: int
    ) -> tuple[dict[str, Moments], dict[str, Array]]:
        """Return the moments of a slab's outcomes, and the columns of some draws."""
        state: dict[str, Moments] = {
            v.name: moments(np.zeros((0, self.cells, *v.shape)))
            for v in self.outcomes
            if v.name not in self._finished
        }
        rows: dict[str, list[Array]] = {}
        given, program = self._given(n, self.draws_of(n)), self._program(variant)
        for k, valid in enumerate(given.pop("valid")):
            found = program({q: x[k] for q, x in given.items()}, self._table)
            state = _merged(state, {q: found[q] for q in state}, valid)
            if k * self.batch < needed:
                for name, values in found.items():
                    rows.setdefault(name, []).append(values)
        return state, {q: jnp.concatenate(parts) for q, parts in rows.items()}

    @functools.cache  # noqa: B019  a study has few
    def _program(self, variant: int) -> Any:
        """Return the program of a batch of draws."""
        study, cells, draws = self.study, self.cells, self.batch
        cell = jnp.tile(jnp.arange(cells), draws)

        def batch(one: dict[str, Array], table: Array) -> dict[str, Array]:
            index = one["index"] + jnp.arange(draws * cells, dtype=jnp.uint32)
            # beyond 2^32 samples the next key; a gather would be slow
            over = (index < one["index"])[:, None]
            words = jnp.where(over, one["keys"][1], one["keys"][0])
            keys = folded(jax.random.wrap_key_data(words), index)
            if "scores" in one:
                scores = jnp.repeat(one["scores"], cells, 0)
            else:
                scores = normal_scores(keys, len(study.drawn))
            found = answers_of(study, variant, keys, scores, table, cell)
            return {q: x.reshape(draws, cells, *x.shape[1:]) for q, x in found.items()}

        return jax.jit(batch, **WIDE)


@jax.jit
def _merged(
    state: dict[str, Moments], found: dict[str, Array], valid: Array
) -> dict[str, Moments]:
    """Return moments with those of the first draws of a batch."""

    def merged(name: str) -> Moments:
        values = found[name]
        which = jnp.arange(len(values)) < valid
        return merged_moments(state[name], moments(values, which))

    return {name: merged(name) for name in state}


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
    found = numbers_at(
        study.uncertain, scores, study.numbers, jnp.asarray(study.table), cells
    )
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
        known(name, found, "numbers:", "parameter")
    for part in parts_of(study, variant):
        got = f"{part.names[0]}, which jblast.study.run computes for whole batches"
        pure = part.prepared.finish is None
        require(pure, study.source, "outcomes of single samples", got)
    answers = answers_of(
        study,
        variant,
        key[None],
        normal_scores(key[None], len(study.drawn)),
        jnp.asarray(study.table),
        jnp.full((1,), cell),
        {name: value[None] for name, value in given.items()},
    )
    return {name: answers[name][0] for name in study.outcomes}


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
        options = sorted({key for family, _ in families for key in family.options})
        for key in study.options:
            known(key, options, f"{study.source}: [options]", "key")
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
    cells = study.table
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
        answers = part.prepared.batched(folded(keys, part.family.number), found)
        whole |= {name: _failed_where(good, values) for name, values in answers.items()}
    return whole


def axis_variables(study: Study) -> tuple[Variable, ...]:
    """Return the axes, in the order of the dimensions of the store."""
    words = [
        Variable(
            one.key,
            "axis",
            "1",
            f"{one.key} of the scene",
            values=tuple(map(str, one.values)),
        )
        for one in study.words
    ]
    numbers = [
        _parameter(one.key, "axis")._replace(values=one.values) for one in study.numbers
    ]
    return (*words, *numbers)


def _parameter(name: str, role: Role) -> Variable:
    parameter = parameter_named(name)
    return Variable(name, role, parameter.unit, parameter.words)


def outcome_variables(study: Study) -> tuple[Variable, ...]:
    """Return the columns of the outcomes."""
    sensors = tuple(s.name for s in study.uncertain.scene.sensors)
    requested = outcomes_named(
        study.outcomes, study.source, allow_code=study.allow_code
    )
    names = {tuple(s.name for s in one.scene.sensors) for one in study.variants}
    alike = len(names) == 1 or not any(outcome.per_sensor for outcome in requested)
    words = "the same sensors in each variant of the scene for outcomes at sensors"
    got = f"{len(names)} different sets"
    require(alike, f"{study.source}: [axes]", words, got)
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


def _joined(values: Array) -> Array:
    """Return values with the first two dimensions as one; the others may be empty."""
    draws, cells, *others = values.shape
    return values.reshape(draws * cells, *others)


def _failed_where(good: Array | None, values: Any) -> Array:
    """Return answers, marked as failed for samples with invalid parameters."""
    if good is None:
        return values
    good = good.reshape(good.shape + (1,) * (values.ndim - 1))
    if jnp.issubdtype(values.dtype, jnp.inexact):
        return jnp.where(good, values, jnp.nan)
    return jnp.where(good, values.astype(jnp.int8), jnp.int8(NO_ANSWER))
