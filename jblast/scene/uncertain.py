"""A scene together with what is not known of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import jax
from jaxtyping import PRNGKeyArray

from jblast.errors import InputError, argument, nearest
from jblast.parameter_table import CLOCK_OFFSET, PARAMETERS
from jblast.scene.parameters import (
    names_in,
    parameter_named,
    value_of,
    with_values,
)
from jblast.scene.priors import Belief, Free, draw
from jblast.scene.scene import Scene
from jblast.scene.sensor import Clock

NO_SCENE = "the default scene"
"""Source of the scene that is taken where none is given."""


class Place(NamedTuple):
    """A place on the Earth, WGS84.

    Attributes:
        lat_deg: Geodetic latitude [degree].
        lon_deg: Longitude, east positive [degree].
        alt_m: Height above the ellipsoid, or above the one datum that all heights are
            counted from [m].
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0


@dataclass(frozen=True)
class UncertainScene:
    """A scene, and a belief about each of its numbers that is not fixed.

    Attributes:
        scene: Its fixed numbers; an uncertain one holds its prior's median, or a
            place to start from where it is free.
        beliefs: By name of `scene.PARAMETERS`. What is not named is fixed.
        source: The file it was read from; `NO_SCENE` for the default one, "" for one
            made in Python.
        place: Where on the Earth its origin lies, if anybody said.
    """

    scene: Scene
    beliefs: Mapping[str, Belief] = field(default_factory=dict)
    source: str = ""
    place: Place | None = None


def default_scene() -> UncertainScene:
    """Return what is taken where no scene is given.

    A surface charge at the origin at time 0, its mass free, in sea-level air.
    """
    return UncertainScene(Scene(), {"charge_mass_kg": Free(positive=True)}, NO_SCENE)


def draw_scene(key: PRNGKeyArray, uncertain: UncertainScene) -> Scene:
    """Draw every uncertain number of a scene from its prior.

    Raises:
        InputError: A number is free: nothing says where to draw it from.
    """
    names = list(uncertain.beliefs)
    values = {}
    for name, key_ in zip(
        names, jax.random.split(key, max(len(names), 1)), strict=False
    ):
        belief = uncertain.beliefs[name]
        if isinstance(belief, Free):
            raise InputError(
                f"{uncertain.source or 'scene'}: {name} is free and cannot be drawn; "
                "give it a value or a prior"
            )
        values[name] = draw(key_, belief)  # pyright: ignore[reportArgumentType]  a prior, not being free
    return with_values(uncertain.scene, values)


def freed(uncertain: UncertainScene, names: Sequence[str]) -> UncertainScene:
    """Free more numbers of a scene: no prior, whatever the scene says of them.

    Args:
        uncertain: The scene.
        names: As in the answer. `clock_offset_s.NAME` of no sensor is the clock that a
            log names so in its `clock` column.

    Raises:
        InputError: There is no such number, or it has no meaning in this scene.
    """
    scene = uncertain.scene
    clocks = [n.partition(".")[2] for n in names if n.startswith(f"{CLOCK_OFFSET}.")]
    added = dict.fromkeys(c for c in clocks if c and c not in scene.clock_offsets())
    scene = replace(scene, clocks=(*scene.clocks, *map(Clock, added)))
    known = names_in(scene)
    for name in names:
        if name not in known:
            raise InputError(
                f"{argument('freed')} {name}: expected one of {', '.join(known)} or "
                f"{CLOCK_OFFSET}.NAME; got {name!r}{nearest(name, known)}"
            )
        _refuse_unused(name, uncertain, names)
    beliefs = dict(uncertain.beliefs) | {
        name: Free(positive=parameter_named(name).positive) for name in names
    }
    unset = {
        name: parameter_named(name).default
        for name in names
        if value_of(scene, name) is None
    }
    return replace(uncertain, scene=with_values(scene, unset), beliefs=beliefs)


def _refuse_unused(name: str, uncertain: UncertainScene, names: Sequence[str]) -> None:
    """Refuse to free a number beside one that takes its place."""
    scene = uncertain.scene
    _, dot, label = name.partition(".")
    for base, parameter in PARAMETERS.items():
        one = base + dot + label
        others = tuple(o + dot + label for o in parameter.takes_the_place_of)
        rivals: list[str] = []
        if name == one:
            rivals = [
                other
                for other in others
                if other in (*uncertain.beliefs, *names)
                or value_of(scene, other) != parameter_named(other).default
            ]
        elif name in others and value_of(scene, one) is not None:
            rivals = [one]
        if rivals:
            raise InputError(
                f"{argument('freed')} {name}: expected {one} alone or "
                f"{' and '.join(others)}, got {name} beside {' and '.join(rivals)}"
            )


def with_laws(uncertain: UncertainScene, laws: Mapping[str, str]) -> UncertainScene:
    """Name laws for some quantities, over what the scene says."""
    law = dict(uncertain.scene.law) | dict(laws)
    scene = replace(uncertain.scene, law=tuple(law.items()))
    return replace(uncertain, scene=scene)
