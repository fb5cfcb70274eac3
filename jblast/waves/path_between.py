"""What lies between a charge of a scene and places near it."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene import Charge, Scene
from jblast.waves.height_of_burst import bursts_in_free_air
from jblast.waves.paths import Path, slant_range
from jblast.waves.propagation.ambient import ambient, sound_speed_of
from jblast.waves.propagation.atmosphere import air_density, effective_sound_speed


def path_between(
    scene: Scene,
    charge: Charge,
    position: Float[Array, "place 3"],
    told_range: Float[Array, " place"],
    time_since_detonation: Float[Array, " place"],
) -> Path:
    """Return what lies between a charge and some places.

    The sound speed is the effective one along the path, wind included. The mass is
    that of the explosive: what it is worth in TNT depends on the quantity.

    Args:
        scene: Air and ground.
        charge: One charge of the scene. Its `range`, where it has one, is the distance
            of every place.
        position: East, north, up [m]; not used where `told_range` is finite.
        told_range: Distance from the charge [m]; NaN where positions decide. Where the
            height leaves the curve set, such a place stands as low as that allows.
        time_since_detonation: When a place is asked about [s]; NaN if at no time.
    """
    air = scene.air
    source = jnp.stack(charge.position_m)[None, :]
    given = jnp.isfinite(told_range)
    slant = slant_range(source, position)
    ground = slant_range(source[:, :2], position[:, :2])
    if charge.range_m is not None:
        slant = ground = jnp.broadcast_to(charge.range_m, slant.shape)
    stated = jnp.where(given, told_range, 1.0)
    temperature, pressure = ambient(air)
    sound_speed = sound_speed_of(air)
    # axis by axis: a product of so few columns costs more than what it adds up
    along = (position[:, 0] - source[:, 0]) * air.wind_east
    along += (position[:, 1] - source[:, 1]) * air.wind_north
    along /= jnp.where(slant > 0, slant, 1.0)
    is_placed = ~given if charge.range_m is None else jnp.zeros_like(given)
    toward = jnp.where(is_placed[:, None], source - position, 0.0)
    untold = jnp.full((), jnp.nan)
    growth, camera = scene.fireball_growth, scene.camera
    if growth is not None:  # to a law NaN is a growth that is not told
        time_since_detonation = jnp.where(
            jnp.isnan(growth), jnp.nan, time_since_detonation
        )
    distance = jnp.where(given, stated, slant)
    sensor_height = jnp.where(is_placed, position[:, 2], 0.0)
    free_air = None
    if charge.burst is None:
        lowest = jnp.maximum(charge.up - distance, 0.0)  # that a range alone allows
        free_air = bursts_in_free_air(
            distance,
            charge.tnt_mass("peak_overpressure_pa"),
            charge.up,
            jnp.where(is_placed, position[:, 2], lowest),
            pressure,
            sound_speed,
        )
    return Path(
        slant_range=distance,
        ground_range=jnp.where(given, stated, ground),
        charge_mass=charge.mass_kg,
        height_of_burst=charge.up,
        ambient_pressure=pressure,
        sound_speed=effective_sound_speed(
            sound_speed, jnp.where(is_placed, along, 0.0)
        ),
        air_density=air_density(temperature, pressure, air.relative_humidity),
        p_speed=scene.ground.p_speed,
        sedov_gamma=scene.sedov_gamma,
        time_since_detonation=time_since_detonation,
        sensor_height=sensor_height,
        temperature=temperature,
        relative_humidity=air.relative_humidity,
        toward_east=toward[:, 0],
        toward_north=toward[:, 1],
        toward_up=toward[:, 2],
        fireball_growth=untold if growth is None else growth,
        # a circle is seen as an ellipse where the two differ: that of its area
        camera_focal=untold if camera is None else jnp.sqrt(jnp.prod(camera.focal)),
        free_air=free_air,
        burst=charge.burst,
        ground_path=scene.ground.path,
    )
