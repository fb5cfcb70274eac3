r"""A barometer on a vehicle: static pressure, which a blast disturbs, through a lag.

The air at rest grows thinner with height as in the standard atmosphere, from what it is
at the scene's ground,

$$P(h) = P_0\,(1 - L h/T_0)^{g/(R L)},$$

and a height is what that gives for the pressure read. A blast's overpressure comes on
top, at the vehicle's place: 10 kPa are 800 m of height. The port is taken as ideal: the
wind across it makes no pressure.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.types import as_float_array
from jblast.vehicle import BlastLoad
from jblast.vehicle.loads.blast import over_alike
from jblast.vehicle.loads.blast_wave import Blast, overpressure
from jblast.waves.propagation import HYDROSTATIC_GRADIENT, LAPSE_RATE

EXPONENT = HYDROSTATIC_GRADIENT / LAPSE_RATE
LEAST_PA, MOST_PA = 1_000.0, 120_000.0
"""What it can tell (MS5611-01BA03 data sheet: 10 to 1200 mbar)."""
MOMENTS = 8
"""Of a period at which a blast's pressure is looked at: fronts come between samples."""


class Barometer(eqx.Module):
    """A barometer.

    Absent numbers: noise is the resolution of an MS5611-01BA03 at its finest (data
    sheet: 0.012 mbar); the lag is declared, of a port under foam.

    Attributes:
        rate: Samples a second [Hz].
        noise: One standard deviation of a sample [Pa].
        lag: Of its port [s].
    """

    rate: float = eqx.field(static=True, converter=float, default=50.0)
    noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=1.2)
    lag: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.02)

    def __check_init__(self):
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate:g} Hz")


def pressure_at(
    up_m: Float[Array, "..."],
    ground_pressure_pa: Float[Array, ""],
    ground_temperature_k: Float[Array, ""],
) -> Float[Array, "..."]:
    """Return the pressure of air at rest at a height above the ground [Pa]."""
    colder = 1 - LAPSE_RATE * up_m / ground_temperature_k
    return ground_pressure_pa * colder**EXPONENT


def height_of(
    pressure_pa: Float[Array, "..."],
    ground_pressure_pa: Float[Array, ""],
    ground_temperature_k: Float[Array, ""],
) -> Float[Array, "..."]:
    """Return the height above the ground at which air at rest has a pressure [m]."""
    colder = (pressure_pa / ground_pressure_pa) ** (1 / EXPONENT)
    return ground_temperature_k / LAPSE_RATE * (1 - colder)


def blast_overpressure(
    load: BlastLoad, time_s: Float[Array, ""], position_m: Float[Array, "3"]
) -> Float[Array, ""]:
    """Return the overpressure of blasts at a time and place [Pa]; they add up.

    Those that come by way of the ground too.
    """

    def of(blast: Blast) -> Float[Array, ""]:
        # one that never happens has a wave without pressure
        wave = load.wave_of(blast, position_m)
        return overpressure(wave, _since_front(load, blast, time_s, position_m))

    return load.pressure_pa * sum(over_alike(of, load.waves), jnp.zeros_like(time_s))


def may_press(
    load: BlastLoad,
    time_s: Float[Array, ""],
    position_m: Float[Array, "3"],
    slack_s: Float[Array, ""],
) -> Bool[Array, ""]:
    """Return whether blasts may make a pressure about a time and place.

    Args:
        load: Of the blasts.
        time_s: When.
        position_m: Where.
        slack_s: How much sooner or later a wave may come, and go.
    """

    def of(blast: Blast) -> Bool[Array, ""]:
        since = _since_front(load, blast, time_s, position_m)
        wave = load.wave_of(blast, position_m)
        lasts = wave.duration_s + wave.suction_s
        return ~blast.never & (since >= -slack_s) & (since <= lasts + slack_s)

    return functools.reduce(
        jnp.logical_or, over_alike(of, load.waves), jnp.zeros((), bool)
    )


def _since_front(
    load: BlastLoad,
    blast: Blast,
    time_s: Float[Array, ""],
    position_m: Float[Array, "3"],
) -> Float[Array, ""]:
    """Return how long ago a front came; if it never goes off, as if it did now."""
    # not since its arrival time, which float32 rounds late on the clock
    travel = blast.travel_time_s(load.surroundings(), position_m)
    return time_s - blast.by(time_s).time_s - travel


def lagging(
    read_pa: Float[Array, ""],
    pressures_pa: Float[Array, " moment"],
    lag_s: Float[Array, ""],
    period_s: Float[Array, ""],
) -> Float[Array, ""]:
    """Return what the port has come to after a period.

    Args:
        read_pa: At its beginning.
        pressures_pa: Outside, at even moments of it, each held for its share.
        lag_s: Of the port.
        period_s: How long it is.
    """
    stays = jnp.exp(-period_s / pressures_pa.shape[0] / lag_s)
    for pressure in pressures_pa:
        read_pa = pressure + (read_pa - pressure) * stays
    return jnp.clip(read_pa, LEAST_PA, MOST_PA)
