"""The solution of one log: draws of its posterior, and what they identify.

The density of the samples of pressure records takes tens of milliseconds, that of the
values picked from them some microseconds, and a fit needs thousands. The two differ by
little and smoothly: both are computed at nodes about the draws by the picks, and a
spline through their difference corrects the weights of the draws. Where that moves or
widens the posterior, more nodes are placed about the new one, and where the farthest
nodes still matter, farther out.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument
from jblast.fidelity import TakenLaw
from jblast.inference.answer import Answer, constrained, unconstrained
from jblast.inference.density import Density, density_of
from jblast.inference.identify import Identified, identified
from jblast.inference.posterior.posterior import posterior_of
from jblast.inference.posterior.record_likelihood import (
    SampledRecords,
    densities_of_samples,
)
from jblast.inference.sample import Draws, redrawn, solve as drawn
from jblast.observations import Observations
from jblast.observations.clocks import refuse_unsolvable_clocks
from jblast.progress import each
from jblast.scene import UncertainScene
from jblast.sensors.simulated_readings import Noise

NODE_ROUNDS = 3
"""Rounds of nodes. The first is about the draws by the picks; a later one follows a
posterior that moved or widened."""
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
"""Largest shift of the mean, in standard deviations, that leaves it among its nodes."""
MAX_WIDENING = 1.5
"""Largest factor on a standard deviation with which the nodes still cover it."""
KNOWN = 0.02
"""Error of the log-density below which no more nodes are added: weights of draws are
then off by 2 %."""
WITHIN = 4.5
"""Fall in ln-density at three standard deviations of a normal. Nodes with a smaller
fall are used for the error of the density."""


@dataclass(frozen=True)
class Solution:
    """Result of the inference for one log.

    Attributes:
        density: The posterior density.
        draws: Weighted draws of it.
        identified: What they identify.
        laws: The law of each quantity, with the reason for its choice.
        other_laws: Automatic choice at the answer, of quantities for which it is not
            the law of the fit.
        bursts_settled: True if the curve sets by height at the answer are those of the
            fit.
        samples_known: Error of the log-density of samples between its nodes; None
            without samples.
    """

    density: Density
    draws: Draws
    identified: Identified
    laws: Mapping[str, TakenLaw]
    other_laws: Mapping[str, str]
    bursts_settled: bool = True
    samples_known: float | None = None

    @property
    def answer(self) -> Answer:
        """The log at the most probable numbers."""
        return self.identified.answer

    @property
    def converged(self) -> bool:
        """True if the best mode was found more than once."""
        return self.draws.modes.met > 1

    @property
    def is_answer(self) -> bool:
        """True if it converged, its weights can be believed, and it is identified."""
        found = self.identified
        return self.converged and found.is_reliable and found.is_identifiable


def solve(
    observations: Observations,
    uncertain: UncertainScene,
    *,
    noise: Noise = "student",
    seed: int = 0,
    records: SampledRecords | None = None,
    begin: Callable[[str], None] = lambda _: None,
) -> Solution:
    """Draw from the posterior of a log, and find what the draws identify.

    Args:
        observations: The log.
        uncertain: The scene and its uncertain parameters.
        noise: Distribution of the independent errors.
        seed: Seed of all random numbers.
        records: Samples of records, if there are any.
        begin: Function that is called with the name of each stage.
    """
    if not uncertain.beliefs:
        raise InputError(
            "nothing to fit: every number of the scene is fixed; expected at least one "
            'that is "free", has a prior, or is named by ' + argument("freed")
        )
    refuse_unsolvable_clocks(observations, uncertain)
    # milliseconds of clocks of days, and differences of laws, need float64
    with jax.enable_x64(True):
        begin("choosing laws")
        density = density_of(observations, uncertain, noise)
        begin("searching")
        density, draws = drawn(density, seed)
        known = None
        if records is not None:
            begin("counting samples")
            draws, known = with_samples(density, draws, records, seed)
        return solution_of(density, draws, known)


def solution_of(
    density: Density, draws: Draws, samples_known: float | None = None
) -> Solution:
    """Return the solution by given draws."""
    best = density.best(_mode_of(density, draws))
    if samples_known is not None:  # the modes are those of the picks
        z = unconstrained(density, draws.values)
        best = constrained(density, (draws.weights @ z)[None])[0]
    there = density.choices_at(best)
    return Solution(
        density=density,
        draws=draws,
        identified=identified(density, draws, best),
        laws={
            quantity: TakenLaw(name, there.laws[quantity].choice)
            for quantity, name in density.laws.items()
        },
        other_laws=there.other_laws(density.laws),
        bursts_settled=there.has_bursts_of(density.scene, density.layout),
        samples_known=samples_known,
    )


def _mode_of(density: Density, draws: Draws) -> Float[np.ndarray, " free"]:
    """Return the highest mode of the most probable region."""
    modes = draws.modes
    if len(modes.u) == 1:
        return modes.u[0]
    first = Answer(density, density.best(modes.u[0]), np.ones(draws.values.shape[1]))
    inside = Identified(first, draws).chosen
    top = draws.u[inside][draws.log_density[inside].argmax()]
    away = np.linalg.solve(modes.root, (top - modes.u)[..., None])
    return modes.u[int(np.argmin((away**2).sum((1, 2))))]


def nodes_for(free: int) -> int:
    """Return the number of nodes of a round for `free` unknowns."""
    coefficients = (free + 1) * (free + 2) // 2
    return MIN_NODES * max(1, -int(-SPARE * coefficients // MIN_NODES))


def with_samples(
    density: Density, draws: Draws, records: SampledRecords, seed: int = 0
) -> tuple[Draws, float]:
    """Return draws by the samples of records in place of their picks.

    Args:
        density: Density by the picks.
        draws: Draws of it.
        records: The samples.
        seed: Seed of the directions of the nodes.

    Returns:
        The draws, and the error of the log-density between nodes.
    """
    readings = posterior_of(
        density.parameters,
        density.layout,
        density.observations,
        density.laws,
        density.noise,
    )
    rng = np.random.default_rng(seed)
    center, root = _spread_of(density, draws)
    inverse = np.linalg.pinv(root, rcond=1e-9)
    free = len(center)
    w, top, apart = np.zeros((0, free)), np.zeros(0), np.zeros(0)
    known, far, base = np.inf, 1.0, draws
    for _ in each(range(NODE_ROUNDS), "rounds"):
        middle, spread = _spread_of(density, draws)
        z = middle + far * _nodes(rng, free) @ spread.T
        sampled = densities_of_samples(readings, records, jnp.asarray(z))
        both = np.stack([sampled, density.of_readings(constrained(density, z))])
        fine = np.isfinite(both).all(axis=0)
        w = np.concatenate([w, ((z - center) @ inverse.T)[fine]])
        top = np.concatenate([top, both[0][fine]])
        apart = np.concatenate([apart, (both[0] - both[1])[fine]])
        if len(w) <= free + 1:
            return draws, np.inf
        correction = _Spline(center, inverse, w, apart)
        near = top > top.max() - WITHIN
        known = correction.error(near)
        before = middle, spread
        draws = redrawn(density, draws, seed, partial(correction, density))
        ends = _end(w, top)
        if known < KNOWN and ends and _stays(before, _spread_of(density, draws)):
            break
        far = 1.0 if ends else far * REACH_FACTOR
    return replace(draws, modes=base.modes), known


@dataclass(frozen=True)
class _Spline:
    """A cubic polyharmonic spline of a difference of log-densities.

    Beyond its nodes it is constant, with the value at their edge (Duchon 1977, Lect.
    Notes Math. 571:85).
    """

    center: Float[np.ndarray, " name"]
    inverse: Float[np.ndarray, "name name"]
    nodes: Float[np.ndarray, "node name"]
    apart: Float[np.ndarray, " node"]

    def __call__(self, density: Density, values) -> Float[np.ndarray, " draw"]:
        w = (unconstrained(density, values) - self.center) @ self.inverse.T
        reach = np.linalg.norm(self.nodes, axis=1).max()
        size = np.maximum(np.linalg.norm(w, axis=1, keepdims=True), 1e-12)
        return _interpolated(self.nodes, self.apart)(w * np.minimum(1.0, reach / size))

    def error(self, near: np.ndarray) -> float:
        """Return the leave-one-out error at some nodes, root mean square."""
        missed = []
        for i in np.flatnonzero(near):
            kept = np.arange(len(self.apart)) != i
            spline = _interpolated(self.nodes[kept], self.apart[kept])
            missed.append(float(spline(self.nodes[i : i + 1])[0] - self.apart[i]))
        return float(np.sqrt(np.mean(np.square(missed))))


def _interpolated(nodes, apart):
    # the import takes half as long as that of JAX; fits without samples need none
    from scipy.interpolate import RBFInterpolator

    free = nodes.shape[1]
    # with fewer nodes than terms of a quadratic its equations are singular
    degree = 2 if len(nodes) > (free + 1) * (free + 2) // 2 else 1
    return RBFInterpolator(nodes, apart, kernel="cubic", degree=degree)


def _spread_of(density: Density, draws: Draws) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and root of the covariance of the fitted coordinates."""
    z = unconstrained(density, draws.values)
    mean = draws.weights @ z
    away = z - mean
    covariance = (away * draws.weights[:, None]).T @ away
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / size / size[:, None])
    return mean, size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def _nodes(rng: np.random.Generator, free: int) -> Float[np.ndarray, "node free"]:
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


def _end(w: Float[np.ndarray, "node free"], top: np.ndarray) -> bool:
    """Return True if the density is negligible at the farthest nodes."""
    size = np.linalg.norm(w, axis=1)
    return bool(np.all(top[size > OUTER_SHARE * size.max()] < top.max() - WITHIN))


def _stays(before, after) -> bool:
    """Return True if mean and standard deviations are nearly unchanged."""
    was, now = (np.linalg.norm(root, axis=1) for _, root in (before, after))
    both = (was > 0) & (now > 0)
    moved = np.abs(after[0] - before[0])[both] / was[both]
    wider = np.abs(np.log(now[both] / was[both]))
    return bool((moved < MAX_SHIFT_SD).all() and (wider < np.log(MAX_WIDENING)).all())
