r"""The probability of residuals whose rows share effects.

Row $i$ misses by $r_i = \sum_k L_{ik} v_k + s_i \epsilon_i$: shared effects $v$ are
standard normal and loaded by $L$, what is left, $\epsilon$, is standard normal or
Student-t with 4 degrees of freedom. The effects are integrated out: exactly for normal
$\epsilon$, where this is $\ln N(r; 0, \mathrm{diag}(s^2) + L L^T)$, and by Laplace's
method about their own mode for Student-t.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jblast.sensors.observe import STUDENT_FREEDOM, Noise

REWEIGHTINGS = 40
"""Rounds to find the effects' mode, at most: few, but where readings contradict."""
SETTLED = 1e-5
"""Effects that move by less, in standard deviations, are left to Newton's steps, of
which the first leaves the square of that."""
WRITTEN_OUT = 16
"""Systems of no more effects are solved without LAPACK."""


def log_noise(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    """Return ln of the density of a standardised independent error."""
    if noise == "gaussian":
        return -0.5 * jnp.square(u) - 0.5 * jnp.log(2 * jnp.pi)
    nu = STUDENT_FREEDOM
    # Gamma((nu + 1)/2) / (Gamma(nu/2) sqrt(nu pi)) is 3/8 for nu = 4
    return jnp.log(0.375) - 0.5 * (nu + 1) * jnp.log1p(jnp.square(u) / nu)


@partial(jax.jit, static_argnames="noise")
def log_likelihood(
    residual: Float[Array, " row"],
    sd: Float[Array, " row"],
    loading: Float[Array, "row effect"],
    noise: Noise,
) -> tuple[Float[Array, ""], Float[Array, " effect"]]:
    """Return ln of the probability of residuals, and the most probable effects.

    Args:
        residual: Measured minus predicted $r$.
        sd: Independent scale of each row $s$.
        loading: What one standard deviation of each effect adds to each row $L$.
        noise: Distribution of the independent errors.
    """
    r, load = residual / sd, loading / sd[:, None]
    v = jnp.zeros(loading.shape[1])
    if loading.shape[1] == 0:
        return jnp.sum(log_noise(r, noise) - jnp.log(sd)), v
    v = _reweighted(lax.stop_gradient(r), lax.stop_gradient(load), noise)
    # Two Newton steps that are differentiated carry first and second derivatives of
    # the mode, which the loop above does not.
    for _ in range(2 if noise == "student" else 1):
        gradient, hessian = _slopes(v, r, load, noise)
        v = v - _solved(hessian, gradient)[0]
    gradient, hessian = _slopes(v, r, load, noise)
    _, log_determinant = _solved(hessian, gradient)
    joint = jnp.sum(log_noise(r - load @ v, noise) - jnp.log(sd)) - 0.5 * v @ v
    return joint - 0.5 * log_determinant, v


def _solved(matrix, right):
    """Solve, and return ln of the determinant's size beside it.

    Few unknowns are eliminated one after another (Gauss-Jordan; positive definite
    matrices need no pivoting) in operations on whole matrices, which a batch runs
    through ten times as fast as through LAPACK.
    """
    count = len(right)
    if count > WRITTEN_OUT:
        return jnp.linalg.solve(matrix, right), jnp.linalg.slogdet(matrix)[1]
    both = jnp.concatenate([matrix, right[:, None]], axis=1)
    pivots = []
    for i in range(count):
        pivots.append(both[i, i])
        row = both[i] / both[i, i]
        both = both - jnp.outer(both[:, i] - jnp.eye(count)[i], row)
    return both[:, -1], jnp.sum(jnp.log(jnp.abs(jnp.stack(pivots))))


def _slopes(v, r, load, noise):
    """Gradient and Hessian of minus the joint log-density in the effects."""
    u = r - load @ v
    slope, curvature = _noise_slopes(u, noise)
    gradient = v - load.T @ slope
    hessian = jnp.eye(v.shape[0]) + load.T @ (curvature[:, None] * load)
    return gradient, hessian


def _noise_slopes(u, noise):
    """First and second derivative of minus `log_noise`."""
    if noise == "gaussian":
        return u, jnp.ones_like(u)
    nu = STUDENT_FREEDOM
    heavy = nu + jnp.square(u)
    return (nu + 1) * u / heavy, (nu + 1) * (nu - jnp.square(u)) / jnp.square(heavy)


def _reweighted(r, load, noise):
    """Mode of the effects by iterated reweighting, which always climbs."""

    def solve(weight):
        precision = jnp.eye(load.shape[1]) + load.T @ (weight[:, None] * load)
        return _solved(precision, load.T @ (weight * r))[0]

    start = solve(jnp.ones_like(r))
    if noise == "gaussian":
        return start

    def again(state):
        rounds, v, _ = state
        u = r - load @ v
        new = solve((STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + jnp.square(u)))
        return rounds + 1, new, jnp.max(jnp.abs(new - v))

    def unsettled(state):
        rounds, _, moved = state
        return (rounds < REWEIGHTINGS) & (moved > SETTLED)

    return lax.while_loop(unsettled, again, (0, start, jnp.inf))[1]
