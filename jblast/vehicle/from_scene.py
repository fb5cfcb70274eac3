"""Vehicle, start and blast loads of a scene.

Every charge of the scene gives one blast; a burst in free air gives a second one, the
reflection from the ground.
"""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.scene import Charge, Scene, VehicleSpec
from jblast.scene.charge import Burst
from jblast.vehicle.control.allocation import rotor_speeds
from jblast.vehicle.loads.blast import BlastLoad
from jblast.vehicle.loads.blast_wave import Blast
from jblast.vehicle.quadrotor import Vehicle, named
from jblast.vehicle.state import State
from jblast.waves.paths import path_between
from jblast.waves.propagation import ambient, sound_speed_of


def vehicle_of(spec: VehicleSpec) -> Vehicle:
    """Return the vehicle.

    Raises:
        InputError: There is no such model.
    """
    return named(spec.model)


def start_of(spec: VehicleSpec) -> State:
    """Return the start: level, turned to its yaw, rotors that carry its weight."""
    vehicle = vehicle_of(spec)
    zero = jnp.zeros_like(spec.yaw)
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return State(
        position_m=spec.position,
        velocity_m_s=spec.velocity,
        quaternion=jnp.stack(
            [zero, zero, jnp.sin(spec.yaw / 2), jnp.cos(spec.yaw / 2)]
        ),
        body_rate_rad_s=jnp.zeros(3),
        rotor_speed_rad_s=rotor_speeds(vehicle, (weight, zero, zero, zero)),
    )


def blast_load(
    scene: Scene,
    *,
    drag: bool = True,
    front: bool = True,
    rotors: bool = True,
    reflection: bool = True,
) -> BlastLoad:
    """Return the loads of a scene's blasts.

    Args:
        scene: Charges and air. Its laws are not used: the loads have theirs
            (`loads.blast_wave`). The curve set of a charge without a stated burst is
            that which its height leaves where the scene's vehicle starts; the surface
            curves where the height is no number yet, as under `vmap`.
        drag: Whether the blast wind drags the body.
        front: Whether the front pushes it as it crosses.
        rotors: Whether the rotors feel the blast wind.
        reflection: Whether waves of free air come by way of the ground too.

    Raises:
        InputError: A charge has a range of its own: then it has no place. Or one above
            the ground has no stated burst, and the scene has no vehicle.
    """
    air = scene.air
    blasts = tuple(_blast(charge, scene) for charge in scene.charges)
    return BlastLoad(
        blasts=blasts,
        pressure_pa=ambient(air)[1],
        sound_speed_m_s=sound_speed_of(air),
        wind_m_s=jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east]),
        drag=drag,
        front=front,
        rotors=rotors,
        images=images_of([b for b in blasts if _may_be_above(b)]) if reflection else (),
    )


def images_of(blasts: Sequence[Blast]) -> tuple[Blast, ...]:
    """Return the images in the ground, at up = 0, of bursts in free air.

    Args:
        blasts: Charges; the image of one that is not above the ground never happens.
    """
    found = []
    for blast in blasts:
        if blast.burst != "free-air":
            continue
        up = blast.position_m[..., 2]
        mirrored = blast.position_m * jnp.array([1.0, 1.0, -1.0], up.dtype)
        time = jnp.where(up > 0, blast.time_s, jnp.inf)
        found.append(replace(blast, position_m=mirrored, time_s=time))
    return tuple(found)


def _may_be_above(blast: Blast) -> bool:
    """Return whether a charge is above the ground, or its height is traced."""
    up = blast.position_m[..., 2]
    return isinstance(up, Tracer) or bool(np.any(np.asarray(up) > 0))


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
