"""The solution of one log: optimum, normal approximation, laws and samples.

Laws depend on the answer where the automatic choice selects them by range: they are
chosen again at each optimum until the choice settles, at most `ROUNDS` times.

The density of the samples of pressure records takes tens of milliseconds, that of the
values picked from them some microseconds, and a fit needs thousands, and slopes. The
two differ by little and smoothly: both are computed at nodes about the optimum, and a
spline through their difference corrects the cheap one
(`posterior.DensityCorrection`). Where that moves the optimum or changes its width, more
nodes are placed about the new one, and where the farthest nodes still matter, farther
out.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.fidelity import TakenLaw
from jblast.inference.identifiability import Identifiability, identifiability
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.range_profile import RangeProfile
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.parameters import Finding
from jblast.inference.posterior.posterior import (
    DensityCorrection,
    Posterior,
    correction_by,
    no_correction,
)
from jblast.inference.posterior.record_likelihood import SampledRecords
from jblast.kept_programs import kept
from jblast.progress import each
from jblast.scene import Scene
from jblast.sensors import Layout, resolve_laws
from jblast.sensors.law_choice import law_names, settled, with_bursts

ROUNDS = 3
"""Largest number of times that laws are chosen again at an answer. A choice that has
not settled by then alternates between two laws near the border of their ranges."""
# The first round is about the optimum of the picks; a later one follows an optimum that
# moved or widened.
NODE_ROUNDS = 3
# Nodes come in multiples of this: the compiled loop over places has few sizes.
MIN_NODES = 16
SPARE = 2.5
"""Nodes per coefficient of a quadratic. The nodes beyond 1 determine the cubic terms of
the spline and its leave-one-out error."""
NODE_REACH_SD = 3.0
"""Distance of the farthest nodes beyond the typical draw [sd]: nearly all draws lie
among the nodes."""
REACH_FACTOR = 1.6
"""Factor on the distances of the next nodes if the density at the farthest ones is not
negligible."""
OUTER_SHARE = 0.75
"""Share of the farthest node's distance beyond which nodes count as the farthest."""
MAX_SHIFT_SD = 0.7
"""Largest shift of the optimum, in standard deviations, that leaves it among its
nodes."""
MAX_WIDENING = 1.5
"""Largest factor on a standard deviation with which the nodes still cover it."""
KNOWN = 0.02
"""Error of the log-density below which no more nodes are added: weights of draws are
then off by 2 %."""
WITHIN = 4.5
"""Fall in ln-density at three standard deviations of a normal. Nodes with a smaller
fall are used for the error of the density."""


class Solution(NamedTuple):
    """Result of the inference for one log.

    Attributes:
        posterior: The posterior.
        laws: The law of each quantity, with the reason for its choice.
        other_laws: Automatic choice at the answer, of quantities for which it is not
            the law of the fit.
        optima: Optima of the searches, the best first.
        identifiability: Identified and null directions.
        laplace: Normal approximation about the best optimum.
        bursts_settled: True if the curve sets by height at the answer are those of the
            fit.
        samples_known: Error of the log-density of samples between its nodes; None
            without samples.
        sight: Range profile of a charge outside a small array; None if the array is not
            small, or the position not free.
    """

    posterior: Posterior
    laws: Mapping[str, TakenLaw]
    other_laws: Mapping[str, str]
    optima: Optima
    identifiability: Identifiability
    laplace: Laplace
    bursts_settled: bool = True
    samples_known: float | None = None
    sight: RangeProfile | None = None


class Choices(NamedTuple):
    """Automatic choices before a search, which depend on the answer.

    Attributes:
        scene: Scene whose charges have the curve sets of their heights.
        layout: Layout with the curve set of each row, if a charge has both.
        laws: The law of each quantity, with the reason for its choice.
    """

    scene: Scene
    layout: Layout
    laws: Mapping[str, TakenLaw]

    def as_for(self, there: "Choices") -> "Choices":
        """Return the choices of another scene, with the numbers of this one."""
        return there._replace(scene=with_bursts(self.scene, there.scene))

    def other_laws(self, there: "Choices") -> dict[str, str]:
        """Return the laws there of quantities whose law here is another."""
        mine = law_names(self.laws)
        return {k: name for k, name in law_names(there.laws).items() if mine[k] != name}

    def agrees_with(self, there: "Choices") -> bool:
        """Return True if laws and curve sets are the same."""
        return not self.other_laws(there) and self.has_bursts_of(there)

    def has_bursts_of(self, there: "Choices") -> bool:
        """Return True if the curve sets are the same."""
        mine, others = (
            [charge.burst for charge in of.scene.charges] for of in (self, there)
        )
        return mine == others and self.layout.free_air == there.layout.free_air


def choices_for(
    scene: Scene, rows: Layout, sigma: Float[np.ndarray, " row"]
) -> Choices:
    """Return the choices for a scene and the rows and errors of a log."""
    scene, layout = settled(scene, rows)
    return Choices(scene, layout, resolve_laws(scene, layout, sigma))


def settle_laws(
    choices: Choices,
    search: Callable[[Choices], tuple[Posterior, Optima, Choices]],
) -> tuple[tuple[Posterior, Optima, Choices], Choices]:
    """Search with choices, and choose again at the answer until they settle.

    If they do not settle, the answer with the most rows within its own laws is used; of
    several, the most probable one.

    Returns:
        Result of one of the searches, and its choices.
    """
    tried: list[tuple[tuple[Posterior, Optima, Choices], Choices]] = []
    for _ in range(1 + ROUNDS):
        *_, there = found = search(choices)
        tried.append((found, choices))
        if choices.agrees_with(there):
            return tried[-1]
        choices = choices.as_for(there)
        # a cycle: further searches would repeat earlier ones
        if any(choices.agrees_with(before) for _, before in tried):
            break

    def valid_rows_and_density(one) -> tuple[int, float]:
        posterior, optima, _ = one[0]
        valid = posterior.misfit(jnp.asarray(np.asarray(optima.z)[0])).valid
        return int(np.sum(np.asarray(valid))), float(optima.log_density[0])

    return max(tried, key=valid_rows_and_density)


def nodes_for(free: int) -> int:
    """Return the number of nodes of a round for `free` unknowns."""
    coefficients = (free + 1) * (free + 2) // 2
    return MIN_NODES * max(1, -int(-SPARE * coefficients // MIN_NODES))


def room_for(free: int) -> DensityCorrection:
    """Return a correction of zero with space for the nodes of all rounds.

    A posterior has it from the start, so its programs are compiled once.
    """
    return no_correction(free, NODE_ROUNDS * nodes_for(free))


def with_sample_density(
    solution: Solution,
    records: SampledRecords,
    search: Callable[[Posterior], Optima],
    *,
    seed: int = 0,
) -> Solution:
    """Return the solution by the samples of records in place of their picks.

    Args:
        solution: Solution by picks; its posterior has space for a correction.
        records: The samples.
        search: Function that returns the optima of a posterior.
        seed: Seed of the directions of the nodes.
    """
    read = replace(solution.posterior, correction=None)
    root, inverse = _roots(solution.laplace)
    center = solution.laplace.z
    # all rounds share the coordinates of the first optimum: earlier nodes stay usable
    blank = eqx.tree_at(
        lambda of: (of.center, of.inverse),
        room_for(center.size),
        (jnp.asarray(center), jnp.asarray(inverse)),
    )
    rng = np.random.default_rng(seed)
    w, density, apart = np.zeros((0, center.size)), np.zeros(0), np.zeros(0)
    far = 1.0
    for _ in each(range(NODE_ROUNDS), "rounds"):
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
        # leave-one-out error, of nodes near enough to matter
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
        far = 1.0 if ends else far * REACH_FACTOR
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
    """Return the log-density of samples, and that of their picks.

    Args:
        read: Posterior of the picks.
        records: The samples.
        z: Places.
    """
    return np.asarray(_both(read, records, z))


def _roots(normal: Laplace) -> tuple[np.ndarray, np.ndarray]:
    """Return a root of the covariance, and its pseudo-inverse."""
    sds = np.sqrt(np.diag(normal.covariance))
    size = np.where(sds > 0, sds, 1.0)
    values, vectors = np.linalg.eigh(normal.covariance / size / size[:, None])
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root, np.linalg.pinv(root / size[:, None], rcond=1e-9) / size[None, :]


def _spread(rng: np.random.Generator, free: int) -> Float[np.ndarray, "node free"]:
    """Return nodes in antithetic pairs about the center, at increasing distances.

    Pairs determine odd and even terms of the difference equally well.
    """
    count = nodes_for(free)
    directions = rng.standard_normal((count // 2, free))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pairs = np.stack([directions, -directions], axis=1).reshape(-1, free)
    share = np.arange(1, count) / (count - 1)
    far = (NODE_REACH_SD + np.sqrt(free)) * share
    return np.concatenate([np.zeros((1, free)), far[:, None] * pairs[: count - 1]])


def _ends(w: Float[np.ndarray, "node free"], density: np.ndarray) -> bool:
    """Return True if the density is negligible at the farthest nodes."""
    size = np.linalg.norm(w, axis=1)
    return bool(
        np.all(density[size > OUTER_SHARE * size.max()] < density.max() - WITHIN)
    )


def _stays(before: Laplace, after: Laplace) -> bool:
    """Return True if optimum and standard deviations are nearly unchanged."""
    was, now = (np.sqrt(np.diag(of.covariance)) for of in (before, after))
    both = (was > 0) & (now > 0)
    moved = np.abs(after.z - before.z)[both] / was[both]
    wider = np.abs(np.log(now[both] / was[both]))
    return bool((moved < MAX_SHIFT_SD).all() and (wider < np.log(MAX_WIDENING)).all())


@dataclass(frozen=True)
class SamplesRoughlyCounted(Finding):
    """The density of samples is imprecise between its nodes.

    Attributes:
        known: Root mean square error of the log-density.
        wanted: Limit of this error.
    """

    known: float
    wanted: float
