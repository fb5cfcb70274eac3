"""Numbers of a scene by name: what they are, read out and put in."""

from collections.abc import Mapping
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import equinox as eqx
from jaxtyping import Array, ArrayLike, Float

from jblast.parameter import Parameter
from jblast.parameter_table import CLOCK, CLOCK_OFFSET, PARAMETERS
from jblast.scene.scene import Scene
from jblast.types import as_float_array


def parameter_named(name: str) -> Parameter:
    """Return what a number is: `charge_mass_kg`, or of one of several, `....NAME`.

    Raises:
        KeyError: No number has that name.
    """
    base = name.partition(".")[0]
    return CLOCK if base == CLOCK_OFFSET else PARAMETERS[base]


def place_of(name: str) -> Parameter:
    """Return `parameter_named` of it: the name that `jblast.scene` promised first."""
    return parameter_named(name)


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
    names = list(values)
    return eqx.tree_at(
        lambda s: [leaf_of(s, name) for name in names],
        scene,
        [as_float_array(values[name]) for name in names],
        is_leaf=lambda leaf: leaf is None,
    )


def value_of(scene: Scene, name: str) -> Float[Array, ""] | None:
    """Return one of a scene's numbers; None where the scene leaves it derived."""
    return leaf_of(scene, name)


def leaf_of(scene: Scene, name: str) -> Any:
    """Return what holds one of a scene's numbers, be it a batch or no number yet."""
    base, _, label = name.partition(".")
    if base == CLOCK_OFFSET:
        return _clock_offset(scene, label)
    holder: Any = scene
    if label:
        named = next(charge for charge in scene.charges if charge.name == label)
        holder = SimpleNamespace(charge=named)
    one = PARAMETERS[base]
    leaf, index = attrgetter(one.attribute)(holder), one.key.index
    return leaf if index is None or not isinstance(leaf, tuple) else leaf[index]


def _clock_offset(scene: Scene, name: str) -> Any:
    for clock in _each(scene.clocks):
        if clock.name == name:
            return clock.offset_s
    for sensor in _each(scene.sensors):
        if sensor.name == name:
            return sensor.clock_offset_s
    raise KeyError(name)


def _each(nodes: Any) -> tuple[Any, ...]:
    """Return a tuple of nodes; an empty one is a wrapped leaf within `eqx.tree_at`."""
    return nodes if isinstance(nodes, tuple) else ()
