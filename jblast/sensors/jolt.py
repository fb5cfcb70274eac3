r"""The jolt that a blast gives the scene's vehicle, and its laws.

$\Delta v = \tfrac1m \int F\,dt$ over the whole wave, of the load that flights go
through (`vehicle.loads.blast`), on a vehicle that hovers at the sensor's place, in
the scene's wind tilted against it, with the heading of the scene's. Of a range alone it
is as from a charge level with the vehicle.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import InputError
from jblast.quantities import BY_VEHICLE
from jblast.registry import Law, declared_scatter, mark_packaged, register
from jblast.scene import Charge, Scene
from jblast.scene.charge import BURSTS, Burst
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.paths import Path
from jblast.waves.propagation import ambient, sound_speed_of
from jblast.waves.scaling import scaled_distance


def with_jolts(
    path: Path, scene: Scene, charge: Charge, quantity: Sequence[str]
) -> Path:
    """Return a path with the jolts at its rows of which one is asked for.

    Args:
        path: From a charge to every row.
        scene: Has vehicle and air.
        charge: What the path is from.
        quantity: Of each row.

    Raises:
        InputError: A jolt is asked for, and there is no vehicle.
    """
    rows = np.flatnonzero(np.isin(quantity, BY_VEHICLE))
    if not rows.size:
        return path
    if scene.vehicle is None:
        raise InputError(
            f"{quantity[rows[0]]}: expected a [vehicle] in the scene, which is what "
            "is jolted; got none"
        )
    spec = scene.vehicle

    def jolts(way: Path) -> Float[Array, "row 3"]:
        toward = jnp.stack([way.toward_east, way.toward_north, way.toward_up], axis=-1)
        range_alone = ~jnp.any(toward != 0, axis=-1)
        east = jnp.zeros_like(toward).at[:, 0].set(way.slant_range)
        place = jnp.where(range_alone[:, None], east, -toward)[rows]
        return jax.vmap(
            lambda at: _jolt(at, scene, charge, spec.model, spec.yaw, way.one_burst())
        )(place)

    if path.burst is not None:
        found = jolts(path)
    else:
        surface, in_free_air = (jolts(path.at_burst(burst)) for burst in BURSTS)
        high = False if path.free_air is None else path.free_air[rows][:, None]
        found = jnp.where(high, in_free_air, surface)
    blank = jnp.full(len(quantity), jnp.nan)
    east, north, up = (blank.at[rows].set(column) for column in found.T)
    return replace(path, jolt_east=east, jolt_north=north, jolt_up=up)


def _jolt(
    place: Float[Array, "3"],
    scene: Scene,
    charge: Charge,
    model: str,
    yaw: Float[Array, ""],
    burst: Burst,
) -> Float[Array, "3"]:
    """Return the jolt of a vehicle at a place, as seen from the charge."""
    # who fits no jolt imports no vehicle
    from jblast.vehicle import named
    from jblast.vehicle.control.allocation import hover_in_wind
    from jblast.vehicle.loads.blast import jolt_velocity
    from jblast.vehicle.loads.blast_wave import Blast, Surroundings

    blast = Blast(
        position_m=jnp.zeros(3),
        time_s=jnp.zeros(()),
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        burst=burst,
    )
    air = scene.air
    wind = jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east])
    around = Surroundings(ambient(air)[1], sound_speed_of(air), wind)
    with jax.ensure_compile_time_eval():
        vehicle = named(model)
    state = hover_in_wind(vehicle, place, yaw, wind)
    return jolt_velocity(blast, around, vehicle, state)


def jolt_speed(
    jolt_east: Float[ArrayLike, "..."],
    jolt_north: Float[ArrayLike, "..."],
    jolt_up: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return the size of a jolt [m/s].

    Args:
        jolt_east: Change of velocity [m/s].
        jolt_north: Likewise [m/s].
        jolt_up: Likewise [m/s].
    """
    return _length(*as_float_arrays(jolt_east, jolt_north, jolt_up))


def jolt_bearing(
    jolt_east: Float[ArrayLike, "..."], jolt_north: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    r"""Return whereto a jolt points, clockwise from north [rad], 0 to $2\pi$.

    One straight up or down has no bearing: zero is returned, with no slope.

    Args:
        jolt_east: Change of velocity [m/s].
        jolt_north: Likewise [m/s].
    """
    east, north = as_float_arrays(jolt_east, jolt_north)
    aside = (east != 0) | (north != 0)
    angle = jnp.arctan2(jnp.where(aside, east, 0.0), jnp.where(aside, north, 1.0))
    return jnp.mod(angle, 2 * math.pi)


def jolt_elevation(
    jolt_east: Float[ArrayLike, "..."],
    jolt_north: Float[ArrayLike, "..."],
    jolt_up: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return how steeply a jolt points up [rad]: rotors lift in a blast wind.

    Args:
        jolt_east: Change of velocity [m/s].
        jolt_north: Likewise [m/s].
        jolt_up: Likewise [m/s].
    """
    east, north, up = as_float_arrays(jolt_east, jolt_north, jolt_up)
    level = _length(east, north)
    moved = (level > 0) | (up != 0)
    return jnp.arctan2(jnp.where(moved, up, 0.0), jnp.where(moved, level, 1.0))


def jolt_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."],
    burst: Burst,
) -> Bool[Array, "..."]:
    """Return True where all laws of the load hold."""
    from jblast.vehicle.loads.blast_wave import RANGE

    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first, last = RANGE[burst]
    return (z >= first) & (z <= last)


def _length(*parts: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the size of a vector; its slope at nothing is zero, not NaN."""
    square = as_float_array(sum(part * part for part in parts))
    some = ~(square <= 0)  # what is no number is not nothing
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


SCATTER = {
    "jolt_velocity_m_s": (jolt_speed, 0.15, 0.15),
    "jolt_bearing_rad": (jolt_bearing, 0.0, 0.02),
    "jolt_elevation_rad": (jolt_elevation, 0.05, 0.02),
}
"""Each law, and what a shot and a record scatter. Nobody has measured it: an impulse
goes about as pressure times impulse of the air, 10 % each of a shot and of a record.
The lift of rotors in a blast wind, by which a jolt rises, is carried far beyond where
its coefficient was fitted."""

mark_packaged(
    *(
        register(
            Law(
                quantity=quantity,
                name="blast_load",
                function=function,
                range="Z = 0.178 to 40 m/kg^(1/3); in free air 0.147 to 37",
                source="the load that flights go through, on a vehicle that hovers",
                valid=jolt_valid,
                scatter=declared_scatter(shot=of_shot, record=of_record),
                scatter_source="declared",
            )
        )
        for quantity, (function, of_shot, of_record) in SCATTER.items()
    )
)
