"""Perception of blasts: arrivals and readings of each sensor for each blast.

Each reading belongs to one blast, named in the column `shot` of the log; a fit uses it
to separate blasts. In a real recording this assignment would have to be found. Errors
of two blasts are independent: each has its own shared effects, as two shots on a range.
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
from jblast.observations.table import stacked
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
"""Sense of a sensor without a kind, by the wave of its records."""
OTHERS = {
    VEHICLE: (("air_arrival_s", "force"),),
    CAMERA: (("flash_time_s", "flash"),),
}
WAVES = ("flash_time_s", "ground_arrival_s", "air_arrival_s")
"""Waves of a blast, each named by the quantity of its arrival time."""
BEFORE_S, AFTER_S = 0.25, 0.5
"""Maximum length of a search interval before and after an arrival; declared.

The part before gives the noise level; 0.5 s contain the positive and negative phase of
charges up to tonnes.
"""
BY_LIGHT = ("flash_time_s", "fireball_radius_px", "fireball_radius_m")
DIRECTIONS = ("bearing_rad", "elevation_rad")


def out_of_view(scene: Scene, flight: Trajectory | None = None) -> tuple[str, ...]:
    """Return the blasts whose fireballs are never in the camera's view.

    A mounted camera has its position and attitude at the time of detonation. The result
    is empty without a camera.

    Args:
        scene: Charges and camera.
        flight: Flight of the vehicle that carries the camera; None for a fixed one.
    """
    camera = scene.camera
    if camera is None:
        return ()
    bare = replace(scene, sensors=(), clocks=(), ambient=None)
    path = camera_path(flight) if camera.mount and flight is not None else None
    unseen = []
    for charge in scene.charges:
        if charge.never:
            continue
        here = camera
        if path is not None:
            here = carried_camera(camera, path, jnp.asarray(charge.time_s))
        alone = replace(bare, charges=(replace(charge, name=""),), camera=None)
        if not in_view(alone, here):
            unseen.append(charge.name)
    return tuple(unseen)


def camera_path(flight: Trajectory) -> CameraPath:
    """Return the path of a camera's carrier."""
    return CameraPath(flight.time_s, flight.position_m, flight.quaternion)


class Arrivals(NamedTuple):
    """Arrival times of all waves of all blasts at all observers.

    Attributes:
        entities: Names of sensors, vehicle and camera.
        times_s: Arrival times by wave, shape (entity, charge), on the common clock [s];
            infinite: never.
        places_m: Positions of the entities at these times, shape (entity, charge, 3).
    """

    entities: tuple[str, ...]
    times_s: dict[str, Float[np.ndarray, "entity shot"]]
    places_m: dict[str, Float[np.ndarray, "entity shot 3"]]

    def last_s(self) -> float:
        """Return the last arrival time [s]; 0 without arrivals."""
        times = np.concatenate([times.ravel() for times in self.times_s.values()])
        return float(times.max(where=np.isfinite(times), initial=0.0))


def readings_of(
    world: DrawnWorld,
    arrivals: Arrivals,
    seconds: float,
    picked: Collection[str] = (),
) -> tuple[Observations | None, int]:
    """Return the readings of every sensor for every blast, with errors.

    Each reading of a moving sensor has the sensor's position at the arrival.

    Args:
        world: The world.
        arrivals: Times and positions of arrivals.
        seconds: End of the world; later waves are not recorded [s].
        picked: Names of sensors whose air shocks are picked from samples instead.

    Returns:
        The log, None without a reading; and the number of waves after the end.

    Raises:
        InputError: A sensor cannot record a required quantity.
    """
    logs: list[Observations] = []
    late, scene = 0, world.scene
    sensors = [
        replace(
            sensor,
            records=tuple(r for r in sensor.records if waves_of(sensor)[r[0]] != AIR),
        )
        if sensor.name in picked
        else sensor
        for sensor in scene.sensors
    ]
    for column, charge in enumerate(scene.charges):
        if charge.never:
            continue
        present: list[Sensor] = []
        for sensor in sensors:
            parts = _at_arrivals(sensor, arrivals, column, seconds)
            # Counted per wave, not per quantity: one late wave misses all of its
            # readings.
            late += len(set(waves_of(sensor).values())) - len(parts)
            present += parts
        if not present:
            continue
        # Keyed by number, a random blast has the same errors in a longer world. Only
        # exact decimals count as numbers ("007" and "²" do not), or two charges would
        # share errors.
        number = whole_number(charge.name)
        if number is None or number >= 2**31 or str(number) != charge.name:
            number = 2**31 + column
        key = jax.random.fold_in(world.noise_key, number)
        alone = replace(
            scene,
            charges=(replace(charge, name=""),),
            sensors=tuple(present),
        )
        log = readings(key, alone)
        logs.append(replace(log, shot=(charge.name,) * len(log)))
    if not logs:
        return None, late
    comments = tuple(dict.fromkeys(line for log in logs for line in log.comments))
    return Observations(**stacked(logs), comments=comments), late


def _at_arrivals(
    sensor: Sensor, arrivals: Arrivals, column: int, seconds: float
) -> list[Sensor]:
    """Return a sensor once per wave, with position and records of that wave."""
    row, waves = arrivals.entities.index(sensor.name), waves_of(sensor)
    by_wave: dict[str, list[tuple[str, float]]] = {}
    for quantity, sigma in sensor.records:
        by_wave.setdefault(waves[quantity], []).append((quantity, sigma))
    parts = []
    for wave, records in by_wave.items():
        # Negated, so that a wave without an arrival (NaN) is left out too.
        if not arrivals.times_s[wave][row, column] < seconds:
            continue
        place = sensor.position_m
        if sensor.mount:
            place = jnp.asarray(arrivals.places_m[wave][row, column])
        parts.append(replace(sensor, position_m=place, records=tuple(records)))
    return parts


class Perceived(NamedTuple):
    """First perception of one blast by one sense of one observer.

    Attributes:
        shot: Name of the charge.
        entity: Name of the sensor, "vehicle" or "camera".
        sense: Name of the sense.
        time_s: Beginning, on the common clock [s].
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
    """Return all perceptions, sorted by time.

    Args:
        scene: The scene.
        arrivals: Times and positions of arrivals.
        seconds: End of the world; later waves are not perceived [s].
        out_of_view: Names of blasts outside the camera's view.

    Returns:
        The perceptions, and the number of those after the end.
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
    """Return pairs of wave and sense of a sensor, by its kind and records."""
    by_kind = SENSOR_KINDS[sensor.kind].senses if sensor.kind else ()
    waves = dict.fromkeys(waves_of(sensor).values())
    known = {wave for wave, _ in by_kind}
    return (*by_kind, *((wave, BY_WAVE[wave]) for wave in waves if wave not in known))


def interval_about(
    comes_s: Float[np.ndarray, " shot"], shot: int
) -> tuple[float, float]:
    """Return the search interval of one arrival among others [s].

    Args:
        comes_s: Arrival times of all blasts at one sensor.
        shot: Index of the arrival.
    """
    here = comes_s[shot]
    before = max((t for t in comes_s if t < here), default=-np.inf)
    after = min((t for t in comes_s if t > here), default=np.inf)
    first = max(here - BEFORE_S, 0.5 * (before + here))
    return float(first), float(min(here + AFTER_S, 0.5 * (here + after)))


def waves_of(sensor: Sensor) -> dict[str, str]:
    """Return the wave (one of `WAVES`) of each quantity that a sensor records.

    The direction of a sensor that records flash or fireball is that of the light.
    """
    recorded = [quantity for quantity, _ in sensor.records]
    sees = any(quantity in BY_LIGHT for quantity in recorded)
    return {quantity: _wave(quantity, sees) for quantity in recorded}


def _wave(quantity: str, sees: bool) -> str:
    if quantity in BY_LIGHT or (sees and quantity in DIRECTIONS):
        return "flash_time_s"
    return "ground_arrival_s" if quantity.startswith("ground_") else "air_arrival_s"


def arrivals_of(scene: Scene, tracks: Mapping[str, Track] | None = None) -> Arrivals:
    """Return the arrival times of each blast at all observers, by the scene's laws.

    Times are those of `sensors.record`. Moving sensors have their position at the
    arrival. The blasts are computed one by one, by one program.

    Args:
        scene: The scene, with its laws stated.
        tracks: Paths of the vehicle and of mounted sensors, by name; without a path
            they are at the vehicle's target position.

    Raises:
        InputError: An observer is as fast as sound.
    """
    entities, moving = _entities(scene, tracks or {})
    # Without sensors and camera the scene has one PyTree structure, so one program
    # serves all blasts.
    bare = replace(scene, sensors=(), camera=None, clocks=(), ambient=None)
    observers = tuple(Sensor(name, place) for name, place in entities.items())
    # The name is static: with it each blast would compile its own program.
    truths = [
        truth_of(
            replace(bare, charges=(replace(x, name=""),)), observers, moving, WAVES
        )
        for x in scene.charges
    ]
    return Arrivals(
        tuple(entities),
        {w: np.stack([one.values[w][:, 0] for one in truths], 1) for w in WAVES},
        {w: np.stack([one.places[w][:, 0] for one in truths], 1) for w in WAVES},
    )


def _entities(
    scene: Scene, tracks: Mapping[str, Track]
) -> tuple[dict[str, Float[Array, "3"]], dict[str, Track]]:
    """Return the positions of all observers, and the paths of moving ones."""
    held = jnp.zeros(3) if scene.vehicle is None else scene.vehicle.held
    found = {s.name: held if s.mount else s.position_m for s in scene.sensors}
    if scene.vehicle is not None:
        found[VEHICLE] = held
    if scene.camera is not None:
        found[CAMERA] = held if scene.camera.mount else scene.camera.position
    return found, {name: track for name, track in tracks.items() if name in found}
