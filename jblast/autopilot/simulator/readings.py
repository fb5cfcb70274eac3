"""What a simulator tells an autopilot, as the numbers of its messages.

Units, axes and bits are those of MAVLink's HIL messages as PX4 reads them
(PX4-Autopilot, SimulatorMavlink.cpp and .hpp, commits 000f5fd and 002cb24): fields that
are whole numbers are rounded to them, those in single precision lose their digits as
they are packed. Temperature comes with the barometer.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.autopilot.simulator import axes
from jblast.autopilot.simulator.geodesy import Origin, geodetic_of, level_of
from jblast.constants import STANDARD_GRAVITY
from jblast.sensors.carried.barometer import height_of
from jblast.sensors.carried.suite import Sample
from jblast.vehicle import State

INERTIAL, FIELD, AIR = 0b111111, 0b111000000, 0b1101000000000
"""Bits of `fields_updated`: accelerometer and gyroscope, magnetometer, barometer with
its temperature."""
SENSOR = (
    *("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag"),
    *("abs_pressure", "pressure_alt", "temperature", "fields_updated"),
)
FIX = ("lat", "lon", "alt", "eph", "epv", "vel", "vn", "ve", "vd", "cog")
STATE = (
    *("q0", "q1", "q2", "q3", "rollspeed", "pitchspeed", "yawspeed", "lat", "lon"),
    *("alt", "vx", "vy", "vz", "ind_airspeed", "true_airspeed", "xacc", "yacc", "zacc"),
)
MOST_16 = 32_767.0


class Readings(NamedTuple):
    """Numbers of three messages, in the order of `SENSOR`, `FIX` and `STATE`.

    Attributes:
        sensor: Of HIL_SENSOR.
        fix: Of HIL_GPS.
        state: Of HIL_STATE_QUATERNION.
        has_fix: Whether a fix comes at this turn: 1 or 0.
    """

    sensor: Float[Array, "13"]
    fix: Float[Array, "10"]
    state: Float[Array, "18"]
    has_fix: Float[Array, ""]


def readings_of(
    origin: Origin,
    sample: Sample,
    now: State,
    air_velocity_m_s: Float[Array, "3"],
    temperature_k: Float[Array, ""],
    noise_m: Float[Array, "6"],
) -> Readings:
    """Return what is told of a sample and of the vehicle's true state.

    Args:
        origin: Where the scene lies.
        sample: Of the instruments.
        now: The vehicle.
        air_velocity_m_s: Of the wind, east, north, up.
        temperature_k: Of the air.
        noise_m: One standard deviation of the numbers of a fix.
    """
    updated = INERTIAL + jnp.where(sample.has_field, FIELD, 0)
    updated = updated + jnp.where(sample.has_pressure, AIR, 0)
    standard = height_of(sample.pressure_pa, *map(jnp.asarray, (101_325.0, 288.15)))
    force, rate = axes.body(sample.force_m_s2), axes.body(sample.rate_rad_s)
    sensor = [
        *(*force, *rate, *axes.body(sample.field_gauss)),
        *(sample.pressure_pa / 100, standard, temperature_k - 273.15, updated),
    ]
    moves = axes.world(sample.fix.velocity_m_s)
    course = jnp.degrees(jnp.arctan2(moves[1], moves[0])) % 360
    fix = [
        *_geodetic_whole(origin, sample.fix.position_m),
        *_whole(noise_m[jnp.array([0, 2])] * 100),
        jnp.round(100 * jnp.linalg.norm(moves[:2])),
        *_whole(100 * moves),
        jnp.round(100 * course) % 36_000,
    ]
    return Readings(
        jnp.stack([jnp.asarray(x, float) for x in sensor]),
        jnp.stack([jnp.asarray(x, float) for x in fix]),
        state_reported(origin, now, force, air_velocity_m_s),
        sample.has_fix.astype(float),
    )


def state_reported(
    origin: Origin,
    now: State,
    force_m_s2: Float[Array, "3"],
    air_velocity_m_s: Float[Array, "3"],
) -> Float[Array, "18"]:
    """Return the numbers of HIL_STATE_QUATERNION.

    Args:
        origin: Where the scene lies.
        now: The vehicle.
        force_m_s2: Specific force, the autopilot's body axes.
        air_velocity_m_s: Of the wind.
    """
    through = jnp.linalg.norm(now.velocity_m_s - air_velocity_m_s)
    speed = jnp.round(100 * through)
    single = [*axes.attitude_out(now.quaternion), *axes.body(now.body_rate_rad_s)]
    return jnp.stack(
        [
            *(jnp.asarray(x, jnp.float32).astype(float) for x in single),
            *_geodetic_whole(origin, now.position_m),
            *_whole(100 * axes.world(now.velocity_m_s)),
            *(speed, speed),
            *_whole(1000 / STANDARD_GRAVITY * force_m_s2),
        ]
    )


def state_heard(
    origin: Origin, reported: Float[Array, "18"], rotor_speed_rad_s: Float[Array, "4"]
) -> State:
    """Return the state that the numbers of HIL_STATE_QUATERNION tell.

    Args:
        origin: Where the scene lies.
        reported: The numbers.
        rotor_speed_rad_s: Which they do not tell.
    """
    lat_lon_alt = reported[7:10] * jnp.array([1e-7, 1e-7, 1e-3])
    return State(
        level_of(origin, lat_lon_alt),
        axes.world(reported[10:13] / 100),
        axes.attitude_in(reported[:4]),
        axes.body(reported[4:7]),
        rotor_speed_rad_s,
    )


def _geodetic_whole(origin: Origin, place_m: Float[Array, "3"]) -> list[Array]:
    """Return latitude and longitude [1e-7 degree], height [mm]."""
    return [*jnp.round(geodetic_of(origin, place_m) * jnp.array([1e7, 1e7, 1e3]))]


def _whole(numbers: Float[Array, " n"]) -> list[Array]:
    return [*jnp.clip(jnp.round(numbers), -MOST_16, MOST_16)]
