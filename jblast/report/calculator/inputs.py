"""What a calculation was made with, by name and in SI units."""

from typing import Any

import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.kept_programs import kept
from jblast.report.calculator.notes import notes
from jblast.sensors.calculator.question import (
    Question,
    charge_radius,
    scene_path,
    tnt_factor_in,
)
from jblast.waves.laws.ground_factor import ground_factor
from jblast.waves.propagation.ambient import ambient
from jblast.waves.scaling import scaled_distance


def inputs(question: Question) -> dict[str, Any]:
    """Return what was given and what was taken for granted, by name, in SI units."""
    scene = question.scene
    charge, air = scene.charge, scene.air
    path = scene_path(scene)
    temperature, _ = ambient(air)
    ranges, masses = question.rows()
    given: dict[str, Any]
    if question.quantity and question.charge_mass:
        given = {"mass_kg": question.charge_mass[0], "asked": "range_m"}
    elif question.quantity:
        given = {"range_m": question.slant_range[0], "asked": "charge_mass_kg"}
    else:
        tnt_masses = tnt_factor_in(scene, "peak_overpressure_pa").item() * masses
        distances, factors = map(
            np.asarray, _scaled(ranges, tnt_masses, path.ambient_pressure)
        )
        given = {
            "mass_kg": _one_or_all(masses),
            "range_m": _one_or_all(ranges),
            "scaled_distance_m_kg13": _one_or_all(distances),
            "charge_radius_m": _one_or_all(charge_radius(masses)),
            "ground_factor": _one_or_all(factors),
        }
    if question.quantity:
        given[question.quantity] = question.target
    return given | {
        "explosive": charge.explosive,
        "tnt_factor": {
            "pressure": tnt_factor_in(scene, "peak_overpressure_pa").item(),
            "impulse": tnt_factor_in(scene, "positive_impulse_pa_s").item(),
        },
        "burst": charge.burst or "by height",
        "height_m": charge.up.item(),
        "temperature_k": temperature.item(),
        "pressure_pa": path.ambient_pressure.item(),
        "relative_humidity": air.relative_humidity.item(),
        "altitude_m": None if air.altitude is None else air.altitude.item(),
        "sound_speed_m_s": path.sound_speed.item(),
        "p_speed_m_s": path.p_speed.item(),
        "defaults": sorted(question.defaults),
        "notes": notes(question),
    }


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


def _one_or_all(values: np.ndarray) -> Any:
    return float(values[0]) if len(values) == 1 else [float(v) for v in values]
