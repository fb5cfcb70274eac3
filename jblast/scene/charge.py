"""The charge: how big, where, when."""

from typing import Literal

import equinox as eqx
from jaxtyping import Array, Float

from jblast.types import as_float_array

Burst = Literal["surface", "free-air"]


class Charge(eqx.Module):
    """A point charge.

    Attributes:
        mass: Mass of the explosive $Q$ [kg]; TNT until explosives are supported.
        east: Position [m].
        north: Position [m].
        up: Height of burst, or minus the depth of burial [m].
        time: Detonation time on the sensors' common clock [s].
        range: Slant distance to the one sensor there is [m]; takes the place of the
            distance from the position. None where positions decide.
        burst: Which curve set holds: "surface" (hemispherical) or "free-air".
    """

    mass: Float[Array, ""] = eqx.field(converter=as_float_array, default=1.0)
    east: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    north: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    up: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    time: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    range: Float[Array, ""] | None = eqx.field(
        converter=lambda r: None if r is None else as_float_array(r), default=None
    )
    burst: Burst = eqx.field(static=True, default="surface")
