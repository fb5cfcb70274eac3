"""Who perceives what of which blast, and when."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from jblast.scene import Scene, Sensor
from jblast.world.arrivals import Arrivals, waves_of
from jblast.world.drawn import CAMERA, VEHICLE

BY_KIND = {
    "microphone": (("ground_arrival_s", "ground sound"), ("air_arrival_s", "sound")),
    "pressure": (("air_arrival_s", "pressure"),),
    "anemometer": (("air_arrival_s", "wind"),),
    "geophone": (("ground_arrival_s", "ground motion"),),
    "flash": (("flash_time_s", "flash"),),
    "imu": (("air_arrival_s", "jolt"),),
}
"""What a sensor of a kind perceives, and which wave brings it."""

BY_WAVE = {
    "flash_time_s": "flash",
    "ground_arrival_s": "ground motion",
    "air_arrival_s": "pressure",
}
"""What one of no kind perceives that writes down what a wave brings."""

OTHERS = {
    VEHICLE: (("air_arrival_s", "force"),),
    CAMERA: (("flash_time_s", "flash"),),
}


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
    seen = sorted((one for one in found if one.time_s < seconds), key=_order)
    return tuple(seen), len(found) - len(seen)


def _order(one: Perceived) -> tuple[float, str, str]:
    return one.time_s, one.entity, one.sense


def _senses(sensor: Sensor) -> tuple[tuple[str, str], ...]:
    """Return which waves a sensor perceives, and as what: by its kind and records."""
    by_kind = BY_KIND.get(sensor.kind, ())
    waves = dict.fromkeys(waves_of(sensor).values())
    known = {wave for wave, _ in by_kind}
    return (*by_kind, *((wave, BY_WAVE[wave]) for wave in waves if wave not in known))
