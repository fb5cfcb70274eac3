"""A scene's vehicle as one that an autopilot flies in the scene's blasts."""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.autopilot.simulator.geodesy import origin_at
from jblast.autopilot.simulator.stepping import PERIOD_S, Turns
from jblast.errors import InputError
from jblast.scene import Imu, Place, Scene, VehicleSpec
from jblast.sensors.carried.magnetometer import Magnetometer, dipole_field
from jblast.sensors.carried.suite import Suite
from jblast.vehicle import BlastLoad, StepGust, blast_load, start_of, vehicle_of
from jblast.vehicle.rollout.flight import Flight
from jblast.waves.propagation.ambient import ambient

PLACE = Place(47.397742, 8.545594, 0.0)
"""Where the origin lies if the scene does not say: PX4's default home, at sea level."""


def suite_of(scene: Scene, place: Place | None, load: object, rate: float) -> Suite:
    """Return the instruments of a scene's vehicle.

    Args:
        scene: Its air, and its wind.
        place: Where its origin lies; None: at `PLACE`.
        load: Of the blasts, whose overpressure the barometer feels; one that is not
            of jblast's own laws has none.
        rate: Of their turns [Hz].
    """
    where = PLACE if place is None else place
    temperature, pressure = ambient(scene.air)
    return Suite(
        Magnetometer(dipole_field(where.lat_deg, where.lon_deg)),
        imu=Imu(rate=rate, bits=None),
        ground_pressure_pa=pressure,
        ground_temperature_k=temperature,
        wind_m_s=wind_of(scene),
        blasts=load if isinstance(load, BlastLoad) else None,
    )


def wind_of(scene: Scene) -> Float[Array, "3"]:
    """Return the velocity of a scene's air: east, north, up [m/s]."""
    air = scene.air
    return jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east])


def turns_of(
    scene: Scene, spec: VehicleSpec, place: Place | None, seed: int, source: str = ""
) -> Turns:
    """Return the turns of a scene's vehicle, rotors at rest where it stands.

    Args:
        scene: What is there, without a number that is not known.
        spec: The vehicle.
        place: Where the origin lies; None: at `PLACE`.
        seed: Of the instruments' draws.
        source: The scene's file, for messages.

    Raises:
        InputError: The vehicle starts below ground.
    """
    if float(spec.position[2]) < 0:
        raise InputError(
            f"{source or 'scene'}: [vehicle] position_m: expected a vehicle that is "
            f"not below ground, got up {float(spec.position[2]):g} m"
        )
    vehicle, load = vehicle_of(spec), blast_load(scene)
    start = start_of(spec)
    if float(spec.position[2]) == 0:
        start = replace(start, rotor_speed_rad_s=0 * start.rotor_speed_rad_s)
    wind = wind_of(scene)
    flight = Flight(
        vehicle, start, None, None, StepGust(wind, 0 * wind[0]), (load,), jnp.zeros(())
    )
    suite = suite_of(scene, place, load, 1 / PERIOD_S)
    where = PLACE if place is None else place
    return Turns(flight, suite, origin_at(where), jax.random.key(seed))
