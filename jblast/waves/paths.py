"""What lies between a charge and a sensor: everything a law may depend on."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.scene.charge import BURSTS, Burst
from jblast.scene.ground import GroundPath
from jblast.types import as_float_array


def _untold() -> Any:
    return eqx.field(converter=as_float_array, default=math.nan)


class Path(eqx.Module):
    r"""One way from charge to sensor, or many at once: fields broadcast.

    A law's arguments are named after these fields.

    Attributes:
        slant_range: Straight distance $R$ [m].
        ground_range: Distance along the ground [m].
        charge_mass: TNT-equivalent mass $W$ [kg].
        height_of_burst: Height above ground [m]; negative is buried.
        ambient_pressure: $P_0$ [Pa].
        sound_speed: $c_0$ [m/s].
        air_density: $\rho_0$ [kg/m3].
        p_speed: P-wave speed of the ground $c_s$ [m/s].
        sedov_gamma: Ratio of specific heats behind a strong shock [-].
        time_since_detonation: When the row was taken [s]; NaN where it has no time.
        sensor_height: Height of the sensor above the ground [m].
        temperature: Of the air [K].
        relative_humidity: Of the air, fraction, 0 to 1.
        toward_east: From the sensor to the charge [m]; 0 where a range alone is told.
        toward_north: Likewise [m].
        toward_up: Likewise [m].
        fireball_growth: Time constant of the fireball's expansion [s]; NaN for the
            law's own.
        camera_focal: Focal length of the scene's camera [px]; NaN without one.
        jolt_east: What the blast changes of the velocity of a vehicle there [m/s];
            NaN where that is not asked for.
        jolt_north: Likewise [m/s].
        jolt_up: Likewise [m/s].
        burst: "surface" or "free-air"; None where `free_air` tells.
        free_air: Whether the reflection from the ground comes too late to matter, by
            place; None where `burst` is told.
        ground_path: "head" (along the ground) or "thesis" (ground leg, then up).
    """

    slant_range: Float[Array, "..."]
    ground_range: Float[Array, "..."]
    charge_mass: Float[Array, "..."]
    height_of_burst: Float[Array, "..."]
    ambient_pressure: Float[Array, "..."]
    sound_speed: Float[Array, "..."]
    air_density: Float[Array, "..."]
    p_speed: Float[Array, "..."]
    sedov_gamma: Float[Array, "..."]
    time_since_detonation: Float[Array, "..."]
    sensor_height: Float[Array, "..."]
    temperature: Float[Array, "..."]
    relative_humidity: Float[Array, "..."]
    toward_east: Float[Array, "..."] = _untold()
    toward_north: Float[Array, "..."] = _untold()
    toward_up: Float[Array, "..."] = _untold()
    fireball_growth: Float[Array, "..."] = _untold()
    camera_focal: Float[Array, "..."] = _untold()
    jolt_east: Float[Array, "..."] = _untold()
    jolt_north: Float[Array, "..."] = _untold()
    jolt_up: Float[Array, "..."] = _untold()
    free_air: Bool[Array, "..."] | None = None
    burst: Burst | None = eqx.field(static=True, default="surface")
    ground_path: GroundPath = eqx.field(static=True, default="head")

    def one_burst(self) -> Burst:
        """Return the curve set of every place.

        Raises:
            ValueError: `free_air` tells of each place for itself.
        """
        if self.burst is None:
            raise ValueError("expected a path with one burst, got one of each place")
        return self.burst

    def at_burst(self, burst: Burst) -> "Path":
        """Return the same with one curve set at all places."""
        return replace(self, burst=burst, free_air=None)

    def by_height(self, answer: Callable[["Path"], Any]) -> Any:
        """Return an answer by the curve set that the height leaves, place by place."""
        surface, free_air = (answer(self.at_burst(burst)) for burst in BURSTS)
        high = False if self.free_air is None else self.free_air
        return jax.tree.map(lambda f, s: jnp.where(high, f, s), free_air, surface)


def slant_range(
    source: Float[Array, "... axis"], sensor: Float[Array, "... axis"]
) -> Float[Array, "..."]:
    """Return the straight distance between two places [m].

    Its gradient at distance zero is defined, as zero. From a place that is no number it
    is none either.
    """
    # axis by axis: a reduction of so few numbers costs more than the rest of the path
    squared = jnp.square(sensor[..., 0] - source[..., 0])
    for axis in range(1, sensor.shape[-1]):
        squared += jnp.square(sensor[..., axis] - source[..., axis])
    apart = ~(squared <= 0)  # NaN is no place, and no distance of zero
    return jnp.where(apart, jnp.sqrt(jnp.where(apart, squared, 1.0)), 0.0)
