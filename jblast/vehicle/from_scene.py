"""Vehicle, initial state and blast loads of a scene.

Every charge of the scene gives one blast; a burst in free air gives a second one, the
reflection from the ground.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

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
    """Return the initial state: level, at its yaw, with the rotor speeds of hover."""
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
        scene: Charges and air. Its laws are not used: the loads have their own
            (`loads.blast_wave`). Without a stated burst, the curve set of a charge
            follows from its height and the start of the scene's vehicle. If the height
            is traced, as under `vmap`, the surface curves are used.
        drag: Include the drag of the blast wind on the body.
        front: Include the impulse of the front that crosses the body.
        rotors: Include the rotors' forces in the blast wind.
        reflection: Include ground reflections of bursts in free air.

    Raises:
        InputError: A charge has a range instead of a position, or a charge above the
            ground has no stated burst and the scene has no vehicle.
    """
    air = scene.air
    blasts = tuple(_blast(charge, scene) for charge in scene.charges)
    ups = [blast.position_m[..., 2] for blast in blasts]
    # A traced height may be above the ground. For a known one on the ground an image
    # would only add work: it is one more blast in every step.
    above = [isinstance(up, Tracer) or np.any(np.asarray(up) > 0) for up in ups]
    return BlastLoad(
        blasts=blasts,
        pressure_pa=ambient(air)[1],
        sound_speed_m_s=sound_speed_of(air),
        wind_m_s=jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east]),
        drag=drag,
        front=front,
        rotors=rotors,
        images=images_of(list(compress(blasts, above))) if reflection else (),
    )


def images_of(blasts: Sequence[Blast]) -> tuple[Blast, ...]:
    """Return the mirror images of bursts in free air, in the ground at up = 0.

    Args:
        blasts: Charges; the image of a charge not above the ground never detonates.
    """
    found = []
    for blast in blasts:
        if blast.burst != "free-air":
            continue
        up = blast.position_m[..., 2]
        mirrored = blast.position_m * jnp.array([1.0, 1.0, -1.0], up.dtype)
        # Heights may be traced, so an image cannot be left out: an infinite time
        # disables it.
        time = jnp.where(up > 0, blast.time_s, jnp.inf)
        found.append(replace(blast, position_m=mirrored, time_s=time))
    return tuple(found)


def free_air_at(scene: Scene, charge: Charge, place: Array) -> Float[Array, " place"]:
    """Return the weight of the free-air curves by the height, at positions."""
    nothing = jnp.full(len(place), jnp.nan)
    any_burst = replace(charge, burst=None)
    return path_between(scene, any_burst, place, nothing, nothing).free_air


def _burst(charge: Charge, scene: Scene) -> Burst:
    if charge.burst is not None:
        return charge.burst
    if isinstance(charge.up, Tracer) or not float(charge.up) > 0.0:
        return "surface"
    if scene.vehicle is None:
        raise InputError(
            "charge burst: expected 'surface' or 'free-air' for a charge above the "
            "ground in a scene without a vehicle, got neither; without a burst it "
            "follows from the vehicle's position"
        )
    place = jnp.asarray(scene.vehicle.position)[None, :]
    return (
        "free-air" if float(free_air_at(scene, charge, place)[0]) >= 1.0 else "surface"
    )


def _blast(charge: Charge, scene: Scene) -> Blast:
    if charge.range_m is not None:
        raise InputError(
            "charge range: expected a position of the charge for a scene with a "
            "vehicle, got a distance"
        )
    return Blast(
        position_m=jnp.stack(charge.position_m),
        time_s=charge.time_s,
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        burst=_burst(charge, scene),
    )
