"""What a fireball looks like beyond its size and temperature: none of it is fitted."""

import math

import equinox as eqx
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, shown
from jblast.types import as_float_array, as_optional_float_array

WHITE = 3e4
"""Luminance of a white wall in the sun [cd/m2]: 1e5 lux / pi."""

LUMPS = 20.0
"""Lumps of smoke along a diameter [-]. Declared: it makes the limb a twentieth of the
radius wide, as in pictures of black smoke."""

RIM = 0.9
"""Excess of temperature at the limb over that in the middle [-]. Declared."""

SMOKE = 0.07
r"""Part of the light that thick soot gives back [-]: $(1 - s)/(1 + s)$, $s^2 = 1 - w$,
for scattering alike in all directions with the albedo $w = 0.25$ of fresh soot (Bond
and Bergstrom 2006, from memory: 0.2 to 0.3)."""


class Appearance(eqx.Module):
    """How a fireball is exposed, and how its smoke is distributed.

    Attributes:
        white: Luminance that is full scale [cd/m2].
        lumps: Lumps of smoke along a diameter [-]; many make the smoke even.
        rim: Excess of temperature over the air at the limb, as a part of that in the
            middle [-].
        smoke: Part of the sky's light that thick smoke gives back [-].
        illuminance: Of a level surface, by sky and sun [lx]: the light in which the
            background was taken, and that smoke gives back. None: as much as makes a
            white wall full scale, which is what a picture is exposed for.
        flash: Whether the fire lights the background (`flash.py`).

    Raises:
        InputError: Outside jit: a number is not positive and finite, or `rim` or
            `smoke` is above 1.
    """

    white: Float[Array, ""] = eqx.field(converter=as_float_array, default=WHITE)
    lumps: Float[Array, ""] = eqx.field(converter=as_float_array, default=LUMPS)
    rim: Float[Array, ""] = eqx.field(converter=as_float_array, default=RIM)
    smoke: Float[Array, ""] = eqx.field(converter=as_float_array, default=SMOKE)
    illuminance: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    flash: bool = eqx.field(static=True, default=True)

    @property
    def daylight(self) -> Float[Array, ""]:
        """Luminance of a white wall in the light of sky and sun [cd/m2]."""
        return self.white if self.illuminance is None else self.illuminance / math.pi

    def __check_init__(self):
        for name in ("white", "lumps", "rim", "smoke", "illuminance"):
            value = getattr(self, name)
            if value is None or isinstance(value, Tracer):
                continue
            number, part = value.item(), name in ("rim", "smoke")
            if not 0 < number < math.inf or (part and number > 1):
                raise InputError(
                    f"look {name}: expected a number above 0"
                    f"{', at most 1' if part else ''}, got {shown(number)}"
                )
