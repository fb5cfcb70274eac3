"""Outcomes, in families whose members follow from one calculation.

A family prepares itself once for a scene, outside JAX, where it may reject the scene.
The result is a pure function of a batch, so that the caller can compile it,
differentiate it and divide it among devices. Work that runs only from Python on whole
batches, such as fits with several starts, takes the values of that function: on a CPU
block by block, on a GPU all of them, in its own memory.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int8, Key

from jblast.scene import UncertainScene
from jblast.study.engine.store import NO_ANSWER, Kind

Answers = Mapping[str, Array]
"""By outcome a value for each sample, or for each sample and sensor."""

Finish = Callable[[Mapping[str, Array | np.ndarray]], Answers]
"""From what a calculation gave of a batch, here or on a device, to answers."""

Numbers = Mapping[str, Float[Array, " sample"]]
"""What was drawn, and what axes set, by name of the scene's numbers."""

Batched = Callable[[Key[Array, " sample"], Numbers], Answers]
"""From the keys of samples and their numbers to answers."""


@dataclass(frozen=True)
class Outcome:
    """What may be asked of a sample.

    Attributes:
        name: As in the file of a study.
        units: Of its value; "1" of none.
        long_name: In words.
        family: What it is calculated with.
        kind: A number, or yes and no.
        per_sensor: Whether every sensor has its own.
        needs: What the scene must have, in words.
    """

    name: str
    units: str
    long_name: str
    family: str
    kind: Kind = "number"
    per_sensor: bool = False
    needs: str = ""


class Prepared(NamedTuple):
    """A family, ready for the scenes of a study.

    Attributes:
        batched: What calculates it.
        finish: What makes answers of what that returns, for a batch, from Python; None:
            they are answers already.
        notes: Remarks on the calculation.
    """

    batched: Batched
    finish: Finish | None = None
    notes: tuple[str, ...] = ()


class Setting(NamedTuple):
    """What a family is made ready for.

    Attributes:
        uncertain: The scene, and what its numbers are drawn from.
        believed: The same scene with what it says of its numbers itself, free ones
            among them: what a fit goes by.
        names: Outcomes that are asked for.
        options: Options of the study.
        pilot: Numbers of some samples, of each cell of the axes among them.
    """

    uncertain: UncertainScene
    believed: UncertainScene
    names: tuple[str, ...]
    options: Mapping[str, Any]
    pilot: Mapping[str, np.ndarray]


Prepare = Callable[[Setting], Prepared]
"""Raises InputError where the scene lacks what an outcome needs."""


@dataclass(frozen=True)
class Family:
    """Outcomes that come from one calculation.

    Attributes:
        name: Of the family.
        number: Folded into a sample's key for what the family draws; never changed.
        prepare: Makes it ready for a scene.
        block: The most samples that should be calculated together, a power of two.
        tile: The most of a chunk of the store.
        together: The most that a GPU takes together.
        on_core: Values that a core takes together, a power of two: as many as its
            cache holds; 1: a block at a time.
        options: Keys of [options] that it reads, and what each means.
    """

    name: str
    number: int
    prepare: Prepare
    block: int = 1024
    tile: int = 1 << 20
    together: int = 1 << 19
    on_core: int = 1
    options: Mapping[str, str] = field(default_factory=dict)


FAMILIES: dict[str, Family] = {}
OUTCOMES: dict[str, Outcome] = {}


def register_family(family: Family) -> Family:
    """Enter a family into the table."""
    FAMILIES[family.name] = family
    return family


def register(outcome: Outcome) -> Outcome:
    """Enter an outcome into the table; one of the same name is replaced."""
    OUTCOMES[outcome.name] = outcome
    return outcome


def yes_no(yes: Bool[Array, "..."], known: Bool[Array, "..."]) -> Int8[Array, "..."]:
    """Return 1 for yes, 0 for no, and -1 where there is no answer."""
    return jnp.where(known, yes.astype(jnp.int8), jnp.int8(NO_ANSWER))
