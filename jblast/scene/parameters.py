"""Every number of a scene that may be fixed, free or uncertain, by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import equinox as eqx
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import (
    GRANITE_P_SPEED,
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    STANDARD_TEMPERATURE,
)
from jblast.scene.scene import Scene
from jblast.types import as_float_array


@dataclass(frozen=True)
class Place:
    """Where in a scene a number lives.

    Attributes:
        where: Finds it in a scene.
        positive: Whether it is fitted in ln.
        default: Where a fit starts if nothing else is said.
        of_charge: Whether each charge has its own.
    """

    where: Callable[[Any], Any]
    positive: bool
    default: float
    of_charge: bool = False


PARAMETERS: dict[str, Place] = {
    "charge_mass_kg": Place(lambda s: s.charge.mass, True, 1.0, True),
    "tnt_factor": Place(lambda s: s.charge.tnt_factor, True, 1.0, True),
    "charge_east_m": Place(lambda s: s.charge.east, False, 0.0, True),
    "charge_north_m": Place(lambda s: s.charge.north, False, 0.0, True),
    "charge_up_m": Place(lambda s: s.charge.up, False, 0.0, True),
    "charge_range_m": Place(lambda s: s.charge.range, True, 100.0, True),
    "origin_time_s": Place(lambda s: s.charge.time, False, 0.0, True),
    "air_temperature_k": Place(lambda s: s.air.temperature, True, STANDARD_TEMPERATURE),
    "air_pressure_pa": Place(lambda s: s.air.pressure, True, STANDARD_PRESSURE),
    "air_relative_humidity": Place(lambda s: s.air.relative_humidity, True, 0.5),
    "air_altitude_m": Place(lambda s: s.air.altitude, False, 0.0),
    "air_sound_speed_m_s": Place(
        lambda s: s.air.sound_speed, True, STANDARD_SOUND_SPEED
    ),
    "wind_east_m_s": Place(lambda s: s.air.wind_east, False, 0.0),
    "wind_north_m_s": Place(lambda s: s.air.wind_north, False, 0.0),
    "ground_p_speed_m_s": Place(lambda s: s.ground.p_speed, True, GRANITE_P_SPEED),
    "sedov_gamma": Place(lambda s: s.sedov_gamma, True, 1.4),
    # that of the fireball of 15 kg
    "fireball_growth_s": Place(lambda s: s.fireball_growth, True, 2.5e-3),
}
"""Every number of a scene of one charge, by the name it has in the answer."""

CLOCK_OFFSET = "clock_offset_s"
"""`clock_offset_s.NAME` is the offset of a sensor's, or of a recorder's, clock."""


def place_of(name: str) -> Place:
    """Return where a number lives: `charge_mass_kg`, or of one of several, `....NAME`.

    Raises:
        KeyError: No number has that name.
    """
    base, _, label = name.partition(".")
    if base == CLOCK_OFFSET:
        return Place(lambda s: _clock_offset(s, label), False, 0.0)
    place = PARAMETERS[base]
    if not label:
        return place

    def where(scene: Scene) -> Any:
        named = next(c for c in scene.charges if c.name == label)
        return place.where(SimpleNamespace(charge=named))

    return Place(where, place.positive, place.default, of_charge=True)


def names_in(scene: Scene) -> tuple[str, ...]:
    """Return the names of all numbers of a scene."""
    labels = [scene.label(charge) for charge in scene.charges]
    names = [
        base + label
        for base, place in PARAMETERS.items()
        for label in (labels if place.of_charge else [""])
    ]
    return (*names, *(f"{CLOCK_OFFSET}.{clock}" for clock in scene.clock_offsets()))


def with_values(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """Return the scene with some of its numbers replaced."""
    names = list(values)
    return eqx.tree_at(
        lambda s: [place_of(name).where(s) for name in names],
        scene,
        [as_float_array(values[name]) for name in names],
        is_leaf=lambda leaf: leaf is None,
    )


def value_of(scene: Scene, name: str) -> Float[Array, ""] | None:
    """Return one of a scene's numbers; None where the scene leaves it derived."""
    return place_of(name).where(scene)


def _clock_offset(scene: Scene, name: str) -> Any:
    for clock in _each(scene.clocks):
        if clock.name == name:
            return clock.offset
    for sensor in _each(scene.sensors):
        if sensor.name == name:
            return sensor.clock_offset
    raise KeyError(name)


def _each(nodes: Any) -> tuple[Any, ...]:
    """Return a tuple of nodes; an empty one is a wrapped leaf within `eqx.tree_at`."""
    return nodes if isinstance(nodes, tuple) else ()
