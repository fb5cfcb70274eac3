r"""Peak pressure far away by the weak-shock tail alone.

$$p = \frac{A}{Z \sqrt{\ln(Z/b)}}$$

with $A$ and $b$ where the tail leaves the curve of Kingery and Bulmash, at $Z = 20$
m/kg^(1/3) (`shock_kinematics/front.py`; `weak_shock_tail.py` derives it). From there
on it is `shock_kinematics`; nearer, where this law does not hold, it is a power law
with the slope at 20. Range: Z = 20 to 300; past it recorded peaks are half of this, and
the formula continues. The scatter grows as measured (`waves/shock/far_scatter.py`).
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.laws.kingery_bulmash.table import kingery_bulmash_curve
from jblast.waves.laws.shock_kinematics.front import JOIN, front_tail
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_pressure_factor,
    scaled_distance,
)
from jblast.waves.shock.far_scatter import FAR_END, measured_far_scatter

RANGE = (JOIN, FAR_END)
"""Scaled distances where the law holds [m/kg^(1/3)]."""


@checked
def weak_shock_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak incident overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    start = math.log(JOIN)
    # The tail meets the curve in slope, so the curve's is its own.
    curve = kingery_bulmash_curve("incident_pressure", burst)
    slope = curve.segments[-1].log_slope(start)
    far = jnp.maximum(log_z, start)
    near = jnp.minimum(log_z - start, 0.0)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(
        front_tail(burst).log_pressure(far) + slope * near
    )


def weak_shock_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Bool[Array, "..."]:
    """Return where Z lies in 20 to 300."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= RANGE[0]) & (z <= RANGE[1])


register(
    Law(
        quantity="peak_overpressure_pa",
        name="weak_shock",
        function=weak_shock_pressure,
        range="Z = 20 to 300 m/kg^(1/3); no absorption",
        source="Landau 1945; Whitham 1974; from Kingery & Bulmash at Z = 20",
        valid=weak_shock_valid,
        scatter=declared_scatter(shot=0.10, record=0.10),
        scatter_source="declared",
        joins=(JOIN,),
        far_scatter=measured_far_scatter("peak_overpressure_pa"),
    )
)
