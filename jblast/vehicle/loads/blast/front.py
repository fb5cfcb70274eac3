r"""Impulse of a blast's front on a body that it crosses.

The pressure gradient and the added mass, $\rho_0 V (1 + C_m)\,Du/Dt$. With the
ambient density the gradient's part is exact across a shock, $p_s/U = \rho_0 u_s$. As an
impulse it is $\rho_0 V (1 + C_m)$ times the change of $u$: whatever the step, a jump is
whole. The front crosses within (diameter of the sphere of the mean area)/U. That the
added mass also resists the vehicle's own acceleration is left out: $\rho_0 V C_m$ is
below 1e-3 of its mass.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.dynamics.components import Number
from jblast.vehicle.loads.blast.passage import Passage
from jblast.vehicle.loads.blast.wave import Wave, wind_speed
from jblast.vehicle.quadrotor.parameters import Body


def crossing_time(body: Body, wave: Wave) -> Number:
    """Return how long the front takes to cross a body [s]."""
    speed = wave.sound_speed_m_s * jnp.sqrt(1 + 6 / 7 * wave.peak)
    area = jnp.mean(body.area_m2)
    known = ~(area <= 0)
    diameter = jnp.sqrt(4 / jnp.pi * jnp.where(known, area, 1.0))
    return jnp.where(known, diameter, 1e-3) / speed


def front_impulse(
    body: Body, passage: Passage, since_s: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return what pressure gradient and added mass have given until then [N s]."""
    wave = passage.wave
    crossed = jnp.clip(since_s / crossing_time(body, wave) + 0.5, 0, 1)
    moved = passage.air_density * body.volume_m3 * (1 + body.added_mass_coefficient)
    return moved * crossed * wind_speed(wave, jnp.maximum(since_s, 0))
