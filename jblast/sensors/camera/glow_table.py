"""The glow of a fireball tabulated over time, where it is wanted a million times.

Planck's law is hundreds of exponentials. Of one fireball it is a smooth function of
time alone, so that cubics between its values and slopes (Hermite) tell it: with `KNOTS`
over the time looked at, to 1e-9 of its value.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene import Charge, Scene
from jblast.sensors.camera.fireball_image import cloud, glow
from jblast.sensors.camera.look import Look

KNOTS = 4096


class GlowTable(eqx.Module):
    """Light of a fireball's limb and of its middle.

    Attributes:
        begin: The burst, before which it is as at the burst [s].
        pace: From one knot to the next [s].
        knots: Logarithm of the light [cd/m2], and its change over a pace.
    """

    begin: Float[Array, ""]
    pace: Float[Array, ""]
    knots: Float[Array, "knot 2 2 3"]

    def at(self, time: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return the light of limb and middle at a time up to the last knot [cd/m2]."""
        place = jnp.maximum(time - self.begin, 0.0) / self.pace
        before = jnp.clip(place.astype(int), 0, len(self.knots) - 2)
        u = place - before.astype(place.dtype)
        (a, rise), (b, leave) = self.knots[before], self.knots[before + 1]
        square, cube = u * u, u * u * u
        bend = 3.0 * square - 2.0 * cube
        slopes = rise * (u - 2.0 * square + cube) + leave * (cube - square)
        limb, middle = jnp.exp(a + (b - a) * bend + slopes)
        return limb, middle


@partial(jax.jit, static_argnames="knots")
def glow_table(
    scene: Scene,
    charge: Charge,
    look: Look,
    stop: Float[Array, ""],
    *,
    knots: int = KNOTS,
) -> GlowTable:
    """Return the table of a charge's fireball from its burst to a time [s]."""
    # of a charge that never goes off, or not yet, any time will do: nothing is seen
    begin = jnp.where(charge.time < stop, charge.time, stop)
    pace = jnp.maximum(stop - begin, 1e-6) / (knots - 1)
    times = begin + pace * jnp.arange(knots, dtype=pace.dtype)

    def logarithm(time):
        return jnp.log(jnp.stack(glow(cloud(scene, charge, time), look)))

    def knot(time):
        return jnp.stack(jax.jvp(logarithm, (time,), (pace,)))

    # a fireball cools from its burst on: the slope there is that from the right
    times = times.at[0].add(1e-9 * pace)
    return GlowTable(begin, pace, jax.lax.map(knot, times, batch_size=256))
