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

from jblast.inference.mode.least_squares import NORMAL, residuals
from jblast.inference.mode.row_subset import is_long, row_subset
from jblast.inference.mode.starts import start_sd, starts
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.sensors.simulate import STUDENT_FREEDOM

STARTS = 64
FINALISTS = 8
SAME = 0.1
"""Ends closer than this many standard deviations are one optimum."""
MET = 1e-4
"""Searches nearer one another than this, in typical steps, are at one place."""
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
            lambda: Optima(jnp.full_like(z, jnp.nan), jnp.full_like(density, -jnp.inf)),
        )

    preference = _preference(scale, middle)
    ends = lax.map(climb, found)
    distinct, _, repeated = _distinct(posterior, ends, preference)
    return _in_order(distinct, repeated, preference)


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
    first = starts(key, posterior, STARTS, far=True) / scale[None, :]
    near = posterior.independent()
    shape = jax.eval_shape(near.misfit, first[0]).loading.shape
    effects = jnp.zeros((STARTS, shape[1]))

    # Half of the starts go through normal errors, which see far; half do not, since
    # where two groups of readings disagree normal errors end between them.
    last = STUDENT_FREEDOM if posterior.noise == "student" else NORMAL
    freedoms = jnp.tile(jnp.array([[NORMAL, last], [last, last]]), (1, STARTS // 2))

    import optimistix as optx  # takes as long to import as a kept search to find

    def approach(y, freedom):
        return optx.least_squares(
            lambda y, freedom: residuals(near, scale, y, freedom),
            optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6),
            y,
            freedom,
            max_steps=100,
            throw=False,
        ).value

    unknowns = jnp.concatenate([first, effects], axis=1)
    places = onward(approach, unknowns, freedoms)[:, : scale.size]
    places = places * scale[None, :]
    ends = Optima(places, lax.map(posterior.log_density, places))
    preference = _preference(scale, first[0])
    finalists, known, repeated = _distinct(posterior, ends, preference)

    def climb(start):
        end, known, repeated = start
        return lax.cond(
            repeated, lambda: end, lambda: _climb(posterior, scale, end.z, known)
        )

    climbed = lax.map(climb, (finalists, known, repeated))
    return _in_order(climbed, repeated, preference), first[0]


def onward(approach, unknowns, freedoms):
    """Take starts through one search after another; those that have met go as one.

    Args:
        approach: Searches from a place, with so many degrees of freedom.
        unknowns: Where each begins.
        freedoms: Of each search, by start.
    """
    searches, count = freedoms.shape
    begun = jnp.broadcast_to(unknowns, (searches + 1, *unknowns.shape))

    def one(places, at):
        search, start = at // count, at % count
        here, freedom = places[search], freedoms[search]
        met = jnp.max(jnp.abs(here - here[start][None, :]), axis=1, initial=0.0) < MET
        met &= (freedom == freedom[start]) & (jnp.arange(count) < start)
        found = lax.cond(
            met.any(),
            lambda: places[search + 1, jnp.argmax(met)],
            lambda: approach(here[start], freedom[start]),
        )
        return places.at[search + 1, start].set(found), None

    return lax.scan(one, begun, jnp.arange(searches * count))[0][-1]


def _preference(scale, middle):
    """Return what ranks ends by density, and equal ones by how near the middle."""

    def preference(z, density):
        away = jnp.sum(jnp.square(z / scale[None, :] - middle[None, :]), axis=1)
        return jnp.where(jnp.isnan(density), -jnp.inf, density - TIE_BREAK * away)

    return preference


def _in_order(ends: Optima, repeated, preference) -> Optima:
    """Put ends in order, the best first."""
    density = ends.log_density
    density = jnp.where(jnp.isnan(density) | repeated, -jnp.inf, density)
    order = jnp.argsort(-preference(ends.z, density))
    return Optima(ends.z[order], density[order])


def _distinct(posterior: Posterior, found: Optima, preference):
    """Pick the best ends that differ by more than `SAME` standard deviations.

    Returns:
        The ends, the information at each, and whether each repeats another because
        fewer were found.
    """
    ends, density = found.z, preference(*found)

    def pick(left, _):
        best = jnp.argmax(left)
        known = information(posterior, ends[best])
        away = ends - ends[best][None, :]
        distance = jnp.einsum("ni,ij,nj->n", away, known, away)
        # at a sensor itself no slope is a number: that end alone goes
        itself = jnp.arange(len(ends)) == best
        gone = jnp.where(jnp.isfinite(known).all(), ~(distance > SAME**2), itself)
        there = Optima(ends[best], found.log_density[best])
        picked = there, known, left[best] == -jnp.inf
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

    def fall(w, _):
        density = posterior.log_density(z + out @ w)
        return -density, density

    found = optx.minimise(
        fall,
        optx.BFGS(rtol=1e-10, atol=1e-10),
        jnp.zeros_like(z),
        has_aux=True,
        max_steps=200,
        throw=False,
    )
    return Optima(z + out @ found.value, found.aux)
