"""What stands between a sensor's place, or motion, and the samples it writes down."""

import math
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import STANDARD_GRAVITY
from jblast.types import as_float_array, as_optional_float_array

RATE_HZ = 48_000.0
"""Samples a second where nobody says otherwise."""

FEWEST_BITS, MOST_BITS = 8, 32

Saturation = Literal["clip", "compress"]


class Instrument(eqx.Module):
    """What an instrument makes of what reaches it; by itself it adds nothing.

    Full scale and noise are in the unit that the sensor measures in: Pa for a
    microphone and a pressure gauge, m/s for an anemometer and a geophone.

    Attributes:
        rate: Samples a second [Hz].
        full_scale: Largest magnitude that it can write down; None: there is none.
        noise: Its own noise, rms; None: it has none.
        bits: Bits of a sample, with the full scale for their range; None: it writes
            floating-point numbers.
        high_pass: Corner below which it loses what is slow [Hz]; None: it loses none.
        low_pass: Corner above which it loses what is fast [Hz]; None: it loses none.
        saturation: What becomes of more than the full scale: "clip" keeps just that,
            "compress" approaches it smoothly.
        noise_slope: How that noise rises above 20 Hz [dB/octave]; None: it is white.
        wind_noise: What wind does on its membrane: rms over the air's density and the
            square of its speed [-]; None: nothing.
    """

    rate: float = eqx.field(static=True, converter=float, default=RATE_HZ)
    full_scale: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    noise: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    bits: int | None = eqx.field(static=True, default=None)
    high_pass: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    low_pass: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    saturation: Saturation = eqx.field(static=True, default="clip")
    noise_slope: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    wind_noise: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )

    def __check_init__(self):
        if not 0 < self.rate < math.inf:
            raise ValueError(f"rate must be positive and finite, got {self.rate:g} Hz")
        if self.bits is not None and not FEWEST_BITS <= self.bits <= MOST_BITS:
            raise ValueError(
                f"bits must be {FEWEST_BITS} to {MOST_BITS}, got {self.bits}"
            )
        if self.bits is not None and self.full_scale is None:
            raise ValueError(f"{self.bits} bits need a full_scale for their range")


class Imu(eqx.Module):
    """Accelerometer and gyroscope, three axes each; a sample is the mean over its time.

    Absent numbers are those of a Bosch BMI088, as Crazyflie 2.1 and Pixhawk boards
    carry it (data sheet BST-BMI088-DS001: range and bits; noise and offsets are quoted
    second hand): 24 g, 2000 degrees a second, 16 bits; noise of 160 ug and 0.014
    degrees a second per root hertz; offsets of 20 mg and 1 degree a second. How they
    walk no data sheet says: declared, a tenth of the offset in 1000 s.

    Attributes:
        rate: Samples a second [Hz].
        accelerometer_range: Largest magnitude of an axis [m/s2].
        gyroscope_range: Likewise [rad/s].
        accelerometer_noise: One-sided density of white noise [m/s2/sqrt(Hz)].
        gyroscope_noise: Likewise [rad/s/sqrt(Hz)].
        accelerometer_bias: One standard deviation of what an axis is off by when it is
            switched on [m/s2].
        gyroscope_bias: Likewise [rad/s].
        accelerometer_walk: How far that walks on in a second, one standard deviation
            [m/s2/sqrt(s)].
        gyroscope_walk: Likewise [rad/s/sqrt(s)].
        bits: Of a sample; None: floating-point numbers.
    """

    rate: float = eqx.field(static=True, converter=float, default=1000.0)
    accelerometer_range: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=24 * STANDARD_GRAVITY
    )
    gyroscope_range: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=math.radians(2000)
    )
    accelerometer_noise: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=160e-6 * STANDARD_GRAVITY
    )
    gyroscope_noise: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=math.radians(0.014)
    )
    accelerometer_bias: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=20e-3 * STANDARD_GRAVITY
    )
    gyroscope_bias: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=math.radians(1)
    )
    accelerometer_walk: Float[Array, ""] = eqx.field(
        converter=as_float_array,
        default=20e-3 * STANDARD_GRAVITY / 10 / math.sqrt(1000),
    )
    gyroscope_walk: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=math.radians(1) / 10 / math.sqrt(1000)
    )
    bits: int | None = eqx.field(static=True, default=16)

    def sample_noise(self) -> Float[Array, "2"]:
        """Return the sd of one sample's white noise, of both instruments.

        The mean over a time 1/f passes half of f of a one-sided spectrum.
        """
        half = math.sqrt(self.rate / 2)
        return half * jnp.stack([self.accelerometer_noise, self.gyroscope_noise])
