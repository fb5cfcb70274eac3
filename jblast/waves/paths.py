"""Path from a charge to a sensor: all numbers on which a law may depend.

The arguments of every law are named after the fields of `Path`. `path_between` derives
them from the charge, air and ground of a scene and from positions or stated distances,
with the effective sound speed along the path, wind included.
"""

import math
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from jblast.registry import call, law_for, names_for, total_scatter
from jblast.scene import Charge, Scene
from jblast.scene.charge import Burst
from jblast.scene.scene import GroundPath
from jblast.types import Array, Bool, Float, Module, as_numbers, field, namespace
from jblast.waves.height_of_burst import free_air_weight
from jblast.waves.propagation import (
    air_density,
    ambient,
    effective_sound_speed,
    sound_speed_of,
)


def _optional() -> Any:
    return field(converter=as_numbers, default=math.nan)


def slant_range(
    source: Float[Any, "... axis"], sensor: Float[Any, "... axis"]
) -> Float[Array, "..."]:
    """Return the straight distance between two positions [m], on the last axis.

    Its gradient at distance zero is defined as zero. A NaN position gives NaN.
    """
    xp = namespace(source, sensor)
    # axis by axis: a reduction over three numbers costs more than the rest of the path
    squared = xp.square(sensor[..., 0] - source[..., 0])
    for axis in range(1, sensor.shape[-1]):
        squared = squared + xp.square(sensor[..., axis] - source[..., axis])
    apart = ~(squared <= 0)  # also where it is NaN
    # the guard is on the input of the root, whose slope at zero is infinite
    return xp.where(apart, xp.sqrt(xp.where(apart, squared, 1.0)), 0.0)


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
        jolt_east: Change of velocity of the vehicle to the east [m/s]; NaN: none known.
        jolt_north: Change of velocity of the vehicle to the north [m/s].
        jolt_up: Change of velocity of the vehicle upwards [m/s].
        burst: "surface" or "free-air"; None for the mean with the weight `free_air`.
        free_air: Weight of the free-air curves: 1 where the reflection from the ground
            follows the positive phase, 0 where it is far inside it.
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
    jolt_east: Float[Array, "..."] = _optional()
    jolt_north: Float[Array, "..."] = _optional()
    jolt_up: Float[Array, "..."] = _optional()
    free_air: Float[Array, "..."] = field(converter=as_numbers, default=0.0)
    burst: Burst | None = field(static=True, default="surface")
    ground_path: GroundPath = field(static=True, default="head")


def path_between(
    scene: Scene,
    charge: Charge,
    position: Float[Any, "place 3"],
    stated_range: Float[Any, " place"],
    time_since_detonation: Float[Any, " place"],
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
    xp = namespace(position, stated_range, time_since_detonation, charge.mass_kg)
    source = xp.stack(charge.position_m)[None, :]
    given = xp.isfinite(stated_range)
    slant = slant_range(source, position)
    ground = slant_range(source[:, :2], position[:, :2])
    if charge.range_m is not None:
        slant = ground = xp.broadcast_to(charge.range_m, slant.shape)
    # A NaN of the unused branch would reach the gradient.
    stated = xp.where(given, stated_range, 1.0)
    temperature, pressure = ambient(air)
    sound_speed = sound_speed_of(air)
    # axis by axis: a matrix product of two columns costs more than its sums
    along = (position[:, 0] - source[:, 0]) * air.wind_east
    along += (position[:, 1] - source[:, 1]) * air.wind_north
    along /= xp.where(slant > 0, slant, 1.0)
    is_placed = ~given if charge.range_m is None else xp.zeros_like(given)
    toward = xp.where(is_placed[:, None], source - position, 0.0)
    unspecified = xp.full((), xp.nan)
    growth, camera = scene.fireball_growth, scene.camera
    if growth is not None:  # laws read a NaN growth as "not given", so the time is NaN
        time_since_detonation = xp.where(
            xp.isnan(growth), xp.nan, time_since_detonation
        )
    distance = xp.where(given, stated, slant)
    sensor_height = xp.where(is_placed, position[:, 2], 0.0)
    free_air = 0.0
    if charge.burst is None:
        lowest = xp.maximum(charge.up - distance, 0.0)  # that the range allows
        free_air = free_air_weight(
            distance,
            charge.tnt_mass("peak_overpressure_pa"),
            charge.up,
            xp.where(is_placed, position[:, 2], lowest),
            pressure,
            sound_speed,
        )
    return Path(
        slant_range=distance,
        ground_range=xp.where(given, stated, ground),
        charge_mass=charge.mass_kg,
        height_of_burst=charge.up,
        ambient_pressure=pressure,
        sound_speed=effective_sound_speed(sound_speed, xp.where(is_placed, along, 0.0)),
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
            unspecified if camera is None else xp.sqrt(xp.prod(camera.focal))
        ),
        free_air=free_air,
        burst=charge.burst,
        ground_path=scene.ground.path,
    )


class Evaluated(NamedTuple):
    """All laws of a quantity on a path.

    Attributes:
        names: Name of each law, in the order of registration.
        value: Value of each law and row.
        valid: True where the law is valid.
        sd: Scatter of real blasts about the law: of `registry.total_scatter`.
    """

    names: tuple[str, ...]
    value: Float[Any, "law ..."]
    valid: Bool[Any, "law ..."]
    sd: Float[Any, "law ..."]


def evaluate(quantity: str, path: Path) -> Evaluated:
    """Evaluate all laws of a quantity: in NumPy, or as one program of JAX.

    Args:
        quantity: A quantity with laws.
        path: Numbers of the path, single or one for each row. If one of them is an
            array of JAX, the laws are those of JAX.
    """
    if namespace(*vars(path).values()) is np:
        with np.errstate(all="ignore"):  # of laws far outside their ranges
            return _evaluated(quantity, path)
    return _program()(quantity, path)


@cache
def _program() -> Callable[[str, Path], Evaluated]:
    from jblast.kept_programs import kept  # at the first use: it imports JAX

    return kept(_evaluated)


def _evaluated(quantity: str, path: Path) -> Evaluated:
    laws = [law_for(quantity, name) for name in names_for(quantity)]
    numbers = [x for x in vars(path).values() if not isinstance(x, str | None)]
    xp, shape = namespace(*numbers), np.broadcast_shapes(*map(np.shape, numbers))

    def rows(results: Iterable[Any]) -> Any:
        return xp.stack([xp.broadcast_to(xp.asarray(x), shape) for x in results])

    return Evaluated(
        tuple(law.name for law in laws),
        rows(call(law.function, path) for law in laws),
        rows(call(law.valid, path) for law in laws),
        rows(total_scatter(law, path) for law in laws),
    )
