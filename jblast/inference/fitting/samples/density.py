"""The density of samples, from a few dozen places where it was computed.

Samples cost tens of milliseconds a density, what a pick of them reads some
microseconds, and a fit asks for thousands and for slopes. The two differ by little, and
smoothly: so both are computed at nodes about the optimum, and a spline through what one
has over the other corrects the cheap one (`posterior/density_correction.py`). Where the
optimum moves by that, or its width changes, more nodes are laid about the new one, and
where the farthest still count, farther off.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.fitting.solution import Solution
from jblast.inference.identifiability.null_space import identifiability
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.density_correction import (
    DensityCorrection,
    correction_by,
    no_correction,
)
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.posterior.record_likelihood import SampledRecords
from jblast.kept_programs import kept
from jblast.progress import each

ROUNDS = 3
FEWEST = 16
SPARE = 2.5
"""Nodes for each coefficient of a quadratic."""
REACH = 3.0
"""Standard deviations beyond the typical draw's that nodes go to."""
FARTHER = 1.6
"""So many times as far nodes are laid next, where the farthest still count."""
EDGE = 0.75
"""Of the farthest node's distance, from which on nodes are the farthest."""
MOVED = 0.7
"""An optimum that moves by less, in standard deviations, lies among its nodes."""
WIDENED = 1.5
"""So it does while no width changes by such a factor."""
KNOWN = 0.02
"""A density that is known to this in ln needs no more nodes."""
WITHIN = 4.5
"""Nodes count for how well it is known that lie less than three standard deviations
off: so much is lost in ln there."""


def nodes_for(free: int) -> int:
    """Return how many nodes a round lays for so many unknowns."""
    coefficients = (free + 1) * (free + 2) // 2
    return FEWEST * max(1, -int(-SPARE * coefficients // FEWEST))


def room_for(free: int) -> DensityCorrection:
    """Return a correction that adds nothing, with room for the nodes of all rounds.

    A posterior has it from the first: so what is compiled for it serves for all.
    """
    return no_correction(free, ROUNDS * nodes_for(free))


def with_sample_density(
    solution: Solution,
    records: SampledRecords,
    search: Callable[[Posterior], Optima],
    *,
    seed: int = 0,
) -> Solution:
    """Return a solution by the samples of records in place of what was read off them.

    Args:
        solution: By readings; its posterior has room for a correction.
        records: The samples.
        search: Finds the optima of a posterior.
        seed: Of the directions in which nodes lie.
    """
    read = replace(solution.posterior, correction=None)
    root, inverse = _roots(solution.laplace)
    center = solution.laplace.z
    blank = eqx.tree_at(
        lambda of: (of.center, of.inverse),
        room_for(center.size),
        (jnp.asarray(center), jnp.asarray(inverse)),
    )
    rng = np.random.default_rng(seed)
    w, density, apart = np.zeros((0, center.size)), np.zeros(0), np.zeros(0)
    far = 1.0
    for _ in each(range(ROUNDS), "rounds"):
        before = solution.laplace
        z = before.z + far * _spread(rng, center.size) @ root.T
        both = densities_of_samples(read, records, jnp.asarray(z))
        fine = np.isfinite(both).all(axis=0)
        w = np.concatenate([w, ((z - center) @ inverse.T)[fine]])
        density = np.concatenate([density, both[0][fine]])
        apart = np.concatenate([apart, (both[0] - both[1])[fine]])
        if not len(w):
            return solution._replace(samples_known=np.inf)
        made, missed = correction_by(blank, w, apart)
        near = density > density.max() - WITHIN
        known = float(np.sqrt(np.mean(np.square(missed[near]))))
        posterior = replace(solution.posterior, correction=made)
        found = search(posterior)
        at = np.asarray(found.z[0])
        directions = identifiability(posterior, at)
        solution = solution._replace(
            posterior=posterior,
            optima=found,
            identifiability=directions,
            laplace=laplace(posterior, at, directions.identified_basis),
            samples_known=known,
        )
        root, _ = _roots(solution.laplace)
        ends = _ends(w, density)
        if known < KNOWN and ends and _stays(before, solution.laplace):
            break
        far = 1.0 if ends else far * FARTHER
    return solution


@kept
def _both(
    read: Posterior, records: SampledRecords, z: Float[Array, "place free"]
) -> Float[Array, "2 place"]:
    sampled = replace(read, records=records)

    def at(z):
        return jnp.stack([sampled.log_density(z), read.log_density(z)])

    return jax.lax.map(at, z).T


def densities_of_samples(
    read: Posterior, records: SampledRecords, z: Float[Array, "place free"]
) -> Float[np.ndarray, "2 place"]:
    """Return the log-density of samples, and that of what was read off them.

    Args:
        read: The posterior of readings.
        records: The samples.
        z: Places.
    """
    return np.asarray(_both(read, records, z))


def _roots(normal: Laplace) -> tuple[np.ndarray, np.ndarray]:
    """Return a root of the covariance, and what undoes it where it tells anything."""
    sds = np.sqrt(np.diag(normal.covariance))
    size = np.where(sds > 0, sds, 1.0)
    values, vectors = np.linalg.eigh(normal.covariance / size / size[:, None])
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root, np.linalg.pinv(root / size[:, None], rcond=1e-9) / size[None, :]


def _spread(rng: np.random.Generator, free: int) -> Float[np.ndarray, "node free"]:
    """Return nodes in pairs on either side of the center, ever farther off."""
    count = nodes_for(free)
    ways = rng.standard_normal((count // 2, free))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    pairs = np.stack([ways, -ways], axis=1).reshape(-1, free)
    share = np.arange(1, count) / (count - 1)
    far = (REACH + np.sqrt(free)) * share
    return np.concatenate([np.zeros((1, free)), far[:, None] * pairs[: count - 1]])


def _ends(w: Float[np.ndarray, "node free"], density: np.ndarray) -> bool:
    """Return whether the density has ended before the farthest nodes."""
    size = np.linalg.norm(w, axis=1)
    return bool(np.all(density[size > EDGE * size.max()] < density.max() - WITHIN))


def _stays(before: Laplace, after: Laplace) -> bool:
    """Return whether an optimum and its widths stay about where they were."""
    was, now = (np.sqrt(np.diag(of.covariance)) for of in (before, after))
    both = (was > 0) & (now > 0)
    moved = np.abs(after.z - before.z)[both] / was[both]
    wider = np.abs(np.log(now[both] / was[both]))
    return bool((moved < MOVED).all() and (wider < np.log(WIDENED)).all())
