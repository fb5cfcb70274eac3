"""The charge: how big, where, when."""

from typing import Literal

import equinox as eqx
from jaxtyping import Array, Float

from jblast.scene.explosives import tnt_factor
from jblast.types import as_float_array, as_optional_float_array

Burst = Literal["surface", "free-air"]


class Charge(eqx.Module):
    """A point charge.

    Attributes:
        mass: Mass of the explosive [kg].
        east: Position [m].
        north: Position [m].
        up: Height of burst, or minus the depth of burial [m].
        time: Detonation time on the sensors' common clock [s].
        range: Slant distance to the one sensor there is [m]; takes the place of the
            distance from the position. None where positions decide.
        burst: Which curve set holds: "surface" (hemispherical) or "free-air".
        explosive: What it is of, a name of `explosives.EXPLOSIVES`.
        tnt_factor: TNT mass over mass, for every quantity [-]; None takes the
            explosive's own.
        name: What tells it from other charges; "" if it is the only one.
    """

    mass: Float[Array, ""] = eqx.field(converter=as_float_array, default=1.0)
    east: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    north: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    up: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    time: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    range: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    burst: Burst = eqx.field(static=True, default="surface")
    explosive: str = eqx.field(static=True, default="TNT")
    tnt_factor: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    name: str = eqx.field(static=True, default="")

    def tnt_mass(self, quantity: str) -> Float[Array, ""]:
        """Return the mass of TNT that makes the same of a quantity [kg]."""
        if self.tnt_factor is not None:
            return self.mass * self.tnt_factor
        return self.mass * tnt_factor(self.explosive, quantity)
