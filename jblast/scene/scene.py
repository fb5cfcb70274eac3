"""The scene: one argument of the whole physics."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import (
    GRANITE_P_SPEED,
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    STANDARD_TEMPERATURE,
)
from jblast.scene.air import Air
from jblast.scene.charge import Charge
from jblast.scene.ground import Ground
from jblast.scene.sensor import Sensor
from jblast.types import as_float_array


class Scene(eqx.Module):
    """Everything that decides what the sensors record.

    Attributes:
        charge: What exploded.
        air: What the shock travels in.
        ground: What the ground wave travels in.
        sensors: Who listens.
        law: Pairs of quantity and law name; a quantity without one is "auto".
        scatter: Whether the laws scatter about nature, or are exact.
        sedov_gamma: Ratio of specific heats in the Sedov-Taylor law [-].
    """

    charge: Charge = eqx.field(default_factory=Charge)
    air: Air = eqx.field(default_factory=Air)
    ground: Ground = eqx.field(default_factory=Ground)
    sensors: tuple[Sensor, ...] = ()
    law: tuple[tuple[str, str], ...] = eqx.field(static=True, default=())
    scatter: bool = eqx.field(static=True, default=True)
    sedov_gamma: Float[Array, ""] = eqx.field(converter=as_float_array, default=1.4)


@dataclass(frozen=True)
class Place:
    """Where in a scene a number lives that may be fixed, free or uncertain.

    Attributes:
        where: Finds it in a scene.
        positive: Whether it is fitted in ln.
        default: Where a fit starts if nothing else is said.
    """

    where: Callable[[Scene], Any]
    positive: bool
    default: float


PARAMETERS: dict[str, Place] = {
    "charge_mass_kg": Place(lambda s: s.charge.mass, True, 1.0),
    "charge_east_m": Place(lambda s: s.charge.east, False, 0.0),
    "charge_north_m": Place(lambda s: s.charge.north, False, 0.0),
    "charge_up_m": Place(lambda s: s.charge.up, False, 0.0),
    "charge_range_m": Place(lambda s: s.charge.range, True, 100.0),
    "origin_time_s": Place(lambda s: s.charge.time, False, 0.0),
    "air_temperature_k": Place(lambda s: s.air.temperature, True, STANDARD_TEMPERATURE),
    "air_pressure_pa": Place(lambda s: s.air.pressure, True, STANDARD_PRESSURE),
    "air_relative_humidity": Place(lambda s: s.air.relative_humidity, True, 0.5),
    "air_altitude_m": Place(lambda s: s.air.altitude, False, 0.0),
    "air_sound_speed_m_s": Place(
        lambda s: s.air.sound_speed, True, STANDARD_SOUND_SPEED
    ),
    "ground_p_speed_m_s": Place(lambda s: s.ground.p_speed, True, GRANITE_P_SPEED),
    "sedov_gamma": Place(lambda s: s.sedov_gamma, True, 1.4),
}
"""Every number of a scene that can be fitted, by the name it has in the answer."""


def with_values(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """Return the scene with some of its `PARAMETERS` replaced."""
    names = list(values)
    return eqx.tree_at(
        lambda s: [PARAMETERS[name].where(s) for name in names],
        scene,
        [as_float_array(values[name]) for name in names],
        is_leaf=lambda leaf: leaf is None,
    )


def value_of(scene: Scene, name: str) -> Float[Array, ""] | None:
    """Return one of a scene's `PARAMETERS`; None where the scene leaves it derived."""
    return PARAMETERS[name].where(scene)
