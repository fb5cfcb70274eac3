r"""Peak pressure and duration by Sadovsky's cubic, the handbook law of the USSR.

Sadovsky (1952), read second-hand. With $Z$ of `scaling.py` and pressures in kgf/cm2
(98066.5 Pa),

$$p = \frac{0.95}{Z} + \frac{3.9}{Z^2} + \frac{13.0}{Z^3} \text{ (ground)}$$

which is 93.2, 383, 1275 kPa. Handbooks also round it to MPa: 0.1, 0.43, 1.4 lies 8 (Z =
15) to 10 % (Z = 1) higher.

Range: Z = 1 to 15 m/kg^(1/3), where the pressure is 1.29 (Z = 1), 1.06 (2), 1.02 (5)
and 0.97 (10) of Kingery and Bulmash, the duration 0.98, 1.17, 1.00 and 1.12. Closer in,
the cubic leaves them fast (2.4 at 0.5), so there, as past 15, the pressure is a power
law with the end slope and not valid.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.curves import LogCurve, ReciprocalPolynomial
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)

KGF_PER_CM2 = 98_066.5
"""One kilogram-force per square centimetre [Pa], exact."""

RANGE = (1.0, 15.0)
"""Valid scaled distances [m/kg^(1/3)]; some sources state 10 as the upper limit."""


# Coefficients as printed, in kgf/cm^2 over powers of Z. No constant term: far away the
# pressure vanishes.
CURVE = LogCurve(
    (
        ReciprocalPolynomial(
            *RANGE, tuple(KGF_PER_CM2 * c for c in (0.0, 0.95, 3.9, 13.0))
        ),
    )
)


@checked
def sadovsky_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure of a charge on the ground [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(CURVE.log_value(log_z))


@checked
def sadovsky_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return the duration of the positive phase of a charge on the ground [s].

    $$\tau_+ = 1.7\times10^{-3}\,W^{1/6} R^{1/2} = 1.7\times10^{-3}\,W^{1/3} Z^{1/2}$$

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * 1.7e-3 * jnp.sqrt(z)


def sadovsky_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True for Z from 1 to 15 and a charge on the ground."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= RANGE[0]) & (z <= RANGE[1]) & (burst == "surface")


register(
    Law(
        quantity="peak_overpressure_pa",
        name="sadovsky",
        title="Sadovsky",
        function=sadovsky_pressure,
        range="surface, Z = 1 to 15 m/kg^(1/3)",
        source="Sadovsky 1952, second-hand",
        valid=sadovsky_valid,
        scatter=declared_scatter(shot=0.10, record=0.10),
        scatter_source="declared",
        joins=RANGE,
    )
)
register(
    Law(
        quantity="positive_duration_s",
        name="sadovsky",
        title="Sadovsky",
        function=sadovsky_duration,
        range="surface, Z = 1 to 15 m/kg^(1/3)",
        source="Sadovsky 1952, second-hand",
        valid=sadovsky_valid,
        scatter=declared_scatter(shot=0.10, record=0.10),
        scatter_source="declared",
    )
)
