"""The families of outcomes of a study, made ready for a variant of its scene."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from jblast.errors import InputError, nearest
from jblast.scene import parameter_named
from jblast.study.engine.variable import NO_ANSWER, Variable
from jblast.study.file.study import Study
from jblast.study.outcome.family import Family, Prepared, Setting
from jblast.study.outcome.registry import families_of, outcomes_named
from jblast.study.sampling.draws import allowed, numbers_at, part_of

PILOT, MOST_PILOTS = 256, 4096
"""Samples that families are made ready by."""


class Part(NamedTuple):
    """A family of outcomes, ready for one variant of the scene."""

    family: Family
    names: tuple[str, ...]
    prepared: Prepared


def parts_of(study: Study, variant: int) -> tuple[Part, ...]:
    """Return what calculates the outcomes of a variant; made ready once.

    Raises:
        InputError: There is no such outcome or option, or the scene lacks what an
            outcome needs.
    """
    if variant not in study.prepared:
        families = families_of(
            outcomes_named(study.outcomes, study.source, allow_code=study.allow_code)
        ).values()
        _refuse_options(study, [family for family, _ in families])
        with jax.ensure_compile_time_eval():  # also from within a program
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
    """Return numbers of some samples, every cell of the axes among them."""
    cells = np.array(study.cells, float).reshape(len(study.cells), -1)
    count = min(max(PILOT, len(cells)), MOST_PILOTS)
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
    """Return numbers and outcomes of samples of one variant.

    Args:
        study: The study.
        variant: Which variant of the scene.
        keys: Of the samples.
        scores: Standard normal coordinates of the draws.
        table: Values of the axes by cell.
        cell: Of each sample.
        numbers: In place of what is drawn or set.
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
    """Return the columns of what is drawn, and of what axes set."""

    def number(name: str, role: Any) -> Variable:
        said = parameter_named(name)
        return Variable(name, role, said.unit, said.words)

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
    asked = outcomes_named(study.outcomes, study.source, allow_code=study.allow_code)
    names = {tuple(s.name for s in one.scene.sensors) for one in study.variants}
    if len(names) > 1 and any(outcome.per_sensor for outcome in asked):
        raise InputError(
            f"{study.source}: [axes]: expected the same sensors in every variant of "
            "the scene, where an outcome is asked of each, got others"
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
        for o in asked
    )


def _failed_where(good: Array | None, values: Any) -> Array:
    """Mark answers of samples that cannot be as having failed."""
    if good is None:
        return values
    good = good.reshape(good.shape + (1,) * (values.ndim - 1))
    if jnp.issubdtype(values.dtype, jnp.inexact):
        return jnp.where(good, values, jnp.nan)
    return jnp.where(good, values.astype(jnp.int8), jnp.int8(NO_ANSWER))


def _refuse_options(study: Study, families: list[Family]) -> None:
    """Refuse an option that no outcome asked for reads."""
    known = sorted({key for family in families for key in family.options})
    for key in study.options:
        if key not in known:
            raise InputError(
                f"{study.source}: [options] {key}: unknown key{nearest(key, known)}; "
                f"expected one of {', '.join(known) or '(none of these outcomes)'}"
            )
