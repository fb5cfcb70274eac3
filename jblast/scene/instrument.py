"""What stands between a sensor's place and the samples it writes down."""

import math
from typing import Literal

import equinox as eqx
from jaxtyping import Array, Float

from jblast.types import as_optional_float_array

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
