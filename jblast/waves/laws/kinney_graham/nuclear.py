r"""Air blast of a nuclear burst in free air, after Kinney and Graham.

$$\frac{p}{P_0} = 3.2 \cdot 10^6\, z^{-3} \sqrt{1 + (z/87)^2}\,(1 + z/800)$$
$$t_d = \frac{180 \sqrt{1 + (z/100)^3}}{\sqrt{1 + z/40}\,
  [1 + (z/285)^5]^{1/6}\, [1 + z/50000]^{1/6}} \; \mathrm{ms}$$

with $z = R/Y^{1/3}$ in m/kt^(1/3) and the duration for 1 kt. Kinney and Graham (1985),
*Explosive Shocks in Air*, 2nd ed., read second-hand in two public programs (InfraPy,
Supracenter) that agree. The charge's mass is chemical, $Y = 2W$, so z = 79.37 Z; that
and other air, by Sachs, are those of `scaling.py`, as `laws.py` says why.

Range: we could read none. Ours is that of the DNA's 1 kt standard (`dna_1kt.py`), 16 to
4000 m/kt^(1/3), over which this pressure is 1.00 to 1.22 times that. Both formulas are
powers of z at their ends and go on as printed. Against Kingery's and Bulmash's TNT in
free air the duration is 0.89 to 1.22 from Z = 1 to 40, and ten times as long at 0.2,
where a bomb, without the size of a charge, presses harder and longer.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.curves.broken_power_law import Break, BrokenPowerLaw
from jblast.waves.scaling import (
    LOG_NUCLEAR_SCALED_METRES,
    NUCLEAR_SCALED_METRES,
    log_scaled_distance,
    sachs_time_factor,
    scaled_distance,
)

SOURCE = "Kinney & Graham 1985 (Explosive Shocks in Air), nuclear, two transcriptions"
RANGE = "free air, z = 16 to 4000 m/kt^(1/3) (Z = 0.2 to 50 m/kg^(1/3)), Y = 2 W (ours)"

RELATIVE_PRESSURE = BrokenPowerLaw(
    3.2e6, -3.0, (Break(87.0, 2.0, 0.5), Break(800.0, 1.0, 1.0))
)
"""Overpressure over the ambient pressure, of m/kt^(1/3)."""

DURATION = BrokenPowerLaw(
    0.180,
    0.0,
    (
        Break(100.0, 3.0, 0.5),
        Break(40.0, 1.0, -0.5),
        Break(285.0, 5.0, -1.0 / 6.0),
        Break(50000.0, 1.0, -1.0 / 6.0),
    ),
)
"""Seconds for 1 kt, of m/kt^(1/3)."""


@checked
def kinney_graham_nuclear_pressure(
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
    slant_range, charge_mass, ambient_pressure = as_float_arrays(
        slant_range, charge_mass, ambient_pressure
    )
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    log_z = log_z + LOG_NUCLEAR_SCALED_METRES
    return ambient_pressure * jnp.exp(RELATIVE_PRESSURE.log_value(log_z))


@checked
def kinney_graham_nuclear_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], half of the nuclear yield.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    # Times of 1 kt grow with Y^(1/3), those of Sachs with W^(1/3).
    per_kilogram = jnp.exp(
        DURATION.log_value(log_z + LOG_NUCLEAR_SCALED_METRES)
        - LOG_NUCLEAR_SCALED_METRES
    )
    return sachs_time_factor(charge_mass, ambient_pressure, sound_speed) * per_kilogram


def kinney_graham_nuclear_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return where the formulas hold; on the surface they do not."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    z = z * NUCLEAR_SCALED_METRES
    return (z >= 16.0) & (z <= 4000.0) & (burst == "free-air")


for _quantity, _function in (
    ("peak_overpressure_pa", kinney_graham_nuclear_pressure),
    ("positive_duration_s", kinney_graham_nuclear_duration),
):
    register(
        Law(
            quantity=_quantity,
            name="kinney_graham_nuclear",
            function=_function,
            range=RANGE,
            source=SOURCE,
            valid=kinney_graham_nuclear_valid,
            scatter=declared_scatter(shot=0.10, record=0.10),
            scatter_source="declared",
        )
    )
