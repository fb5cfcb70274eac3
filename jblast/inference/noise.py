"""Independent errors of one reading, normal or Student-t."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.sensors.simulated_readings import STUDENT_FREEDOM, Noise


def log_noise(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    """Return ln of the density of a standardised independent error."""
    if noise == "gaussian":
        return -0.5 * jnp.square(u) - 0.5 * jnp.log(2 * jnp.pi)
    nu = STUDENT_FREEDOM
    # Gamma((nu + 1)/2) / (Gamma(nu/2) sqrt(nu pi)) is 3/8 for nu = 4
    return jnp.log(0.375) - 0.5 * (nu + 1) * jnp.log1p(jnp.square(u) / nu)


def noise_slopes(u: Float[Array, "..."], noise: Noise) -> tuple[Array, Array]:
    """Return the first and second derivative of minus `log_noise`."""
    if noise == "gaussian":
        return u, jnp.ones_like(u)
    nu = STUDENT_FREEDOM
    heavy = nu + jnp.square(u)
    return (nu + 1) * u / heavy, (nu + 1) * (nu - jnp.square(u)) / jnp.square(heavy)


def information_of_row(noise: Noise) -> float:
    r"""Return the information of one standardised error about its mean.

    1 for a normal error, $(\nu + 1)/(\nu + 3)$ for Student-t (Lange, Little & Taylor
    1989, J. Am. Stat. Assoc. 84:881, appendix B, with one dimension).
    """
    nu = STUDENT_FREEDOM
    return 1.0 if noise == "gaussian" else (nu + 1) / (nu + 3)


def reweighted(
    u: Float[Array, "row ..."],
    curvature: Float[Array, "row ..."],
    noise: Noise,
) -> Float[Array, "row ..."]:
    """Return positive curvatures of minus ln of each row's probability.

    Steps with them always climb. Student-t readings are reweighted as normal ones
    (iteratively reweighted least squares).
    """
    if noise == "gaussian":
        return jnp.maximum(curvature, 0.0)
    return (STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + jnp.square(u))
