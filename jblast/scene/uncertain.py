"""A scene together with what is not known of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import jax
from jaxtyping import PRNGKeyArray

from jblast.scene.priors import Belief, Free, draw
from jblast.scene.scene import Scene, with_values


@dataclass(frozen=True)
class UncertainScene:
    """A scene, and a belief about each of its numbers that is not fixed.

    Attributes:
        scene: Its fixed numbers; an uncertain one holds its prior's median, or a
            place to start from where it is free.
        beliefs: By name of `scene.PARAMETERS`. What is not named is fixed.
        source: The file it was read from, or "" for the default scene.
    """

    scene: Scene
    beliefs: Mapping[str, Belief] = field(default_factory=dict)
    source: str = ""


def default_scene() -> UncertainScene:
    """Return what is taken where no scene is given.

    A surface charge at the origin at time 0, its mass free, in sea-level air.
    """
    return UncertainScene(Scene(), {"charge_mass_kg": Free(positive=True)})


def draw_scene(key: PRNGKeyArray, uncertain: UncertainScene) -> Scene:
    """Draw every uncertain number of a scene from its prior.

    Raises:
        ValueError: A number is free: nothing says where to draw it from.
    """
    names = list(uncertain.beliefs)
    values = {}
    for name, key_ in zip(
        names, jax.random.split(key, max(len(names), 1)), strict=False
    ):
        belief = uncertain.beliefs[name]
        if isinstance(belief, Free):
            raise ValueError(
                f"{name} is free and cannot be drawn; give it a value or a prior"
            )
        values[name] = draw(key_, belief)  # type: ignore[arg-type]
    return with_values(uncertain.scene, values)
