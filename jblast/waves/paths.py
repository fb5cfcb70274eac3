"""Path from a charge to a sensor: all numbers on which a law may depend.

The arguments of every law are named after the fields of `Path`. `path_between` derives
them from the charge, air and ground of a scene and from positions or stated distances,
with the effective sound speed along the path, wind included.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.scene import Charge, Scene
from jblast.scene.charge import BURSTS, Burst
from jblast.scene.scene import GroundPath
from jblast.types import Module, as_float_array, field
from jblast.waves.height_of_burst import bursts_in_free_air
from jblast.waves.propagation import (
    air_density,
    ambient,
    effective_sound_speed,
    sound_speed_of,
)


def _optional() -> Any:
    return field(converter=as_float_array, default=math.nan)


def slant_range(
    source: Float[Array, "... axis"], sensor: Float[Array, "... axis"]
) -> Float[Array, "..."]:
    """Return the straight distance between two positions [m].

    Its gradient at distance zero is defined as zero. A NaN position gives NaN.
    """
    # axis by axis: a reduction over three numbers costs more than the rest of the path
    squared = jnp.square(sensor[..., 0] - source[..., 0])
    for axis in range(1, sensor.shape[-1]):
        squared += jnp.square(sensor[..., axis] - source[..., axis])
    apart = ~(squared <= 0)  # also where it is NaN
    # the guard is on the input of the root, whose slope at zero is infinite
    return jnp.where(apart, jnp.sqrt(jnp.where(apart, squared, 1.0)), 0.0)


class Path(Module):
    r"""One path from charge to sensor, or many: fields broadcast.

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
        time_since_detonation: Time of the row [s]; NaN if it has none.
        sensor_height: Height of the sensor above the ground [m].
        temperature: Air temperature [K].
        relative_humidity: Relative humidity, 0 to 1.
        toward_east: East component from sensor to charge [m]; 0 if only a range is
            given.
        toward_north: North component from sensor to charge [m].
        toward_up: Upward component from sensor to charge [m].
        fireball_growth: Time constant of the expansion of the fireball [s]; NaN for
            that of the law.
        camera_focal: Focal length of the camera of the scene [px]; NaN without one.
        burst: "surface" or "free-air"; None if `free_air` selects the curve set.
        free_air: True where the reflection from the ground follows the positive phase;
            None if `burst` is given.
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
    toward_east: Float[Array, "..."] = _optional()
    toward_north: Float[Array, "..."] = _optional()
    toward_up: Float[Array, "..."] = _optional()
    fireball_growth: Float[Array, "..."] = _optional()
    camera_focal: Float[Array, "..."] = _optional()
    free_air: Bool[Array, "..."] | None = None
    burst: Burst | None = field(static=True, default="surface")
    ground_path: GroundPath = field(static=True, default="head")

    def one_burst(self) -> Burst:
        """Return the common curve set of all positions.

        Raises:
            ValueError: `free_air` selects the curve set of each position.
        """
        if self.burst is None:
            raise ValueError(
                "expected a path with one burst, got one for each position"
            )
        return self.burst

    def at_burst(self, burst: Burst) -> "Path":
        """Return the same path with one curve set at all positions."""
        return replace(self, burst=burst, free_air=None)

    def by_height(self, answer: Callable[["Path"], Any]) -> Any:
        """Return a result with the curve set that the height selects at each position.

        Args:
            answer: Function of a path with one burst.
        """
        # both sets are evaluated, since the selection is by element
        surface, free_air = (answer(self.at_burst(burst)) for burst in BURSTS)
        high = False if self.free_air is None else self.free_air
        return jax.tree.map(lambda f, s: jnp.where(high, f, s), free_air, surface)


def path_between(
    scene: Scene,
    charge: Charge,
    position: Float[Array, "place 3"],
    stated_range: Float[Array, " place"],
    time_since_detonation: Float[Array, " place"],
) -> Path:
    """Return the paths from a charge to several positions.

    The sound speed is the effective one along the path, with wind. The mass is that of
    the explosive, since its TNT equivalence depends on the quantity.

    Args:
        scene: Scene with air and ground.
        charge: One charge of the scene. Its `range`, if it has one, is the distance of
            every position.
        position: East, north, up [m]; not used where `stated_range` is finite.
        stated_range: Distance from the charge [m]; NaN to use the position. If the
            height selects the curve set, the sensor is as low as the range allows.
        time_since_detonation: Requested time at each position [s]; NaN for none.
    """
    air = scene.air
    source = jnp.stack(charge.position_m)[None, :]
    given = jnp.isfinite(stated_range)
    slant = slant_range(source, position)
    ground = slant_range(source[:, :2], position[:, :2])
    if charge.range_m is not None:
        slant = ground = jnp.broadcast_to(charge.range_m, slant.shape)
    # A NaN of the unused branch would reach the gradient.
    stated = jnp.where(given, stated_range, 1.0)
    temperature, pressure = ambient(air)
    sound_speed = sound_speed_of(air)
    # axis by axis: a matrix product of two columns costs more than its sums
    along = (position[:, 0] - source[:, 0]) * air.wind_east
    along += (position[:, 1] - source[:, 1]) * air.wind_north
    along /= jnp.where(slant > 0, slant, 1.0)
    is_placed = ~given if charge.range_m is None else jnp.zeros_like(given)
    toward = jnp.where(is_placed[:, None], source - position, 0.0)
    unspecified = jnp.full((), jnp.nan)
    growth, camera = scene.fireball_growth, scene.camera
    if growth is not None:  # laws read a NaN growth as "not given", so the time is NaN
        time_since_detonation = jnp.where(
            jnp.isnan(growth), jnp.nan, time_since_detonation
        )
    distance = jnp.where(given, stated, slant)
    sensor_height = jnp.where(is_placed, position[:, 2], 0.0)
    free_air = None
    if charge.burst is None:
        lowest = jnp.maximum(charge.up - distance, 0.0)  # that the range allows
        free_air = bursts_in_free_air(
            distance,
            charge.tnt_mass("peak_overpressure_pa"),
            charge.up,
            jnp.where(is_placed, position[:, 2], lowest),
            pressure,
            sound_speed,
        )
    return Path(
        slant_range=distance,
        ground_range=jnp.where(given, stated, ground),
        charge_mass=charge.mass_kg,
        height_of_burst=charge.up,
        ambient_pressure=pressure,
        sound_speed=effective_sound_speed(
            sound_speed, jnp.where(is_placed, along, 0.0)
        ),
        air_density=air_density(temperature, pressure, air.relative_humidity),
        p_speed=scene.ground.p_speed,
        sedov_gamma=scene.sedov_gamma,
        time_since_detonation=time_since_detonation,
        sensor_height=sensor_height,
        temperature=temperature,
        relative_humidity=air.relative_humidity,
        toward_east=toward[:, 0],
        toward_north=toward[:, 1],
        toward_up=toward[:, 2],
        fireball_growth=unspecified if growth is None else growth,
        # with two focal lengths a circle becomes an ellipse: the mean keeps its area
        camera_focal=(
            unspecified if camera is None else jnp.sqrt(jnp.prod(camera.focal))
        ),
        free_air=free_air,
        burst=charge.burst,
        ground_path=scene.ground.path,
    )
