r"""The curve of `ford_2021.py` in ln, and how far nature scatters about it.

With $Z = R/S_d$ and $x = h/S_d$ (Sachs), of a quantity $y$ over its factor $S$,

$$\ln(y/S) = b_1 + b_2 \ln Z - b_4 \ln(1 + e^{-b_3 x})$$
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array
from jblast.waves.scaling import log_scaled_distance, sachs_distance_factor

Number = Float[ArrayLike, "..."]
Numbers = Float[Array, "..."]


class FordCurve(eqx.Module):
    """What recordings taught about one quantity.

    Attributes:
        coefficients: $b_1$ to $b_4$.
        covariance: Theirs; zero for a coefficient that was not fitted.
        site_sd: Scatter in ln shared by all shots of one site.
        shot_sd: Scatter in ln shared by all records of one shot at the surface.
        burial_sd: What each unit of $-x$ below ground adds to it, in quadrature.
        path_sd: Scatter in ln shared by the records of one path.
        record_sd: Scale of the Student-t (4 degrees of freedom) of one record, in ln.
    """

    coefficients: Float[Array, "4"] = eqx.field(converter=as_float_array)
    covariance: Float[Array, "4 4"] = eqx.field(converter=as_float_array)
    site_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    shot_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    burial_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    path_sd: Float[Array, ""] = eqx.field(converter=as_float_array)
    record_sd: Float[Array, ""] = eqx.field(converter=as_float_array)

    def scatter(
        self,
        slant_range: Number,
        charge_mass: Number,
        height_of_burst: Number,
        ambient_pressure: Number,
    ) -> tuple[Numbers, Numbers, Numbers]:
        """Return the scatter in ln of a new shot: of the shot, a path and a record.

        What the site and the uncertain coefficients do to a shot, they do to all its
        records; so they are counted with the shot.
        """
        log_range, height = log_scaled_place(
            slant_range, charge_mass, height_of_burst, ambient_pressure
        )
        gradient = log_gradient(self.coefficients, log_range, height)
        covariance, site, shot, burial, path, own = (
            jnp.asarray(x, gradient.dtype)
            for x in (
                self.covariance,
                self.site_sd,
                self.shot_sd,
                self.burial_sd,
                self.path_sd,
                self.record_sd,
            )
        )
        learned = jnp.einsum("...i,ij,...j->...", gradient, covariance, gradient)
        depth = jnp.maximum(-height, 0.0)
        shared = site**2 + shot**2 + (burial * depth) ** 2
        return jnp.sqrt(shared + learned), path, own


def log_curve(
    coefficients: Float[Array, "4"], log_range: Numbers, height: Numbers
) -> Numbers:
    r"""Return $\ln(y/S)$ at $\ln Z$ and $x$: the equation above."""
    b1, b2, b3, b4 = jnp.asarray(coefficients, log_range.dtype)
    ground = b4 * jax.nn.softplus(-b3 * height)
    return b1 + b2 * log_range - ground


def log_gradient(
    coefficients: Float[Array, "4"], log_range: Numbers, height: Numbers
) -> Float[Array, "... 4"]:
    """Return the derivative of `log_curve` by each coefficient."""
    _, _, b3, b4 = jnp.asarray(coefficients, log_range.dtype)
    by_coefficient = (
        jnp.ones_like(log_range),
        log_range,
        b4 * height * jax.nn.sigmoid(-b3 * height),
        -jax.nn.softplus(-b3 * height),
    )
    return jnp.stack(jnp.broadcast_arrays(*by_coefficient), axis=-1)


def log_scaled_place(
    slant_range: Number,
    charge_mass: Number,
    height_of_burst: Number,
    ambient_pressure: Number,
) -> tuple[Numbers, Numbers]:
    r"""Return $\ln Z$ and $x$ [m/kg^(1/3)] by Sachs."""
    log_range = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    scale = sachs_distance_factor(charge_mass, ambient_pressure)
    return log_range, as_float_array(height_of_burst) / scale
