"""When light, ground and air bring a blast to everyone, on the one clock."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Scene, Sensor
from jblast.sensors import Track
from jblast.sensors.listening.truth import truth_of
from jblast.world.drawn import CAMERA, VEHICLE, DrawnWorld

WAVES = ("flash_time_s", "ground_arrival_s", "air_arrival_s")
"""What brings a blast, by the quantity that says when."""

BEFORE_S, AFTER_S = 0.25, 0.5
"""Of a stretch about an arrival, at most."""

BY_LIGHT = ("flash_time_s", "fireball_radius_px", "fireball_radius_m")
DIRECTIONS = ("bearing_rad", "elevation_rad")


class Arrivals(NamedTuple):
    """When each wave of each blast comes to whom.

    Attributes:
        entities: Names of sensors, vehicle and camera.
        times_s: By wave, a row for each entity, a column for each charge of the scene;
            on the common clock, infinite: never [s].
        places_m: Where they are then, likewise [m].
    """

    entities: tuple[str, ...]
    times_s: dict[str, Float[np.ndarray, "entity shot"]]
    places_m: dict[str, Float[np.ndarray, "entity shot 3"]]

    def last_s(self) -> float:
        """Return when the last wave comes to anyone; 0 where none does."""
        times = np.concatenate([times.ravel() for times in self.times_s.values()])
        return float(times.max(where=np.isfinite(times), initial=0.0))


def stretch_about(
    comes_s: Float[np.ndarray, " shot"], shot: int
) -> tuple[float, float]:
    """Return when to begin and to end looking for one arrival among others [s].

    Args:
        comes_s: When each blast comes to somebody.
        shot: Whose arrival.
    """
    here = comes_s[shot]
    before = max((t for t in comes_s if t < here), default=-np.inf)
    after = min((t for t in comes_s if t > here), default=np.inf)
    first = max(here - BEFORE_S, 0.5 * (before + here))
    return float(first), float(min(here + AFTER_S, 0.5 * (here + after)))


def waves_of(sensor: Sensor) -> dict[str, str]:
    """Return which of `WAVES` brings each quantity that a sensor records.

    Of one that sees the flash or the fireball, light tells the direction, too.
    """
    recorded = [quantity for quantity, _ in sensor.records]
    sees = any(quantity in BY_LIGHT for quantity in recorded)
    return {quantity: _wave(quantity, sees) for quantity in recorded}


def _wave(quantity: str, sees: bool) -> str:
    if quantity in BY_LIGHT or (sees and quantity in DIRECTIONS):
        return "flash_time_s"
    return "ground_arrival_s" if quantity.startswith("ground_") else "air_arrival_s"


def arrivals_of(scene: Scene, tracks: Mapping[str, Track] | None = None) -> Arrivals:
    """Return when each blast comes to everyone in a scene, by its laws.

    Times are those of `sensors.record`, at the places where who moves meets a wave. One
    blast is asked after another, by one program.

    Args:
        scene: What is there; its laws are said.
        tracks: Where the vehicle and what rides on it are, by name; absent: they stand
            where it holds.

    Raises:
        InputError: Somebody is as fast as sound.
    """
    entities, moving = _entities(scene, tracks or {})
    bare = replace(scene, sensors=(), camera=None, clocks=(), ambient=None)
    asked = tuple(Sensor(name, place) for name, place in entities.items())
    times: dict[str, list[np.ndarray]] = {wave: [] for wave in WAVES}
    places: dict[str, list[np.ndarray]] = {wave: [] for wave in WAVES}
    for charge in scene.charges:
        alone = replace(bare, charge=replace(charge, name=""), others=())
        _, truth = truth_of(alone, asked, moving, WAVES)
        for wave in WAVES:
            times[wave].append(truth.values[wave][:, 0])
            places[wave].append(truth.places[wave][:, 0])
    return Arrivals(
        tuple(entities),
        {wave: np.stack(column, axis=1) for wave, column in times.items()},
        {wave: np.stack(column, axis=1) for wave, column in places.items()},
    )


def arrivals_in(
    world: DrawnWorld, tracks: Mapping[str, Track] | None = None
) -> Arrivals:
    """Return the same of a world; by a preset each sense may have its own air.

    Args:
        world: What was drawn.
        tracks: As in `arrivals_of`.

    Raises:
        InputError: As in `arrivals_of`.
    """
    usual = arrivals_of(world.scene, tracks)
    kinds = {sensor.name: sensor.kind for sensor in world.scene.sensors}
    kinds |= {VEHICLE: VEHICLE, CAMERA: CAMERA}
    rows = [
        row
        for row, name in enumerate(usual.entities)
        if world.scene_of(kinds[name]) is not world.scene
    ]
    if not rows:
        return usual
    own = arrivals_of(world.scene_of(kinds[usual.entities[rows[0]]]), tracks)
    theirs = np.isin(np.arange(len(usual.entities)), rows)[:, None]
    return Arrivals(
        usual.entities,
        {w: np.where(theirs, own.times_s[w], usual.times_s[w]) for w in WAVES},
        {
            w: np.where(theirs[..., None], own.places_m[w], usual.places_m[w])
            for w in WAVES
        },
    )


def _entities(
    scene: Scene, tracks: Mapping[str, Track]
) -> tuple[dict[str, Float[Array, "3"]], dict[str, Track]]:
    """Return everyone with a place to stand at, and the tracks of who moves."""
    held = jnp.zeros(3) if scene.vehicle is None else scene.vehicle.held
    found = {s.name: held if s.mount else s.position_m for s in scene.sensors}
    if scene.vehicle is not None:
        found[VEHICLE] = held
    if scene.camera is not None:
        found[CAMERA] = held if scene.camera.mount else scene.camera.position
    return found, {name: track for name, track in tracks.items() if name in found}
