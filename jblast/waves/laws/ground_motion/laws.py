r"""Peak displacement and velocity of the ground in the P wave of a charge.

With $Z = R/W^{1/3}$ and $x = h/W^{1/3}$ (Hopkinson; $h < 0$ is buried), and no part for
the air:

$$\ln(D/W^{1/3}) = b_1 + b_2 \ln Z + b_3 / (1 + e^{b_4 (x - b_5)})$$

for the displacement $D$ [m], and likewise, with other coefficients, $\ln v$ for the
velocity $v$ [m/s]. Coefficients, their covariance and the scatter stand in
`data/ground_motion.json`, written by `calibration/ground_motion.py` from the P waves of
22 chemical shots of 74 to 744 kg at four sites (S. R. Ford et al. 2021, as LANL's
MultiPEM distributes them), Z from 28 to 902 m/kg^(1/3), x from -1.43 to 0.81.

That the recordings are in metres and metres a second is inferred from the axes of a
figure (Williams, Picard and Anderson 2026, Geophys. J. Int. 245, ggag125, fig. 4), with
medium confidence; which component they are of is not specified. Rocks differ: one of
the four sites moves a twentieth as far as the others, and in wet rock two equal charges
at one site differ by 2.5 in ln of the velocity. The scatter of the law contains both:
the variance of a site and of a shot is its posterior mean over what four sites and 22
shots allow.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from jblast.registry import Law, register
from jblast.types import as_float_array
from jblast.waves.arguments import checked
from jblast.waves.laws.ground_motion.curve import (
    GroundMotionCurve,
    Number,
    Numbers,
    log_curve,
    log_scaled_place,
)

SOURCE = "fitted to P waves recorded by Ford et al. 2021 (units inferred)"
RANGE = "Z = 25 to 1000 m/kg^(1/3), h/W^(1/3) = -1.5 to 1 m/kg^(1/3), along rock"
SCATTER_SOURCE = "measured by calibration/ground_motion.py"


@cache
def _packaged() -> dict[str, Any]:
    data = files("jblast.waves") / "data" / "ground_motion.json"
    return json.loads(data.read_text(encoding="utf-8"))


def ground_motion_curve(quantity: str) -> GroundMotionCurve:
    """Return the packaged curve of a quantity, from all 22 shots."""
    curve = _packaged()["curves"][quantity]
    return GroundMotionCurve(**{name: np.array(x) for name, x in curve.items()})


@checked
def ground_motion_displacement(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Numbers:
    r"""Return the peak displacement of the ground [m].

    Args:
        slant_range: Distance $R$ from the charge to the ground there [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        height_of_burst: $h$ [m]; negative is buried.
    """
    curve = ground_motion_curve("ground_displacement_m")
    place = log_scaled_place(slant_range, charge_mass, height_of_burst)
    mass = as_float_array(charge_mass)
    return jnp.exp(log_curve(curve.coefficients, *place) + jnp.log(mass) / 3.0)


@checked
def ground_motion_velocity(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Numbers:
    r"""Return the peak particle velocity of the ground [m/s].

    Args:
        slant_range: Distance $R$ from the charge to the ground there [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        height_of_burst: $h$ [m]; negative is buried.
    """
    curve = ground_motion_curve("ground_peak_velocity_m_s")
    place = log_scaled_place(slant_range, charge_mass, height_of_burst)
    return jnp.exp(log_curve(curve.coefficients, *place))


def ground_motion_valid(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Bool[Array, "..."]:
    """Return where the recordings reach: see `RANGE`."""
    log_range, height = log_scaled_place(slant_range, charge_mass, height_of_burst)
    scaled_range = jnp.exp(log_range)
    reached = (scaled_range >= 25.0) & (scaled_range <= 1000.0)
    return reached & (height >= -1.5) & (height <= 1.0)


def ground_motion_displacement_scatter(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> tuple[Numbers, Numbers, Numbers]:
    """Return how far displacements depart from the law at a new site, in ln."""
    curve = ground_motion_curve("ground_displacement_m")
    return curve.scatter(slant_range, charge_mass, height_of_burst)


def ground_motion_velocity_scatter(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> tuple[Numbers, Numbers, Numbers]:
    """Return how far velocities depart from the law at a new site, in ln."""
    curve = ground_motion_curve("ground_peak_velocity_m_s")
    return curve.scatter(slant_range, charge_mass, height_of_burst)


for _quantity, _law, _scatter in (
    (
        "ground_displacement_m",
        ground_motion_displacement,
        ground_motion_displacement_scatter,
    ),
    (
        "ground_peak_velocity_m_s",
        ground_motion_velocity,
        ground_motion_velocity_scatter,
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="ground_motion",
            function=_law,
            range=RANGE,
            source=SOURCE,
            valid=ground_motion_valid,
            scatter=_scatter,
            scatter_source=SCATTER_SOURCE,
        )
    )
