r"""What a camera sees of a fireball: light, smoke and how much they hide.

The cloud is a sphere whose density falls as $1 - r^2/R^2$. A ray passes its centre at
the distance $b$, at $s_c$; from $s_0$ to $s_1$ on it, $q = (s - s_c)/R$ kept within
$\pm h$, $h^2 = 1 - b^2/R^2$, the optical depth is

$$\tau = \tfrac34\,\tau_0\,\big[h^2 q - q^3/3\big]_{q_0}^{q_1}, \qquad
\alpha = 1 - e^{-\tau}$$

and $\tau_0 h^3$ for the whole chord: at the limb its slope is zero, so there is no edge
that a gradient would miss. $s_0$ is the camera, $s_1$ the ground or what stands before
the cloud.

Soot alone has hundreds of optical depths. It is not evenly mixed: of $N$ lumps along
a diameter the gaps let through light as if there were

$$\tau_0 = N\,(1 - e^{-\tau_s/N})$$

(Natta and Panagia 1984, from memory). A bright fireball still shows its whole disc,
where little alpha is much light; black smoke has a soft limb.

The light is a black body's, between that of the middle and that of the cooler limb by
$h^2$: as if the temperature fell with $b^2$. To it comes what soot reflects of an even
sky above and of a ground a fifth as bright: $0.6 + 0.4\,n_z$, $n$ the normal where the
ray enters. The wind carries the cloud (`waves/fireball.py`); what the fire does to the
light of all else is told in `flash.py`.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.scene import Camera, Charge, Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays, pixel_rays, pixels
from jblast.sensors.camera.image.blackbody import blackbody_light
from jblast.sensors.camera.image.compositing import laid_over, straight
from jblast.sensors.camera.image.grey_composite import luminance
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.types import as_float_array
from jblast.waves.fireball import fireball
from jblast.waves.propagation import ambient

Glow = tuple[Float[Array, "3"], Float[Array, "3"]]
"""Light of the limb and of the middle of a fireball [cd/m2]."""

FAINTEST = 1e-30
"""Light that no float loses [cd/m2]."""


class Cloud(eqx.Module):
    """A charge's fireball where it is at an instant.

    Attributes:
        centre: East, north, up [m].
        radius: Of the cloud [m].
        temperature: Of its light [K].
        optical_depth: Of its soot along a diameter [-].
        air: Temperature of the air around [K].
    """

    centre: Float[Array, "3"]
    radius: Float[Array, ""]
    temperature: Float[Array, ""]
    optical_depth: Float[Array, ""]
    air: Float[Array, ""]


def fireball_layer(
    scene: Scene,
    camera: Camera,
    time: Float[ArrayLike, ""],
    *,
    depth: Float[Array, "height width"] | None = None,
    ground: bool = True,
    supersample: int = 1,
    appearance: Appearance | None = None,
) -> Float[Array, "height width 4"]:
    """Return the fireballs of a scene at an instant, with nothing behind them.

    Args:
        scene: Charges, each by its position, and air.
        camera: Who looks.
        time: On the common clock [s].
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: Whether the plane up = 0 hides what is below it.
        supersample: Rays along each side of a pixel.
        appearance: How it is exposed, and how the smoke is distributed.

    Returns:
        Red, green, blue in linear light, full scale 1, not clipped, and straight alpha.
    """
    rays = pixel_rays(camera, depth, supersample=supersample, ground=ground)
    layer = fireballs_seen(scene, rays, as_float_array(time), appearance)
    return straight(pixels(layer, supersample))


def fireballs_seen(
    scene: Scene,
    rays: Rays,
    time: Float[Array, ""],
    appearance: Appearance | None = None,
    shining: Callable[[Cloud], Glow] | None = None,
) -> Float[Array, "4 row column"]:
    """Return the light of all fireballs along rays, laid over each other.

    Whichever's centre is farther is behind; where two meet, the nearer hides the other.

    Args:
        scene: Charges and air.
        rays: Along which to look.
        time: On the common clock [s].
        appearance: How it is exposed, and how the smoke is distributed.
        shining: Light of limb and middle of a fireball, where it is tabulated; None to
            take Planck's law.

    Returns:
        Red, green and blue times alpha, and alpha.
    """
    appearance = Appearance() if appearance is None else appearance
    return laid_over(
        [
            _seen(scene, charge, rays, time, appearance, shining)
            for charge in scene.charges
        ]
    )


class RayPassage(eqx.Module):
    """How rays pass a cloud; zero where they miss it.

    Attributes:
        column: Optical depth over that along a diameter [-], 0 to 1.
        chord: Square of the half chord over the radius, $h^2$ [-].
        height: Of the place where the ray enters above the centre, over the radius [-].
    """

    column: Float[Array, "row column"]
    chord: Float[Array, "row column"]
    height: Float[Array, "row column"]


def passage(
    offset: Float[Array, "3"], radius: Float[Array, ""], rays: Rays
) -> RayPassage:
    """Return how rays pass a cloud.

    Args:
        offset: From the camera to the centre: east, north, up [m].
        radius: Of the cloud [m].
        rays: Along which to look.
    """
    along = jnp.tensordot(offset, rays.direction, 1)
    aside = offset[:, None, None] - along[None] * rays.direction
    room = jnp.square(radius) - jnp.sum(jnp.square(aside), axis=0)
    met = ~(room <= 0)  # so that a radius that is no number is seen, not missed
    half = jnp.sqrt(jnp.where(met, room, 1.0))
    begin = jnp.clip(-along, -half, half)
    end = jnp.clip(rays.farthest - along, -half, half)
    size = jnp.where(met, radius, 1.0)
    chord = jnp.where(met, room, 0.0) / jnp.square(size)
    first, last = begin / size, end / size
    # the difference of two cubes by its factors: no rounding is left of an empty way
    cubes = jnp.square(first) + first * last + jnp.square(last)
    column = 0.75 * (last - first) * jnp.maximum(chord - cubes / 3.0, 0.0)
    height = (begin * rays.direction[2] - aside[2]) / size
    return RayPassage(
        column=jnp.where(met, column, 0.0),
        chord=chord,
        height=jnp.where(met, height, 0.0),
    )


def cloud(scene: Scene, charge: Charge, time: Float[Array, ""]) -> Cloud:
    """Return the fireball of a scene's charge at a time on the common clock [s]."""
    temperature, _ = ambient(scene.air)
    mass = charge.tnt_mass("fireball_radius_m")
    since, growth = charge.since(time), scene.fireball_growth
    ball = fireball(mass, since, temperature, growth)
    air = scene.air
    centre = jnp.stack(
        [
            charge.east + ball.drift_time * air.wind_east,
            charge.north + ball.drift_time * air.wind_north,
            charge.up + ball.rise,
        ]
    )
    depth = ball.optical_depth
    return Cloud(centre, ball.radius, ball.temperature, depth, temperature)


def glow(
    temperature: Float[Array, ""], air: Float[Array, ""], appearance: Appearance
) -> Glow:
    """Return the light of the limb and of the middle of a fireball [cd/m2].

    Args:
        temperature: Of its middle [K].
        air: Temperature of the air around [K].
        appearance: How much cooler its limb is.
    """
    limb = air + appearance.rim * (temperature - air)
    return blackbody_light(limb), blackbody_light(temperature)


def _seen(
    scene: Scene,
    charge: Charge,
    rays: Rays,
    time: Float[Array, ""],
    appearance: Appearance,
    shining: Callable[[Cloud], Glow] | None,
) -> tuple[Float[Array, "4 row column"], Float[Array, ""]]:
    """Return the premultiplied light of one charge's fireball, and how far it is."""
    ball = cloud(scene, charge, time)
    offset = ball.centre - rays.origin
    met = passage(offset, ball.radius, rays)
    alpha = -jnp.expm1(-lumpy_depth(ball, appearance) * met.column)
    if shining is None:
        limb, middle = glow(ball.temperature, ball.air, appearance)
    else:
        limb, middle = shining(ball)
    day = appearance.smoke * (0.6 + 0.4 * met.height) * appearance.daylight
    light = (between(limb, middle, met.chord) + day[None]) / appearance.white
    layer = jnp.concatenate([alpha[None] * light, alpha[None]])
    return layer, jnp.sqrt(jnp.sum(jnp.square(offset)))


def lumpy_depth(ball: Cloud, appearance: Appearance) -> Float[Array, ""]:
    r"""Return $\tau_0$: the optical depth along a diameter of smoke that has gaps."""
    return -appearance.lumps * jnp.expm1(-ball.optical_depth / appearance.lumps)


def between(
    limb: Float[Array, "3"], middle: Float[Array, "3"], part: Float[Array, "row column"]
) -> Float[Array, "3 row column"]:
    """Return light between two: a power of both luminances, its colour linear.

    One exponential a pixel, where Planck's law would be hundreds.
    """
    lights = jnp.stack([limb, middle]) + FAINTEST
    brightness = luminance(lights)
    (low, high), (cool, hot) = jnp.log(brightness), lights / brightness[:, None]
    colour = cool[:, None, None] + (hot - cool)[:, None, None] * part[None]
    return jnp.exp(low + (high - low) * part)[None] * colour
