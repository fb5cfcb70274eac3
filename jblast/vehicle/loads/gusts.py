"""Gusts that fill the whole air at once: a step, an N-wave, Friedlander's pulse.

Each has its limit from inside at its beginning and is zero before it. One whose
beginning is infinite never blows.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.quadrotor.numbers import floats
from jblast.waves.waveform import modified_friedlander_pressure


class StepGust(eqx.Module):
    """Still air, then a steady wind.

    Attributes:
        velocity_m_s: East, north, up [m/s].
        start_s: When it sets in [s].
    """

    velocity_m_s: Float[Array, "3"] = eqx.field(converter=floats)
    start_s: Float[Array, ""] = eqx.field(converter=floats)

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        return jnp.where(time_s >= self.start_s, self.velocity_m_s, 0)


class NWaveGust(eqx.Module):
    """A wind that falls straight from a peak to its opposite: zero in the mean.

    Attributes:
        velocity_m_s: At the peak: east, north, up [m/s].
        start_s: When it sets in [s].
        duration_s: How long it lasts [s].
    """

    velocity_m_s: Float[Array, "3"] = eqx.field(converter=floats)
    start_s: Float[Array, ""] = eqx.field(converter=floats)
    duration_s: Float[Array, ""] = eqx.field(converter=floats)

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        begun = time_s >= self.start_s
        phase = jnp.where(begun, time_s - self.start_s, 0) / self.duration_s
        return self.velocity_m_s * jnp.where(begun & (phase <= 1), 1 - 2 * phase, 0)


class FriedlanderGust(eqx.Module):
    """A blast wind with the shape of Friedlander's pulse, tail and all.

    Attributes:
        velocity_m_s: At the peak: east, north, up [m/s].
        start_s: When it sets in [s].
        duration_s: Of its positive phase [s].
        decay: $b$ [-], positive.
    """

    velocity_m_s: Float[Array, "3"] = eqx.field(converter=floats)
    start_s: Float[Array, ""] = eqx.field(converter=floats)
    duration_s: Float[Array, ""] = eqx.field(converter=floats)
    decay: Float[Array, ""] = eqx.field(converter=floats, default=1.0)

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        since = jnp.where(time_s >= self.start_s, time_s - self.start_s, -1)
        one = jnp.ones_like(since)
        shape = modified_friedlander_pressure(since, one, self.duration_s, self.decay)
        return self.velocity_m_s * shape
