"""Charge: mass, position, time and TNT equivalence.

The TNT equivalence of an explosive is the mass of TNT with the same blast as one
kilogram of the explosive. A mass factor applies to one quantity over a range of
distances; handbooks print one factor for pressure and one for impulse.
`Quantity.tnt_factor` names the factor for each quantity.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np

from jblast.errors import InputError, nearest, require, shown
from jblast.parameters import PARAMETERS
from jblast.quantities import quantity_named
from jblast.types import (
    Array,
    ArrayLike,
    Bool,
    Described,
    Float,
    Scalar,
    as_numbers,
    field,
    is_traced,
    namespace,
    number,
)

Burst = Literal["surface", "free-air"]
BURSTS: tuple[Burst, ...] = ("surface", "free-air")
EastNorthUp = tuple[Float[Array, "..."], Float[Array, "..."], Float[Array, "..."]]
"""East, north and up [m] as separate leaves, because one may be traced and the others
not; in a batch of charges each is an array."""
IATG = "UN IATG 01.80, read in one port of its calculator"
UFC = "UFC 3-340-02, from memory"
HEAT = "ratio of heats of detonation, one port"
C2N = "half of the energy goes into the air blast (MultiPEM: C2N = 2)"


def _place(value: ArrayLike | Sequence[ArrayLike]) -> EastNorthUp:
    if getattr(value, "ndim", 1) == 1:  # rejects an array of three positions
        with suppress(TypeError, ValueError):
            east, north, up = cast(Sequence[ArrayLike], value)
            return as_numbers(east), as_numbers(north), as_numbers(up)
    raise InputError(
        "charge position_m: expected three numbers: east, north, up [m]; got "
        f"{shown(value)}"
    )


def tnt_factor(explosive: str, quantity: str) -> float:
    """Return the TNT equivalence factor of an explosive for a quantity [-].

    Args:
        explosive: A name of `EXPLOSIVES`.
        quantity: As in `QUANTITIES`.
    """
    known = quantity_named(quantity)
    return getattr(EXPLOSIVES[explosive], known.tnt_factor if known else "pressure")


class Charge(Described):
    """A point charge.

    Attributes:
        mass_kg: Mass of the explosive [kg].
        position_m: East, north, up [m]; up is the height of burst, or minus the depth
            of burial. A tuple: each is a number of its own, fixed or free.
        time_s: Detonation time on the sensors' common clock [s]; infinite: it never
            happens and has no effect, so the number of charges in a batch may vary.
        range_m: Slant distance to the only sensor [m]; it replaces the distance from
            the position. None where positions decide.
        burst: Which curve set holds: "surface" (hemispherical) or "free-air"; None
            weighs both by the height at each place (`waves/height_of_burst.py`).
        explosive: A name of `EXPLOSIVES`.
        tnt_factor: TNT mass over mass, for every quantity [-]; None takes the
            explosive's own.
        name: To distinguish it from other charges; "" if it is the only one.

    Raises:
        InputError: The position is not three numbers, or the time not a number, or
            minus infinity. Inside jit the time is not checked.
        TypeError: A keyword that no attribute has, or text in place of a number.

    Example:
        `jblast.Charge(mass_kg=15.0, position_m=(0.0, 0.0, 1.5), explosive="C4")`
    """

    mass_kg: Scalar = number(default=PARAMETERS["charge_mass_kg"].default)
    position_m: EastNorthUp = field(converter=_place, default=(0.0, 0.0, 0.0))
    time_s: Scalar = number(default=0.0)
    range_m: Scalar | None = number(default=None)
    burst: Burst | None = field(static=True, default=None)
    explosive: str = field(static=True, default="TNT")
    tnt_factor: Scalar | None = number(default=None)
    name: str = field(static=True, default="")

    def __check_init__(self) -> None:
        if not is_traced(self.time_s):
            # NumPy, because JAX operations on constants inside jit would be traced.
            time = np.asarray(self.time_s)
            expected = "a number, or inf for never [s]"
            require((time > -np.inf).all(), "charge time_s", expected, time.tolist())

    @property
    def east(self) -> Float[Array, "..."]:
        """East of the position [m]."""
        return self.position_m[0]

    @property
    def north(self) -> Float[Array, "..."]:
        """North of the position [m]."""
        return self.position_m[1]

    @property
    def up(self) -> Float[Array, "..."]:
        """Height of burst, or minus the depth of burial [m]."""
        return self.position_m[2]

    @property
    def never(self) -> Bool[Array, ""]:
        """True if it never happens."""
        return namespace(self.time_s).isposinf(self.time_s)

    def as_if_at_zero(self) -> "Charge":
        """Return a charge that never happens with time 0; other charges as they are.

        For values that are computed before they are masked: an infinite time has NaN
        gradients, masked or not.
        """
        # 0 * inf is NaN in a gradient, even where a mask removes the value.
        xp = namespace(self.time_s)
        return replace(self, time_s=xp.where(self.never, 0.0, self.time_s))

    def since(self, time: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return the time since detonation [s]; negative if it never happens.

        Args:
            time: On the common clock [s].
        """
        # A negative time is before the detonation, and has no effect.
        elapsed = time - self.as_if_at_zero().time_s
        return namespace(elapsed).where(self.never, -1.0, elapsed)

    def tnt_mass(self, quantity: str) -> Float[Array, "..."]:
        """Return the TNT-equivalent mass for a quantity [kg]."""
        return self.mass_kg * self.tnt_factor_for(quantity)

    def tnt_factor_for(self, quantity: str) -> Float[Array, "..."] | float:
        """Return the TNT equivalence factor for a quantity [-]."""
        if self.tnt_factor is not None:
            return self.tnt_factor
        return tnt_factor(self.explosive, quantity)


@dataclass(frozen=True)
class Explosive:
    """TNT equivalence factors of an explosive.

    Attributes:
        pressure: Mass factor for pressures, shock speeds and arrivals [-].
        impulse: Mass factor for impulses and durations [-].
        source: Reference of the factors.
        energy: Mass factor for the energy of a strong shock [-].
    """

    pressure: float
    impulse: float
    source: str
    energy: float


def _by_mass(pressure: float, impulse: float, source: str = IATG) -> Explosive:
    # No factor of the energy is printed; that of the pressure is used.
    return Explosive(pressure, impulse, source, energy=pressure)


# Pressure and impulse factors of IATG 01.80 unless another source is named.
EXPLOSIVES: dict[str, Explosive] = {
    "TNT": _by_mass(1.0, 1.0),
    "Amatol": _by_mass(0.99, 0.98),
    "ANFO": _by_mass(0.82, 0.82, UFC),
    "C3": _by_mass(1.08, 1.01),
    "C4": _by_mass(1.37, 1.19),  # the port misprints the second as 0.19
    "Comp B": _by_mass(1.11, 0.98),
    "Cyclotol 60/40": _by_mass(1.14, 1.09),
    "HMX": _by_mass(1.02, 1.03),
    "Octol 75/25": _by_mass(1.06, 1.06),
    "PETN": _by_mass(1.27, 1.11),
    "RDX": _by_mass(1.14, 1.09),
    "Tetryl": _by_mass(1.07, 1.05),
    "Tritonal": _by_mass(1.07, 0.96),
    "dynamite 60 %": _by_mass(0.6, 0.6, HEAT),
    "nitroglycerin": _by_mass(1.481, 1.481, HEAT),
    "Semtex": _by_mass(1.25, 1.25, HEAT),
    # The mass is the yield: 1 kt is 1e6 kg. The strong shock has all of its energy, the
    # air blast farther away half of it.
    "nuclear": Explosive(0.5, 0.5, C2N, energy=1.0),
}
"""Explosives by name. The mass of "nuclear" is the yield in kilograms of TNT."""


def explosive_named(name: str, where: str) -> str:
    """Return an explosive's name as in `EXPLOSIVES`, from any case and punctuation.

    Raises:
        InputError: The name is unknown; the message lists all.
    """

    # "C-4", "comp. B" and "cyclotol 60 40" are found as well.
    def plain(text: str) -> str:
        return "".join(c for c in text.lower() if c.isalnum())

    known = {plain(one): one for one in EXPLOSIVES}
    got = f"{shown(name)}{nearest(name, EXPLOSIVES)}"
    require(plain(name) in known, where, f"one of {', '.join(EXPLOSIVES)}", got)
    return known[plain(name)]
