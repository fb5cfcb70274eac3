r"""The most probable numbers by least squares, and their uncertainty.

Levenberg-Marquardt runs with fixed weights. The weights are then evaluated at its
result, and both are repeated until the result settles. The information of the record is
$J^T J$ of the residuals there, in units of large changes. A direction in which it is
less than `LEAST_INFORMATION` is a null direction: two large changes along it leave the
record as it is. A weak pull to the start keeps such directions at the start; intervals
are those of all others.

A step solves $(J^T J + \lambda\,\mathrm{diag}\,J^T J)\,p = -J^T r$. Only $J^T J$ and
$J^T r$ are stored, and the columns of $J$ are computed one after another, so a record's
residuals are held twice and no more. The damping follows the ratio of actual to
predicted gain (Nielsen 1999, IMM-REP-1999-05, from memory). The search ends where a
full step would be shorter than `CONVERGED_SD` standard deviations, $\sqrt{g^T A^{-1}
g}$.

For a camera, the rim of a fireball at another position than expected has no slope
towards it, and clipped white has none at all: a search from afar can end where nothing
fits. So the residual is evaluated at several points, up to a few large changes away,
and a search begins at the best one, or at the next where that does not lead to a fit.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.tuning.unknowns import Unknown, tuned_value, with_tuned
from jblast.scene import Scene

LEAST_INFORMATION = 0.25
"""Information on a large change below which a direction is a null direction: one
standard deviation is then more than two large changes."""
PULL = 1e-3
"""Weak prior at the start: one over its standard deviation in large changes. It is far
below `LEAST_INFORMATION`, and keeps the equations regular."""
MAX_ROUNDS = 12
"""Largest number of updates of the weights. Without convergence by then the result is
reported as not converged."""
SETTLED = 0.02
"""Change between rounds, in standard deviations, at which the result has settled."""
# of one search, accepted or not: a well-posed one takes far fewer
MAX_STEPS = 100
PLACES, TRIED = 96, 3
"""Number of places at which the residual is evaluated, and of searches from the best of
them. An evaluation costs much less than a search."""
SPREAD = 0.7
"""Standard deviation of these places in large changes."""
CONVERGED_SD = 1e-3
"""Distance from the optimum at which a search stops [sd]."""
AT_REST = 0.02
"""Distance from the optimum within which a search that cannot descend has converged
[sd]: rounding hides a smaller gain."""
FIRST_DAMPING, MIN_DAMPING, MAX_DAMPING = 1e-3, 1e-12, 1e12
"""Initial, smallest and largest damping. At the smallest a step is that of
Gauss-Newton, at the largest it is below rounding, and the search ends."""


class Solution(NamedTuple):
    """End of a search.

    Attributes:
        z: Coordinates.
        record_information: Information of the record, in large changes.
        prior_information: Information of the priors, in large changes.
        rounds: Number of updates of the weights.
        converged: True if the search converged.
    """

    z: Float[np.ndarray, " unknown"]
    record_information: Float[np.ndarray, "unknown unknown"]
    prior_information: Float[np.ndarray, "unknown unknown"]
    rounds: int
    converged: bool


class Problem(eqx.Module):
    """A record, a scene, and the numbers to tune.

    Attributes:
        evidence: The record, with `index`, `weights` and `residuals` as in
            `SoundEvidence`.
        scene: The scene, in which numbers are replaced.
        unknowns: The numbers to tune.
        start: Coordinates of the start, and of the weak prior `PULL`.
    """

    evidence: Any
    scene: Scene
    unknowns: tuple[Unknown, ...]
    start: Float[Array, " unknown"]

    def scene_at(self, z: Float[Array, " unknown"]) -> Scene:
        """Return the scene for some coordinates."""
        values = {
            one.name: one.belief.constrain(z[number])
            for number, one in enumerate(self.unknowns)
        }
        return with_tuned(self.scene, self.evidence.index, values)

    def steps(self) -> Float[Array, " unknown"]:
        """Return a large change of each coordinate."""
        return jnp.stack([one.step for one in self.unknowns])

    def has_prior(self) -> Float[Array, " unknown"]:
        """Return 1 for numbers with a prior, else 0."""
        return jnp.array([float(one.has_prior) for one in self.unknowns])


def problem_from(evidence: Any, scene: Scene, unknowns: tuple[Unknown, ...]) -> Problem:
    """Return the problem whose search begins at the values of a scene."""
    start = []
    for one in unknowns:
        held = tuned_value(scene, evidence.index, one.name)
        assert held is not None, "unknowns are filled in before"
        start.append(one.belief.unconstrain(held))
    return Problem(evidence, scene, unknowns, jnp.stack(start))


def solve(
    problem: Problem, begin: Float[np.ndarray, " unknown"] | None = None
) -> Solution:
    """Return the most probable numbers, by a search from a place or from the start."""
    # First without the residuals that constrain the noise: the misfit of the wave form
    # at the start would be taken for noise.
    begun = problem.start if begin is None else jnp.asarray(begin)
    z, _ = _round(problem, begun, jnp.zeros(()))
    converged, rounds = False, 0
    for _ in range(MAX_ROUNDS):
        rounds += 1
        new, ended = _round(problem, z, jnp.ones(()))
        known, believed = information(problem, new)
        # of the weak prior at most, along null directions
        total = np.asarray(known) + np.asarray(believed)
        total = total + PULL**2 * np.eye(len(total))
        sd = np.sqrt(np.diag(np.linalg.inv(total)))
        steps = np.asarray(problem.steps())
        moved = np.abs(np.asarray(new - z)) / steps / sd
        z = new
        # a diverged search ends here, and is reported as not converged
        if not np.isfinite(np.asarray(z)).all():
            break
        if moved.max(initial=0.0) < SETTLED:
            converged = bool(ended)
            break
    known, believed = information(problem, z)
    return Solution(
        np.asarray(z), np.asarray(known), np.asarray(believed), rounds, converged
    )


@eqx.filter_jit
def _round(problem: Problem, z: Float[Array, " unknown"], share: Float[Array, ""]):
    """Return the end of least squares with the weights of a place, and convergence.

    Args:
        problem: The problem.
        z: The place.
        share: Factor on the residuals that constrain noise (all but the first): 1 or 0.
    """
    steps, has_prior = problem.steps(), problem.has_prior()
    weights = problem.evidence.weights(problem.scene_at(z))

    def residuals(y: Float[Array, " unknown"]):
        z = y * steps
        first, *rest = problem.evidence.residuals(problem.scene_at(z), weights)
        data = first, [share * one for one in rest]
        pull = PULL * (1.0 - has_prior) * (y - problem.start / steps)
        return data, has_prior * z, pull

    place, ended = least_squares(residuals, z / steps, most_steps=MAX_STEPS)
    return place * steps, ended


@eqx.filter_jit
def information(
    problem: Problem, z: Float[Array, " unknown"]
) -> tuple[Float[Array, "unknown unknown"], Float[Array, "unknown unknown"]]:
    """Return the information of record and priors on large changes at a place."""
    steps, has_prior = problem.steps(), problem.has_prior()
    weights = problem.evidence.weights(problem.scene_at(z))

    def residuals(y: Float[Array, " unknown"]):
        data = problem.evidence.residuals(problem.scene_at(y * steps), weights)
        return jax.tree.leaves(data)

    count = z.size
    rows = [slope.reshape(count, -1) for slope in columns(residuals, z / steps)]
    known = sum((row @ row.T for row in rows), jnp.zeros((count, count)))
    return known, jnp.diag(has_prior * jnp.square(steps))


def identified_and_null(
    information: Float[np.ndarray, "unknown unknown"],
) -> tuple[
    Float[np.ndarray, "identified unknown"], Float[np.ndarray, "null unknown"], Any
]:
    """Split directions into identified and null ones.

    Returns:
        Identified directions, null directions, and the covariance in large changes.
        Null directions have a standard deviation of two large changes there, so numbers
        with a small component in them have a correspondingly larger one.
    """
    values, vectors = np.linalg.eigh(information)
    identified = values >= LEAST_INFORMATION
    covariance = (vectors / np.maximum(values, LEAST_INFORMATION)) @ vectors.T
    return vectors[:, identified].T, vectors[:, ~identified].T, covariance


def widening(problem: Problem, z: Float[np.ndarray, " unknown"]) -> Any:
    """Return the factor by which correlated residuals widen standard deviations.

    Residuals of one group (`evidence.groups`) need not be independent: rounding of
    slowly varying values is similar all over a frame, and thresholds are common to the
    events of a pixel. The scatter of the groups' scores is used: $A^{-1} B A^{-1}$ with
    $B$ the sum over groups of the square of the score (White 1980; Liang and Zeger
    1986, both from memory), where that is more than $A^{-1}$.
    """
    known, believed = information(problem, jnp.asarray(z))
    groups, count = problem.evidence.groups()
    scores = np.asarray(_scores(problem, jnp.asarray(z), groups, count))
    total = np.asarray(known) + np.asarray(believed)
    _, _, covariance = identified_and_null(total)
    # sandwich covariance; the diagonal of the plain covariance is its lower limit
    together = covariance @ (scores @ scores.T) @ covariance
    own, wide = np.diag(covariance), np.diag(together)
    ratio = np.where(own > 0, wide / np.where(own > 0, own, 1.0), 1.0)
    return np.sqrt(np.maximum(ratio, 1.0))


@eqx.filter_jit
def _scores(problem: Problem, z, groups, count: int) -> Float[Array, "unknown group"]:
    steps = problem.steps()
    weights = problem.evidence.weights(problem.scene_at(z))

    def residuals(y):
        return problem.evidence.residuals(problem.scene_at(y * steps), weights)[0]

    left = residuals(z / steps)
    slopes = columns(residuals, z / steps)
    parts = (slopes * left[None]).reshape(z.size, -1)
    return jax.vmap(lambda part: jax.ops.segment_sum(part, groups, count))(parts)


def best_of_several(problem: Problem, allowed: float) -> tuple[Solution, float]:
    """Return the best result of searches from several places, and its error.

    Args:
        problem: The problem.
        allowed: Error (`misfit`) at which no further search is made.
    """
    ended = []
    for place in places(problem)[:TRIED]:
        found = solve(problem, place)
        (error,) = np.asarray(_misfits(problem, jnp.asarray(found.z)[None]))
        ended.append((error if np.isfinite(error) else np.inf, found))
        # a result within its error needs no further search
        if error <= allowed:
            break
    error, found = min(ended, key=lambda one: one[0])
    return found, float(error)


def places(problem: Problem) -> list[Float[np.ndarray, " unknown"]]:
    """Return starting places, that of the smallest misfit first.

    They are reproducible and include the start of the problem.
    """
    start, steps = np.asarray(problem.start), np.asarray(problem.steps())
    drawn = np.random.default_rng(0).normal(size=(PLACES, start.size))
    # the start itself is one of the places
    drawn[0] = 0.0
    evaluated = start + SPREAD * drawn * steps
    left = np.asarray(_misfits(problem, jnp.asarray(evaluated)))
    order = np.argsort(np.where(np.isfinite(left), left, np.inf), kind="stable")
    return list(evaluated[order])


@eqx.filter_jit
def _misfits(
    problem: Problem, places: Float[Array, "place unknown"]
) -> Float[Array, " place"]:
    return jax.lax.map(lambda z: problem.evidence.misfit(problem.scene_at(z)), places)


class Slopes(NamedTuple):
    """Expansion of residuals about a place: cost, its gradient, and $J^T J$."""

    cost: Float[Array, ""]
    gradient: Float[Array, " unknown"]
    squares: Float[Array, "unknown unknown"]


class _Search(NamedTuple):
    y: Float[Array, " unknown"]
    here: Slopes
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    steps: Int[Array, ""]
    away: Float[Array, ""]


def least_squares(
    residuals: Callable[[Float[Array, " unknown"]], Any],
    start: Float[Array, " unknown"],
    *,
    most_steps: int,
) -> tuple[Float[Array, " unknown"], Bool[Array, ""]]:
    """Return the minimum of a sum of squares, and True if the search converged.

    Args:
        residuals: Function of the numbers that returns arrays of any shapes.
        start: Starting point.
        most_steps: Largest number of steps, accepted or not.
    """

    def continues(search: _Search) -> Bool[Array, ""]:
        able = (search.damping < MAX_DAMPING) & (search.steps < most_steps)
        return able & (search.away > CONVERGED_SD) & jnp.isfinite(search.here.cost)

    def step(search: _Search) -> _Search:
        y, here, damping, growth, steps, _ = search
        own = jnp.diag(here.squares)
        move = _solved(here.squares + jnp.diag(damping * own), -here.gradient)
        there = 0.5 * _square(residuals(y + move))
        wanted = 0.5 * move @ (damping * own * move - here.gradient)
        ratio = (here.cost - there) / wanted
        taken = jnp.isfinite(there) & (there < here.cost)
        # Nielsen's update: less damping the better the model predicted the gain
        gained = jnp.maximum(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        new = jnp.where(taken, y + move, y)
        # the derivatives are computed for accepted steps only: they cost one evaluation
        # per unknown
        here = jax.lax.cond(taken, lambda: slopes_at(residuals, new), lambda: here)
        return _Search(
            y=new,
            here=here,
            damping=jnp.maximum(
                damping * jnp.where(taken, gained, growth), MIN_DAMPING
            ),
            growth=jnp.where(taken, 2.0, 2.0 * growth),
            steps=steps + 1,
            away=_away(here),
        )

    here = slopes_at(residuals, start)
    one = jnp.ones((), start.dtype)
    begun = _Search(
        start, here, FIRST_DAMPING * one, 2.0 * one, jnp.zeros((), int), _away(here)
    )
    found = jax.lax.while_loop(continues, step, begun)
    # no step descends any more: converged if the rest is within rounding
    stuck = (found.damping >= MAX_DAMPING) & (found.away <= AT_REST)
    return found.y, (found.away <= CONVERGED_SD) | stuck


def slopes_at(
    residuals: Callable[[Float[Array, " unknown"]], Any], y: Float[Array, " unknown"]
) -> Slopes:
    """Return cost, gradient and $J^T J$ of residuals about a place."""
    left = jax.tree.leaves(residuals(y))
    rows = jax.tree.leaves(columns(lambda y: jax.tree.leaves(residuals(y)), y))
    rows = [row.reshape(y.size, -1) for row in rows]
    return Slopes(
        0.5 * _square(left),
        sum((row @ one.ravel() for row, one in zip(rows, left, strict=True)), 0.0 * y),
        sum((row @ row.T for row in rows), jnp.zeros((y.size, y.size), y.dtype)),
    )


def columns(function: Callable[..., Any], y: Float[Array, " unknown"]) -> Any:
    """Return the derivatives of a function, one coordinate after another, stacked.

    They are not computed by `vmap`, which would need memory for all records together.
    Also, batches of Fourier transforms can deadlock in XLA's thread pool on the CPU
    (PyAutoFit issue 1530: each requests the whole pool from within it).
    """
    return jax.lax.map(
        lambda unit: jax.jvp(function, (y,), (unit,))[1], jnp.eye(y.size, dtype=y.dtype)
    )


def _square(residuals: Any) -> Float[Array, ""]:
    return sum(
        (jnp.square(one).sum() for one in jax.tree.leaves(residuals)), jnp.zeros(())
    )


def _away(here: Slopes) -> Float[Array, ""]:
    """Return the length of a full step, in standard deviations."""
    move = _solved(here.squares, here.gradient)
    return jnp.sqrt(jnp.maximum(here.gradient @ move, 0.0))


def _solved(
    squares: Float[Array, "unknown unknown"], right: Float[Array, " unknown"]
) -> Float[Array, " unknown"]:
    """Solve a linear system scaled to a unit diagonal."""
    own = jnp.diag(squares)
    unit = jnp.sqrt(jnp.where(own > 0, own, 1.0))
    scaled = squares / unit[:, None] / unit[None, :]
    # rounding of the unit diagonal: a singular system has a finite solution
    floor = 1e-14 * jnp.eye(right.size, dtype=right.dtype)
    return jnp.linalg.solve(scaled + floor, right / unit) / unit
