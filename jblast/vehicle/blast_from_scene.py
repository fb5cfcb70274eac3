"""The loads of a scene's blasts."""

import jax.numpy as jnp

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle.blast import Blast
from jblast.vehicle.blast_load import BlastLoad
from jblast.waves.atmosphere import sound_speed_in_air, standard_atmosphere


def blast_load(
    scene: Scene, *, drag: bool = True, front: bool = True, rotors: bool = True
) -> BlastLoad:
    """Return the loads of a scene's blasts.

    Args:
        scene: Charges and air. Its laws are not asked: the loads have theirs
            (`blast_curves.py`).
        drag: Whether the blast wind drags the body.
        front: Whether the front pushes it as it crosses.
        rotors: Whether the rotors feel the blast wind.

    Raises:
        InputError: A charge has a range of its own: then it has no place.
    """
    air = scene.air
    temperature, pressure = air.temperature, air.pressure
    if air.altitude is not None:
        temperature, pressure = standard_atmosphere(air.altitude)
    sound_speed = air.sound_speed
    if sound_speed is None:
        sound_speed = sound_speed_in_air(temperature, pressure, air.relative_humidity)
    return BlastLoad(
        blasts=tuple(_blast(charge) for charge in scene.charges),
        pressure_pa=pressure,
        sound_speed_m_s=sound_speed,
        wind_m_s=jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east]),
        drag=drag,
        front=front,
        rotors=rotors,
    )


def _blast(charge: Charge) -> Blast:
    if charge.range is not None:
        raise InputError(
            "charge range: expected a position of the charge, from which a vehicle's "
            "own distance follows, got a distance"
        )
    return Blast(
        position_m=jnp.stack([charge.east, charge.north, charge.up]),
        time_s=charge.time,
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        burst=charge.burst,
    )
