r"""Pressure and arrival of a nuclear burst in free air: the DNA's 1 kt standard.

$$p = \frac{3.04 \cdot 10^{11}}{r^3} + \frac{1.13 \cdot 10^9}{r^2}
  + \frac{7.9 \cdot 10^6}{r \sqrt{\ln\left(x + 3\, e^{-\sqrt{x}/3}\right)}}
  \; \mathrm{Pa}, \qquad x = r/445.42$$
$$t = \frac{r^2 (6.7 + r)}{7.12 \cdot 10^6 + 7.32 \cdot 10^4\, r + 340.5\, r^2}
  \; \mathrm{s}$$

with r in m for 1 kt. As in the program BLAST of the Defense Nuclear Agency (1984), read
second-hand in two public programs (GOFAI/glasstone, HeWu) that agree. The mass of the
charge is chemical: $Y = 2W$ (`scaling.py`), so r = 79.37 Z.

The formulas need no guard and no continuation: the argument of the logarithm is least,
2.784, at r = 83.4 m, so the root is never of less than 1.02. Close in p goes as
$r^{-3}$, a strong shock; far out as $1/(r \sqrt{\ln r})$, a weak one.

Other air: by Sachs (`scaling.py`). The arrival's own sound speed is 340.5 m/s, not the
340.29 of our curves. What is carried over is the fraction $340.5\,t/r$ of the sound's
travel time, so that far away $t = R/c_0$ for the sound speed given; BLAST does the same
with the sound speed at altitude. In our standard air times are 0.06 % above the print.

Range: 16 to 4000 m/kt^(1/3), as BLAST has it. (It also asks for 0.1 to 25000 kt; cube-
root scaling knows no such bound.) Against `shock_kinematics`, free air, the pressure is
0.87 to 1.01 from Z = 1 to 50 and still 0.95 at 1e4. Closer to a TNT charge than Z = 1
it is too high, 1.5 times at 0.5 and 5 times at 0.2: a bomb has no size there, TNT has.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.scaling import (
    NUCLEAR_SCALED_METRES,
    sachs_pressure_factor,
    scaled_distance,
)

SOURCE = "DNA 1 kt free-air standard (program BLAST, 1984), over two transcriptions"
RANGE = "free air, r = 16 to 4000 m/kt^(1/3) (Z = 0.2 to 50 m/kg^(1/3)), Y = 2 W"


@checked
def dna_1kt_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure in free air [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], half of the nuclear yield.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    r = _nuclear_range(slant_range, charge_mass, ambient_pressure)
    x = r / 445.42
    weak = jnp.sqrt(jnp.log(x + 3.0 * jnp.exp(-jnp.sqrt(x) / 3.0)))
    standard = (3.04e11 / r**2 + 1.13e9 / r + 7.9e6 / weak) / r
    return sachs_pressure_factor(ambient_pressure) * standard


@checked
def dna_1kt_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the time from detonation to the arrival of the shock [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], half of the nuclear yield.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    slant_range, charge_mass, sound_speed = as_float_arrays(
        slant_range, charge_mass, sound_speed
    )
    r = _nuclear_range(slant_range, charge_mass, ambient_pressure)
    # Divided through by 340.5 r^2: no power that overflows single precision.
    fraction = (1.0 + 6.7 / r) / (1.0 + (7.32e4 / 340.5 + 7.12e6 / 340.5 / r) / r)
    return slant_range / sound_speed * fraction


def dna_1kt_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return True where the standard is valid, in free air only."""
    r = _nuclear_range(slant_range, charge_mass, ambient_pressure)
    return (r >= 16.0) & (r <= 4000.0) & (burst == "free-air")


def _nuclear_range(slant_range, charge_mass, ambient_pressure) -> Float[Array, "..."]:
    """Return the range that 1 kt would have [m]."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return z * NUCLEAR_SCALED_METRES


for _quantity, _function, _sd in (
    ("air_arrival_s", dna_1kt_arrival_time, 0.01),
    ("peak_overpressure_pa", dna_1kt_pressure, 0.10),
):
    register(
        Law(
            quantity=_quantity,
            name="dna_1kt",
            title="DNA 1 kt standard",
            function=_function,
            range=RANGE,
            source=SOURCE,
            valid=dna_1kt_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
        )
    )
