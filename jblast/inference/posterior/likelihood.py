r"""The probability of residuals whose rows share effects.

Row $i$ misses by $r_i = \sum_k L_{ik} v_k + s_i \epsilon_i$: shared effects $v$ are
standard normal and loaded by $L$, what is left, $\epsilon$, is standard normal or
Student-t with 4 degrees of freedom. The effects are integrated out: exactly for normal
$\epsilon$, where this is $\ln N(r; 0, \mathrm{diag}(s^2) + L L^T)$, and by Laplace's
method about their own mode for Student-t. Of a row that is a lower bound it is known
that it misses by $r_i$ or more: its own error counts with the survival function, where
others count with the density, and the effects are integrated out by Laplace's method.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.effect_systems import Blocks, effects_of
from jblast.inference.posterior.error_density import (
    log_noise,
    log_survival,
    noise_slopes,
    survival_slopes,
)
from jblast.sensors.observe import STUDENT_FREEDOM, Noise

REWEIGHTINGS = 40
"""Rounds to find the effects' mode, at most: few, but where readings contradict."""
SETTLED = 1e-5
"""Effects that move by less, in standard deviations, are left to Newton's steps, of
which the first leaves the square of that."""
PARTS = np.append(0.5 ** np.arange(12), 0.0)
"""Of a Newton step, of which the one that climbs most is taken: bounds bend the density
so that a whole step may overshoot."""


@partial(jax.jit, static_argnames=("noise", "blocks"))
def log_likelihood(
    residual: Float[Array, " row"],
    sd: Float[Array, " row"],
    loading: Float[Array, "row effect"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None = None,
    blocks: Blocks = (),
) -> tuple[Float[Array, ""], Float[Array, " effect"]]:
    """Return ln of the probability of residuals, and the most probable effects.

    Args:
        residual: Measured minus predicted $r$.
        sd: Independent scale of each row $s$.
        loading: What one standard deviation of each effect adds to each row $L$.
        noise: Distribution of the independent errors.
        lower_bound: Whether what was measured is a lower bound; None if none is.
        blocks: Effects that load rows of their own, for speed (`effect_systems`).
    """
    r, load = residual / sd, loading / sd[:, None]
    if loading.shape[1] == 0:
        return log_rows(r, sd, noise, lower_bound), jnp.zeros(0)
    effects = effects_of(load, blocks)
    rows = lax.stop_gradient(r), effects_of(lax.stop_gradient(load), blocks), noise
    v = _reweighted(*rows) if lower_bound is None else _climbed(*rows, lower_bound)

    # Two Newton steps that are differentiated carry first and second derivatives of
    # the mode, which the loop above does not; the last tells of the curvature alone.
    def onward(v, _):
        step, log_determinant = _newton_step(v, r, effects, noise, lower_bound)
        return v - step, (v, log_determinant)

    steps = 1 if noise == "gaussian" and lower_bound is None else 2
    _, along = lax.scan(onward, v, length=steps + 1)
    v, log_determinant = jax.tree.map(lambda x: x[-1], along)
    joint = log_rows(r - effects.added(v), sd, noise, lower_bound) - 0.5 * v @ v
    return joint - 0.5 * log_determinant, effects.in_order(v)


def log_rows(
    u: Float[Array, " row"],
    sd: Float[Array, " row"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None,
) -> Float[Array, ""]:
    """Add ln of the probabilities of independent rows, missed by u times sd."""
    read = log_noise(u, noise) - jnp.log(sd)
    if lower_bound is None:
        return jnp.sum(read)
    return jnp.sum(jnp.where(lower_bound, log_survival(u, noise), read))


def _newton_step(v, r, effects, noise, lower_bound):
    """Return a step downhill minus the joint log-density, and its Hessian's ln det."""
    slope, curvature = row_slopes(r - effects.added(v), noise, lower_bound)
    return effects.solved(curvature, v - effects.gathered(slope))


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
    u: Float[Array, " row"],
    curvature: Float[Array, " row"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None,
) -> Float[Array, " row"]:
    """Return curvatures of minus ln of each row's probability that always climb.

    Student-t readings are reweighted as normal ones; bounds have their own curvature,
    where it is positive.
    """
    weight = jnp.maximum(curvature, 0.0)
    if noise == "gaussian":
        return weight
    of_reading = (STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + jnp.square(u))
    if lower_bound is None:
        return of_reading
    return jnp.where(lower_bound, weight, of_reading)


def _reweighted(r, effects, noise):
    """Mode of the effects by iterated reweighting, which always climbs."""
    if noise == "gaussian":
        return effects.solved(jnp.ones_like(r), effects.gathered(r))[0]

    def again(state):
        rounds, v, _ = state
        u = r - effects.added(v)
        weight = (STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + jnp.square(u))
        weight = jnp.where(rounds == 0, 1.0, weight)  # of normal errors at first
        new = effects.solved(weight, effects.gathered(weight * r))[0]
        return rounds + 1, new, jnp.max(jnp.abs(new - v))

    def unsettled(state):
        rounds, _, moved = state
        return (rounds == 0) | ((rounds <= REWEIGHTINGS) & (moved > SETTLED))

    start = effects.start()
    return lax.while_loop(unsettled, again, (0, start, jnp.asarray(jnp.inf, r.dtype)))[
        1
    ]


def _climbed(r, effects, noise, lower_bound):
    """Mode of the effects where some rows are bounds, by steps that always climb.

    Readings are reweighted; bounds have their own curvature, where it is positive. So
    each step goes uphill, if it is short enough.
    """

    def joint(v):
        u = r - effects.added(v)
        return log_rows(u, jnp.ones_like(r), noise, lower_bound) - 0.5 * v @ v

    def again(state):
        rounds, v, _ = state
        u = r - effects.added(v)
        slope, curvature = row_slopes(u, noise, lower_bound)
        weight = reweighted(u, curvature, noise, lower_bound)
        step = effects.solved(weight, effects.gathered(slope) - v)[0]
        tried = v[None, :] + jnp.asarray(PARTS, v.dtype)[:, None] * step[None, :]
        new = tried[jnp.argmax(jax.vmap(joint)(tried))]
        return rounds + 1, new, jnp.max(jnp.abs(new - v))

    def unsettled(state):
        rounds, _, moved = state
        return (rounds < REWEIGHTINGS) & (moved > SETTLED)

    start = effects.start()
    return lax.while_loop(unsettled, again, (0, start, jnp.asarray(jnp.inf, r.dtype)))[
        1
    ]
