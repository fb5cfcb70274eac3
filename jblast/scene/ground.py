"""The ground under charge and sensors."""

from typing import Literal

import equinox as eqx
from jaxtyping import Array, Float

from jblast.parameter_table import PARAMETERS
from jblast.types import as_float_array

GroundPath = Literal["head", "thesis"]


class Ground(eqx.Module):
    """Uniform rock.

    Attributes:
        p_speed: P-wave speed $c_s$ [m/s].
        path: How its wave gets to a sensor above it: "head" (along the surface alone)
            or "thesis" (then up at the mean speed of the air shock).
    """

    p_speed: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=PARAMETERS["ground_p_speed_m_s"].default
    )
    path: GroundPath = eqx.field(static=True, default="head")
