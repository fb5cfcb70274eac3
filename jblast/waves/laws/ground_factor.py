r"""How much stronger a blast on the ground is than the same charge in free air.

A rigid ground would double the charge: it sends upwards all that would have gone down.
Craters and warmed ground take their share, so handbooks say 1.8. By the two curve sets
of Kingery and Bulmash it depends on the distance: the factor $f$ in

$$p_{free\,air}(R, f W) = p_{surface}(R, W)$$

is 1.38 (Z = 0.2), 1.46 (0.5), 1.66 (1), 1.65 (2), 1.73 (5), 1.88 (10), 2.01 (20).
Outside, it is constant. Farther both curves end in wiggles (2.07 at 30, 2.04 at 40).
Nearer they flatten towards the surface of their charges, which has another shape on
the ground: by the curves the factor would be 2.2 at 0.1, and at 0.0674, where that for
the surface starts, no distance in free air has its pressure.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.arguments import checked
from jblast.waves.curves.hermite import HermiteCurve, hermite_curve
from jblast.waves.laws.kingery_bulmash.table import kingery_bulmash_curve
from jblast.waves.scaling import log_scaled_distance

RANGE = (0.2, 20.0)
"""Scaled distances of the table [m/kg^(1/3)]."""

SPACING = 0.02
"""Of the table in ln Z: it leaves less than 1e-7 of the factor."""


@checked
def ground_factor(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return by what the mass of a surface burst is to be multiplied in free air [-].

    Range: Z = 0.2 to 20 m/kg^(1/3); constant outside.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass on the ground $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return jnp.exp(_log_factor().value(log_z))


@cache
def _log_factor() -> HermiteCurve:
    """Tabulate ln f: in NumPy, always in float64, also under jit.

    Where free air has at $Z_s$ the pressure of the surface at $Z$, $f = (Z/Z_s)^3$; its
    slope follows from that of both curves.
    """
    surface = kingery_bulmash_curve("incident_pressure", "surface").segments[0]
    free_air = kingery_bulmash_curve("incident_pressure", "free-air").segments[0]
    start, end = (math.log(z) for z in RANGE)
    nodes = np.linspace(start, end, math.ceil((end - start) / SPACING) + 1)
    pressure = surface.log_value(nodes)
    log_z = nodes - math.log(1.6) / 3.0
    for _ in range(8):  # Newton's steps; five reach rounding
        log_z = log_z - (free_air.log_value(log_z) - pressure) / free_air.log_slope(
            log_z
        )
    return hermite_curve(
        nodes,
        3.0 * (nodes - log_z),
        3.0 * (1.0 - surface.log_slope(nodes) / free_air.log_slope(log_z)),
        slope_before=0.0,
        slope_after=0.0,
    )
