r"""The light of a fireball on what stands around it.

A surface of a background is as bright as the light that falls on it. By day that is the
illuminance $E_0$, under which the background was taken; the fireball adds $E$ to it,

$$B = B_0\,(1 + E/E_0), \qquad E = \pi\,\bar L\,F$$

in each of red, green and blue, $E_0$ being white. $\bar L$ is the mean light of the
fireball's disc as `fireball_image` draws it, and $F$ the configuration factor of a
sphere of its radius $R$ at the distance $d$, whose centre is $\beta$ off the surface's
normal (`sphere_factor.py`). A charge on the ground lights the ground with half a ball:
far away by the third power of the distance, until it has risen; then by the square of
the distance and the cosine.

Left out: shadows, light that is thrown back once more, smoke between the fire and what
it lights, the ground's own heat, and the flash of the shock in air before the products
are to be seen, which is hotter and shorter than the fireball of the law.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Scene
from jblast.sensors.camera.geometry.surfaces import Surfaces
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.fireball_image import (
    Cloud,
    Glow,
    between,
    cloud,
    glow,
    lumpy_depth,
)
from jblast.sensors.camera.rendering.sphere_factor import sphere_factor

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Of the mean over the disc: it is known to 1e-4."""


def flash(
    scene: Scene,
    surfaces: Surfaces,
    time: Float[Array, ""],
    appearance: Appearance,
    shining: Callable[[Cloud], Glow] | None = None,
) -> Float[Array, "3 row column"]:
    r"""Return $E/E_0$: the fireballs' light on surfaces over that of the day.

    Args:
        scene: Charges and air.
        surfaces: Of the background.
        time: On the common clock [s].
        appearance: How bright the day is, and how the smoke is distributed.
        shining: Light of limb and middle of a fireball, where it is tabulated.

    Returns:
        Of red, green and blue; zero before detonation and where nothing is lit.
    """
    total = jnp.zeros((), surfaces.place.dtype)
    for charge in scene.charges:
        ball = cloud(scene, charge, time)
        if shining is None:
            ends = glow(ball.temperature, ball.air, appearance)
        else:
            ends = shining(ball)
        light = disc_light(ball, ends, appearance) / appearance.daylight
        factor = sphere_factor(ball.centre, ball.radius, surfaces)
        total = total + light[:, None, None] * factor[None]
    return total


def disc_light(ball: Cloud, ends: Glow, appearance: Appearance) -> Float[Array, "3"]:
    r"""Return $\bar L$: the mean light of a fireball's disc, its own alone [cd/m2].

    $\int_0^1 (1 - e^{-\tau h^3})\,L(h^2)\,2h\,dh$ by Gauss and Legendre.

    Args:
        ball: The fireball.
        ends: Light of its limb and of its middle [cd/m2].
        appearance: How its smoke is distributed.
    """
    h = jnp.asarray(0.5 * (1.0 + _NODES), ball.radius.dtype)[None]
    weight = jnp.asarray(_WEIGHTS, h.dtype)[None] * h
    alpha = -jnp.expm1(-lumpy_depth(ball, appearance) * h**3)
    light = between(*ends, jnp.square(h))
    return jnp.sum((weight * alpha)[None] * light, axis=(1, 2))
