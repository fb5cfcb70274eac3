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
from jblast.observations import Observations
from jblast.observations.records.formats import Scaling
from jblast.observations.table import SAMPLES
from jblast.progress import each
from jblast.scene import Scene
from jblast.sensors import Layout, resolve_laws
from jblast.sensors.law_choice import law_names, settled, with_bursts

ROUNDS = 3
"""So often laws are chosen again at an answer. A choice that has not settled by then
goes to and fro between two laws near the border of their ranges."""
NODE_ROUNDS = 3
MIN_DRAWS = 16
SPARE = 2.5
"""Nodes for each coefficient of a quadratic."""
NODE_REACH_SD = 3.0
"""Distance of the nodes beyond the typical draw [sd]."""
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


class Solution(NamedTuple):
    """What inference found.

    Attributes:
        posterior: What was climbed.
        laws: The law of each quantity, and what it was taken by.
        laws_settled: Whether the automatic choice of law at the answer is that used.
        optima: The ends of the searches, the best first.
        identifiability: What the data identify of the parameters.
        laplace: The posterior about the best optimum.
        bursts_settled: Whether the curve sets that heights leave at the answer are
            those used.
        samples_known: To how much in ln the density of samples is known between the
            places where it was computed; None where no samples count.
        sight: The range of a charge beside a small array followed inwards and outwards;
            None where the array is not small, or the place not free.
    """

    posterior: Posterior
    laws: Mapping[str, TakenLaw]
    laws_settled: bool
    optima: Optima
    identifiability: Identifiability
    laplace: Laplace
    bursts_settled: bool = True
    samples_known: float | None = None
    sight: RangeProfile | None = None


class Choices(NamedTuple):
    """Automatic choices before a search, which depend on where the answer lies.

    Attributes:
        scene: Its charges have the curve sets that their heights leave.
        layout: It has the curve set of each row where a charge has both.
        laws: The law of each quantity, and what it was taken by.
    """

    scene: Scene
    layout: Layout
    laws: Mapping[str, TakenLaw]

    def as_for(self, there: "Choices") -> "Choices":
        """Return what another scene leaves, for the numbers of this one."""
        return there._replace(scene=with_bursts(self.scene, there.scene))

    def has_laws_of(self, there: "Choices") -> bool:
        """Return whether the laws are the same."""
        return law_names(self.laws) == law_names(there.laws)

    def agrees_with(self, there: "Choices") -> bool:
        """Return whether laws and curve sets are the same."""
        return self.has_laws_of(there) and self.has_bursts_of(there)

    def has_bursts_of(self, there: "Choices") -> bool:
        """Return whether the curve sets are the same."""
        mine, others = (
            [charge.burst for charge in of.scene.charges] for of in (self, there)
        )
        return mine == others and self.layout.free_air == there.layout.free_air


def choices_for(
    scene: Scene, rows: Layout, sigma: Float[np.ndarray, " row"]
) -> Choices:
    """Choose laws and curve sets for a scene, and the rows and errors of a log."""
    scene, layout = settled(scene, rows)
    return Choices(scene, layout, resolve_laws(scene, layout, sigma))


def settle_laws(
    choices: Choices,
    search: Callable[[Choices], tuple[Posterior, Optima, Choices]],
) -> tuple[tuple[Posterior, Optima, Choices], Choices]:
    """Search with what was chosen, and choose again at the answer until it settles.

    Where it does not settle, the answer is taken that lies within its own laws for the
    most rows; of several, the most probable one.

    Returns:
        Result of one of the searches, and the choices it was made with.
    """
    tried: list[tuple[tuple[Posterior, Optima, Choices], Choices]] = []
    for _ in range(1 + ROUNDS):
        *_, there = found = search(choices)
        tried.append((found, choices))
        if choices.agrees_with(there):
            return tried[-1]
        choices = choices.as_for(there)
        if any(choices.agrees_with(before) for _, before in tried):
            break
    return max(tried, key=lambda one: _standing(*one[0][:2]))


def _standing(posterior, found: Optima) -> tuple[int, float]:
    """Return how many rows lie within their laws at an answer, and its log density."""
    valid = posterior.misfit(jnp.asarray(np.asarray(found.z)[0])).valid
    return int(np.sum(np.asarray(valid))), float(found.log_density[0])


def with_samples(
    log: Observations, scaling: Scaling | None, high_pass_hz: float | None
) -> tuple[Observations, SampledRecords | None]:
    """Return a log of readings, and the samples that count in place of some of them."""
    if SAMPLES not in log.quantity:
        return log, None
    # picks are a second of imports, which other logs do without
    from jblast.inference.sampled_records import sampled_records
    from jblast.signals.picks.pick_log import picked_log

    readings, picks = picked_log(log, scaling, high_pass_hz=high_pass_hz)
    return readings, sampled_records(readings, picks)


def nodes_for(free: int) -> int:
    """Return how many nodes a round lays for so many unknowns."""
    coefficients = (free + 1) * (free + 2) // 2
    return MIN_DRAWS * max(1, -int(-SPARE * coefficients // MIN_DRAWS))


def room_for(free: int) -> DensityCorrection:
    """Return a correction that adds nothing, with room for the nodes of all rounds.

    A posterior has it from the first: so what is compiled for it serves for all.
    """
    return no_correction(free, NODE_ROUNDS * nodes_for(free))


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
    """Return a root of the covariance, and its pseudo-inverse."""
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
    far = (NODE_REACH_SD + np.sqrt(free)) * share
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


@dataclass(frozen=True)
class SamplesRoughlyCounted(Finding):
    """The density of samples is known badly between the places it was computed at.

    Attributes:
        known: To how much in ln, root mean square.
        wanted: To how much it should be.
    """

    known: float
    wanted: float
