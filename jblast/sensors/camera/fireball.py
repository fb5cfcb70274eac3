r"""The image of a fireball: light, smoke and opacity, in a part of the image.

The cloud is a sphere whose density falls as $1 - r^2/R^2$. A ray passes its centre at
the distance $b$, at $s_c$. From $s_0$ to $s_1$ on it, with $q = (s - s_c)/R$ limited to
$\pm h$, $h^2 = 1 - b^2/R^2$, the optical depth is

$$\tau = \tfrac34\,\tau_0\,\big[h^2 q - q^3/3\big]_{q_0}^{q_1}, \qquad
\alpha = 1 - e^{-\tau}$$

and $\tau_0 h^3$ for the whole chord. Its slope is zero at the limb, so that gradients
include the edge. $s_0$ is the camera, $s_1$ the ground or the surface in front of the
cloud.

Soot alone has hundreds of optical depths, but is not evenly mixed. With $N$ lumps along
a diameter the gaps transmit light as if the depth were

$$\tau_0 = N\,(1 - e^{-\tau_s/N})$$

(Natta and Panagia 1984, from memory). A bright fireball still shows its whole disc,
because at its limb even a small alpha is much light; black smoke has a soft limb.

The light is a black body's, interpolated between the middle and the cooler limb by
$h^2$, as if the temperature fell with $b^2$. Soot reflects an even sky above and a
ground a fifth as bright: $0.6 + 0.4\,n_z$, $n$ the normal at the entry of the ray. The
wind carries the cloud (`waves/fireballs.py`). The light of the fire on its surroundings
is in `surroundings.py`.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError, shown
from jblast.scene import Air, Charge
from jblast.sensors.camera.geometry import Rays
from jblast.sensors.camera.image import FULL_SUN, blackbody_light, luminance
from jblast.sensors.camera.tiles import SLACK, over_corners, without_direction
from jblast.types import as_numbers, as_optional_number
from jblast.waves.fireballs import fireball
from jblast.waves.propagation import ambient

WHITE = FULL_SUN
"""Luminance of a white wall in the sun [cd/m2]: 1e5 lux / pi."""
LUMPS = 20.0
"""Lumps of smoke along a diameter [-]. Declared: it makes the limb a twentieth of the
radius wide, as in pictures of black smoke."""
RIM = 0.9
"""Excess of temperature at the limb over that in the middle [-]. Declared."""
SMOKE = 0.07
r"""Share of light that thick soot reflects [-]: $(1 - s)/(1 + s)$, $s^2 = 1 - w$, for
isotropic scattering with the albedo $w = 0.25$ of fresh soot (Bond and Bergstrom 2006,
from memory: 0.2 to 0.3)."""
Glow = tuple[Float[Array, "3"], Float[Array, "3"]]
"""Light of the limb and of the middle of a fireball [cd/m2]."""
FAINTEST = 1e-30
"""Light added before a logarithm [cd/m2]: far below any visible light, and far above
the smallest number of float32 (1e-38)."""


class Appearance(eqx.Module):
    """Exposure of a fireball, and distribution of its smoke.

    Attributes:
        white: Luminance that is full scale [cd/m2].
        lumps: Lumps of smoke along a diameter [-]; many make the smoke even.
        rim: Excess of temperature over the air at the limb, as a share of that in the
            middle [-].
        smoke: Share of the sky's light that thick smoke reflects [-].
        illuminance: Illuminance of a level surface by sky and sun [lx]: the light of
            the background and of the smoke. None: that under which a white wall is full
            scale, which is the usual exposure.
        flash: True if the fire lights the background (`surroundings.py`).

    Raises:
        InputError: Outside jit: a number is not positive and finite, or `rim` or
            `smoke` is above 1.
    """

    white: Float[Array, ""] = eqx.field(converter=as_numbers, default=WHITE)
    lumps: Float[Array, ""] = eqx.field(converter=as_numbers, default=LUMPS)
    rim: Float[Array, ""] = eqx.field(converter=as_numbers, default=RIM)
    smoke: Float[Array, ""] = eqx.field(converter=as_numbers, default=SMOKE)
    illuminance: Float[Array, ""] | None = eqx.field(
        converter=as_optional_number, default=None
    )
    flash: bool = eqx.field(static=True, default=True)

    @property
    def daylight(self) -> Float[Array, ""]:
        """Luminance of a white wall in the light of sky and sun [cd/m2]."""
        return self.white if self.illuminance is None else self.illuminance / math.pi

    def __check_init__(self):
        for name in ("white", "lumps", "rim", "smoke", "illuminance"):
            value = getattr(self, name)
            if value is None or isinstance(value, Tracer):
                continue
            number, part = value.item(), name in ("rim", "smoke")
            if not 0 < number < math.inf or (part and number > 1):
                raise InputError(
                    f"appearance {name}: expected a number above 0"
                    f"{', at most 1' if part else ''}, got {shown(number)}"
                )


class Cloud(eqx.Module):
    """Fireball of a charge at an instant.

    Attributes:
        centre: East, north, up [m].
        radius: Radius of the cloud [m].
        temperature: Temperature of its light [K].
        optical_depth: Optical depth of its soot along a diameter [-].
        air: Temperature of the surrounding air [K].
    """

    centre: Float[Array, "3"]
    radius: Float[Array, ""]
    temperature: Float[Array, ""]
    optical_depth: Float[Array, ""]
    air: Float[Array, ""]


class RayPassage(eqx.Module):
    """Passages of rays through a cloud; zero for rays that miss it.

    Attributes:
        column: Optical depth over that along a diameter [-], 0 to 1.
        chord: Square of the half chord over the radius, $h^2$ [-].
        height: Height of the entry point above the centre, over the radius [-].
    """

    column: Float[Array, "row column"]
    chord: Float[Array, "row column"]
    height: Float[Array, "row column"]


def passage(
    offset: Float[Array, "3"], radius: Float[Array, ""], rays: Rays
) -> RayPassage:
    """Return the passages of rays through a cloud.

    Args:
        offset: Centre relative to the camera: east, north, up [m].
        radius: Radius of the cloud [m].
        rays: Camera rays.
    """
    along = jnp.tensordot(offset, rays.direction, 1)
    aside = offset[:, None, None] - along[None] * rays.direction
    room = jnp.square(radius) - jnp.sum(jnp.square(aside), axis=0)
    met = ~(room <= 0)  # negated: a NaN radius stays visible as NaN
    half = jnp.sqrt(jnp.where(met, room, 1.0))
    # the camera may be inside the cloud: the passage then begins at it
    begin = jnp.clip(-along, -half, half)
    end = jnp.clip(rays.farthest - along, -half, half)
    # a radius of zero has no passage, and would divide by zero
    size = jnp.where(met, radius, 1.0)
    chord = jnp.where(met, room, 0.0) / jnp.square(size)
    first, last = begin / size, end / size
    # the difference of two cubes by its factors: exactly zero for an empty interval
    cubes = jnp.square(first) + first * last + jnp.square(last)
    column = 0.75 * (last - first) * jnp.maximum(chord - cubes / 3.0, 0.0)
    height = (begin * rays.direction[2] - aside[2]) / size
    return RayPassage(
        column=jnp.where(met, column, 0.0),
        chord=chord,
        height=jnp.where(met, height, 0.0),
    )


def cloud(
    charge: Charge,
    time: Float[Array, ""],
    air: Air,
    growth: Float[Array, ""] | None = None,
) -> Cloud:
    """Return the fireball of a charge at a time.

    Args:
        charge: The charge, with a position.
        time: Time on the common clock [s].
        air: Temperature and wind.
        growth: Time constant of the expansion [s]; None for that of the law.
    """
    temperature, _ = ambient(air)
    mass = charge.tnt_mass("fireball_radius_m")
    ball = fireball(mass, charge.since(time), temperature, growth)
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
        temperature: Temperature of its middle [K].
        air: Temperature of the surrounding air [K].
        appearance: Its `rim` states how much cooler the limb is.
    """
    # the excess over the air: a cold cloud has a limb as cold
    limb = air + appearance.rim * (temperature - air)
    return blackbody_light(limb), blackbody_light(temperature)


def ball_seen(
    ball: Cloud, ends: Glow, rays: Rays, appearance: Appearance
) -> Float[Array, "4 row column"]:
    """Return the premultiplied light of one fireball along rays, and alpha.

    Args:
        ball: The fireball.
        ends: Light of its limb and of its middle [cd/m2].
        rays: Camera rays.
        appearance: Exposure, and distribution of the smoke.
    """
    met = passage(ball.centre - rays.origin, ball.radius, rays)
    alpha = -jnp.expm1(-lumpy_depth(ball, appearance) * met.column)
    day = appearance.smoke * (0.6 + 0.4 * met.height) * appearance.daylight
    light = (between(*ends, met.chord) + day[None]) / appearance.white
    return jnp.concatenate([alpha[None] * light, alpha[None]])


def lumpy_depth(ball: Cloud, appearance: Appearance) -> Float[Array, ""]:
    r"""Return $\tau_0$: the optical depth along a diameter of smoke with gaps."""
    return -appearance.lumps * jnp.expm1(-ball.optical_depth / appearance.lumps)


def between(
    limb: Float[Array, "3"], middle: Float[Array, "3"], part: Float[Array, "row column"]
) -> Float[Array, "3 row column"]:
    """Return interpolated light: luminance geometrically, colour linearly.

    This is one exponential per pixel, instead of the hundreds of Planck's law.
    """
    lights = jnp.stack([limb, middle]) + FAINTEST
    brightness = luminance(lights)
    (low, high), (cool, hot) = jnp.log(brightness), lights / brightness[:, None]
    # colour apart from brightness: a mean of lights would take the hue of the brighter
    colour = cool[:, None, None] + (hot - cool)[:, None, None] * part[None]
    return jnp.exp(low + (high - low) * part)[None] * colour


def ball_tiles(ball: Cloud, corners: Rays) -> Bool[Array, "_ _"]:
    """Return the mask of the tiles that may show a fireball.

    A ray meets a fireball of the radius R at the distance d if its angle from the
    middle is less than arcsin(R/d). The rays of a tile are no farther from the nearest
    of its corners than these are from each other.

    Args:
        ball: The fireball.
        corners: Rays at the corners of the tiles.
    """
    direction = corners.direction
    # no ray of a tile is farther from the nearest corner than half a diagonal
    slope = _chord(direction[:, 1:, 1:], direction[:, :-1, :-1])
    other = _chord(direction[:, 1:, :-1], direction[:, :-1, 1:])
    size = (0.5 + SLACK) * jnp.maximum(slope, other)
    offset = ball.centre - corners.origin
    square = jnp.sum(jnp.square(offset))
    away = jnp.sqrt(jnp.where(square > 0.0, square, 1.0))
    middle = jnp.broadcast_to((offset / away)[:, None, None], direction.shape)
    nearest = over_corners(_chord(direction, middle), jnp.minimum)
    sine = ball.radius / away
    # camera inside the ball, which then covers every ray
    within = ~(sine < 1.0) | ~(square > 0.0)
    cosine = jnp.sqrt(1.0 - jnp.square(jnp.where(within, 0.0, sine)))
    # chords obey the triangle inequality; the sum is the chord of arcsin(R/d)
    seen = ~(nearest > sine * jnp.sqrt(2.0 / (1.0 + cosine)) + size)
    # negated comparisons: a NaN radius counts as visible
    return (seen | within | without_direction(corners)) & ~(ball.radius <= 0.0)


def _chord(a: Float[Array, "3 _ _"], b: Float[Array, "3 _ _"]) -> Float[Array, "_ _"]:
    square = jnp.sum(jnp.square(a - b), axis=0)
    some = square > 0.0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)
