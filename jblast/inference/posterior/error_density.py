r"""The probability of one row's own error, of a reading and of a lower bound.

An error $u$, in standard deviations, is standard normal or Student-t with 4 degrees of
freedom. A reading has the density $f(u)$; of a reading known only to be $u$ or more,
as one that was clipped, the probability is the survival function $S(u)$. With
$t/\sqrt{4 + t^2} = \sin\theta$ that of Student-t is closed for 4 degrees of freedom:
$S = (1 - \sin\theta)^2 (2 + \sin\theta) / 4$. Below, both are written so that neither
tail loses digits.
"""

import jax.numpy as jnp
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Float

from jblast.sensors.simulate import STUDENT_FREEDOM, Noise

FAR = 10.0
"""Where the series of Mills' ratio takes over from `log_ndtr`."""
TERMS = 12
"""Of that series; at `FAR` what is left out is 1e-13 of it."""


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


def log_survival(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    """Return ln of the chance of a standardised error of $u$ or more."""
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


def survival_information(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    r"""Return the information of a lower bound about its mean: $f^2/(S(1-S))$.

    That of the answer, yes or no, whether the reading passes the bound: what a bound
    tells on average, positive whatever came.
    """
    both = log_survival(u, noise) + log_survival(-u, noise)
    return jnp.exp(2 * log_noise(u, noise) - both)


def _angle(u):
    """Return cosine and sine of the angle whose tangent is u/2, and 1 + the sine."""
    is_wide = jnp.abs(u) > 2  # squares of wide ones may overflow
    wide, slim = jnp.where(is_wide, u, 2.0), jnp.where(is_wide, 2.0, u)
    long = jnp.abs(wide) * jnp.sqrt(1 + jnp.square(2 / wide))
    length = jnp.where(is_wide, long, jnp.sqrt(4 + jnp.square(slim)))
    cosine, sine = 2 / length, u / length
    left = jnp.where(u > 0, 0.0, sine)
    above = jnp.where(u > 0, 1 + sine, jnp.square(cosine) / (1 - left))
    return cosine, sine, above


def _split(u):
    """Return where u is far up the tail, u where it is not, and u where it is."""
    is_far = u > FAR
    return is_far, jnp.where(is_far, 0.0, u), jnp.where(is_far, u, FAR)


def _mills_series(u):
    """Return $1 - u S(u)/f(u)$ of a normal far up its tail, by its series."""
    t = 1 / jnp.square(u)
    less = jnp.zeros_like(u)
    for odd in range(2 * TERMS - 1, 0, -2):
        less = odd * t * (1 - less)
    return less
