"""The ground under charge and sensors."""

import equinox as eqx
from jaxtyping import Array, Float

from jblast.constants import GRANITE_P_SPEED
from jblast.types import as_float_array


class Ground(eqx.Module):
    """Uniform rock; its wave runs along the surface as a head wave.

    Attributes:
        p_speed: P-wave speed $c_s$ [m/s].
    """

    p_speed: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=GRANITE_P_SPEED
    )
