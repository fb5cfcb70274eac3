r"""The sun in a sky: an even disc, and glare around it.

Full scale is a white wall in the daylight $E$. A disc of half the angle $r$ that alone
gives $E$ to what faces it is, over that wall's $E/\pi$, as bright as

$$L = 1/\sin^2 r$$

A pixel that is wider than the disc sees as much of it: the disc is drawn at least two
pixels wide, and fainter by as much. Around it is glare, of lens and air, by the law of
Stiles and Holladay for the eye, $10\,E/\theta^2$ in cd/m2 at the angle $\theta$ in
degrees: declared for a camera, and no brighter towards the middle than at the limb.

References:
    Holladay (1926), J. Opt. Soc. Am. 12: 271; Stiles (1929), Proc. R. Soc. B 104: 322.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.types import as_float_array

RADIUS = math.radians(0.53 / 2)
"""Half the angle of the sun's disc [rad]."""

GLARE = 10.0 * math.pi
"""Of Stiles and Holladay, over a white wall's light [deg2]."""


class Sun(eqx.Module):
    """A sun without a colour.

    Attributes:
        direction: East, north, up, of length one.
    """

    direction: Float[Array, "3"] = eqx.field(converter=as_float_array)

    def light(
        self, direction: Float[Array, "3 row column"], pixel: Float[Array, ""]
    ) -> Float[Array, "row column"]:
        """Return what it adds to the light of the sky, full scale 1.

        Args:
            direction: Of rays, of length one.
            pixel: Angle of one [rad].
        """
        away = direction - self.direction.astype(direction.dtype)[:, None, None]
        square = jnp.sum(jnp.square(away), axis=0)
        # the chord keeps its digits near the middle, where the cosine has none
        chord = jnp.sqrt(jnp.maximum(square, jnp.finfo(square.dtype).tiny))
        angle = 2.0 * jnp.arcsin(jnp.minimum(0.5 * chord, 1.0))
        radius = jnp.maximum(RADIUS, pixel)
        disc = jnp.clip((radius - angle) / pixel + 0.5, 0.0, 1.0)
        # over the area of a disc whose edge falls off within a pixel
        area = jnp.square(radius) + jnp.square(pixel) / 12.0
        bright = (RADIUS / math.sin(RADIUS)) ** 2 / area
        limb = math.degrees(RADIUS)
        apart = jnp.maximum(jnp.degrees(angle), limb)
        return bright * disc + GLARE / jnp.square(apart)


def sun_at(azimuth_deg: float, elevation_deg: float) -> Sun:
    """Return the sun at an azimuth, clockwise from north, and at a height [deg].

    Raises:
        InputError: It is below the horizon or past the zenith, or a number is none.
    """
    if not math.isfinite(azimuth_deg):
        raise InputError(f"sun: expected an azimuth in degrees, got {azimuth_deg!r}")
    if not 0.0 <= elevation_deg <= 90.0:
        raise InputError(
            f"sun: expected an elevation from 0 to 90 degrees, got {elevation_deg!r}"
        )
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    level = math.cos(elevation)
    return Sun(
        jnp.array(
            [
                level * math.sin(azimuth),
                level * math.cos(azimuth),
                math.sin(elevation),
            ]
        )
    )
