r"""The probability of residuals whose rows share effects.

Row $i$ misses by $r_i = \sum_k L_{ik} v_k + s_i \epsilon_i$: shared effects $v$ are
standard normal and loaded by $L$, what is left, $\epsilon$, is standard normal or
Student-t with 4 degrees of freedom. Of a row that is a lower bound it is known that it
misses by $r_i$ or more: its own error counts with the survival function, where others
count with the density. The effects are integrated out: exactly for normal $\epsilon$,
where this is $\ln N(r; 0, \mathrm{diag}(s^2) + L L^T)$, and otherwise by the
variational Gaussian approximation (Opper & Archambeau 2009, Neural Comput. 21:786). For
any normal density $q(v) = N(m, \Sigma)$

$$\ln p(r) \ge \sum_i E_q[\ln p(r_i | v)] - \tfrac{1}{2} m^T m
  - \tfrac{1}{2} \mathrm{tr} \Sigma + \tfrac{1}{2} \ln |\Sigma| + \tfrac{k}{2}.$$

Here $\Sigma = (I + L^T W L)^{-1}$ with $W$ the expected (Fisher) information of each
row about its mean, and $m$ is where the bound is largest. $\Sigma$ does not depend on
$m$: the bound has no poles, where Laplace's method has one wherever two modes of $v$
become one, and where one maximum takes over from another it has a kink and no step.
For 2 to 20 Student-t rows that share one effect the bound is 0.001 to 0.01 below the
exact integral, where Laplace's method is off by up to 0.1.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.effect_systems import Blocks, effects_of
from jblast.inference.posterior.error_density import (
    information_of_row,
    log_noise,
    log_survival,
    noise_slopes,
    survival_information,
    survival_slopes,
)
from jblast.sensors.simulate import STUDENT_FREEDOM, Noise

ROUNDS = 100
"""Steps of one search at most."""
SETTLED = 1e-5
"""Effects whose next step is shorter, in standard deviations, are left to the Newton
steps that are differentiated, of which the first leaves the square of that."""
LEAST_DAMPING, DAMPING_FACTOR = 1e-3, 10.0
"""Damping of a step (see `_step`). At the least, steps are Newton's but for 1e-3 of
the difference, so distances fall by a thousand in each."""
NODES = 5
"""Gauss-Hermite nodes of expectations over a row's error, whose standard deviation
under $q$ is at most 1.2 for readings: 15 nodes change the mass of `hri_2` by 5e-4
standard deviations."""
MANY_ROWS = 100
"""With more rows than this for each effect one node is used: the squares of those
standard deviations are then 0.014 at most on average (their sum times the information
is below the number of effects), and 200,000 rows take 0.2 s, not 0.8."""


class Rows(NamedTuple):
    """Rows, and how far the effects are uncertain.

    Attributes:
        r: Residuals, in standard deviations.
        blur: Standard deviation under $q$ of what the effects add to each row.
        noise: Distribution of the independent errors.
        lower_bound: Whether each is a lower bound; None if none is.
        nodes: Of expectations over it.
    """

    r: Float[Array, " row"]
    blur: Float[Array, " row"]
    noise: Noise
    lower_bound: Bool[Array, " row"] | None
    nodes: int = NODES

    def log_density(self, added: Float[Array, " row"]) -> Float[Array, ""]:
        """Return the expectation of ln of the rows' probability.

        Args:
            added: Expectation of what the effects add to each row.
        """
        one = jnp.ones_like(self.r)
        total = jnp.zeros((), self.r.dtype)
        for u, weight in self._at_nodes(added):
            total += weight * log_rows(u, one, self.noise, self.lower_bound)
        return total

    def slopes(self, added: Float[Array, " row"]) -> tuple[Array, Array, Array]:
        """Return first and second derivative of minus that, and `reweighted` ones."""
        slope = curvature = sure = jnp.zeros_like(self.r)
        # summed node by node: so XLA makes one pass over the rows of it
        for u, weight in self._at_nodes(added):
            first, second = row_slopes(u, self.noise, self.lower_bound)
            slope, curvature = slope + weight * first, curvature + weight * second
            safe = reweighted(u, second, self.noise, self.lower_bound)
            sure = sure + weight * safe
        return slope, curvature, sure

    def _at_nodes(self, added):
        nodes, weights = np.polynomial.hermite_e.hermegauss(self.nodes)
        u = self.r - added
        return [
            (u + float(node) * self.blur, float(weight / weights.sum()))
            for node, weight in zip(nodes, weights, strict=True)
        ]


@partial(jax.jit, static_argnames=("noise", "blocks"))
def log_likelihood(
    residual: Float[Array, " row"],
    sd: Float[Array, " row"],
    loading: Float[Array, "row effect"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None = None,
    blocks: Blocks = (),
) -> tuple[Float[Array, ""], Float[Array, " effect"]]:
    """Return ln of the probability of residuals, and the expected effects.

    It is no number (NaN) where the search for the effects did not converge.

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
    weight = _weights(r, load, noise, lower_bound)
    if noise == "gaussian" and lower_bound is None:
        v, log_determinant = effects.solved(weight, effects.gathered(r))
        rows = log_rows(r - effects.added(v), sd, noise, lower_bound)
        return rows - 0.5 * (v @ v + log_determinant), effects.in_order(v)
    rows, log_determinant = blurred(r, load, noise, lower_bound, blocks)
    still = effects_of(lax.stop_gradient(load), blocks)
    held = rows._replace(r=lax.stop_gradient(r), blur=lax.stop_gradient(rows.blur))
    v, damping, found = _expected(held, still)

    # The search is not differentiated: steps after it carry the slopes of $m$, on which
    # second derivatives hang. The first leaves 1e-3 of them: enough for long logs.
    def onward(v, _):
        return v + _step(v, jnp.minimum(damping, 1.0), rows, effects)[0], None

    v, _ = lax.scan(onward, v, length=2 if rows.nodes > 1 else 1)
    # tr Sigma = k - sum of weight times squared blur
    bound = rows.log_density(effects.added(v)) - jnp.sum(jnp.log(sd)) - 0.5 * v @ v
    bound += 0.5 * (weight @ jnp.square(rows.blur) - log_determinant)
    if lower_bound is not None:  # whose probability has no unit
        bound += jnp.sum(jnp.where(lower_bound, jnp.log(sd), 0.0))
    return jnp.where(found, bound, jnp.nan), effects.in_order(v)


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


def blurred(
    r: Float[Array, " row"],
    load: Float[Array, "row effect"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None = None,
    blocks: Blocks = (),
) -> tuple[Rows, Float[Array, ""]]:
    r"""Return rows with their spread under $q$, and $-\ln |\Sigma|$.

    Args:
        r: Residuals, in standard deviations.
        load: Loadings, in standard deviations.
        noise: Distribution of the independent errors.
        lower_bound: Whether each is a lower bound; None if none is.
        blocks: As of `log_likelihood`.
    """
    weight = _weights(r, load, noise, lower_bound)
    variance, log_determinant = effects_of(load, blocks).spread(weight)
    some = variance > 0  # else no effect loads the row
    blur = jnp.where(some, jnp.sqrt(jnp.where(some, variance, 1.0)), 0.0)
    rows, effects = load.shape
    nodes = NODES if rows <= MANY_ROWS * effects else 1
    return Rows(r, blur, noise, lower_bound, nodes), log_determinant


def _weights(r, load, noise, lower_bound):
    """Return the information of each row about its mean, whatever the effects are.

    That of a lower bound is taken where the effects are zero but for their spread, and
    vanishes where the bound is met by far. Under normal errors it is the curvature,
    which stays near 1 where a bound is missed by far, as the information does not.
    """
    weight = jnp.full_like(r, information_of_row(noise))
    if lower_bound is None:
        return weight
    about = r / jnp.sqrt(1 + jnp.sum(jnp.square(load), axis=1))
    if noise == "gaussian":
        return jnp.where(lower_bound, survival_slopes(about, noise)[1], weight)
    return jnp.where(lower_bound, survival_information(about, noise), weight)


def _expected(rows, effects):
    """Return the effects where the bound is largest, damping, and whether it converged.

    Student-t readings that disagree with the prior of an effect can leave two maxima:
    the effect is large, or the readings are outliers. Searches from both sides, from
    the solution for normal errors and from zero, find them; the larger one counts.
    """
    read = jnp.ones_like(rows.r)
    if rows.lower_bound is not None:
        read = jnp.where(rows.lower_bound, 0.0, read)
    normal = effects.solved(read, effects.gathered(read * rows.r))[0]

    def end(start):
        v, height, damping, settled = _climbed(start, rows, effects)
        return v, damping, jnp.where(settled, height, -jnp.inf)

    # one after another: the search is compiled once, and long logs are held once
    starts = jnp.stack([normal, jnp.zeros_like(normal)])
    ends, damping, height = lax.map(end, starts)
    best = jnp.argmax(height)
    return ends[best], damping[best], height[best] > -jnp.inf


def _climbed(start, rows, effects):
    """Climb from one place to a maximum; return its height and whether it was reached.

    A step that does not climb, or that a matrix which is not positive definite gave, is
    not taken, and damped more.
    """

    def joint(v):
        return rows.log_density(effects.added(v)) - 0.5 * v @ v

    def again(state):
        rounds, v, height, damping, _ = state
        step, sure = _step(v, damping, rows, effects)
        there = joint(v + step)
        climbs = sure & (there > height)  # not so of no number
        # a step that is shortened is short far from the maximum, too
        moved = jnp.max(jnp.abs(step)) * jnp.maximum(damping, 1.0)
        moved = jnp.where(sure, moved, jnp.inf)
        v = jnp.where(climbs, v + step, v)
        height = jnp.where(climbs, there, height)
        less = jnp.maximum(damping / DAMPING_FACTOR, LEAST_DAMPING)
        damping = jnp.where(climbs, less, damping * DAMPING_FACTOR)
        return rounds + 1, v, height, damping, moved

    def unsettled(state):
        rounds, v, _, _, moved = state
        rounding = 8 * jnp.finfo(v.dtype).eps * jnp.max(jnp.abs(v))
        return (rounds < ROUNDS) & ~(moved <= SETTLED + rounding)

    one, most = jnp.asarray(1.0, start.dtype), jnp.asarray(jnp.inf, start.dtype)
    begun = (0, start, joint(start), one, most)
    end = lax.while_loop(unsettled, again, begun)
    _, v, height, damping, _ = end
    return v, height, damping, ~unsettled((0, *end[1:]))


def _step(v, damping, rows, effects):
    """Return a step uphill, and whether its matrix was positive definite.

    With a damping of 1 readings are reweighted as normal ones, which always climbs
    (bounds have their own curvature, where it is positive); with less, it is between
    that and Newton's step; with more, it is shorter.
    """
    slope, curvature, safe = rows.slopes(effects.added(v))
    weight = curvature + jnp.minimum(damping, 1.0) * (safe - curvature)
    step, log_determinant = effects.solved(weight, effects.gathered(slope) - v)
    return step / jnp.maximum(damping, 1.0), jnp.isfinite(log_determinant)
