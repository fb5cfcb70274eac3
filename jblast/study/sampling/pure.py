"""One sample as a pure function of its key."""

from collections.abc import Mapping

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, PRNGKeyArray

from jblast.errors import InputError, nearest
from jblast.study.file.study import Study
from jblast.study.sampling.draws import normal_scores, numbers_at
from jblast.study.sampling.parts import answers_of, parts_of


def draw(
    key: PRNGKeyArray, study: Study, *, cell: int = 0
) -> dict[str, Float[Array, ""]]:
    """Return the numbers of a sample: drawn by its key, or set by axes.

    Args:
        key: Of the sample: `jax.random.fold_in(jax.random.key(study.seed), index)`.
        study: The study.
        cell: Which of `study.cells` sets the axes.
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
    """Return the outcomes of one sample: under `jit`, `vmap` and `grad` alike.

    Args:
        key: Of the sample, as in `draw`.
        study: The study; its design is left out: the key draws.
        numbers: In place of what the key would draw, by name of the scene's numbers;
            derivatives by them are those of the outcomes.
        variant: Which of `study.variants` it is of.
        cell: Which of `study.cells` sets the axes.

    Returns:
        A number by outcome, or one for each sensor.

    Raises:
        InputError: An outcome cannot be had of the scene, or only by whole batches, or
            there is no such number.

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
                f"{study.source}: {part.names[0]} is had of whole batches alone, which "
                "jblast.study.run makes"
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
