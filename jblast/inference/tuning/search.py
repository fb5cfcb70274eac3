r"""The most probable numbers by least squares, and their uncertainty.

`optimistix.least_squares` runs with fixed weights. The weights are then evaluated at
its result, and both are repeated until a Gauss-Newton step there is short. The
information of record and priors is $J^T J$ of the residuals there, in units of large
changes. A direction in which it is less than `LEAST_INFORMATION` is a null direction:
two large changes along it leave the record as it is. The damping of Levenberg-Marquardt
leaves such directions near the start; intervals are those of all others.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from jblast.inference.tuning.unknowns import Unknown, tuned_value, with_tuned
from jblast.scene import Scene

LEAST_INFORMATION = 0.25
"""Information on a large change below which a direction is a null direction: one
standard deviation is then more than two large changes."""
MAX_ROUNDS = 30
"""Largest number of updates of the weights, of which poorly explained events took 14.
Without convergence by then the result is reported as not converged."""
CLOSE = 1e-3
"""Length of the last step of one search, and of a Gauss-Newton step with the weights of
the result, by which it has converged [sd]."""
# of one search, accepted or not: a well-posed one takes far fewer
MAX_STEPS = 100
FIRST_STEP = 30.0
"""Unit of the coordinates of a search [sd]. optimistix adds 1 to the diagonal of
$J^T J$ in the first step, a part of 1e-3 in this unit."""


class Problem(eqx.Module):
    """A record, a scene, and the numbers to tune.

    Attributes:
        evidence: The record, with `index`, `weights` and `residuals` as in
            `SoundEvidence`.
        scene: The scene, in which numbers are replaced.
        unknowns: The numbers to tune.
        start: Coordinates of the start.
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

    def residuals(
        self, z: Float[Array, " unknown"], weights: Any
    ) -> tuple[Float[Array, "..."], ...]:
        """Return the residuals of the record, and of the priors."""
        has_prior = jnp.array([float(one.has_prior) for one in self.unknowns])
        data = self.evidence.residuals(self.scene_at(z), weights)
        return (*data, has_prior * z)


def problem_from(evidence: Any, scene: Scene, unknowns: tuple[Unknown, ...]) -> Problem:
    """Return the problem whose search begins at the values of a scene."""
    start = []
    for one in unknowns:
        held = tuned_value(scene, evidence.index, one.name)
        assert held is not None, "unknowns are filled in before"
        start.append(one.belief.unconstrain(held))
    return Problem(evidence, scene, unknowns, jnp.stack(start))


class Solution(NamedTuple):
    """Residuals and their derivatives at a place.

    Attributes:
        z: Coordinates.
        left: Residuals of the record, and of the priors.
        slopes: Their derivatives by large changes of the numbers.
        converged: True if a search has converged there.
    """

    z: Float[np.ndarray, " unknown"]
    left: list[Float[np.ndarray, " value"]]
    slopes: list[Float[np.ndarray, "unknown value"]]
    converged: bool = False

    @property
    def information(self) -> Float[np.ndarray, "unknown unknown"]:
        """Information of record and priors, in large changes."""
        return sum((rows @ rows.T for rows in self.slopes), 0.0 * np.eye(self.z.size))

    @property
    def remaining_sd(self) -> float:
        """Length of a Gauss-Newton step, in standard deviations."""
        pairs = zip(self.slopes, self.left, strict=True)
        gradient = sum((rows @ left for rows, left in pairs), 0.0 * self.z)
        _, _, covariance = identified_and_null(self.information)
        return float(np.sqrt(gradient @ covariance @ gradient))


def solve(
    problem: Problem, begin: Float[np.ndarray, " unknown"] | None = None
) -> Solution:
    """Return the most probable numbers, by a search from a place or from the start."""
    here = _solution(problem, problem.start if begin is None else jnp.asarray(begin))
    # First without the residuals that constrain the noise: the misfit of the wave form
    # at the start would be taken for noise.
    for share in (0.0, *[1.0] * MAX_ROUNDS):
        known = np.maximum(np.diag(here.information), LEAST_INFORMATION)
        unit = FIRST_STEP * np.asarray(problem.steps()) / np.sqrt(known)
        here = _solution(problem, _searched(problem, here.z, unit, share))
        # a diverged search ends here, and is reported as not converged
        if not np.isfinite(here.information).all():
            break
        if here.remaining_sd < CLOSE:
            return here._replace(converged=True)
    return here


@eqx.filter_jit
def _searched(problem: Problem, z, unit, share) -> Float[Array, " unknown"]:
    """Return the end of least squares with the weights of a place.

    Args:
        problem: The problem.
        z: The place.
        unit: Unit of each coordinate in the search.
        share: Factor on the residuals that constrain noise: 1 or 0.
    """
    weights = problem.evidence.weights(problem.scene_at(z))

    def residuals(y: Float[Array, " unknown"]):
        first, *rest, prior = problem.residuals(z + unit * y, weights)
        return first, [share * one for one in rest], prior

    found = optx.least_squares(
        one_by_one(residuals),
        optx.LevenbergMarquardt(rtol=0.0, atol=CLOSE, norm=optx.two_norm),
        jnp.zeros_like(z),
        max_steps=MAX_STEPS,
        throw=False,
    )
    return z + unit * found.value


def _solution(problem: Problem, z: Float[Array, " unknown"]) -> Solution:
    left, slopes = jax.tree.map(np.asarray, _expansion(problem, z))
    rows = [slope.reshape(len(slope), -1) for slope in slopes]
    return Solution(np.asarray(z), [one.ravel() for one in left], rows)


@eqx.filter_jit
def _expansion(problem: Problem, z: Float[Array, " unknown"]):
    """Return residuals with the weights of a place, and derivatives there."""
    steps = problem.steps()
    weights = problem.evidence.weights(problem.scene_at(z))
    return expanded(
        lambda y: problem.residuals(z + steps * y, weights), jnp.zeros_like(z)
    )


def one_by_one(function: Callable[[Float[Array, " unknown"]], Any]) -> Any:
    """Return a function for optimistix, with the derivatives of `expanded`."""

    @jax.custom_jvp
    def same(y: Float[Array, " unknown"]):
        return function(y)

    @same.defjvp
    def _(primals, tangents):
        value, rows = expanded(function, *primals)
        (change,) = tangents
        return value, jax.tree.map(lambda row: jnp.tensordot(change, row, 1), rows)

    return lambda y, _: same(y)


def expanded(
    function: Callable[[Float[Array, " unknown"]], Any], y: Float[Array, " unknown"]
) -> tuple[Any, Any]:
    """Return a function, and its derivatives one coordinate after another, stacked.

    They are not computed by `vmap`, which would need memory for all records together.
    Also, batches of Fourier transforms can deadlock in XLA's thread pool on the CPU
    (PyAutoFit issue 1530: each requests the whole pool from within it).
    """
    count, shapes = y.size, jax.eval_shape(function, y)
    # the place is an input of each turn: `linearize` would move all that depends on it
    # alone out of the loop, and store every intermediate array of a film
    return jax.lax.scan(
        lambda _, at: jax.jvp(function, (at[0],), (at[1],)),
        jax.tree.map(lambda one: jnp.zeros(one.shape, one.dtype), shapes),
        (jnp.tile(y, (count, 1)), jnp.eye(count, dtype=y.dtype)),
    )


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
    # without a finite residual nothing is identified
    values, vectors = np.linalg.eigh(np.nan_to_num(information))
    identified = values >= LEAST_INFORMATION
    covariance = (vectors / np.maximum(values, LEAST_INFORMATION)) @ vectors.T
    return vectors[:, identified].T, vectors[:, ~identified].T, covariance
