r"""Peak pressure of a spherical blast in free air by Brode's fit.

Brode (1955), J. Appl. Phys. 26:766, from memory and checked against Kingery and
Bulmash only. With $Z$ of `scaling.py` and pressures in bar,

$$p = \begin{cases} 6.7/Z^3 + 1 & p > 10 \\
0.975/Z + 1.455/Z^2 + 5.85/Z^3 - 0.019 & 0.1 < p < 10 \end{cases}$$

The first branch falls to 10 bar at Z = 0.9063, the second at 0.9295 only, and between
them it is 7 % higher than the first. They change at the geometric mean, 0.9178, blended
over 5 % in Z, which departs from either by at most 3.4 %. The slope d ln p/d ln Z,
-2.7 before and -2.6 after, is as flat as -0.08 inside: still falling, but a pressure
of 10 bar hardly constrains the distance.

The second branch ends at 0.1 bar, Z = 9.924; as printed it would be negative past
52.9. From 9.924 on, and below 0.05, the law is a power law with the end slope.

Range: the source states no near limit, because its blast starts from a point, while a
charge has a size. The law is 0.88 (Z = 1), 0.80 (2), 0.90 (5) and 0.89 (10) of the
pressure of Kingery and Bulmash, but 1.4 times it at Z = 0.5, 2.8 at 0.3, 22 at 0.1. The
near limit of 0.5 is our choice.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import BAR, STANDARD_PRESSURE
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.curves import LogCurve, ReciprocalPolynomial
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_pressure_factor,
    scaled_distance,
)

# About the surface of a charge of TNT, 0.053.
NEAREST_Z = 0.05
"""Start of the curve [m/kg^(1/3)]."""

# Nearer, the law exceeds Kingery and Bulmash by more than 40 %.
NEAREST_VALID = 0.5
"""Smallest valid scaled distance [m/kg^(1/3)]."""
# The two branches are 10 bar at these scaled distances.
JOIN = math.sqrt(0.9063113756 * 0.9294529451)
"""Scaled distance of the join [m/kg^(1/3)]."""

FARTHEST_Z = 9.9243959638
"""Scaled distance at which the second branch is 0.1 bar [m/kg^(1/3)]."""

CURVE = LogCurve(
    (
        ReciprocalPolynomial(NEAREST_Z, JOIN, (BAR, 0.0, 0.0, 6.7 * BAR)),
        ReciprocalPolynomial(
            JOIN, FARTHEST_Z, tuple(BAR * c for c in (-0.019, 0.975, 1.455, 5.85))
        ),
    )
)


@checked
def brode_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure in free air [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(CURVE.log_value(log_z))


def brode_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True for Z from 0.5 to 9.92 in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= NEAREST_VALID) & (z <= FARTHEST_Z) & (burst == "free-air")


register(
    Law(
        quantity="peak_overpressure_pa",
        name="brode",
        function=brode_pressure,
        range="free air, Z = 0.5 to 9.92 m/kg^(1/3) (0.1 bar); from memory",
        source="Brode 1955, from memory",
        valid=brode_valid,
        scatter=declared_scatter(shot=0.10, record=0.10),
        scatter_source="declared",
        joins=(NEAREST_Z, JOIN, FARTHEST_Z),
    )
)
