"""Search for all optima of a posterior.

Least squares from many starts (Levenberg-Marquardt), with the shared effects among the
unknowns. With normal errors it reaches the right basin from far away; the Student-t
cost, which follows, ignores wild readings; half of the starts use that cost alone. Each
row, shared effect and prior is one residual whose half square is its cost. From the
best few ends BFGS climbs the posterior itself, in which the effects are integrated out,
in coordinates whitened by the Fisher information. Correlated errors of one record are
integrated out in this last step only; until then they count as independent.

A long log is searched with a subset of its rows, spread over quantities, shots and
paths: the optima of all rows lie near those of the subset. All rows are used to climb
from its ends.

Sensors in a line, seen from above, measure the same for a charge on either side of it,
and sensors in a plane the same for a charge above and below it. A search need not reach
both, so the mirror image of the best optimum is tried as one more start.

Starts are run one after another inside one compiled loop: for 64 starts of a small log
`vmap` runs in 0.12 s instead of 0.17 s, but takes 1.4 s longer to trace and load. The
whole search may be batched over logs.
"""

from collections.abc import Collection
from itertools import combinations
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int, PRNGKeyArray

from jblast.inference.mode.laplace import climbed
from jblast.inference.mode.starts import start_sd, starts, typical_step
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.likelihood import log_survival
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.scene import Free
from jblast.sensors import Layout
from jblast.sensors.record import path_effects
from jblast.sensors.simulated_readings import STUDENT_FREEDOM

STARTS = 64
FINALISTS = 8
SAME_OPTIMUM_SD = 0.1
"""Ends closer than this many standard deviations are one optimum."""
MET = 1e-4
"""Searches nearer one another than this, in typical steps, are at one place."""
SEPARATE = 1.0
"""Optima further apart than this many standard deviations are two answers."""
TIE_BREAK = 1e-6
"""Among ends equally probable the one nearest the middle of the starts is preferred:
this penalty in ln-density for each squared distance in sd of the starts."""
LONGEST_STEP = 10.0
"""Where the data constrain little, climb by this many typical steps at first."""
HOPELESS = 10.0
"""An end whose density by some of the rows is so much lower in ln is left out: by all
rows it is further behind."""
FLAT = 0.03
"""A layout whose extent across its line or plane is a smaller share of that along it is
taken as symmetric: an image by a wider one is off the log by more than arrival times
with a scatter of 1 % allow."""
ROUNDS = 20
"""Newton steps from an image to its optimum."""
GAIN = 1e-6
"""A step that gains less than this in ln of the density is the last."""
ASIDE = 2.0
"""An optimum nearer to its image than this many standard deviations is one with it."""
LEAST_COST = 1e-12
"""Of a lower bound that is passed by far, so that its square root has a slope."""
NORMAL = 1e8
"""So many degrees of freedom make a Student-t normal."""
MOST_ROWS = 1000
"""A search goes through no more rows than these."""
MOST_PATHS = 32
"""Nor, where paths have effects of their own, through more paths of a kind."""


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

    tops = lax.map(climb, (finalists, known, repeated))
    return _in_order(tops, repeated, preference), first[0]


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
    """Pick the best ends that are farther apart than `SAME_OPTIMUM_SD`.

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
        gone = jnp.where(
            jnp.isfinite(known).all(), ~(distance > SAME_OPTIMUM_SD**2), itself
        )
        there = Optima(ends[best], found.log_density[best])
        picked = there, known, left[best] == -jnp.inf
        return jnp.where(gone, -jnp.inf, left), picked

    return lax.scan(pick, density, length=FINALISTS)[1]


def _climb(posterior: Posterior, scale, z, known):
    """Climb the posterior from one place, in coordinates in which it is round.

    Where the data constrain little, a step is bounded by a few typical ones.
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


def with_mirror_images(posterior: Posterior, found: Optima) -> Optima:
    """Add the mirror images of the best optimum that are optima themselves.

    Args:
        posterior: What was searched.
        found: Ends of the search, the best first.
    """
    best = np.asarray(found.z)[0]
    known = np.asarray(information(posterior, jnp.asarray(best)))
    least = np.diag(1e-6 / np.square(np.asarray(typical_step(posterior))))
    everything = np.eye(len(best))

    def known_at(z):
        return np.asarray(information(posterior, jnp.asarray(z))) + least, everything

    images = []
    for image in _images(posterior, best):
        away = image - best
        if not away @ known @ away > ASIDE**2:
            continue
        end = climbed(posterior, image, known_at, np.add, rounds=ROUNDS, gain=GAIN)
        away = end.z - best
        if away @ known @ away > ASIDE**2:
            images.append((end.z, end.log_density))
    if not images:
        return found
    z = np.concatenate([np.asarray(found.z), np.array([z for z, _ in images])])
    density = np.append(np.asarray(found.log_density), [d for _, d in images])
    order = np.argsort(-density, kind="stable")
    # the best of the search stays the answer unless an image is better by itself
    order = np.concatenate([[0], order[order != 0]])
    if density[order[1:]].max() > density[0] + GAIN:
        order = np.argsort(-density, kind="stable")
    return Optima(jnp.asarray(z[order]), jnp.asarray(density[order]))


def _images(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> list[Float[np.ndarray, " free"]]:
    """Return the images of a place in the symmetries of the layout."""
    parameters, position = posterior.parameters, posterior.layout.places()
    scene = parameters.scene
    if len(scene.charges) > 1 or scene.charge.range_m is not None or len(position) < 2:
        return []

    def free(name):
        at = parameters.names.index(name) if name in parameters.names else -1
        return at if at >= 0 and isinstance(parameters.beliefs[at], Free) else -1

    east, north, up = map(free, CHARGE_POSITION)
    middle = position.mean(axis=0)
    width = float(np.ptp(position, axis=0).max())
    mirrors = []
    if east >= 0 and north >= 0:
        _, sizes, axes = np.linalg.svd(position[:, :2] - middle[:2])
        if len(position) == 2 or sizes[1] < FLAT * sizes[0]:
            normal = np.zeros(len(z))
            normal[[east, north]] = axes[1]
            mirrors.append((normal, middle[:2] @ axes[1]))
    if up >= 0 and np.ptp(position[:, 2]) < FLAT * width:
        normal = np.zeros(len(z))
        normal[up] = 1.0
        mirrors.append((normal, middle[2]))
    images = []
    for count in range(1, len(mirrors) + 1):
        for some in combinations(mirrors, count):
            image = np.array(z)
            for normal, offset in some:
                image = image - 2 * (normal @ image - offset) * normal
            images.append(image)
    return images


def residuals(posterior: Posterior, scale, y, freedom):
    """Residuals of least squares, whose unknowns include the shared effects.

    Half the square of each is minus the Student-t log-density of that many degrees of
    freedom, up to a constant; of a lower bound, minus ln of its probability.
    """
    z, effects = y[: scale.size] * scale, y[scale.size :]
    cost = _costs(posterior, freedom, z, effects)
    return cost, effects, z * posterior.parameters.has_prior()


@eqx.filter_custom_jvp
def _costs(posterior: Posterior, freedom, z, effects):
    """Residuals of the rows, see `residuals`."""
    return _costs_of(posterior, freedom, _missed(posterior, z, effects)[0])


@_costs.def_jvp
def _costs_moved(primals, tangents):
    """Slopes to z alone go through the laws: effects, often many more, are linear."""
    posterior, freedom, z, effects = primals
    *_, z_moved, effects_moved = tangents

    def missed(z):
        u, load = _missed(posterior, z, effects)
        return u, (u, load)

    slopes, (u, load) = jax.jacfwd(missed, has_aux=True)(z)
    costs, steepness = jax.jvp(
        lambda u: _costs_of(posterior, freedom, u), (u,), (jnp.ones_like(u),)
    )
    moved = jnp.zeros_like(u) if z_moved is None else slopes @ z_moved
    if effects_moved is not None:
        moved = moved - load @ effects_moved
    return costs, steepness * moved


def _missed(posterior: Posterior, z, effects):
    """Return what is missed, and what effects add to it, in standard deviations."""
    misfit = posterior.misfit(z)
    load = misfit.loading / misfit.sd[:, None]
    return misfit.residual / misfit.sd - load @ effects, load


def _costs_of(posterior: Posterior, freedom, u):
    """Return the residuals of rows missed by u standard deviations."""
    away = jnp.abs(u) > 1e-6
    tail = (freedom + 1) * jnp.log1p(jnp.square(jnp.where(away, u, 1.0)) / freedom)
    near = u * jnp.sqrt((freedom + 1) / freedom)
    cost = jnp.where(away, jnp.sign(u) * jnp.sqrt(tail), near)
    if posterior.lower_bound is None:
        return cost
    survival = jnp.where(
        freedom == NORMAL, log_survival(u, "gaussian"), log_survival(u, "student")
    )
    bound = jnp.sqrt(LEAST_COST - 2 * survival)
    return jnp.where(posterior.lower_bound, bound, cost)


def is_long(posterior: Posterior) -> bool:
    """Return whether a log has more than a search should go through."""
    layout = posterior.layout
    if len(layout.quantity) > MOST_ROWS:
        return True
    return len(set(layout.group)) > MOST_PATHS and _has_path_effects(posterior)


def row_subset(posterior: Posterior) -> Posterior:
    """Keep some rows of every kind: of each quantity, charge and clock that is free.

    Errors that readings share are taken as independent, of the same sizes.
    """
    posterior = posterior.independent()
    paths = MOST_PATHS if _has_path_effects(posterior) else None
    free = [
        name.partition(".")[2]
        for name, belief in zip(
            posterior.parameters.names, posterior.parameters.beliefs, strict=True
        )
        if name.startswith(f"{CLOCK_OFFSET}.") and isinstance(belief, Free)
    ]
    rows = spread_rows(posterior.layout, MOST_ROWS, paths=paths, clocks=free)
    return Posterior(
        parameters=posterior.parameters,
        layout=posterior.layout.only(rows),
        measured=posterior.measured[rows],
        sigma=posterior.sigma[rows],
        laws=posterior.laws,
        noise=posterior.noise,
        lower_bound=None
        if posterior.lower_bound is None
        else posterior.lower_bound[rows],
    )


def spread_rows(
    layout: Layout, most: int, *, paths: int | None = None, clocks: Collection[str] = ()
) -> Int[np.ndarray, " kept"]:
    """Pick rows of every kind in equal numbers, from all paths in turn.

    Args:
        layout: Rows of a log.
        most: Rows wanted in all; more only if there are more kinds.
        paths: Paths wanted of each kind, if not all.
        clocks: Clocks whose rows are kinds of their own.
    """
    of_clock = [clock if clock in clocks else "" for clock in layout.clock]
    kinds: dict[tuple, list[int]] = {}
    for row, kind in enumerate(
        zip(layout.quantity, layout.shot, of_clock, strict=True)
    ):
        kinds.setdefault(kind, []).append(row)
    group = np.array(layout.group)
    kept: list[np.ndarray] = []
    left = most
    # the rarest first: what it leaves of its share goes to the others
    for count, rows in enumerate(sorted(kinds.values(), key=len)):
        share = max(left // (len(kinds) - count), 1)
        some = _in_turn(np.array(rows), group[rows], share, paths)
        kept.append(some)
        left -= len(some)
    return np.sort(np.concatenate(kept))


def _in_turn(rows, group, share: int, paths: int | None) -> np.ndarray:
    """Pick the first row of every path, then the second of every path, ..."""
    ways, way = np.unique(group, return_inverse=True)
    if paths is not None and len(ways) > paths:
        chosen = np.isin(way, np.linspace(0, len(ways) - 1, paths).astype(int))
        rows, way = rows[chosen], way[chosen]
    order = np.argsort(way, kind="stable")
    start = np.searchsorted(way[order], way[order])
    turn = np.empty(len(rows), int)
    turn[order] = np.arange(len(rows)) - start
    by_turn = np.lexsort((way, turn))
    if len(by_turn) <= share:
        return rows
    last = turn[by_turn[share - 1]]  # of the last round only some paths are taken
    whole = by_turn[turn[by_turn] < last]
    part = by_turn[turn[by_turn] == last]
    some = np.linspace(0, len(part) - 1, share - len(whole)).astype(int)
    return rows[np.concatenate([whole, part[some]])]


def _has_path_effects(posterior: Posterior) -> bool:
    return bool(
        path_effects(posterior.parameters.scene, posterior.layout, dict(posterior.laws))
    )
