"""What a calculation was made with, by name and in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.json_values import ABSENT, AMONG
from jblast.kept_programs import kept
from jblast.report.calculator.notes import notes
from jblast.sensors.calculator.question import (
    Question,
    charge_radius,
    scene_path,
)
from jblast.waves.laws.ground_factor import ground_factor
from jblast.waves.propagation.ambient import ambient
from jblast.waves.scaling import scaled_distance

Numbers = float | tuple[float, ...]
"""One, or one a row."""


@dataclass(frozen=True)
class TntFactor:
    """TNT mass of an explosive over its mass.

    Attributes:
        pressure: For pressures and times.
        impulse: For impulses and durations.
    """

    pressure: float
    impulse: float


@dataclass(frozen=True)
class Scaled:
    """What ranges and masses come to, by row.

    Attributes:
        scaled_distance_m_kg13: By Sachs, for pressures.
        charge_radius_m: Of a sphere of TNT.
        ground_factor: How many times the mass makes the same pressure in free air.
    """

    scaled_distance_m_kg13: Numbers
    charge_radius_m: Numbers
    ground_factor: Numbers


@dataclass(frozen=True)
class Inputs:
    """What was given and what was taken for granted.

    Attributes:
        mass_kg: Of the explosive, by row; absent where it is asked for.
        range_m: Slant range, by row; absent where it is asked for.
        asked: Which of the two is asked for; absent where none is.
        scaled: What the two come to; None where one is asked for.
        measured: What was measured in place of the one asked for, by quantity.
        explosive: Of what the charge is.
        tnt_factor: Its TNT mass over its mass.
        burst: The curve set, or "by height" where each row has its own.
        height_m: Of burst; negative is buried.
        temperature_k: Of the air at the charge.
        pressure_pa: Of the air at the charge.
        relative_humidity: Of the air, 0 to 1.
        altitude_m: Of the standard atmosphere; null where none was asked for.
        sound_speed_m_s: In the air at the charge.
        p_speed_m_s: Of the ground.
        defaults: What was not said: air, burst, explosive, ground.
        notes: What no number says by itself, a sentence each.
    """

    mass_kg: Numbers | None = field(metadata=ABSENT)
    range_m: Numbers | None = field(metadata=ABSENT)
    asked: Literal["range_m", "charge_mass_kg"] | None = field(metadata=ABSENT)
    scaled: Scaled | None = field(metadata=AMONG)
    measured: Mapping[str, float] = field(metadata=AMONG)
    explosive: str
    tnt_factor: TntFactor
    burst: str
    height_m: float
    temperature_k: float
    pressure_pa: float
    relative_humidity: float
    altitude_m: float | None
    sound_speed_m_s: float
    p_speed_m_s: float
    defaults: tuple[str, ...]
    notes: tuple[str, ...]


def inputs(question: Question) -> Inputs:
    """Return what was given and what was taken for granted, by name, in SI units."""
    scene = question.scene
    charge, air = scene.charge, scene.air
    path = scene_path(scene)
    temperature, _ = ambient(air)
    pressure_factor = float(charge.tnt_factor_for("peak_overpressure_pa"))
    mass = distance = asked = scaled = None
    if question.quantity and question.charge_mass:
        mass, asked = question.charge_mass[0], "range_m"
    elif question.quantity:
        distance, asked = question.slant_range[0], "charge_mass_kg"
    else:
        ranges, masses = question.rows()
        mass, distance = _one_or_all(masses), _one_or_all(ranges)
        tnt_masses = pressure_factor * masses
        rows = _scaled(ranges, tnt_masses, path.ambient_pressure)
        distances, factors = map(np.asarray, rows)
        scaled = Scaled(
            scaled_distance_m_kg13=_one_or_all(distances),
            charge_radius_m=_one_or_all(charge_radius(masses)),
            ground_factor=_one_or_all(factors),
        )
    return Inputs(
        mass_kg=mass,
        range_m=distance,
        asked=asked,
        scaled=scaled,
        measured={question.quantity: question.target} if question.quantity else {},
        explosive=charge.explosive,
        tnt_factor=TntFactor(
            pressure=pressure_factor,
            impulse=float(charge.tnt_factor_for("positive_impulse_pa_s")),
        ),
        burst=charge.burst or "by height",
        height_m=charge.up.item(),
        temperature_k=temperature.item(),
        pressure_pa=path.ambient_pressure.item(),
        relative_humidity=air.relative_humidity.item(),
        altitude_m=None if air.altitude is None else air.altitude.item(),
        sound_speed_m_s=path.sound_speed.item(),
        p_speed_m_s=path.p_speed.item(),
        defaults=tuple(sorted(question.defaults)),
        notes=tuple(notes(question)),
    )


@kept
def _scaled(
    slant_range: Float[ArrayLike, " row"],
    charge_mass: Float[ArrayLike, " row"],
    ambient_pressure: Float[ArrayLike, ""],
) -> tuple[Float[Array, " row"], Float[Array, " row"]]:
    """Return scaled distances, and how much more a charge in free air weighs there.

    It makes the same pressure there as the charge on the ground.
    """
    distance = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return distance, ground_factor(distance, 1.0)


def _one_or_all(values: np.ndarray) -> Numbers:
    return float(values[0]) if len(values) == 1 else tuple(float(v) for v in values)
