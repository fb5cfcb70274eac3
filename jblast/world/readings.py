"""What the sensors of a world write down: a log of every blast, ready to be fitted.

Blasts come one after another, so each reading is of one blast, and is told so in the
column `shot`: a fit takes them apart by it. Whose blast a wave is, which a recorder of
real ones would have to find out, is known here. Errors of two blasts have nothing in
common: each has its own shared effects, as two shots on a range have.
"""

from collections.abc import Collection
from dataclasses import replace

import jax
import jax.numpy as jnp

from jblast.observations import Observations
from jblast.observations.grouping import stacked
from jblast.scene import Scene, Sensor
from jblast.sensors import readings
from jblast.world.arrivals import Arrivals, waves_of
from jblast.world.drawn import DrawnWorld

AIR = "air_arrival_s"


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
        # the number of a random blast is its own in a longer world, too
        number = int(charge.name) if charge.name.isdigit() else 2**31 + column
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
    """Return a sensor that does not say what it records of the air shock."""
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
