"""The loads of a scene's blasts."""

from dataclasses import replace

import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Bool

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.scene.charge import Burst
from jblast.vehicle.loads.blast.load import BlastLoad
from jblast.vehicle.loads.blast.passage import Blast
from jblast.waves.path_between import path_between
from jblast.waves.propagation.ambient import ambient, sound_speed_of


def blast_load(
    scene: Scene, *, drag: bool = True, front: bool = True, rotors: bool = True
) -> BlastLoad:
    """Return the loads of a scene's blasts.

    Args:
        scene: Charges and air. Its laws are not asked: the loads have theirs
            (`wave.py`). The curve set of a charge that does not say its burst
            is that which its height leaves where the scene's vehicle starts; the
            surface curves where the height is no number yet, as under `vmap`.
        drag: Whether the blast wind drags the body.
        front: Whether the front pushes it as it crosses.
        rotors: Whether the rotors feel the blast wind.

    Raises:
        InputError: A charge has a range of its own: then it has no place. Or one above
            the ground does not say its burst, and the scene has no vehicle.
    """
    air = scene.air
    return BlastLoad(
        blasts=tuple(_blast(charge, scene) for charge in scene.charges),
        pressure_pa=ambient(air)[1],
        sound_speed_m_s=sound_speed_of(air),
        wind_m_s=jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east]),
        drag=drag,
        front=front,
        rotors=rotors,
    )


def free_air_at(scene: Scene, charge: Charge, place: Array) -> Bool[Array, " place"]:
    """Return whether the reflection comes after the positive phase at places."""
    nothing = jnp.full(len(place), jnp.nan)
    unsaid = replace(charge, burst=None)
    free_air = path_between(scene, unsaid, place, nothing, nothing).free_air
    return jnp.zeros(len(place), bool) if free_air is None else free_air


def _burst(charge: Charge, scene: Scene) -> Burst:
    if charge.burst is not None:
        return charge.burst
    if isinstance(charge.up, Tracer) or not float(charge.up) > 0.0:
        return "surface"
    if scene.vehicle is None:
        raise InputError(
            "charge burst: expected 'surface' or 'free-air' for a charge above the "
            "ground, as the scene has no vehicle whose place would tell; got neither"
        )
    place = jnp.asarray(scene.vehicle.position)[None, :]
    return "free-air" if bool(free_air_at(scene, charge, place)[0]) else "surface"


def _blast(charge: Charge, scene: Scene) -> Blast:
    if charge.range_m is not None:
        raise InputError(
            "charge range: expected a position of the charge, from which a vehicle's "
            "own distance follows, got a distance"
        )
    return Blast(
        position_m=jnp.stack(charge.position_m),
        time_s=charge.time_s,
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        burst=_burst(charge, scene),
    )
