r"""The curve of both quantities of ground motion in ln, and its scatter in nature.

With $Z = R/W^{1/3}$ and $x = h/W^{1/3}$ (Hopkinson), of a quantity $y$ over its factor
$S$ ($W^{1/3}$ for a displacement, 1 for a velocity),

$$\ln(y/S) = b_1 + b_2 \ln Z + \frac{b_3}{1 + e^{b_4 (x - b_5)}}$$

A buried charge shakes the ground $e^{b_3}$ times as much as one above it; in between,
at $x = b_5$, the coupling is half way in ln.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array, as_float_arrays

Number = Float[ArrayLike, "..."]
Numbers = Float[Array, "..."]


class GroundMotionCurve(eqx.Module):
    """What recordings taught about one quantity.

    Attributes:
        coefficients: $b_1$ to $b_5$.
        covariance: Theirs; zero for a coefficient that was held.
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

        What the site and the uncertain coefficients do to a shot, they do to all its
        records; so they are counted with the shot.
        """
        place = log_scaled_place(slant_range, charge_mass, height_of_burst)
        gradient = log_gradient(self.coefficients, *place)
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
        learned = jnp.einsum("...i,ij,...j->...", gradient, covariance, gradient)
        return jnp.sqrt(site**2 + shot**2 + learned), path, own


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
