"""Perception of blasts: who perceives which blast, and when.

Blasts follow one another, so each reading belongs to one blast, which the column `shot`
of the log names; a fit separates the blasts by it. In a real recording this assignment
would have to be found. Errors of two blasts are independent: each has its own shared
effects, as two shots on a range have.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import whole_number
from jblast.observations import Observations
from jblast.observations.grouping import stacked
from jblast.scene import Scene, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors import Track, readings
from jblast.sensors.camera.geometry import CameraPath, carried_camera
from jblast.sensors.camera.rendering import in_view
from jblast.sensors.listening import truth_of
from jblast.vehicle import Trajectory
from jblast.world.drawn import CAMERA, VEHICLE, DrawnWorld

AIR = "air_arrival_s"
BY_WAVE = {
    "flash_time_s": "flash",
    "ground_arrival_s": "ground motion",
    "air_arrival_s": "pressure",
}
"""What a sensor without a kind perceives, by the wave that brings its records."""
OTHERS = {
    VEHICLE: (("air_arrival_s", "force"),),
    CAMERA: (("flash_time_s", "flash"),),
}
WAVES = ("flash_time_s", "ground_arrival_s", "air_arrival_s")
"""Carrier of a blast, by the quantity that times it."""
BEFORE_S, AFTER_S = 0.25, 0.5
"""Of a stretch about an arrival, at most."""
BY_LIGHT = ("flash_time_s", "fireball_radius_px", "fireball_radius_m")
DIRECTIONS = ("bearing_rad", "elevation_rad")


def out_of_view(scene: Scene, flight: Trajectory | None = None) -> tuple[str, ...]:
    """Return the blasts of which no ray of the camera ever meets the fireball.

    A camera that flies is taken where it is, and turned as it is, when a blast goes
    off. Without a camera there is nothing out of its view.

    Args:
        scene: What explodes, and the camera.
        flight: Of the vehicle; None: a camera on it looks level from where it holds.
    """
    camera = scene.camera
    if camera is None:
        return ()
    bare = replace(scene, sensors=(), clocks=(), ambient=None)
    path = _path(scene, flight) if camera.mount else None
    unseen = []
    for charge in scene.charges:
        if charge.never:
            continue
        here = camera
        if path is not None:
            here = carried_camera(camera, path, jnp.asarray(charge.time_s))
        alone = replace(bare, charge=replace(charge, name=""), others=(), camera=None)
        if not in_view(alone, here):
            unseen.append(charge.name)
    return tuple(unseen)


def _path(scene: Scene, flight: Trajectory | None) -> CameraPath:
    """Return where the vehicle is; of one that was lost, up to there."""
    if flight is None:
        held = jnp.zeros(3) if scene.vehicle is None else scene.vehicle.held
        level = jnp.array([0.0, 0.0, 0.0, 1.0])
        return CameraPath(
            jnp.array([0.0, 1.0]), jnp.stack([held, held]), jnp.stack([level, level])
        )
    known = jnp.isfinite(flight.position_m).all(axis=-1)
    rows = (flight.time_s, flight.position_m, flight.quaternion)
    return CameraPath(*(row[known] for row in rows))


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


def readings_of(
    world: DrawnWorld,
    arrivals: Arrivals,
    seconds: float,
    picked: Collection[str] = (),
) -> tuple[Observations | None, int]:
    """Return what every sensor records of every blast, with errors.

    A sensor that moves stands, for each reading, where the wave met it.

    Args:
        world: What is there.
        arrivals: When and where the waves come to whom.
        seconds: When the world ends; a wave that comes later is not recorded [s].
        picked: Names of sensors whose air shocks are picked from samples instead.

    Returns:
        The log, None where there is no reading; and how many waves came too late.

    Raises:
        InputError: A sensor cannot record what it should.
    """
    logs: list[Observations] = []
    late, scene = 0, world.scene
    sensors = [
        _without_air(sensor) if sensor.name in picked else sensor
        for sensor in scene.sensors
    ]
    for column, charge in enumerate(scene.charges):
        if charge.never:
            continue
        present: list[Sensor] = []
        for sensor in sensors:
            parts = _as_it_stood(sensor, arrivals, column, seconds)
            late += len(set(waves_of(sensor).values())) - len(parts)
            present += parts
        if not present:
            continue
        # the number of a random blast is its own in a longer world, too; a name that
        # only resembles one ("007", "²") is a name, or two charges would share errors
        number = whole_number(charge.name)
        if number is None or number >= 2**31 or str(number) != charge.name:
            number = 2**31 + column
        key = jax.random.fold_in(world.noise_key, number)
        for which, (own, some) in enumerate(_by_scene(world, present)):
            alone = replace(
                own, charge=replace(charge, name=""), others=(), sensors=tuple(some)
            )
            log = readings(jax.random.fold_in(key, which) if which else key, alone)
            logs.append(replace(log, shot=(charge.name,) * len(log)))
    if not logs:
        return None, late
    comments = tuple(dict.fromkeys(line for log in logs for line in log.comments))
    return Observations(**stacked(logs), comments=comments), late


def _by_scene(
    world: DrawnWorld, sensors: list[Sensor]
) -> list[tuple[Scene, list[Sensor]]]:
    """Return sensors by the scene as they have it; there is one but in a preset."""
    groups: list[tuple[Scene, list[Sensor]]] = []
    usual = [s for s in sensors if world.scene_of(s.kind) is world.scene]
    if usual:
        groups.append((world.scene, usual))
    others = [s for s in sensors if world.scene_of(s.kind) is not world.scene]
    if others:
        groups.append((world.scene_of(others[0].kind), others))
    return groups


def _without_air(sensor: Sensor) -> Sensor:
    """Return a sensor without its records of the air shock."""
    waves = waves_of(sensor)
    kept = [(q, sigma) for q, sigma in sensor.records if waves[q] != AIR]
    return replace(sensor, records=tuple(kept))


def _as_it_stood(
    sensor: Sensor, arrivals: Arrivals, column: int, seconds: float
) -> list[Sensor]:
    """Return a sensor where each wave met it, for what it records of that wave."""
    row, waves = arrivals.entities.index(sensor.name), waves_of(sensor)
    by_wave: dict[str, list[tuple[str, float]]] = {}
    for quantity, sigma in sensor.records:
        by_wave.setdefault(waves[quantity], []).append((quantity, sigma))
    parts = []
    for wave, records in by_wave.items():
        if not arrivals.times_s[wave][row, column] < seconds:
            continue
        place = sensor.position_m
        if sensor.mount:
            place = jnp.asarray(arrivals.places_m[wave][row, column])
        parts.append(replace(sensor, position_m=place, records=tuple(records)))
    return parts


class Perceived(NamedTuple):
    """One blast, as one sense of one who is there had it first.

    Attributes:
        shot: Name of the charge.
        entity: Of the sensor; "vehicle" or "camera".
        sense: What was perceived.
        time_s: When it began, on the common clock [s].
    """

    shot: str
    entity: str
    sense: str
    time_s: float


def perceived(
    scene: Scene,
    arrivals: Arrivals,
    seconds: float,
    out_of_view: Collection[str] = (),
) -> tuple[tuple[Perceived, ...], int]:
    """Return who perceives what and when, in order of time.

    Args:
        scene: What is there.
        arrivals: When the waves of its blasts come to whom.
        seconds: When the world ends; what comes later is not perceived [s].
        out_of_view: Names of blasts that the camera does not see.

    Returns:
        What is perceived, and how much comes too late to be.
    """
    senses = {sensor.name: _senses(sensor) for sensor in scene.sensors} | OTHERS
    found = [
        Perceived(charge.name, entity, sense, float(time))
        for row, entity in enumerate(arrivals.entities)
        for wave, sense in senses[entity]
        for charge, time in zip(scene.charges, arrivals.times_s[wave][row], strict=True)
        if np.isfinite(time) and (entity != CAMERA or charge.name not in out_of_view)
    ]
    seen = sorted(
        (one for one in found if one.time_s < seconds),
        key=lambda one: (one.time_s, one.entity, one.sense),
    )
    return tuple(seen), len(found) - len(seen)


def _senses(sensor: Sensor) -> tuple[tuple[str, str], ...]:
    """Return which waves a sensor perceives, and as what: by its kind and records."""
    by_kind = SENSOR_KINDS[sensor.kind].senses if sensor.kind else ()
    waves = dict.fromkeys(waves_of(sensor).values())
    known = {wave for wave, _ in by_kind}
    return (*by_kind, *((wave, BY_WAVE[wave]) for wave in waves if wave not in known))


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

    A sensor with a reading of the flash or the fireball takes its direction from light.
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

    Times are those of `sensors.record`. A moving sensor is placed where it meets the
    wave. The blasts are computed one by one, by one program.

    Args:
        scene: The scene, with its laws stated.
        tracks: Paths of the vehicle and of mounted sensors, by name; absent: they stand
            at the held position.

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
