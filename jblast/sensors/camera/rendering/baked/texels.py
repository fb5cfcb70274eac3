r"""From the five numbers of a texel to light: heat that glows, soot that is lit.

Heat $h$ is the excess of temperature over the air's, as a part of that in the middle of
the law's fireball: the light given off is that of a black body of

$$T_a + h\,(T - T_a)$$

whatever the fireball's temperature $T$ is at the time. What the fire does not outshine
is soot and dust of a colour, in the light of the day. Both are covered by one opacity.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, UInt8

from jblast.sensors.camera.image.blackbody import blackbody_light
from jblast.sensors.camera.image.compositing import srgb_to_linear
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.fireball_image import Cloud


def heat_light(ball: Cloud, appearance: Appearance) -> Float[Array, "256 3"]:
    """Return the light of every heat of 8 bits at an instant, full scale 1.

    Args:
        ball: The law's fireball.
        appearance: Its white is full scale.
    """
    heat = jnp.arange(256, dtype=ball.temperature.dtype) / 255.0
    light = blackbody_light(ball.air + heat * (ball.temperature - ball.air))
    return light / appearance.white


def texel_light(
    texels: UInt8[Array, "height width 5"],
    glow: Float[Array, "256 3"],
    day: Float[Array, ""],
) -> Float[Array, "height width 4"]:
    """Return premultiplied linear light.

    Args:
        texels: Heat; red, green and blue of soot and dust, sRGB; opacity.
        glow: Light of every heat.
        day: Light of a white wall in the light of the day, full scale 1.
    """
    numbers = jnp.arange(256, dtype=glow.dtype) / 255.0
    shade = day * srgb_to_linear(numbers)
    # indices of integers are bounded by their type
    parts = texels.astype(jnp.int32)
    light = _entries(glow, parts[..., 0]) + _entries(shade, parts[..., 1:4])
    alpha = _entries(numbers, parts[..., 4:])
    return jnp.concatenate([alpha * light, alpha], axis=-1)


def _entries(table, index):
    return table.at[index].get(mode="promise_in_bounds")
