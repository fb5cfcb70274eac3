"""A scene with its random blasts drawn: what every sense of it is asked about."""

import math
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.errors import InputError, shown
from jblast.scene import Charge, Scene, UncertainScene, WorldSpec, draw_scene
from jblast.sensors import record_laws
from jblast.world.presets.preset import Preset
from jblast.world.schedule import Blasts, draw_blasts, world_key

VEHICLE, CAMERA = "vehicle", "camera"
"""What the scene's one vehicle and its camera are called among all who perceive."""

OF_SCENE, OF_NOISE = 2**32 - 3, 2**32 - 4
"""Folded into a world's key: past the numbers of blasts, which count from 0."""


class DrawnWorld(NamedTuple):
    """A world that was drawn.

    Attributes:
        scene: What is there; its charges are named and come in order of time. Where
            there is none, one that never happens stands for it. Its laws are said, so
            that all senses go by the same ones.
        seed: Of all draws.
        source: Where the world was read from.
        preset: By which blasts act other than they do; None: by the scene's laws.
    """

    scene: Scene
    seed: int
    source: str
    preset: Preset | None = None

    def scene_of(self, kind: str) -> Scene:
        """Return the scene as a sense has it; one for all but in a preset.

        Args:
            kind: Of a sensor; "vehicle" or "camera".
        """
        if self.preset is None:
            return self.scene
        return self.preset.scene_of(self.scene, kind)

    @property
    def charges(self) -> tuple[Charge, ...]:
        """Those that happen, in order of time."""
        return tuple(charge for charge in self.scene.charges if not charge.never)

    @property
    def shots(self) -> tuple[str, ...]:
        """Their names: of a random one its number, as it was drawn."""
        return tuple(charge.name for charge in self.charges)

    @property
    def noise_key(self) -> PRNGKeyArray:
        """Of the errors of readings."""
        return jax.random.fold_in(world_key(self.seed), OF_NOISE)


def draw_world(
    uncertain: UncertainScene,
    world: WorldSpec | None,
    seed: int = 0,
    *,
    until_s: float = math.inf,
    preset: Preset | None = None,
) -> DrawnWorld:
    """Draw a world: its random blasts, and every number of the scene with a prior.

    Args:
        uncertain: The scene besides; its one charge may be one that never happens.
        world: What the blasts are drawn by; None: there are those of the scene alone.
        seed: Of all draws.
        until_s: When the world ends [s].
        preset: By which blasts act; the scene has taken it in (`with_preset`).

    Raises:
        InputError: A number is free, the region is about a vehicle that is not there,
            two who perceive have one name, or as in `draw_blasts`.

    Example:
        `draw_world(*jblast.scene.read_world("world.toml"), seed=1).shots`
    """
    source = uncertain.source or "scene"
    key = jax.random.fold_in(world_key(seed), OF_SCENE)
    scene = draw_scene(key, uncertain)
    _refuse_one_name(scene, source)
    blasts: Blasts | tuple[()] = ()
    if world is not None:
        about = _held(scene, source) if world.about == "vehicle" else None
        blasts = draw_blasts(seed, world, about, until_s=until_s, source=source)
    charges = [
        replace(charge, name=charge.name or "charge")
        for charge in scene.charges
        if not charge.never
    ]
    drawn = zip(*blasts, strict=True)
    for number, (time, place, mass) in enumerate(drawn, start=1):
        name = str(number)
        if name in {charge.name for charge in charges}:
            raise InputError(
                f"{source}: [[charge]] name: expected another than that of a random "
                f"blast, got {shown(name)}"
            )
        charges.append(Charge(mass, tuple(place), time, name=name))
    charges.sort(key=lambda charge: float(charge.time_s))
    charges = charges or [Charge(time_s=math.inf)]
    if any(charge.range_m is not None for charge in charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, got a range, which is "
            "to one sensor alone"
        )
    scene = replace(scene, charge=charges[0], others=tuple(charges[1:]))
    laws = dict(scene.law) | record_laws(scene, ground=True)
    scene = replace(scene, law=tuple(laws.items()))
    return DrawnWorld(scene, seed, source, preset)


def _held(scene: Scene, source: str) -> Float[Array, "3"]:
    """Return the place that the vehicle holds."""
    if scene.vehicle is None:
        raise InputError(
            f"{source}: [world] about: expected a [vehicle] that the region is about, "
            "got none"
        )
    return scene.vehicle.held


def _refuse_one_name(scene: Scene, source: str) -> None:
    """Refuse a sensor that is called as the vehicle or the camera is."""
    taken = {
        name
        for name, there in ((VEHICLE, scene.vehicle), (CAMERA, scene.camera))
        if there is not None
    }
    for sensor in scene.sensors:
        if sensor.name in taken:
            raise InputError(
                f"{source}: [[sensor]] name: expected another than that of the "
                f"scene's {sensor.name}, got {shown(sensor.name)}"
            )
        if not sensor.mount and np.isnan(sensor.position_m).any():
            raise InputError(
                f"{source}: [[sensor]] {shown(sensor.name)} position_m: expected "
                "[east, north, up], or a mount, got nothing"
            )
