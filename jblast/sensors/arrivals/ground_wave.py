r"""The waves in the ground at a place, and the pressure that they make in the air.

Arrival, displacement and velocity are those of `sensors.record` for the same scene and
laws; `ground.path` says how the arrival's way goes. The motion is that of the ground
below the place. The ground is a piston to the air above it: $p = \rho c\,v$, a plane
wave that goes up and does not weaken on its way.
"""

from collections.abc import Mapping

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene import Air, Scene
from jblast.sensors.arrivals.laws import DEFAULT_GROUND_LAWS
from jblast.sensors.layout import Layout
from jblast.sensors.record import record
from jblast.waves.propagation import air_density, ambient, sound_speed_of
from jblast.waves.pulse import GroundPulse, ground_pulse_of


def ground_waves(
    scene: Scene, position: Float[Array, "3"], laws: Mapping[str, str]
) -> tuple[GroundPulse, ...]:
    """Return the wave in the ground of every charge, on the common clock.

    That of a charge that never happens comes never. Pure: for jit, vmap and grad.

    Args:
        scene: What is there.
        position: East, north, up [m]; in the ground, or above the ground it is felt by.
        laws: By quantity, all of `DEFAULT_GROUND_LAWS`.
    """
    below = position.at[2].min(0.0)
    shots = len(scene.charges)
    quantities = tuple(DEFAULT_GROUND_LAWS)
    n = shots * len(quantities)
    layout = Layout(
        quantity=quantities * shots,
        position=jnp.stack([position, below, below] * shots),
        slant_range=jnp.full(n, jnp.nan),
        time=jnp.full(n, jnp.nan),
        group=(0,) * n,
        shot=tuple(shot for shot in range(shots) for _ in quantities),
        clock=("",) * n,
    )
    value = record(scene, layout, laws).value.reshape(shots, len(quantities))
    return tuple(ground_pulse_of(*value[shot]) for shot in range(shots))


def pressure_of_velocity(air: Air) -> Float[Array, ""]:
    r"""Return the pressure above ground that moves, over its velocity: $\rho c$."""
    density = air_density(*ambient(air), air.relative_humidity)
    return density * sound_speed_of(air)
