r"""The jolt of the scene's vehicle: its change of velocity by a blast.

$\Delta v = \tfrac1m \int F\,dt$ over the whole wave. The load $F$ is that of simulated
flights (`vehicle.loads.blast`), on a vehicle that hovers at the sensor's position in
the scene's wind, tilted against it, with the scene's heading. If a row states only a
range, the charge is level with the vehicle. Laws of a jolt have its components as
arguments, which the forward model puts into their path.
"""

import math

import jax
import jax.numpy as jnp

from jblast.errors import require
from jblast.registry import Law, declared_scatter, mark_packaged, register
from jblast.scene import Charge, Scene
from jblast.scene.charge import Burst
from jblast.types import Array, Bool, Float, namespace
from jblast.waves.paths import Path
from jblast.waves.propagation import ambient, sound_speed_of
from jblast.waves.scaling import scaled_distance


def jolts(scene: Scene, charge: Charge, path: Path) -> Float[Array, "row 3"]:
    """Return the jolt at each row of a path: east, north, up [m/s].

    Args:
        scene: Its vehicle and air are used.
        charge: Origin of the path.
        path: Paths to the vehicle.

    Raises:
        InputError: The scene has no vehicle.
    """
    needed = "a [vehicle], whose velocity changes"
    require(scene.vehicle is not None, "scene with a jolt", needed, "none")
    toward = jnp.stack([path.toward_east, path.toward_north, path.toward_up], axis=-1)
    # a range without direction: the vehicle is placed east of the charge, at its height
    range_alone = ~jnp.any(toward != 0, axis=-1)
    east = jnp.zeros_like(toward).at[:, 0].set(path.slant_range)
    place = jnp.where(range_alone[:, None], east, -toward)

    free_air = float(path.burst == "free-air") if path.burst else path.free_air
    weight = jnp.broadcast_to(free_air, len(place)).astype(place.dtype)
    return jax.vmap(lambda at, high: _jolt(at, scene, charge, high))(place, weight)


def _jolt(
    place: Float[Array, "3"], scene: Scene, charge: Charge, free_air: Float[Array, ""]
) -> Float[Array, "3"]:
    """Return the jolt of the vehicle at a position relative to the charge."""
    # imported here: most logs have no jolts, and the vehicle is slow to import
    from jblast.vehicle import BlastLoad, named
    from jblast.vehicle.control.allocation import hover_in_wind
    from jblast.vehicle.loads.blast_wave import Blast

    blast = Blast(
        position_m=jnp.zeros(3),
        time_s=jnp.zeros(()),
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        free_air=free_air,
    )
    air, spec = scene.air, scene.vehicle
    assert spec is not None
    wind = jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east])
    # the model is a constant: evaluated at once, not traced into the program
    with jax.ensure_compile_time_eval():
        vehicle = named(spec.model)
    load = BlastLoad(
        waves=jax.tree.map(lambda x: x[None], blast),
        charges=1,
        pressure_pa=ambient(air)[1],
        sound_speed_m_s=sound_speed_of(air),
        wind_m_s=wind,
    )
    state = hover_in_wind(vehicle, place, spec.yaw, wind)
    begins_s, ends_s = load.span_s(place, vehicle)
    push, _ = load.impulse(begins_s[0], ends_s[0], state, vehicle)
    return push / vehicle.mass_kg


def jolt_speed(
    jolt_east: Float[Array, "..."],
    jolt_north: Float[Array, "..."],
    jolt_up: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return the magnitude of a jolt [m/s].

    Args:
        jolt_east: Change of velocity to the east [m/s].
        jolt_north: Change of velocity to the north [m/s].
        jolt_up: Change of velocity upwards [m/s].
    """
    return _length(jolt_east, jolt_north, jolt_up)


def jolt_bearing(
    jolt_east: Float[Array, "..."], jolt_north: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""Return the direction of a jolt, clockwise from north [rad], 0 to $2\pi$.

    A vertical jolt has no bearing: zero is returned, with zero slope.

    Args:
        jolt_east: Change of velocity to the east [m/s].
        jolt_north: Change of velocity to the north [m/s].
    """
    xp = namespace(jolt_east)
    # atan2(0, 0) has a NaN gradient
    aside = (jolt_east != 0) | (jolt_north != 0)
    angle = xp.atan2(xp.where(aside, jolt_east, 0.0), xp.where(aside, jolt_north, 1.0))
    return angle % (2 * math.pi)


def jolt_elevation(
    jolt_east: Float[Array, "..."],
    jolt_north: Float[Array, "..."],
    jolt_up: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return the elevation of a jolt [rad]: rotors lift in a blast wind.

    Args:
        jolt_east: Change of velocity to the east [m/s].
        jolt_north: Change of velocity to the north [m/s].
        jolt_up: Change of velocity upwards [m/s].
    """
    xp, level = namespace(jolt_up), _length(jolt_east, jolt_north)
    moved = (level > 0) | (jolt_up != 0)
    return xp.atan2(xp.where(moved, jolt_up, 0.0), xp.where(moved, level, 1.0))


def _length(*parts: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the length of a vector, with zero slope (not NaN) at zero length."""
    xp, square = namespace(*parts), sum(part * part for part in parts)
    some = ~(square <= 0)  # negated: NaN stays NaN
    return xp.where(some, xp.sqrt(xp.where(some, square, 1.0)), 0.0)


def jolt_valid(
    slant_range: Float[Array, "..."],
    charge_mass: Float[Array, "..."],
    ambient_pressure: Float[Array, "..."],
    burst: Burst,
) -> Bool[Array, "..."]:
    """Return True where all laws of the load hold."""
    from jblast.vehicle.loads.blast_wave import RANGE

    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first, last = RANGE[burst]
    return (z >= first) & (z <= last)


SCATTER = {
    "jolt_velocity_m_s": (jolt_speed, 0.15, 0.15),
    "jolt_bearing_rad": (jolt_bearing, 0.0, 0.02),
    "jolt_elevation_rad": (jolt_elevation, 0.05, 0.02),
}
"""Function of each law, and its scatter of a shot and of a record. It has not been
measured. An impulse scatters about as pressure times impulse of the air, 10 % each per
shot and per record. The lift of rotors in a blast wind, which determines the
elevation, is extrapolated far beyond the fit of its coefficient."""
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
