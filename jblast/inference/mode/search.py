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

# With 64 starts 8 reach the best optimum of a log of five microphones with a free clock
# (see `starts.AMONG`). Fewer starts miss optima; each costs one least-squares search.
STARTS = 64
# Distinct ends that are climbed with the effects integrated out. Twice as many as the
# mirror images of a line or plane of sensors (four at most).
FINALISTS = 8
SAME_OPTIMUM_SD = 0.1
"""Ends closer than this many standard deviations are one optimum."""
MERGE_STEPS = 1e-4
"""Searches closer than this, in typical steps, are merged: far below any standard
deviation, and above the 1e-6 to which a search converges."""
SEPARATE = 1.0
"""Optima further apart than this many standard deviations are two answers."""
TIE_BREAK = 1e-6
"""Penalty in ln-density for each squared distance from the middle of the starts, in
their standard deviations. Of equally probable ends the nearest is preferred: ten
standard deviations outweigh a difference of 1e-4 in ln-density, no more."""
LONGEST_STEP = 10.0
"""Length of the first step along directions that the data hardly constrain, in typical
steps. Without the bound it would be as long as the inverse information: infinite."""
HOPELESS = 10.0
"""Optima with a density lower by more than this in ln are left out: a probability of
e^-10 of the best. If it is that of a subset of the rows, all rows rule them out
further.
"""
MIRROR_FLATNESS = 0.03
"""A layout whose extent across its line or plane is a smaller share of that along it is
taken as symmetric. The image in a wider layout is off the log by more than arrival
times with a scatter of 1 % allow."""
ROUNDS = 20
"""Largest number of Newton steps from an image to its optimum. The image is close to it
in a flat layout; a climb that needs more is a saddle."""
GAIN = 1e-6
"""A step that gains less than this in ln of the density is the last. An image must also
be better by more than this to come first."""
MIRROR_SEPARATION_SD = 2.0
"""An optimum closer to its image than this many standard deviations is not separated
from it: one normal approximation covers both."""
LEAST_COST = 1e-12
"""Added to the cost of a lower bound. Where it is exceeded by far the cost is 0, and
its root would have no slope."""
NORMAL_FREEDOM = 1e8
"""Degrees of freedom of normal errors. The Student-t cost differs from a normal one by
u^4 / 4 nu: 1e-4 at 14 standard deviations."""
MAX_SEARCH_ROWS = 1000
"""Largest number of rows of a search. It locates the basins, and all rows are used to
climb from its ends, so more rows cost time and find nothing else."""
MAX_SEARCH_PATHS = 32
"""Largest number of paths of a kind if paths have effects of their own: each effect is
an unknown of the least squares, whose cost is cubic in their number."""


class Optima(NamedTuple):
    """Optima found by searches, the most probable first.

    Attributes:
        z: Coordinates.
        log_density: ln of the posterior density; -inf for a repeated optimum.
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
    """Return the most probable starting point of a search.

    A long log is judged by a subset of its rows.
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

    # Half of the starts go through normal errors first: their cost grows without bound,
    # so it leads back from far away. Half do not: if two groups of readings disagree,
    # normal errors end between them, in the basin of neither.
    last = STUDENT_FREEDOM if posterior.noise == "student" else NORMAL_FREEDOM
    freedoms = jnp.tile(
        jnp.array([[NORMAL_FREEDOM, last], [last, last]]), (1, STARTS // 2)
    )

    # imported here: the import takes as long as loading a stored search program
    import optimistix as optx

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
    """Run consecutive searches from all starts; merged searches are computed once.

    Args:
        approach: Function of a place and degrees of freedom that returns the end of a
            search.
        unknowns: Starting points, one row each.
        freedoms: Degrees of freedom, shape (search, start).
    """
    searches, count = freedoms.shape
    begun = jnp.broadcast_to(unknowns, (searches + 1, *unknowns.shape))

    def one(places, at):
        search, start = at // count, at % count
        here, freedom = places[search], freedoms[search]
        # of earlier starts alone: the first of a group is searched, the others copy it
        met = (
            jnp.max(jnp.abs(here - here[start][None, :]), axis=1, initial=0.0)
            < MERGE_STEPS
        )
        met &= (freedom == freedom[start]) & (jnp.arange(count) < start)
        found = lax.cond(
            met.any(),
            lambda: places[search + 1, jnp.argmax(met)],
            lambda: approach(here[start], freedom[start]),
        )
        return places.at[search + 1, start].set(found), None

    return lax.scan(one, begun, jnp.arange(searches * count))[0][-1]


def _preference(scale, middle):
    """Return a function that scores ends by density, with `TIE_BREAK`."""

    def preference(z, density):
        away = jnp.sum(jnp.square(z / scale[None, :] - middle[None, :]), axis=1)
        return jnp.where(jnp.isnan(density), -jnp.inf, density - TIE_BREAK * away)

    return preference


def _in_order(ends: Optima, repeated, preference) -> Optima:
    """Return the ends in order of `preference`, the best first."""
    density = ends.log_density
    density = jnp.where(jnp.isnan(density) | repeated, -jnp.inf, density)
    order = jnp.argsort(-preference(ends.z, density))
    return Optima(ends.z[order], density[order])


def _distinct(posterior: Posterior, found: Optima, preference):
    """Pick the best ends that are farther apart than `SAME_OPTIMUM_SD`.

    Returns:
        The ends, the information at each, and a flag for those that repeat another one
        because fewer were found.
    """
    ends, density = found.z, preference(*found)

    def pick(left, _):
        best = jnp.argmax(left)
        known = information(posterior, ends[best])
        away = ends - ends[best][None, :]
        distance = jnp.einsum("ni,ij,nj->n", away, known, away)
        # at the position of a sensor the slopes are NaN: remove that end alone
        itself = jnp.arange(len(ends)) == best
        gone = jnp.where(
            jnp.isfinite(known).all(), ~(distance > SAME_OPTIMUM_SD**2), itself
        )
        there = Optima(ends[best], found.log_density[best])
        picked = there, known, left[best] == -jnp.inf
        return jnp.where(gone, -jnp.inf, left), picked

    return lax.scan(pick, density, length=FINALISTS)[1]


def _climb(posterior: Posterior, scale, z, known):
    """Climb the posterior from one place, in whitened coordinates.

    Steps along weakly constrained directions are bounded (`LONGEST_STEP`).
    """
    import optimistix as optx

    # BFGS begins with a unit matrix. In these coordinates that is the Hessian of the
    # expected information, so its first step is a Newton step.
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
        posterior: The posterior.
        found: Optima of the search, the best first.
    """
    best = np.asarray(found.z)[0]
    known = np.asarray(information(posterior, jnp.asarray(best)))
    # a prior of 1000 typical steps: it keeps Newton steps finite along null directions
    least = np.diag(1e-6 / np.square(np.asarray(typical_step(posterior))))
    everything = np.eye(len(best))

    def known_at(z):
        return np.asarray(information(posterior, jnp.asarray(z))) + least, everything

    images = []
    for image in _images(posterior, best):
        away = image - best
        if not away @ known @ away > MIRROR_SEPARATION_SD**2:
            continue
        end = climbed(posterior, image, known_at, np.add, rounds=ROUNDS, gain=GAIN)
        away = end.z - best
        if away @ known @ away > MIRROR_SEPARATION_SD**2:
            images.append((end.z, end.log_density))
    if not images:
        return found
    z = np.concatenate([np.asarray(found.z), np.array([z for z, _ in images])])
    density = np.append(np.asarray(found.log_density), [d for _, d in images])
    order = np.argsort(-density, kind="stable")
    # the best of the search stays first unless an image is better by more than rounding
    order = np.concatenate([[0], order[order != 0]])
    if density[order[1:]].max() > density[0] + GAIN:
        order = np.argsort(-density, kind="stable")
    return Optima(jnp.asarray(z[order]), jnp.asarray(density[order]))


def _images(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> list[Float[np.ndarray, " free"]]:
    """Return the mirror images of a place in the line and the plane of the sensors."""
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
        # two sensors always form a line; rounding may give them a second extent
        if len(position) == 2 or sizes[1] < MIRROR_FLATNESS * sizes[0]:
            normal = np.zeros(len(z))
            normal[[east, north]] = axes[1]
            mirrors.append((normal, middle[:2] @ axes[1]))
    if up >= 0 and np.ptp(position[:, 2]) < MIRROR_FLATNESS * width:
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

    Half the square of each is minus the Student-t log-density for these degrees of
    freedom, up to a constant. For a lower bound it is minus ln of its probability.
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
    """Derivative of the residuals.

    Only the slopes by z go through the laws. The effects are often many more, and the
    residuals are linear in them.
    """
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
    """Return residuals less the effects, and loadings, in standard deviations."""
    misfit = posterior.misfit(z)
    load = misfit.loading / misfit.sd[:, None]
    return misfit.residual / misfit.sd - load @ effects, load


def _costs_of(posterior: Posterior, freedom, u):
    """Return signed roots of twice the cost of rows that are off by u sigmas."""
    # the root has no slope at u = 0: below 1e-6 its series, which is exact to 1e-12
    away = jnp.abs(u) > 1e-6
    tail = (freedom + 1) * jnp.log1p(jnp.square(jnp.where(away, u, 1.0)) / freedom)
    near = u * jnp.sqrt((freedom + 1) / freedom)
    cost = jnp.where(away, jnp.sign(u) * jnp.sqrt(tail), near)
    if posterior.lower_bound is None:
        return cost
    survival = jnp.where(
        freedom == NORMAL_FREEDOM,
        log_survival(u, "gaussian"),
        log_survival(u, "student"),
    )
    bound = jnp.sqrt(LEAST_COST - 2 * survival)
    return jnp.where(posterior.lower_bound, bound, cost)


def is_long(posterior: Posterior) -> bool:
    """Return True if a log has more rows or paths than a search uses."""
    layout = posterior.layout
    if len(layout.quantity) > MAX_SEARCH_ROWS:
        return True
    return len(set(layout.group)) > MAX_SEARCH_PATHS and _has_path_effects(posterior)


def row_subset(posterior: Posterior) -> Posterior:
    """Return the posterior of some rows for each quantity, charge and free clock.

    Shared errors of readings are taken as independent errors of the same size.
    """
    posterior = posterior.independent()
    paths = MAX_SEARCH_PATHS if _has_path_effects(posterior) else None
    free = [
        name.partition(".")[2]
        for name, belief in zip(
            posterior.parameters.names, posterior.parameters.beliefs, strict=True
        )
        if name.startswith(f"{CLOCK_OFFSET}.") and isinstance(belief, Free)
    ]
    rows = spread_rows(posterior.layout, MAX_SEARCH_ROWS, paths=paths, clocks=free)
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
    """Select rows of every kind in equal numbers, from all paths in turn.

    Args:
        layout: Rows of a log.
        most: Largest number of rows, unless there are more kinds.
        paths: Largest number of paths of each kind; None for all.
        clocks: Clocks whose rows are separate kinds.
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
    # the rarest first: the unused part of its share goes to the other kinds
    for count, rows in enumerate(sorted(kinds.values(), key=len)):
        share = max(left // (len(kinds) - count), 1)
        some = _in_turn(np.array(rows), group[rows], share, paths)
        kept.append(some)
        left -= len(some)
    return np.sort(np.concatenate(kept))


def _in_turn(rows, group, share: int, paths: int | None) -> np.ndarray:
    """Pick the first row of every path, then the second of every path, ..."""
    groups, path = np.unique(group, return_inverse=True)
    if paths is not None and len(groups) > paths:
        chosen = np.isin(path, np.linspace(0, len(groups) - 1, paths).astype(int))
        rows, path = rows[chosen], path[chosen]
    order = np.argsort(path, kind="stable")
    start = np.searchsorted(path[order], path[order])
    turn = np.empty(len(rows), int)
    turn[order] = np.arange(len(rows)) - start
    by_turn = np.lexsort((path, turn))
    if len(by_turn) <= share:
        return rows
    # the last round is incomplete: its rows are spread evenly over the paths
    last = turn[by_turn[share - 1]]
    whole = by_turn[turn[by_turn] < last]
    part = by_turn[turn[by_turn] == last]
    some = np.linspace(0, len(part) - 1, share - len(whole)).astype(int)
    return rows[np.concatenate([whole, part[some]])]


def _has_path_effects(posterior: Posterior) -> bool:
    return bool(
        path_effects(posterior.parameters.scene, posterior.layout, dict(posterior.laws))
    )
