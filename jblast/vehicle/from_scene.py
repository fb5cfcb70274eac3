"""Vehicle, initial state and blast loads of a scene.

Every charge of the scene gives one blast; a burst in free air gives a second one, the
reflection from the ground.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError, require
from jblast.scene import Charge, Scene, VehicleSpec
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
) -> BlastLoad:
    """Return the loads of a scene's blasts.

    Args:
        scene: Charges and air. Its laws are not used: the loads have their own
            (`loads.blast_wave`). Without a stated burst, the curves of a charge follow
            from its height and the start of the scene's vehicle; without a vehicle, a
            traced height counts as the ground.
        drag: Include the drag of the blast wind on the body.
        front: Include the impulse of the front that crosses the body.
        rotors: Include the rotors' forces in the blast wind.

    Raises:
        InputError: A charge has a range instead of a position, or a charge above the
            ground has no stated burst and the scene has no vehicle.
    """
    air = scene.air
    free_air = [_free_air(charge, scene) for charge in scene.charges]
    pairs = list(zip(scene.charges, free_air, strict=True))
    blasts = [_blast(charge, weight) for charge, weight in pairs]
    # An image that is known never to detonate would only add work: it is one more wave
    # in every step.
    images = [
        image_of(blast)
        for blast, (charge, weight) in zip(blasts, pairs, strict=True)
        if _may_exceed_0(charge.up) and _may_exceed_0(weight)
    ]
    return BlastLoad(
        waves=jax.tree.map(lambda *x: jnp.stack(x), *blasts, *images),
        charges=len(blasts),
        pressure_pa=ambient(air)[1],
        sound_speed_m_s=sound_speed_of(air),
        wind_m_s=wind_of(scene),
        drag=drag,
        front=front,
        rotors=rotors,
    )


def wind_of(scene: Scene) -> Float[Array, "*batch 3"]:
    """Return the velocity of the air of a scene, or of each of a batch [m/s]."""
    air = scene.air
    return jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east], axis=-1)


def _may_exceed_0(value: float | Array) -> bool:
    return isinstance(value, Tracer) or float(value) > 0


def image_of(blast: Blast) -> Blast:
    """Return the mirror image of a charge, in the ground at up = 0.

    That of a charge not above the ground, or with the curves of the surface, never
    detonates.
    """
    reflects = (blast.position_m[2] > 0) & (blast.free_air > 0)
    return replace(
        blast,
        position_m=blast.position_m * jnp.array([1.0, 1.0, -1.0]),
        time_s=jnp.where(reflects, blast.time_s, jnp.inf),
    )


def free_air_at(scene: Scene, charge: Charge, place: Array) -> Float[Array, " place"]:
    """Return the weight of the free-air curves by the height, at positions."""
    nothing = jnp.full(len(place), jnp.nan)
    any_burst = replace(charge, burst=None)
    return path_between(scene, any_burst, place, nothing, nothing).free_air


def _free_air(charge: Charge, scene: Scene) -> float | Float[Array, ""]:
    """Return the weight of the free-air curves: 0 or 1."""
    unplaced = scene.vehicle is None and isinstance(charge.up, Tracer)
    if charge.burst is not None or unplaced or not _may_exceed_0(charge.up):
        return float(charge.burst == "free-air")
    if scene.vehicle is None:
        raise InputError(
            "charge burst: expected 'surface' or 'free-air' for a charge above the "
            "ground in a scene without a vehicle, got neither; without a burst it "
            "follows from the vehicle's position"
        )
    place = jnp.asarray(scene.vehicle.position)[None, :]
    high = free_air_at(scene, charge, place)[0] >= 1.0
    return jnp.where((charge.up > 0.0) & high, 1.0, 0.0)


def _blast(charge: Charge, free_air: float | Float[Array, ""]) -> Blast:
    words = "a position of the charge for a scene with a vehicle"
    require(charge.range_m is None, "charge range", words, "a distance")
    return Blast(
        position_m=jnp.stack(charge.position_m),
        time_s=charge.time_s,
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        free_air=free_air,
    )
