"""Sound without a blast."""

import math

import equinox as eqx
from jaxtyping import Array, Float

from jblast.types import as_float_array, as_optional_float_array

HEIGHT_M = 30.0
"""Scale of the ambient sound's fall with height above ground, where not said [m]."""


class Ambient(eqx.Module):
    """What is heard where nothing explodes: a recording in a loop, or coloured noise.

    Attributes:
        level: Noise on the ground, rms over its band [Pa].
        slope: How its spectrum rises with frequency [dB/octave]: 0 is white, -3 pink.
        height: Its amplitude falls by e over this height above ground [m].
        file: Recording to loop instead of noise; "" if there is none.
        full_scale: What a sample of 1 in that recording stands for [Pa].
        loop: Samples of the recording [Pa], once somebody has read the file.
        loop_rate: Their samples a second [Hz].
    """

    level: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    slope: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    height: Float[Array, ""] = eqx.field(converter=as_float_array, default=HEIGHT_M)
    file: str = eqx.field(static=True, default="")
    full_scale: Float[Array, ""] = eqx.field(converter=as_float_array, default=1.0)
    loop: Float[Array, " sample"] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    loop_rate: float = eqx.field(static=True, converter=float, default=math.nan)

    def __check_init__(self):
        if self.loop is None:
            return
        if self.loop.ndim != 1 or self.loop.size < 2:
            raise ValueError(
                f"loop must be a row of two samples or more, got {self.loop.shape}"
            )
        if not 0 < self.loop_rate < math.inf:
            raise ValueError(
                f"loop_rate must be positive and finite, got {self.loop_rate:g} Hz"
            )
