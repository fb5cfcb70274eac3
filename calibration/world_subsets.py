"""The worlds of the round trip, and the subsets of their readings.

Three stations about the place see the flash, feel the ground, hear the bang and its
peak; a vehicle that hovers beside it, in worlds of the same blasts, sees the flash and
is jolted (when, how much and whereto, by what its IMU leaves of it).
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.posterior.parameters import Parameters
from jblast.scene.uncertain import Belief

RECORDS = {
    "flash_time_s": 1e-3,
    "ground_arrival_s": 1e-3,
    "air_arrival_s": 1e-3,
    "peak_overpressure_pa": "5%",
}
PLACES = {"east": [50, 0, 1.5], "north": [-20, 45, 1.5], "west": [-30, -40, 1.5]}
DOCUMENT: dict[str, Any] = {
    "world": {
        "count": 1,
        "region_m": {"box": [[-10, -10, 0], [10, 10, 0]]},
        "mass_kg": {"uniform": [5, 15]},
        "time_s": [0.5, 2.0],
    },
    "sensor": [
        {"name": name, "position_m": place, "records": RECORDS}
        for name, place in PLACES.items()
    ],
}
JOLTED = {
    "flash_time_s": 1e-3,
    "air_arrival_s": 1e-3,
    "jolt_velocity_m_s": "3%",
    "jolt_bearing_rad": 0.02,
    "jolt_elevation_rad": 0.02,
}
"""What an IMU of 1 kHz leaves of a jolt (`calibration.jolts`), and a flash."""
BY_AIR: dict[str, Any] = {
    "world": DOCUMENT["world"],
    "vehicle": {"model": "hummingbird", "position_m": [25.0, 5.0, 4.0]},
    "sensor": [
        {"name": "imu", "kind": "imu", "mount": "vehicle", "records": JOLTED},
    ],
}
SUBSETS = {
    "three microphones": ("air_arrival_s",),
    "flash + air": ("flash_time_s", "air_arrival_s"),
    "flash + ground + air": ("flash_time_s", "ground_arrival_s", "air_arrival_s"),
    "pressure + arrival": ("air_arrival_s", "peak_overpressure_pa"),
    "jolt + flash": tuple(JOLTED),
}
PARTS = (DOCUMENT, tuple(SUBSETS)[:4]), (BY_AIR, tuple(SUBSETS)[4:])
"""A document of worlds, and which subsets are of it."""


def log_slope(belief: Belief, z: Float[Array, ""]) -> tuple[Array, Array]:
    """Return the logarithm of a positive number, and how it goes with z."""
    return jax.value_and_grad(lambda z: jnp.log(belief.constrain(z)))(z)


_log_slopes = jax.jit(jax.vmap(log_slope, (None, 0)))


def sharpness(
    parameters: Parameters,
    z: Float[np.ndarray, "draw free"],
    weights: Float[np.ndarray, " draw"],
    truth: Float[np.ndarray, " free"],
    least: Float[np.ndarray, "free free"],
) -> tuple[float, float]:
    """Return the sd of ln(mass) by weighted draws, and the least by a covariance."""
    mass = parameters.names.index("charge_mass_kg")
    places = jnp.asarray([*z[:, mass], truth[mass]])
    ln, slope = map(np.asarray, _log_slopes(parameters.beliefs[mass], places))
    ln = ln[:-1]
    sd = np.sqrt(weights @ np.square(ln - weights @ ln))
    return float(sd), float(slope[-1] * np.sqrt(least[mass, mass]))
