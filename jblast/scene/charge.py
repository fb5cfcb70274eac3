"""The charge: how big, where, when."""

from dataclasses import replace
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.parameter_table import PARAMETERS
from jblast.scene.explosives import tnt_factor
from jblast.types import as_float_array, as_optional_float_array

Burst = Literal["surface", "free-air"]
BURSTS: tuple[Burst, ...] = ("surface", "free-air")


class Charge(eqx.Module):
    """A point charge.

    Attributes:
        mass: Mass of the explosive [kg].
        east: Position [m].
        north: Position [m].
        up: Height of burst, or minus the depth of burial [m].
        time: Detonation time on the sensors' common clock [s]; infinite: it never
            happens, and is neither recorded, seen nor felt. So a batch can have a
            varying number of charges.
        range: Slant distance to the one sensor there is [m]; takes the place of the
            distance from the position. None where positions decide.
        burst: Which curve set holds: "surface" (hemispherical) or "free-air"; None
            leaves it to the height, place by place (`waves/height_of_burst.py`).
        by_height: Whether `burst` was not said but follows from the height.
        explosive: What it is of, a name of `explosives.EXPLOSIVES`.
        tnt_factor: TNT mass over mass, for every quantity [-]; None takes the
            explosive's own.
        name: What tells it from other charges; "" if it is the only one.

    Raises:
        InputError: The time is not a number, or minus infinity. Inside jit it is not
            looked at.

    Example:
        `jblast.Charge(mass=15.0, up=1.5, explosive="C4")`
    """

    mass: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=PARAMETERS["charge_mass_kg"].default
    )
    east: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    north: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    up: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    time: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    range: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    burst: Burst | None = eqx.field(static=True, default=None)
    by_height: bool = eqx.field(static=True, default=False)
    explosive: str = eqx.field(static=True, default="TNT")
    tnt_factor: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    name: str = eqx.field(static=True, default="")

    def __check_init__(self):
        if isinstance(self.time, Tracer):
            return
        time = np.asarray(self.time)  # what JAX computes inside jit is traced
        if not (time > -np.inf).all():
            raise InputError(
                "charge time: expected a number, or inf for never [s], got "
                f"{time.tolist()}"
            )

    @property
    def never(self) -> Bool[Array, ""]:
        """Whether it never happens."""
        return jnp.isposinf(self.time)

    def as_if_at_zero(self) -> "Charge":
        """Return a charge that never happens as if it did, at time 0; others as is.

        For what is computed before it is masked: an infinite time has gradients that
        are no numbers, masked or not.
        """
        return replace(self, time=jnp.where(self.never, 0.0, self.time))

    def since(self, time: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return the time since detonation [s]; negative if it never happens.

        Args:
            time: On the common clock [s].
        """
        return jnp.where(self.never, -1.0, time - self.as_if_at_zero().time)

    def tnt_mass(self, quantity: str) -> Float[Array, ""]:
        """Return the mass of TNT that makes the same of a quantity [kg]."""
        if self.tnt_factor is not None:
            return self.mass * self.tnt_factor
        return self.mass * tnt_factor(self.explosive, quantity)
