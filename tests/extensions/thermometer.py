"""A fast thermometer: the temperature of air that a blast wave compresses."""

import jax.numpy as jnp

from jblast.parameters import Bounds
from jblast.scene import SENSOR_KINDS, Number, SceneKey, SensorKind
from jblast.sensors import overpressure, sampled_by
from jblast.waves import ambient

WITHIN_5 = Bounds(at_least=-5.0, at_most=5.0)


def temperature(scene, sensor, times_s):
    """Return the temperature [K] by the adiabatic law, T = T0 (1 + p/P0)^(2/7)."""
    still_k, pressure_pa = ambient(scene.air)
    half_s = 0.5 * (times_s[1] - times_s[0])
    edges_s = jnp.append(times_s - half_s, times_s[-1] + half_s)
    rise = overpressure(scene, sensor.position_m, edges_s) / pressure_pa
    return still_k * (1.0 + rise) ** (2 / 7) + sensor.settings["offset_k"]


SENSOR_KINDS.register(
    SensorKind(
        name="thermometer",
        words="thermometer of the air",
        unit="k",  # of the keys full_scale_k and noise_k
        columns=("air_temperature_k",),
        sources=sampled_by(temperature),
        keys=(
            SceneKey("offset_k", Number(WITHIN_5), default=0.0),
        ),  # error of its zero
        site="above",
        unmounted="a thermometer, whose cable ends on the ground",
        senses=(("air_arrival_s", "warmth"),),
    )
)
