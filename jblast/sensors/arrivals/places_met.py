"""Where a moving sensor is when light and waves of a blast come to it."""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Scene
from jblast.sensors.arrivals.heard import check_speed
from jblast.sensors.arrivals.meeting import meeting_time
from jblast.sensors.arrivals.track import Track
from jblast.sensors.arrivals.way import (
    Way,
    alone,
    arrival_time,
    low_charges_settled,
)


class PlacesMet(NamedTuple):
    """Where a place that moves is as a blast comes to it; a row for each charge.

    For one that never happens, where it is at time 0 or meets it as if it did.

    Attributes:
        light: As it sees the flash: where it was at the detonation, for on its way of a
            kilometre light gives it 3 us, in which 30 m/s are 0.1 mm [m].
        air: As the air shock comes [m].
        ground: As the ground wave comes [m].
    """

    light: Float[np.ndarray, "shot 3"]
    air: Float[np.ndarray, "shot 3"]
    ground: Float[np.ndarray, "shot 3"]

    def of(self, quantity: str) -> Float[np.ndarray, "shot 3"]:
        """Return the places that a quantity is of."""
        if quantity == "flash_time_s":
            return self.light
        return self.ground if quantity.startswith("ground_") else self.air


def places_met(scene: Scene, track: Track, laws: Mapping[str, str]) -> PlacesMet:
    """Return where a place on a track is as the blasts of a scene come to it.

    Each wave is met at the root of a(x(t)) = t, with a the law's arrival at a place, so
    that `sensors.record` at the place returned says the time at which it is there.

    Args:
        scene: What is there.
        track: Where the place is over time.
        laws: Of air_arrival_s and ground_arrival_s.

    Raises:
        InputError: The track is as fast as sound.
    """
    check_speed(scene, track)
    scene = low_charges_settled(scene)
    arrivals = {name: laws[name] for name in ("air_arrival_s", "ground_arrival_s")}
    shots = range(len(scene.charges))
    rows = [_met(alone(scene, shot), track, arrivals) for shot in shots]
    return PlacesMet(*(np.stack(places) for places in zip(*rows, strict=True)))


@eqx.filter_jit
def _met(
    scene: Scene, track: Track, laws: dict[str, str]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    origin = scene.charge.as_if_at_zero().time_s

    def place(way: Way) -> Float[Array, "3"]:
        def arrival(time: Array) -> Array:
            return arrival_time(scene, track.at(time), laws, 0, way)

        return track.at(meeting_time(arrival, arrival(jnp.asarray(origin))))

    return track.at(origin), place("air"), place("ground")
