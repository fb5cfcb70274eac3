"""The curve of a point source in logarithms, as its tests read it."""

import jax
import jax.numpy as jnp

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.curves import log_sound_fraction
from jblast.waves.laws.point_source import (
    LENGTH,
    log_overpressure_ratio,
    point_source_arrival,
    point_source_pressure,
)


def overpressure_ratio(scaled):
    return point_source_pressure(LENGTH * scaled, 1.0) / STANDARD_PRESSURE


def log_arrival(log_scaled):
    return log_sound_fraction(log_scaled, point_source_arrival())


def log_slope(scaled):
    slope = jax.jit(jax.vmap(jax.grad(log_overpressure_ratio)))
    return slope(jnp.log(jnp.asarray(scaled)))
