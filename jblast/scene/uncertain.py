"""Scenes with uncertain numbers, which are free or have a prior.

Numbers are read from a scene and replaced in it by name (`jblast.parameters`). Each
uncertain number has a coordinate $z$ for the fit. Every prior is a standard normal in
its $z$, so the log-determinant of the transform is included. A free number is flat in
its $z$, which is its logarithm for positive numbers.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from jblast.errors import argument, nearest, require
from jblast.parameters import (
    CLOCK,
    CLOCK_OFFSET,
    PARAMETERS,
    Parameter,
    Place as Place,
)
from jblast.scene.scene import Scene
from jblast.scene.sensor import Clock
from jblast.types import (
    Array,
    ArrayLike,
    Float,
    Module,
    Scalar,
    as_numbers,
    field,
    is_traced,
    namespace,
    number,
)

if TYPE_CHECKING:
    from jaxtyping import PRNGKeyArray

NO_SCENE = "the default scene"
"""Source of the scene that is used if none is given."""


@dataclass(frozen=True)
class UncertainScene:
    """A scene, and a belief about each of its numbers that is not fixed.

    Attributes:
        scene: The scene; an uncertain number has its prior's median, a free one the
            start of the fit.
        beliefs: Priors and free numbers, by name in `PARAMETERS`; others are fixed.
        source: File of the scene; `NO_SCENE` for the default one, "" for one made in
            Python.
        place: Geodetic position of its origin, if it is given.
    """

    scene: Scene
    beliefs: Mapping[str, "Belief"] = field(default_factory=dict)
    source: str = ""
    place: Place | None = None


def default_scene() -> UncertainScene:
    """Return the scene that is used if none is given.

    A surface charge at the origin at time 0, its mass free, in sea-level air.
    """
    return UncertainScene(Scene(), {"charge_mass_kg": Free(positive=True)}, NO_SCENE)


def draw_scene(key: "PRNGKeyArray", uncertain: UncertainScene) -> Scene:
    """Sample every uncertain number of a scene from its prior.

    Raises:
        InputError: A number is free, so it has no distribution.
    """
    import jax

    beliefs = uncertain.beliefs
    for name, belief in beliefs.items():
        where = f"{uncertain.source or 'scene'}: {name}"
        drawable = not isinstance(belief, Free)
        got = "a number that is free and cannot be drawn"
        require(drawable, where, "a value or a prior", got)
    # At least one key, as `split` into none is an error; strict=False for that case.
    keys = jax.random.split(key, max(len(beliefs), 1))
    pairs = zip(beliefs.items(), keys, strict=False)
    drawn = {name: draw(one, cast(Prior, belief)) for (name, belief), one in pairs}
    return with_values(uncertain.scene, drawn)


def freed(uncertain: UncertainScene, names: Sequence[str]) -> UncertainScene:
    """Free more numbers of a scene, in place of their fixed values or priors.

    Args:
        uncertain: The scene.
        names: Names of parameters. `clock_offset_s.NAME` without a sensor NAME is the
            clock with this name in the `clock` column of a log.

    Raises:
        InputError: A name is unknown, or has no meaning in this scene.
    """
    scene = uncertain.scene
    # A recorder of a log need not be in the scene: freeing its offset adds it.
    clocks = [n.partition(".")[2] for n in names if n.startswith(f"{CLOCK_OFFSET}.")]
    added = dict.fromkeys(c for c in clocks if c and c not in scene.clock_offsets())
    scene = replace(scene, clocks=(*scene.clocks, *map(Clock, added)))
    known = names_in(scene)
    for name in names:
        where, got = f"{argument('freed')} {name}", f"{name!r}{nearest(name, known)}"
        expected = f"one of {', '.join(known)} or {CLOCK_OFFSET}.NAME"
        require(name in known, where, expected, got)
        require(list(names).count(name) == 1, where, "each name once", "it twice")
        _check_exclusive(name, uncertain, names)
    rows = {name: parameter_named(name) for name in names}
    free = {name: Free(positive=row.positive) for name, row in rows.items()}
    # A number that the scene derives from others gets its default as a start.
    derived = [name for name in names if value_of(scene, name) is None]
    scene = with_values(scene, {name: rows[name].default for name in derived})
    return replace(uncertain, scene=scene, beliefs={**uncertain.beliefs, **free})


def _check_exclusive(
    name: str, uncertain: UncertainScene, names: Sequence[str]
) -> None:
    """Reject freeing a number together with one that replaces it."""
    _, dot, label = name.partition(".")
    value, given = partial(value_of, uncertain.scene), (*uncertain.beliefs, *names)
    for base, row in PARAMETERS.items():
        one, *others = (
            f"{number}{dot}{label}" for number in (base, *row.takes_the_place_of)
        )
        if name not in (one, *others):
            continue
        # Both would determine one number, so that a fit had a null direction.
        rivals = [
            other
            for other in others
            if other in given or value(other) != parameter_named(other).default
        ]
        both = rivals and (one in names or value(one) is not None)
        expected = f"{one} alone or {' and '.join(others)}"
        got = f"{one} and {' and '.join(rivals)}"
        require(not both, f"{argument('freed')} {name}", expected, got)


def with_laws(uncertain: UncertainScene, laws: Mapping[str, str]) -> UncertainScene:
    """Return a scene with laws for some quantities, in place of its own."""
    law = dict(uncertain.scene.law) | dict(laws)
    scene = replace(uncertain.scene, law=tuple(law.items()))
    return replace(uncertain, scene=scene)


def parameter_named(name: str) -> Parameter:
    """Return the row of a number: `charge_mass_kg`, or `charge_mass_kg.NAME`.

    Raises:
        KeyError: No number has that name.
    """
    base = name.partition(".")[0]
    return CLOCK if base == CLOCK_OFFSET else PARAMETERS[base]


def names_in(scene: Scene) -> tuple[str, ...]:
    """Return the names of all numbers of a scene."""
    labels = [scene.label(charge) for charge in scene.charges]
    names = [
        base + label
        for base, parameter in PARAMETERS.items()
        for label in (labels if parameter.of_charge else [""])
    ]
    return (*names, *(f"{CLOCK_OFFSET}.{clock}" for clock in scene.clock_offsets()))


def with_values(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """Return the scene with some of its numbers replaced."""
    for name, value in values.items():
        scene = with_value_at(scene, _path(scene, name), as_numbers(value))
    return scene


def value_of(scene: Scene, name: str) -> Any:
    """Return one of a scene's numbers, which may be a batch; None if it is derived.

    Raises:
        KeyError: The scene has no such number.
    """
    return value_at(scene, _path(scene, name))


def _path(scene: Scene, name: str) -> tuple[str | int, ...]:
    """Return the fields and indices that lead to a number of a scene."""
    base, _, label = name.partition(".")
    if base == CLOCK_OFFSET:
        for part, offset in (("clocks", "offset_s"), ("sensors", "clock_offset_s")):
            names = [one.name for one in getattr(scene, part)]
            if label in names:
                return part, names.index(label), offset
        raise KeyError(label)
    one = PARAMETERS[base]
    steps = one.attribute.split(".")
    if not one.of_charge:
        return tuple(steps)
    # A single charge has plain names, also if the file names it.
    names = [charge.name for charge in scene.charges]
    charge = ("charges", names.index(label) if label else 0)
    return *charge, *steps[1:], *([] if one.key.index is None else [one.key.index])


def value_at(node: Any, path: Sequence[str | int]) -> Any:
    """Return the part of a scene at the end of fields and indices."""
    for step in path:
        node = node[step] if isinstance(step, int) else getattr(node, step)
    return node


def with_value_at(node: Any, path: Sequence[str | int], value: Any) -> Any:
    """Return a scene with another value at the end of fields and indices."""
    if not path:
        return value
    step, *rest = path
    new = with_value_at(value_at(node, [step]), rest, value)
    if isinstance(step, str):
        return replace(node, **{step: new})
    return (*node[:step], new, *node[step + 1 :])


class Belief(Module):
    """Belief about a number, as a function of its coordinate $z$.

    The number is its first parameter plus a multiple of $z$, or for an interval of the
    share of the normal distribution below $z$. A number in ln is that parameter times a
    power. Near a bound of an interval $z$ goes to infinity, so that no step leaves it.
    """

    in_ln: ClassVar[bool] = False
    of_interval: ClassVar[bool] = False

    def constrain(self, z: ArrayLike) -> Any:
        """Return the number at a fitted coordinate."""
        return self._at(_normal("ndtr", z) if self.of_interval else z)

    def unconstrain(self, value: ArrayLike) -> Any:
        """Return the fitted coordinate of a number."""
        xp, value, first, scale = self._line(value)
        steps = (xp.log(value / first) if self.in_ln else value - first) / scale
        return _normal("ndtri", steps) if self.of_interval else steps

    def log_density(self, z: ArrayLike) -> Any:
        """Return ln of the prior density per unit of $z$, log-determinant included."""
        return -0.5 * z**2 - 0.5 * math.log(2 * math.pi)

    @property
    def middle(self) -> float:
        """Median of the number, the start of a fit."""
        return float(self._at(0.5 if self.of_interval else 0.0))

    def _at(self, steps):
        xp, steps, first, scale = self._line(steps)
        # exp(z ln f), because XLA does not vectorize powers on a CPU.
        return first * xp.exp(steps * scale) if self.in_ln else first + scale * steps

    def _line(self, value) -> tuple[Any, ...]:
        """Return NumPy or JAX, and its arrays of a value, the first and the scale.

        In NumPy nothing is compiled, which JAX would do for each shape.
        """
        numbers = vars(self).values()
        xp = namespace(value, *filter(is_traced, numbers))
        value, first, second = (xp.asarray(one) for one in (value, *numbers))
        if self.of_interval:
            second = second / first if self.in_ln else second - first
        return xp, value, first, xp.log(second) if self.in_ln else second


class Free(Belief):
    """Free: flat in ln of a positive number, flat otherwise.

    In ln a step of the search is a factor, for masses from grams to kilotonnes. A fit
    limits the number by the weak prior of `inference.coordinates`.

    Attributes:
        positive: Whether the number is positive.
    """

    positive: bool = field(static=True)

    @property
    def in_ln(self) -> bool:  # type: ignore[override]
        """True for a positive number."""
        return self.positive

    def log_density(self, z: ArrayLike) -> Any:
        """Return zero: the density is improper."""
        return 0.0 * z

    def _line(self, value) -> tuple[Any, ...]:
        xp = namespace(value)
        return xp, xp.asarray(value), float(self.positive), 1.0


class Prior(Belief):
    """Distribution of a number, a standard normal in its coordinate $z$."""


class Normal(Prior):
    """Normal about `mean` with standard deviation `sd`."""

    mean: Scalar = number()
    sd: Scalar = number()


class LogNormal(Prior):
    """Normal in ln about `median`, with standard deviation ln `factor`."""

    in_ln: ClassVar[bool] = True
    median: Scalar = number()
    factor: Scalar = number()


class Uniform(Prior):
    """Uniform from `lo` to `hi`."""

    of_interval: ClassVar[bool] = True
    lo: Scalar = number()
    hi: Scalar = number()


class LogUniform(Prior):
    """Uniform in ln from `lo` to `hi`."""

    in_ln: ClassVar[bool] = True
    of_interval: ClassVar[bool] = True
    lo: Scalar = number()
    hi: Scalar = number()


PRIORS = {
    kind.__name__.lower(): kind for kind in (LogNormal, Normal, Uniform, LogUniform)
}
"""Kinds of prior by their names in a scene file, which has their numbers in order."""


def _normal(function: str, value: Any) -> Any:
    """Return the standard normal distribution function, or its inverse."""
    jax = "" if namespace(value) is np else "jax."
    return getattr(import_module(f"{jax}scipy.special"), function)(value)


def draw(key: "PRNGKeyArray", prior: Prior) -> Float[Array, ""]:
    """Sample one number from a prior."""
    import jax

    # Every prior is a standard normal in its coordinate.
    return jax.numpy.asarray(prior.constrain(jax.random.normal(key)))
