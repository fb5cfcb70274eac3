"""The glow of fireballs tabulated over temperature, where it is wanted a million times.

Planck's law is hundreds of exponentials. In one air and appearance the light of limb
and middle is a smooth function of the fireball's temperature alone, so that cubics
between its values and slopes (Hermite) tell it: with `KNOTS` from the air's temperature
to that of the burst, its luminance to 1e-9 of its value, however long a film lasts.

Colour stands apart from luminance and leaves it alone: while anything glows it is known
to 1e-9 of it too, and below that less well.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.sensors.camera.image.grey_composite import luminance
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.fireball_image import Cloud, Glow, glow
from jblast.waves.fireball import HOTTEST

KNOTS = 4096


class GlowTable(eqx.Module):
    """Light of a fireball's limb and of its middle.

    Attributes:
        air: Temperature of the air around, to which it cools [K].
        pace: From one knot to the next [K].
        knots: Logarithm of luminance [cd/m2] and the light over it, and their change
            over a pace.
    """

    air: Float[Array, ""]
    pace: Float[Array, ""]
    knots: Float[Array, "knot 2 2 4"]

    def __call__(self, ball: Cloud) -> Glow:
        """Return the light of limb and middle of a fireball in the table's air."""
        place = (ball.temperature - self.air) / self.pace
        before = jnp.clip(place.astype(int), 0, len(self.knots) - 2)
        u = place - before.astype(place.dtype)
        (a, rise), (b, leave) = self.knots[before], self.knots[before + 1]
        square, cube = u * u, u * u * u
        bend = 3.0 * square - 2.0 * cube
        slopes = rise * (u - 2.0 * square + cube) + leave * (cube - square)
        found = a + (b - a) * bend + slopes
        limb, middle = jnp.exp(found[:, :1]) * found[:, 1:]
        return limb, middle


@partial(jax.jit, static_argnames="knots")
def glow_table(
    air: Float[Array, ""], appearance: Appearance, *, knots: int = KNOTS
) -> GlowTable:
    """Return the table of fireballs in air of a temperature [K]."""
    pace = (HOTTEST - air) / (knots - 1)
    temperatures = air + pace * jnp.arange(knots, dtype=pace.dtype)

    def glowing(temperature):
        light = jnp.stack(glow(temperature, air, appearance))
        grey = luminance(light)[:, None]
        return jnp.concatenate([jnp.log(grey), light / grey], axis=1)

    def knot(temperature):
        return jnp.stack(jax.jvp(glowing, (temperature,), (pace,)))

    return GlowTable(air, pace, jax.lax.map(knot, temperatures, batch_size=256))
