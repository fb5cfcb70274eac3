r"""Peak pressure of a TNT charge in free air by Henrych.

Henrych (1979), *The Dynamics of Explosion and Its Use*; the coefficients are from
memory, checked against one another and against Kingery and Bulmash only. With $Z$ of
`scaling.py` and pressures in bar,

$$p = \begin{cases}
14.072/Z + 5.540/Z^2 - 0.357/Z^3 + 0.00625/Z^4 & 0.05 \le Z \le 0.3 \\
6.194/Z - 0.326/Z^2 + 2.132/Z^3 & 0.3 \le Z \le 1 \\
0.662/Z + 4.05/Z^2 + 3.288/Z^3 & 1 \le Z \le 10 \end{cases}$$

At the joins the values meet (to 0.03 % at 0.3, exactly at 1) and the slopes d ln p/d
ln Z break: -1.39 to -2.61, and -1.49 to -2.33. They are blended over 5 % in Z, which
departs from the printed curve by at most 0.22 % (0.3) and 0.14 % (1); inside a blend
the slope runs from -1.18 to -2.81 and from -1.36 to -2.47. Outside 0.05 to 10
m/kg^(1/3) the law is a power law with the end slope (-0.23 and -1.43) and not valid.

Against Kingery and Bulmash (free air): 1.27 (Z = 0.05), 1.34 (0.08), 1.07 (0.3),
0.72 (0.5), 0.86 (1), 0.90 (2), 1.02 (5), 0.99 (10).
"""

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

# The leading zeros are Z^0, which `ReciprocalPolynomial` expects and the print lacks.
PRINTED = (
    (0.05, 0.3, (0.0, 14.072, 5.540, -0.357, 0.00625)),
    (0.3, 1.0, (0.0, 6.194, -0.326, 2.132)),
    (1.0, 10.0, (0.0, 0.662, 4.05, 3.288)),
)
"""Lower and upper limit of Z, and the coefficients of Z^0, Z^-1, Z^-2, ... [bar]."""

CURVE = LogCurve(
    tuple(
        ReciprocalPolynomial(start, end, tuple(BAR * c for c in terms))
        for start, end, terms in PRINTED
    )
)


@checked
def henrych_pressure(
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


def henrych_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True for Z from 0.05 to 10 in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= CURVE.z_min) & (z <= CURVE.z_max) & (burst == "free-air")


register(
    Law(
        quantity="peak_overpressure_pa",
        name="henrych",
        function=henrych_pressure,
        range="free air, Z = 0.05 to 10 m/kg^(1/3); from memory",
        source="Henrych 1979, from memory",
        valid=henrych_valid,
        scatter=declared_scatter(shot=0.10, record=0.10),
        scatter_source="declared",
        joins=(CURVE.z_min, *(segment.z_max for segment in CURVE.segments)),
    )
)
