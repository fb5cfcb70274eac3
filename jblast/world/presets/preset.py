"""What a preset says, and how a scene file takes it.

A preset decides how blasts act. What it says of air, ground and laws a scene may leave
out or say likewise; another value is a contradiction, and refused. Which blasts there
are, and who perceives them, is the scene's: of these a preset fills in what the scene
is silent on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import jax.numpy as jnp

from jblast.errors import InputError, shown
from jblast.scene import Scene

PRESSURE_SENSES = ("pressure", "anemometer", "imu", "vehicle")
"""Kinds of those whom a blast's pressure reaches rather than its sound."""

OCCURRENCES = ("count", "rate_hz", "probability")
TOGETHER = (("region_m", "about"), (*OCCURRENCES, "tick_s"))
"""Keys of [world] that say one thing: who says one of them says it all."""

LoadLaw = Literal["thesis-as-printed", "thesis-as-coded"]


@dataclass(frozen=True)
class Preset:
    """How blasts act, and which there are where a scene does not say.

    Attributes:
        name: As it is asked for.
        source: Where it comes from.
        physics: Tables and keys of a scene file.
        world: Keys of [world].
        load: By which load blasts push the vehicle.
        pressure_speed_m_s: At which pressure and force travel; None: as the sound.
        frame_differences: Whether events are differences of frames.
    """

    name: str
    source: str
    physics: Mapping[str, Mapping[str, Any]]
    world: Mapping[str, Any]
    load: LoadLaw
    pressure_speed_m_s: float | None = None
    frame_differences: bool = False

    def scene_of(self, scene: Scene, kind: str) -> Scene:
        """Return a scene as a sense of a kind has it: waves at their own speed.

        Args:
            scene: What is there, by `physics`.
            kind: Of a sensor; "vehicle" or "camera".
        """
        if self.pressure_speed_m_s is None or kind not in PRESSURE_SENSES:
            return scene
        speed = jnp.full_like(scene.air.wind_east, self.pressure_speed_m_s)
        laws = dict(scene.law) | {"air_arrival_s": "acoustic"}
        return replace(
            scene,
            air=replace(scene.air, sound_speed=speed),
            law=tuple(laws.items()),
        )


def with_preset(
    document: Mapping[str, Any], preset: Preset, source: str
) -> dict[str, Any]:
    """Return the tables of a scene file, a preset's taken in.

    Args:
        document: The tables.
        preset: What is to hold.
        source: The file's name, for the messages.

    Raises:
        InputError: The scene says otherwise than the preset how blasts act, or a preset
            about a vehicle finds none.
    """
    made = dict(document)
    for name, keys in preset.physics.items():
        table = made.get(name, {})
        if not isinstance(table, dict):
            return made  # its reader says what is wrong
        for key, value in keys.items():
            if key in table and table[key] not in (value, "auto"):
                raise InputError(
                    f"{source}: [{name}] {key}: expected nothing, or "
                    f"{shown(value)} as the preset {preset.name} has it, got "
                    f"{shown(table[key])}"
                )
        made[name] = {**table, **keys}
    world = made.get("world", {} if "charge" not in made else None)
    if not isinstance(world, dict):
        return made
    said = set(world)
    for group in TOGETHER:
        if said.intersection(group):
            said.update(group)
    filled = {key: value for key, value in preset.world.items() if key not in said}
    if filled.get("about") == "vehicle" and "vehicle" not in made:
        raise InputError(
            f"{source}: [world] region_m: expected one, or a [vehicle] about which the "
            f"preset {preset.name} draws blasts, got neither"
        )
    made["world"] = {**filled, **world}
    return made
