"""Sampler: ways to 90 % intervals of a posterior, their cost against their error.

The posterior of five microphones (`five_microphones.py`); its optimum is known. Held
against a long walk of the compiled sampler, whose own error is half of what its first
and second half are apart.
"""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from jblast.fidelity.timing import best_of
from jblast.inference import Posterior
from jblast.inference.identifiability.null_space import Identifiability, identifiability
from jblast.inference.importance.marginals import weighted_quantiles
from jblast.inference.importance.psis import Importance, importance
from jblast.inference.importance.whitening import Whitened, whitened_density
from jblast.inference.mcmc.emcee_engine import Emcee
from jblast.inference.mcmc.scan_engine import Scan
from jblast.inference.mode.laplace import NORMAL_Q95, Laplace, laplace
from jblast.inference.mode.search import optima
from jblast.progress import in_words
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.cases.five_microphones import one_posterior
from jblast.verification.cases.timed_sampling import (
    SHARES,
    WALKERS,
    interval_ends,
    timed_walk,
)

STEPS = (200, 1000, 5000)
DRAWS = (500, 4000, 30_000)
REFERENCE = 20_000
"""Steps of the walk that the others are held against."""
RUNS = 3
"""Runs of the longest, which differ by the seed."""
MOST_RUNS = 5
"""Shorter ones are run more often, as chance tells more in them."""
REFERENCE_SEED = 100
"""Of no other run."""

Interval = Float[np.ndarray, "2 free"]


class Solved(NamedTuple):
    """What every sampler starts from.

    Attributes:
        posterior: It.
        identified: What its log tells.
        normal: Its normal approximation.
        seconds: What that takes, with the optimum known.
        density: The posterior in coordinates in which it is round.
    """

    posterior: Posterior
    identified: Identifiability
    normal: Laplace
    seconds: float
    density: Whitened


def solved() -> Solved:
    """Find the optimum and the normal approximation."""
    posterior = one_posterior()
    z = np.asarray(optima(jax.random.key(0), posterior).z[0])
    identified = identifiability(posterior, z)
    seconds, normal = best_of(
        lambda: laplace(posterior, z, identified.identified_basis)
    )
    density = whitened_density(posterior, normal, identified)
    return Solved(posterior, identified, normal, seconds, density)


def weighted_ends(found: Importance, normal: Laplace) -> Interval:
    """Return the ends that weighted draws give, from the optimum."""
    away = (found.z - normal.z).T
    return np.array([weighted_quantiles(x, found.weights, SHARES) for x in away]).T


def sampler_points(
    steps: tuple[int, ...] = STEPS,
    draws: tuple[int, ...] = DRAWS,
    reference: int = REFERENCE,
    runs: int = RUNS,
) -> list[BenchmarkPoint]:
    """Return the cost of every sampler at some lengths, and the error of its intervals.

    The error is that of the worst end of any unknown, rms over the runs; one below what
    the reference itself may be off counts as that.

    Args:
        steps: Of walks, a hundred and more.
        draws: Of importance sampling.
        reference: Steps of the walk that the others are held against.
        runs: Of the longest of each; of a shorter one up to `MOST_RUNS`.
    """
    tell = in_words()
    tell("the optimum")
    what = solved()
    free, axes = what.normal.z.size, np.asarray(what.density.root)
    tell("the reference")
    long, took = timed_walk(Scan(), what.density, free, reference, REFERENCE_SEED)
    long = long @ axes.T
    true, sd = interval_ends(long), long.reshape(-1, free).std(axis=0)
    half = len(long) // 2
    halves = interval_ends(long[:half]) - interval_ends(long[half:])
    own = 0.5 * float(np.max(np.abs(halves) / sd))
    over = f"{free} unknowns, 90 % intervals"
    points = []

    def add(method: str, seconds: float, ends: list[Interval], words: str = "") -> None:
        worst = [np.max(np.abs(one - true) / sd) for one in ends]
        error = max(own, float(np.sqrt(np.mean(np.square(worst)))))
        points.append(
            BenchmarkPoint(method, what.seconds + seconds, error, over + words)
        )

    for name, sampler in (("emcee", Emcee()), ("one scan", Scan())):
        for number in steps:
            tell(f"{name}, {number} steps")
            times = min(runs * max(steps) // number, MOST_RUNS)
            walked = [
                timed_walk(sampler, what.density, free, number, seed)
                for seed in range(times)
            ]
            add(
                f"{name}, {number:,} steps",
                min(seconds for _, seconds in walked),
                [interval_ends(chain @ axes.T) for chain, _ in walked],
                f", {WALKERS} walkers, {times} runs",
            )
    for number in draws:
        tell(f"importance sampling, {number} draws")
        times = min(runs * max(draws) // number, MOST_RUNS)
        drawn = [
            best_of(
                lambda number=number, seed=seed: importance(
                    what.posterior, what.normal, seed=seed, draws=number
                ),
                1,
            )
            for seed in range(times)
        ]
        add(
            f"importance, {number:,} draws",
            min(seconds for seconds, _ in drawn),
            [weighted_ends(found, what.normal) for _, found in drawn],
            f", {times} runs",
        )
    sds = np.sqrt(np.diag(what.normal.covariance))
    add("Laplace", 0.0, [np.outer([-NORMAL_Q95, NORMAL_Q95], sds)])
    points.append(
        BenchmarkPoint(
            f"one scan, {reference:,} steps",
            what.seconds + took,
            own,
            f"{over}, {WALKERS} walkers",
            is_reference=True,
        )
    )
    return points


register_benchmark(
    Benchmark(
        name="sampler",
        title="Sampling a posterior: cost against error",
        cost="time of a run, the optimum known",
        error="worst end of a 90 % interval [posterior sd], or that of the reference",
        measure=sampler_points,
        relative=False,
    )
)
