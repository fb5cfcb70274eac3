"""Outcomes and their families, whose members follow from one calculation.

A family prepares itself once for a scene, outside JAX, where it may reject the scene.
The result is a pure function of a batch, so that the caller can compile it,
differentiate it and divide it among devices. Work that runs only from Python on whole
batches, such as fits with several starts, takes the values of that function: on a CPU
block by block, on a GPU all of them, in its own memory.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int8, Key

from jblast.scene import UncertainScene
from jblast.study.statistics import NO_ANSWER
from jblast.study.store import Kind

YES_NO = "yes or no"
"""Stands for the unit of an outcome that is yes or no."""
DESCRIBED = "_outcome"
"""Attribute of a function of the user that has its description."""
F = TypeVar("F", bound=Callable[..., Any])

Answers = Mapping[str, Array]
"""Values by outcome, with axes sample, or sample and sensor."""

Finish = Callable[[Mapping[str, Array | np.ndarray]], Answers]
"""Function from the results of a batch, on host or device, to answers."""

Numbers = Mapping[str, Float[Array, " sample"]]
"""Sampled and listed parameters of the scene, by name."""

Batched = Callable[[Key[Array, " sample"], Numbers], Answers]
"""Function from the keys and parameters of samples to answers."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a sample.

    Attributes:
        name: Name in a study file.
        units: Unit of the value; "1" for none.
        long_name: Description.
        family: Name of its family.
        kind: A number, or yes and no.
        per_sensor: Whether each sensor has a value.
        needs: Required sections of the scene.
    """

    name: str
    units: str
    long_name: str
    family: str
    kind: Kind = "number"
    per_sensor: bool = False
    needs: str = ""


class Prepared(NamedTuple):
    """Family prepared for the scenes of a study.

    Attributes:
        batched: Pure function of a batch.
        finish: Function from its results to answers, which runs from Python; None if
            the results are answers.
        notes: Remarks on the calculation.
    """

    batched: Batched
    finish: Finish | None = None
    notes: tuple[str, ...] = ()


class Setting(NamedTuple):
    """Input of the preparation of a family.

    Attributes:
        uncertain: Scene with the priors of the samples.
        believed: The same scene with its own priors and free parameters, for fits.
        names: Requested outcomes.
        options: Options of the study.
        pilot: Parameters of pilot samples, which include each cell of the axes.
    """

    uncertain: UncertainScene
    believed: UncertainScene
    names: tuple[str, ...]
    options: Mapping[str, Any]
    pilot: Mapping[str, np.ndarray]


Prepare = Callable[[Setting], Prepared]
"""Preparation; raises InputError if the scene lacks a requirement of an outcome."""


@dataclass(frozen=True)
class Family:
    """Family of outcomes that follow from one calculation.

    Attributes:
        name: Name of the family.
        number: Number folded into a sample's key for the random numbers of the family.
            It never changes, so that studies stay reproducible.
        prepare: Preparation for a scene.
        outcomes: Its outcomes.
        block: Samples computed together on a core, a power of two.
        on_core: Values computed together on a core, a power of two, if samples are
            small: as many as stay in its cache and outlast the call of a program.
        together: Largest number of values computed together on a GPU.
        options: Keys of [options] of the family, with their descriptions.
    """

    name: str
    number: int
    prepare: Prepare
    outcomes: tuple[Outcome, ...]
    block: int = 1024
    on_core: int = 1
    together: int = 1 << 19
    options: Mapping[str, str] = field(default_factory=dict)


FAMILIES: dict[str, Family] = {}


def family(
    name: str,
    number: int,
    table: Mapping[str, tuple[str, str]],
    *,
    per_sensor: bool = False,
    needs: str = "",
    **how: Any,
) -> Callable[[Prepare], Prepare]:
    """Return a decorator that registers a preparation as a family.

    Args:
        name: Name of the family.
        number: Its number, see `Family`.
        table: Unit and description by outcome; `YES_NO` for the unit of yes and no.
        per_sensor: Whether each sensor has a value.
        needs: Required sections of the scene.
        how: Other attributes of the family.
    """
    outcomes = tuple(
        Outcome(
            one,
            "1" if units == YES_NO else units,
            words,
            name,
            "yes_no" if units == YES_NO else "number",
            per_sensor,
            needs,
        )
        for one, (units, words) in table.items()
    )

    def registered(prepare: Prepare) -> Prepare:
        FAMILIES[name] = Family(name, number, prepare, outcomes, **how)
        return prepare

    return registered


def own_outcome(
    units: str = "1",
    long_name: str = "",
    *,
    kind: Kind = "number",
    per_sensor: bool = False,
) -> Callable[[F], F]:
    """Return a decorator that describes a function of the user as an outcome.

    `python:MODULE.FUNCTION` in a study file names it. A function without a description
    is a number without a unit.

    Args:
        units: Unit of the value.
        long_name: Description.
        kind: A number, or yes and no.
        per_sensor: Whether it returns a value for each sensor.

    Example:
        `@own_outcome("m", "distance of the charge from the tower")`
    """

    def described(function: F) -> F:
        about = Outcome("", units, long_name, "own", kind, per_sensor)
        setattr(function, DESCRIBED, about)
        return function

    return described


def yes_no(yes: Bool[Array, "..."], known: Bool[Array, "..."]) -> Int8[Array, "..."]:
    """Return 1 for yes, 0 for no, and -1 without an answer."""
    return jnp.where(known, yes.astype(jnp.int8), jnp.int8(NO_ANSWER))
