"""Presets: alternative physics of a world.

A preset specifies air, ground, laws and loads. A scene may omit or repeat these values;
a different value is rejected. The scene specifies the blasts and the sensors, and the
preset fills in missing values.

The presets are the thesis as printed (Parab 2024, eqs. 3.1 to 3.5, algorithm 4, section
4.2.1) and as coded: facts read from charlotte-visionlab/gazebo_blast3d, `e6dd04c` and
its state of July 2025, which is under the GPL: nothing is copied. Laws "thesis_..." are
in `waves/laws/thesis.py`, loads in `vehicle/loads/thesis`.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import jax.numpy as jnp

from jblast.errors import InputError, nearest, shown
from jblast.scene import Scene, UncertainScene, WorldSpec
from jblast.scene.reader.scene import (
    document_of,
    scene_or_world,
    world_from_document,
)
from jblast.scene.sensor_kinds import SENSOR_KINDS

SOUND = (
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
)
AIR = {"sound_speed_m_s": 340.0, "absorption": False}
"""The thesis's speed of sound "in dry air at 20 C"; the laws include absorption."""
TICKS = {"probability": 0.15, "tick_s": 0.5, "gap_s": 0.5}
"""Values of the plugin; the thesis's algorithm 4 has no numbers."""
OCCURRENCES = ("count", "rate_hz", "probability")
EXCLUSIVE_KEYS = (("region_m", "about"), (*OCCURRENCES, "tick_s"))
"""Groups of exclusive keys of [world]: a scene with one key sets the whole group."""
LoadLaw = Literal["thesis-as-printed", "thesis-as-coded"]


@dataclass(frozen=True)
class Preset:
    """Effects of blasts, and the blasts themselves where a scene has none.

    Attributes:
        name: Name of the preset.
        source: Source of the physics.
        physics: Tables and keys of a scene file.
        world: Keys of [world].
        load: Load of the blasts on the vehicle.
        pressure_speed_m_s: Speed of pressure and force; None: that of sound.
        frame_differences: True if camera events are differences of frames.
    """

    name: str
    source: str
    physics: Mapping[str, Mapping[str, Any]]
    world: Mapping[str, Any]
    load: LoadLaw
    pressure_speed_m_s: float | None = None
    frame_differences: bool = False

    def scene_of(self, scene: Scene, kind: str) -> Scene:
        """Return the scene for a kind of sensor, with the wave speed of its sense.

        Args:
            scene: The scene, according to `physics`.
            kind: Kind of sensor, "vehicle" or "camera".
        """
        by_pressure = kind == "vehicle" or (
            kind in SENSOR_KINDS and SENSOR_KINDS[kind].by_pressure
        )
        if self.pressure_speed_m_s is None or not by_pressure:
            return scene
        # The plugin uses one speed for all distances, so the acoustic law with that
        # sound speed reproduces it.
        speed = jnp.full_like(scene.air.wind_east, self.pressure_speed_m_s)
        laws = dict(scene.law) | {"air_arrival_s": "acoustic"}
        return replace(
            scene,
            air=replace(scene.air, sound_speed=speed),
            law=tuple(laws.items()),
        )


def preset_named(name: str | None) -> Preset | None:
    """Return a preset by its name; None for None.

    Raises:
        InputError: The name is unknown.
    """
    if name is None:
        return None
    if name not in PRESETS:
        raise InputError(
            f"preset: expected one of {', '.join(PRESETS)}, got {shown(name)}"
            f"{nearest(name, PRESETS)}"
        )
    return PRESETS[name]


def read_world_by(
    path: str | os.PathLike[str], preset: Preset | None
) -> tuple[UncertainScene, WorldSpec | None]:
    """Read a scene file of random or given blasts and apply a preset.

    Args:
        path: TOML file with [world], [charge] or both, or a mission of the vehicle;
            with a preset, none of them is required.
        preset: Preset to apply; None: the scene's own physics.

    Raises:
        InputError: As in `read_world` and `with_preset`.

    Example:
        `read_world_by("world.toml", PRESETS["thesis-as-coded"])`
    """
    document = document_of(path)
    if preset is not None:
        document = with_preset(document, preset, str(path))
    vehicle = document.get("vehicle")
    flies = isinstance(vehicle, dict) and "mission" in vehicle
    if "world" not in document and ("charge" in document or flies):
        return scene_or_world(document, str(path), needs_charge=False)
    return world_from_document(document, str(path))


def _laws(sound: str) -> dict[str, object]:
    arrivals = dict.fromkeys(("air_arrival_s", "ground_arrival_s"), "wu_hao")
    return {**arrivals, **dict.fromkeys(SOUND, sound), "scatter": False}


PRINTED = Preset(
    name="thesis-as-printed",
    source="Parab's thesis, eqs. 3.1 to 3.5 and section 4.2.1",
    physics={
        "air": AIR,
        "ground": {"p_speed_m_s": 6000.0, "path": "head"},
        "law": _laws("thesis_as_printed"),
    },
    world={
        **TICKS,
        "region_m": {"ring": [10.0, 20.0]},
        "about": "world",
        "mass_kg": {"uniform": [5.0, 15.0]},
        "time_s": {"uniform": [1.0, 20.0]},
    },
    load="thesis-as-printed",
)
CODED = Preset(
    name="thesis-as-coded",
    source="gazebo_blast3d of July 2025, as read",
    physics={
        "air": AIR,
        "ground": {"p_speed_m_s": 6000.0, "path": "thesis"},
        "law": _laws("thesis_as_coded"),
    },
    world={
        **TICKS,
        "region_m": {"box": [[10.0, 10.0, 10.0], [20.0, 20.0, 20.0]]},
        "about": "vehicle",
        "mass_kg": {"uniform": [10.0, 11.0]},
        "time_s": {"uniform": [1.0, 20.0]},
    },
    load="thesis-as-coded",
    pressure_speed_m_s=300.0,
    frame_differences=True,
)
PRESETS = {preset.name: preset for preset in (PRINTED, CODED)}


def with_preset(
    document: Mapping[str, Any], preset: Preset, source: str
) -> dict[str, Any]:
    """Return the tables of a scene file with a preset applied.

    Args:
        document: The tables.
        preset: The preset.
        source: Name of the file, for messages.

    Raises:
        InputError: The scene contradicts the preset, or the preset needs a vehicle that
            the scene does not have.
    """
    made = dict(document)
    for name, keys in preset.physics.items():
        table = made.get(name, {})
        if not isinstance(table, dict):
            return made  # rejected by the reader, with a better message
        for key, value in keys.items():
            # "auto" leaves the choice to jblast, and therefore to the preset.
            if key in table and table[key] not in (value, "auto"):
                raise InputError(
                    f"{source}: [{name}] {key}: expected {shown(value)} (preset "
                    f"{preset.name}) or no value, got {shown(table[key])}"
                )
        made[name] = {**table, **keys}
    world = made.get("world", {} if "charge" not in made else None)
    if not isinstance(world, dict):
        return made
    given = set(world)
    for group in EXCLUSIVE_KEYS:
        if given.intersection(group):
            # One key of a group replaces all of them: the preset's are dropped.
            given.update(group)
    filled = {key: value for key, value in preset.world.items() if key not in given}
    if filled.get("about") == "vehicle" and "vehicle" not in made:
        raise InputError(
            f"{source}: [world] region_m: expected a region, or a [vehicle] as centre "
            f"of the preset {preset.name}'s region, got neither"
        )
    made["world"] = {**filled, **world}
    return made
