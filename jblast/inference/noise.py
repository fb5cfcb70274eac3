"""Independent errors of one reading, normal or Student-t, and of a lower bound."""

import jax.numpy as jnp
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Bool, Float

from jblast.sensors.simulated_readings import STUDENT_FREEDOM, Noise

SERIES_FROM = 10.0
"""Argument above which the series of Mills' ratio replaces `log_ndtr`: hazard minus
argument would cancel in the far tail."""
TERMS = 12
"""Terms of the series; at `SERIES_FROM` the remainder is 1e-13 of the sum."""


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


def log_rows(
    u: Float[Array, " row"],
    sd: Float[Array, " row"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None,
) -> Float[Array, ""]:
    """Return the sum of ln of the probabilities of independent rows.

    Args:
        u: Residuals in standard deviations.
        sd: Standard deviation of each row.
        noise: Distribution of the errors.
        lower_bound: True for lower bounds; None if none is.
    """
    read = log_noise(u, noise) - jnp.log(sd)
    if lower_bound is None:
        return jnp.sum(read)
    return jnp.sum(jnp.where(lower_bound, log_survival(u, noise), read))


def row_slopes(
    u: Float[Array, " row"], noise: Noise, lower_bound: Bool[Array, " row"] | None
) -> tuple[Array, ...]:
    """First and second derivative of minus ln of each row's probability."""
    read = noise_slopes(u, noise)
    if lower_bound is None:
        return read
    bound = survival_slopes(u, noise)
    return tuple(
        jnp.where(lower_bound, *pair) for pair in zip(bound, read, strict=True)
    )


def reweighted(
    u: Float[Array, "row ..."],
    curvature: Float[Array, "row ..."],
    noise: Noise,
    lower_bound: Bool[Array, "row ..."] | None,
) -> Float[Array, "row ..."]:
    """Return positive curvatures of minus ln of each row's probability.

    Steps with them always climb. Student-t readings are reweighted as normal ones
    (iteratively reweighted least squares). Bounds keep their curvature where it is
    positive.
    """
    weight = jnp.maximum(curvature, 0.0)
    if noise == "gaussian":
        return weight
    of_reading = (STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + jnp.square(u))
    if lower_bound is None:
        return of_reading
    return jnp.where(lower_bound, weight, of_reading)


def log_survival(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    """Return ln of the probability of a standardised error of $u$ or more."""
    if noise == "gaussian":
        is_far, near, far = _split(u)
        less = _mills_series(far)
        tail = log_noise(far, noise) - jnp.log(far) + jnp.log1p(-less)
        return jnp.where(is_far, tail, log_ndtr(-near))
    cosine, sine, above = _angle(u)
    is_right = u > 0
    size = 4 * jnp.log(cosine) - 2 * jnp.log(jnp.where(is_right, above, 1.0))
    below = jnp.where(is_right, 0.0, jnp.square(above) * (2 - sine) / 4)
    return jnp.where(is_right, size + jnp.log((2 + sine) / 4), jnp.log1p(-below))


def survival_slopes(u: Float[Array, "..."], noise: Noise) -> tuple[Array, Array]:
    r"""Return the first and second derivative of minus `log_survival`.

    The first is the hazard $\lambda = f/S$, the second $\lambda(\lambda - \psi)$ with
    $\psi = -f'/f$, which for Student-t is negative above 1.6.
    """
    if noise == "gaussian":
        is_far, near, far = _split(u)
        less = _mills_series(far)
        rate = jnp.exp(log_noise(near, noise) - log_ndtr(-near))
        hazard = jnp.where(is_far, far / (1 - less), rate)
        excess = jnp.where(is_far, far * less / (1 - less), rate - near)
        return hazard, hazard * excess
    cosine, sine, above = _angle(u)
    hazard = 1.5 * cosine * jnp.square(above) / (2 + sine)
    return hazard, hazard * (hazard - noise_slopes(u, noise)[0])


def _angle(u):
    """Return cosine and sine of the angle whose tangent is u/2, and 1 + the sine."""
    is_wide = jnp.abs(u) > 2  # whose squares may overflow
    wide, slim = jnp.where(is_wide, u, 2.0), jnp.where(is_wide, 2.0, u)
    long = jnp.abs(wide) * jnp.sqrt(1 + jnp.square(2 / wide))
    length = jnp.where(is_wide, long, jnp.sqrt(4 + jnp.square(slim)))
    cosine, sine = 2 / length, u / length
    left = jnp.where(u > 0, 0.0, sine)
    # for u < 0, 1 + sin = cos^2 / (1 - sin): the sum would cancel
    above = jnp.where(u > 0, 1 + sine, jnp.square(cosine) / (1 - left))
    return cosine, sine, above


def _split(u):
    """Return the mask of u in the far tail, u below it, and u in it.

    Elsewhere the values are harmless: both branches of a `where` are differentiated.
    """
    is_far = u > SERIES_FROM
    return is_far, jnp.where(is_far, 0.0, u), jnp.where(is_far, u, SERIES_FROM)


def _mills_series(u):
    """Return $1 - u S(u)/f(u)$ of a normal in its far tail, by its series."""
    t = 1 / jnp.square(u)
    less = jnp.zeros_like(u)
    # nested (Horner) from the last term: 1/u^2 - 3/u^4 + 15/u^6 - ...
    for odd in range(2 * TERMS - 1, 0, -2):
        less = odd * t * (1 - less)
    return less
