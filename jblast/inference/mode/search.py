"""The most probable scenes: every optimum of the posterior worth telling.

Least squares from many starts (Levenberg-Marquardt), the shared effects among the
unknowns: with normal errors, which reach the right basin from far away, and then with
the Student-t cost, which ignores wild readings; from half of the starts with that
alone. BFGS, in coordinates whitened by the Fisher information, then climbs the
posterior itself, in which the effects are integrated out, from the best few ends.
Errors that readings of one record share are integrated out there alone; until then
they count as independent.
A long log is searched by some of its rows (`row_subset`), then by all.

Starts are run one after another inside one compiled loop: for 64 starts of a small log
`vmap` runs in 0.12 s instead of 0.17 s, but takes 1.4 s longer to trace and load. The
whole search may be batched over logs.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.inference.mode.row_subset import is_long, row_subset
from jblast.inference.mode.starts import start_sd, starts
from jblast.inference.posterior.error_density import log_survival
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.sensors.observe import STUDENT_FREEDOM

STARTS = 64
FINALISTS = 8
SAME = 0.1
"""Ends closer than this many standard deviations are one optimum."""
SEPARATE = 1.0
"""Optima further apart than this many standard deviations are two answers."""
TIE_BREAK = 1e-6
"""Among ends equally probable the one nearest the middle of the starts is preferred:
this penalty in ln-density for each squared distance in sd of the starts."""
LONGEST_STEP = 10.0
"""Where the data tell little, climb by this many typical steps at first."""
HOPELESS = 10.0
"""An end whose density by some of the rows is so much lower in ln is left out: by all
rows it is further behind."""
LEAST_COST = 1e-12
"""Of a lower bound that is passed by far, so that its square root has a slope."""
NORMAL = 1e8
"""So many degrees of freedom make a Student-t normal."""


class Optima(NamedTuple):
    """Places where searches ended, the most probable first.

    Attributes:
        z: Coordinates.
        log_density: ln of the posterior density there; -inf for a repeated end.
    """

    z: Float[Array, "optimum free"]
    log_density: Float[Array, " optimum"]


@kept
def optima(key: PRNGKeyArray, posterior: Posterior) -> Optima:
    """Search a posterior from `STARTS` places and climb from the best few ends."""
    if not is_long(posterior):
        return _searched(key, posterior)[0]
    found, middle = _searched(key, row_subset(posterior))
    scale = start_sd(posterior)

    def climb(end):
        z, density = end
        return lax.cond(
            density > found.log_density[0] - HOPELESS,
            lambda: _climb(posterior, scale, z, information(posterior, z)),
            lambda: jnp.full_like(z, jnp.nan),
        )

    preference = _preference(scale, middle)
    ends, _, repeated = _distinct(posterior, lax.map(climb, found), preference)
    return _in_order(posterior, ends, repeated, preference)


@kept
def likeliest_start(key: PRNGKeyArray, posterior: Posterior) -> Float[Array, " free"]:
    """Return the most probable of the places where a search begins.

    Of a long log some of the rows judge.
    """
    posterior = row_subset(posterior) if is_long(posterior) else posterior.of_readings()
    places = starts(key, posterior, STARTS)
    density = lax.map(posterior.log_density, places)
    return places[jnp.argmax(jnp.where(jnp.isnan(density), -jnp.inf, density))]


def _searched(key: PRNGKeyArray, posterior: Posterior):
    """Return the optima, and the middle of the starts."""
    scale = start_sd(posterior)
    first = starts(key, posterior, STARTS) / scale[None, :]
    near = posterior.independent()
    shape = jax.eval_shape(near.misfit, first[0]).loading.shape
    effects = jnp.zeros((STARTS, shape[1]))

    # Half of the starts go through normal errors, which see far; half do not, since
    # where two groups of readings disagree normal errors end between them.
    last = STUDENT_FREEDOM if posterior.noise == "student" else NORMAL
    freedoms = jnp.tile(jnp.array([(NORMAL, last), (last, last)]), (STARTS // 2, 1))

    import optimistix as optx  # takes as long to import as a kept search to find

    def approach(start: tuple[Array, Array]) -> Float[Array, " free"]:
        y, freedoms = start

        def with_freedom(y, freedom):
            solution = optx.least_squares(
                lambda y, freedom: _residuals(near, scale, y, freedom),
                optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6),
                y,
                freedom,
                max_steps=100,
                throw=False,
            )
            return solution.value, None

        return lax.scan(with_freedom, y, freedoms)[0][: scale.size] * scale

    unknowns = jnp.concatenate([first, effects], axis=1)
    ends = lax.map(approach, (unknowns, freedoms))
    preference = _preference(scale, first[0])
    finalists, known, repeated = _distinct(posterior, ends, preference)
    climbed = lax.map(
        lambda start: _climb(posterior, scale, *start), (finalists, known)
    )
    return _in_order(posterior, climbed, repeated, preference), first[0]


def _preference(scale, middle):
    """Return what ranks ends by density, and equal ones by how near the middle."""

    def preference(z, density):
        away = jnp.sum(jnp.square(z / scale[None, :] - middle[None, :]), axis=1)
        return jnp.where(jnp.isnan(density), -jnp.inf, density - TIE_BREAK * away)

    return preference


def _in_order(posterior: Posterior, ends, repeated, preference) -> Optima:
    """Put ends in order, the best first."""
    density = lax.map(posterior.log_density, ends)
    density = jnp.where(jnp.isnan(density) | repeated, -jnp.inf, density)
    order = jnp.argsort(-preference(ends, density))
    return Optima(ends[order], density[order])


def _residuals(posterior: Posterior, scale, y, freedom):
    """Residuals of least squares, whose unknowns include the shared effects.

    Half the square of each is minus the Student-t log-density of that many degrees of
    freedom, up to a constant; of a lower bound, minus ln of its probability.
    """
    z, effects = y[: scale.size] * scale, y[scale.size :]
    misfit = posterior.misfit(z)
    u = (misfit.residual - misfit.loading @ effects) / misfit.sd
    away = jnp.abs(u) > 1e-6
    tail = (freedom + 1) * jnp.log1p(jnp.square(jnp.where(away, u, 1.0)) / freedom)
    near = u * jnp.sqrt((freedom + 1) / freedom)
    cost = jnp.where(away, jnp.sign(u) * jnp.sqrt(tail), near)
    if posterior.lower_bound is not None:
        survival = jnp.where(
            freedom == NORMAL, log_survival(u, "gaussian"), log_survival(u, "student")
        )
        bound = jnp.sqrt(LEAST_COST - 2 * survival)
        cost = jnp.where(posterior.lower_bound, bound, cost)
    return cost, effects, z * posterior.parameters.has_prior()


def _distinct(posterior: Posterior, ends, preference):
    """Pick the best ends that differ by more than `SAME` standard deviations.

    Returns:
        The ends, the information at each, and whether each repeats another because
        fewer were found.
    """
    density = preference(ends, lax.map(posterior.log_density, ends))

    def pick(left, _):
        best = jnp.argmax(left)
        known = information(posterior, ends[best])
        away = ends - ends[best][None, :]
        distance = jnp.einsum("ni,ij,nj->n", away, known, away)
        # at a sensor itself no slope is a number: that end alone goes
        itself = jnp.arange(len(ends)) == best
        gone = jnp.where(jnp.isfinite(known).all(), ~(distance > SAME**2), itself)
        picked = ends[best], known, left[best] == -jnp.inf
        return jnp.where(gone, -jnp.inf, left), picked

    return lax.scan(pick, density, length=FINALISTS)[1]


def _climb(posterior: Posterior, scale, z, known):
    """Climb the posterior from one place, in coordinates in which it is round.

    Where the data tell little, a step is bounded by a few typical ones.
    """
    import optimistix as optx

    values, vectors = jnp.linalg.eigh(known * scale[:, None] * scale[None, :])
    width = 1 / jnp.sqrt(jnp.maximum(values, 0.0) + LONGEST_STEP**-2)
    out = scale[:, None] * vectors * width[None, :]
    found = optx.minimise(
        lambda w, _: -posterior.log_density(z + out @ w),
        optx.BFGS(rtol=1e-10, atol=1e-10),
        jnp.zeros_like(z),
        max_steps=200,
        throw=False,
    )
    return z + out @ found.value
