"""Every wave at a place that stands, or at the places where a moving one meets them."""

from collections.abc import Mapping

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene import Scene
from jblast.sensors.arrivals.air_waves import air_wave
from jblast.sensors.arrivals.ground_wave import ground_waves, pressure_of_velocity
from jblast.sensors.arrivals.way import Heard, Way, as_seen, is_there, ways
from jblast.waves.paths import slant_range


def waves_at(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    reflection: float | Float[Array, ""],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return every wave that comes to a place.

    Of a charge that never happens it arrives never, with no pressure. Pure: for jit,
    vmap and grad.

    Args:
        scene: What is there.
        position: East, north, up [m].
        laws: By quantity, all that the ways need.
        reflection: Coefficient of the ground; a plain 0 leaves reflections out.
        ground: Whether the moving ground is heard, too.
    """
    return tuple(
        wave_at(scene, position, laws, shot, way, reflection)
        for shot, way in ways(scene, reflection, ground)
    )


def wave_at(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
    reflection: float | Float[Array, ""],
) -> Heard:
    """Return one wave at a place; what is not there arrives never.

    Args:
        scene: What is there.
        position: East, north, up [m].
        laws: By quantity.
        shot: Which of the scene's charges it is of.
        way: How it comes.
        reflection: Coefficient of the ground.
    """
    if way != "ground":
        return air_wave(scene, position, laws, shot, way, reflection)
    seen, place = as_seen(scene, position, shot, way)
    (motion,) = ground_waves(seen, place, laws)
    there = is_there(scene, position, shot, way)
    loudness = jnp.where(there, pressure_of_velocity(scene.air), 0.0)
    pulse = motion._replace(
        arrival_time=jnp.where(there, motion.arrival_time, jnp.inf),
        amplitude=loudness * motion.amplitude,
    )
    charge = seen.charge
    source = jnp.stack(charge.position_m)
    distance = slant_range(source, place)
    if charge.range_m is not None:
        distance = charge.range_m
    return Heard(pulse, way, shot, distance, jnp.zeros((), bool))
