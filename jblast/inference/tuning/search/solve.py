r"""The most probable numbers, and what the record says of them.

Least squares by Levenberg and Marquardt, weights held; then weights at the place found,
and again, until the place stays. What the record knows is $J^T J$ of the residuals
there, in units of large changes: a direction in which it is less than `LEAST` is one
that two large changes leave as it is. A weak pull to the start keeps such directions
where they were; intervals are those of all others.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.tuning.search.least_squares import columns, least_squares
from jblast.inference.tuning.unknowns import Unknown, tuned_value, with_tuned
from jblast.scene import Scene

LEAST = 0.25
"""Information on a large change, below which a direction counts as not told."""
PULL = 1e-3
"""Of the start: one over how many large changes away one standard deviation is."""
MOST_ROUNDS = 12
"""Of weights."""
SETTLED = 0.02
"""Standard deviations by which a place may still move from round to round."""
MOST_STEPS = 100


class Solution(NamedTuple):
    """Where the search ended.

    Attributes:
        z: Coordinates.
        record_information: What the record says of them, in large changes.
        prior_information: What was believed, likewise.
        rounds: Of weights.
        converged: Whether it ended of itself.
    """

    z: Float[np.ndarray, " unknown"]
    record_information: Float[np.ndarray, "unknown unknown"]
    prior_information: Float[np.ndarray, "unknown unknown"]
    rounds: int
    converged: bool


class Problem(eqx.Module):
    """A record, a scene, and what is looked for.

    Attributes:
        evidence: What `SoundEvidence` is of sound: `index`, `weights`, `residuals`.
        scene: Its numbers; those looked for are replaced.
        unknowns: What is looked for.
        start: Coordinates that a weak pull is towards.
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
        """Return 1 for what something was believed of, else 0."""
        return jnp.array([float(one.has_prior) for one in self.unknowns])


def problem_from(evidence: Any, scene: Scene, unknowns: tuple[Unknown, ...]) -> Problem:
    """Return the problem whose search begins at what a scene holds."""
    start = []
    for one in unknowns:
        held = tuned_value(scene, evidence.index, one.name)
        assert held is not None, "unknowns are filled in before"
        start.append(one.belief.unconstrain(held))
    return Problem(evidence, scene, unknowns, jnp.stack(start))


def solve(
    problem: Problem, begin: Float[np.ndarray, " unknown"] | None = None
) -> Solution:
    """Return the most probable numbers, searched from a place or from the start."""
    # what the wave form misses at the start is no noise: it is explained first
    begun = problem.start if begin is None else jnp.asarray(begin)
    z, _ = _round(problem, begun, jnp.zeros(()))
    converged, rounds = False, 0
    for _ in range(MOST_ROUNDS):
        rounds += 1
        new, ended = _round(problem, z, jnp.ones(()))
        known, believed = information(problem, new)
        sd = _sds(np.asarray(known) + np.asarray(believed))
        steps = np.asarray(problem.steps())
        moved = np.abs(np.asarray(new - z)) / steps / sd
        z = new
        if not np.isfinite(np.asarray(z)).all():
            break
        if moved.max(initial=0.0) < SETTLED:
            converged = bool(ended)
            break
    known, believed = information(problem, z)
    return Solution(
        np.asarray(z), np.asarray(known), np.asarray(believed), rounds, converged
    )


def _sds(known: Float[np.ndarray, "unknown unknown"]) -> Float[np.ndarray, " unknown"]:
    """Return standard deviations in large changes, at most one of the pull."""
    return np.sqrt(np.diag(np.linalg.inv(known + PULL**2 * np.eye(len(known)))))


@eqx.filter_jit
def _round(problem: Problem, z: Float[Array, " unknown"], share: Float[Array, ""]):
    """Return where least squares end with the weights of a place, and whether.

    Args:
        problem: What is to be solved.
        z: The place.
        share: Of what tells of noise, all residuals but the first: 1, or 0 for none.
    """
    steps, has_prior = problem.steps(), problem.has_prior()
    weights = problem.evidence.weights(problem.scene_at(z))

    def residuals(y: Float[Array, " unknown"]):
        z = y * steps
        first, *rest = problem.evidence.residuals(problem.scene_at(z), weights)
        data = first, [share * one for one in rest]
        pull = PULL * (1.0 - has_prior) * (y - problem.start / steps)
        return data, has_prior * z, pull

    place, ended = least_squares(residuals, z / steps, most_steps=MOST_STEPS)
    return place * steps, ended


@eqx.filter_jit
def information(
    problem: Problem, z: Float[Array, " unknown"]
) -> tuple[Float[Array, "unknown unknown"], Float[Array, "unknown unknown"]]:
    """Return what the record and what priors say of large changes about a place."""
    steps, has_prior = problem.steps(), problem.has_prior()
    weights = problem.evidence.weights(problem.scene_at(z))

    def residuals(y: Float[Array, " unknown"]):
        data = problem.evidence.residuals(problem.scene_at(y * steps), weights)
        return jax.tree.leaves(data)

    count = z.size
    rows = [slope.reshape(count, -1) for slope in columns(residuals, z / steps)]
    known = sum((row @ row.T for row in rows), jnp.zeros((count, count)))
    return known, jnp.diag(has_prior * jnp.square(steps))


def parts_told(
    information: Float[np.ndarray, "unknown unknown"],
) -> tuple[Float[np.ndarray, "told unknown"], Float[np.ndarray, "null unknown"], Any]:
    """Split directions by whether they are told.

    Returns:
        Those that are, those that are not, and the covariance in large changes; what
        is not told counts as known to two of them, so that what hangs on it a little
        is no surer than that.
    """
    values, vectors = np.linalg.eigh(information)
    identified = values >= LEAST
    covariance = (vectors / np.maximum(values, LEAST)) @ vectors.T
    return vectors[:, identified].T, vectors[:, ~identified].T, covariance


def names_of(unknowns: Sequence[Unknown]) -> tuple[str, ...]:
    """Return the names of what is looked for."""
    return tuple(one.name for one in unknowns)


def widening(problem: Problem, z: Float[np.ndarray, " unknown"]) -> Any:
    """Return by how much standard deviations widen where what is left goes together.

    Residuals of one group (`evidence.groups`) need not be independent: rounding of
    what changes little is alike in all of a frame, thresholds are in all events of a
    pixel. What groups say together is counted, not supposed: $A^{-1} B A^{-1}$ with
    $B$ the sum over groups of the square of the score (White 1980; Liang and Zeger
    1986, both from memory), where that is more than $A^{-1}$.
    """
    known, believed = information(problem, jnp.asarray(z))
    groups, count = problem.evidence.groups()
    scores = np.asarray(_scores(problem, jnp.asarray(z), groups, count))
    total = np.asarray(known) + np.asarray(believed)
    _, _, covariance = parts_told(total)
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
