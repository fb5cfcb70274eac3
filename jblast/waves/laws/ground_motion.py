r"""Peak displacement and velocity of the ground in the P wave of a charge.

With $Z = R/W^{1/3}$ and $x = h/W^{1/3}$ (Hopkinson; $h < 0$ is buried), a quantity $y$
over its factor $S$ ($W^{1/3}$ for a displacement in m, 1 for a velocity in m/s), and no
dependence on the air:

$$\ln(y/S) = b_1 + b_2 \ln Z + \frac{b_3}{1 + e^{b_4 (x - b_5)}}$$

A buried charge moves the ground $e^{b_3}$ times as much as one above it; in between,
at $x = b_5$, ln of the coupling is at the mean of both. Coefficients, their covariance
and the scatter are in `data/ground_motion.json`, from `calibration/ground_motion.py`,
from the P waves of 22 chemical shots of 74 to 744 kg at four sites (S. R. Ford et al.
2021, as LANL's MultiPEM distributes them), Z from 28 to 902 m/kg^(1/3), x from -1.43 to
0.81.

The units of the recordings, metres and metres a second, are inferred from the axes of a
figure (Williams, Picard and Anderson 2026, Geophys. J. Int. 245, ggag125, fig. 4), with
medium confidence; their component is not specified. Rocks differ: one of the four sites
moves a twentieth as far as the others, and in wet rock two equal charges at one site
differ by 2.5 in ln of the velocity. The scatter of the law contains both: the variance
of a site and of a shot is its posterior mean over what four sites and 22 shots allow.
"""

import json
from functools import cache, partial
from importlib.resources import files
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.registry import Law, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked

SOURCE = "fitted to P waves recorded by Ford et al. 2021 (units inferred)"
RANGE = "Z = 25 to 1000 m/kg^(1/3), h/W^(1/3) = -1.5 to 1 m/kg^(1/3), along rock"
SCATTER_SOURCE = "measured by calibration/ground_motion.py"
Number = Float[ArrayLike, "..."]
Numbers = Float[Array, "..."]


@cache
def _packaged() -> dict[str, Any]:
    data = files("jblast.waves") / "data" / "ground_motion.json"
    return json.loads(data.read_text(encoding="utf-8"))


class GroundMotionCurve(eqx.Module):
    """Fitted curve of one quantity, with its scatter.

    Attributes:
        coefficients: $b_1$ to $b_5$.
        covariance: Covariance of the coefficients; zero for one that was not fitted.
        site_sd: Scatter in ln shared by all shots of one site.
        shot_sd: Scatter in ln shared by all records of one shot.
        path_sd: Scatter in ln shared by the records of one path.
        record_sd: Scatter in ln of one record.
    """

    coefficients: Float[Array, "5"] = eqx.field(converter=as_float_array)
    covariance: Float[Array, "5 5"] = eqx.field(converter=as_float_array)
    site_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    shot_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    path_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    record_sd: Float[Array, ""] = eqx.field(converter=as_float_array)

    def scatter(
        self, slant_range: Number, charge_mass: Number, height_of_burst: Number
    ) -> tuple[Numbers, Numbers, Numbers]:
        """Return the scatter in ln at a new site: of the shot, a path and a record.

        The scatter of the site and of the uncertain coefficients is common to all
        records of a shot, so it is part of the scatter of the shot.
        """
        place = log_scaled_place(slant_range, charge_mass, height_of_burst)
        gradient = log_gradient(self.coefficients, *place)
        # In the precision of the arguments: float64 numbers would promote a float32
        # fit.
        covariance, site, shot, path, own = (
            jnp.asarray(x, gradient.dtype)
            for x in (
                self.covariance,
                self.site_sd,
                self.shot_sd,
                self.path_sd,
                self.record_sd,
            )
        )
        # Delta method: covariance of the coefficients through the gradient of ln y.
        fitted = jnp.einsum("...i,ij,...j->...", gradient, covariance, gradient)
        return jnp.sqrt(site**2 + shot**2 + fitted), path, own


def ground_motion_curve(quantity: str) -> GroundMotionCurve:
    """Return the packaged curve of a quantity, from all 22 shots."""
    # Only the text is cached: an array has the precision enabled when it is made.
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
    # By Hopkinson charges of all sizes have one velocity at one Z: S = 1.
    return jnp.exp(log_curve(curve.coefficients, *place))


def ground_motion_valid(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> Bool[Array, "..."]:
    """Return True within the range of the recordings, `RANGE`."""
    log_range, height = log_scaled_place(slant_range, charge_mass, height_of_burst)
    scaled_range = jnp.exp(log_range)
    # Recorded are Z = 28 to 902 and x = -1.43 to 0.81; the bounds are rounded outward.
    reached = (scaled_range >= 25.0) & (scaled_range <= 1000.0)
    return reached & (height >= -1.5) & (height <= 1.0)


def ground_motion_scatter(
    quantity: str, slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> tuple[Numbers, Numbers, Numbers]:
    """Return the scatter of a quantity at a new site, in ln."""
    # The curve is read here, not at import, when float64 may not be enabled yet.
    curve = ground_motion_curve(quantity)
    return curve.scatter(slant_range, charge_mass, height_of_burst)


def log_curve(
    coefficients: Float[Array, "5"], log_range: Numbers, height: Numbers
) -> Numbers:
    r"""Return $\ln(y/S)$ at $\ln Z$ and $x$: the equation above."""
    b1, b2, b3, b4, b5 = jnp.asarray(coefficients, log_range.dtype)
    return b1 + b2 * log_range + b3 * jax.nn.sigmoid(b4 * (b5 - height))


def log_gradient(
    coefficients: Float[Array, "5"], log_range: Numbers, height: Numbers
) -> Float[Array, "... 5"]:
    """Return the derivative of `log_curve` by each coefficient."""
    _, _, b3, b4, b5 = jnp.asarray(coefficients, log_range.dtype)
    coupled = jax.nn.sigmoid(b4 * (b5 - height))
    slope = b3 * coupled * (1.0 - coupled)
    by_coefficient = (
        # The law is linear in b_1 and b_2: their derivatives contain no coefficient.
        jnp.ones_like(log_range),
        log_range,
        coupled,
        slope * (b5 - height),
        slope * b4,
    )
    return jnp.stack(jnp.broadcast_arrays(*by_coefficient), axis=-1)


def log_scaled_place(
    slant_range: Number, charge_mass: Number, height_of_burst: Number
) -> tuple[Numbers, Numbers]:
    r"""Return $\ln Z$ and $x$ [m/kg^(1/3)] by Hopkinson."""
    slant_range, mass, height = as_float_arrays(
        slant_range, charge_mass, height_of_burst
    )
    log_scale = jnp.log(mass) / 3.0
    return jnp.log(slant_range) - log_scale, height * jnp.exp(-log_scale)


for _quantity, _law in (
    ("ground_displacement_m", ground_motion_displacement),
    ("ground_peak_velocity_m_s", ground_motion_velocity),
):
    register(
        Law(
            quantity=_quantity,
            name="ground_motion",
            function=_law,
            range=RANGE,
            source=SOURCE,
            valid=ground_motion_valid,
            scatter=partial(ground_motion_scatter, _quantity),
            scatter_source=SCATTER_SOURCE,
        )
    )
