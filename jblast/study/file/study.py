"""A study: a scene, what is varied, what is asked of each sample."""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from jblast.scene import UncertainScene

Design = Literal["random", "sobol", "latin", "grid"]
DESIGNS: tuple[Design, ...] = ("random", "sobol", "latin", "grid")
"""How draws fill what the priors allow."""

Keep = Literal["all", "summary"] | int

MOST_SAMPLES = 2**40
"""A limit of the key's counter and of patience: 1e12."""


@dataclass(frozen=True)
class Axis:
    """What is varied beside the draws: listed values.

    Attributes:
        key: A number of the scene by name, or a key of its file as "vehicle.model".
        values: What it takes, one after another.
    """

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Study:
    """A study.

    Attributes:
        variants: The scene, once for each combination of `words`.
        believed: Likewise, with what the scene itself says of its numbers, whatever
            axes set or draw.
        outcomes: Names of what is asked of each sample.
        seed: Of all draws.
        samples: Draws of each cell of each variant.
        sd_target: By outcome the standard error at which it is known well enough; the
            study ends when all are reached.
        design: How draws fill what the priors allow.
        keep: "all" samples, a "summary" alone, or so many samples.
        numbers: Axes over numbers of the scene, crossed with each other.
        words: Axes over what else the scene's file says, crossed likewise.
        options: What else outcomes are told.
        allow_code: Whether outcomes may be functions of the user's own.
        text: The study's file; "" of one made in Python.
        scenes: Likewise the scenes', by the names the study has for them.
        source: Name of the study's file, for messages.
        prepared: What was made ready of it, by variant.
    """

    variants: tuple[UncertainScene, ...]
    believed: tuple[UncertainScene, ...]
    outcomes: tuple[str, ...]
    seed: int = 0
    samples: int = 1000
    sd_target: Mapping[str, float] = field(default_factory=dict)
    design: Design = "random"
    keep: Keep = "all"
    numbers: tuple[Axis, ...] = ()
    words: tuple[Axis, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    allow_code: bool = False
    text: str = ""
    scenes: Mapping[str, str] = field(default_factory=dict)
    source: str = "study"
    prepared: dict[int, Any] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def uncertain(self) -> UncertainScene:
        """The first variant of the scene."""
        return self.variants[0]

    @property
    def cells(self) -> tuple[tuple[float, ...], ...]:
        """Combinations of the values of the axes over numbers; one, empty, of none."""
        return tuple(itertools.product(*(axis.values for axis in self.numbers)))

    @property
    def drawn(self) -> tuple[str, ...]:
        """Names of the numbers that are drawn, in the order of the key's draws."""
        return tuple(self.uncertain.beliefs)


OwnFunction = Callable[..., Any]
"""A user's own outcome: from a key and a scene to a number."""
