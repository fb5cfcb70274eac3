"""Monte Carlo: draws by key, Sobol' points and importance, their cost against error.

Of a pressure whose mean and probabilities are known (`cases.rare_pressure`); three
numbers are drawn. An error is the rms over repetitions of what is off the exact value.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from jblast.fidelity.timing import best_of
from jblast.progress import in_words
from jblast.study.rare import rare_probability
from jblast.study.rare.design_point import Margin
from jblast.study.rare.mixture import random_scores, sobol_scores
from jblast.study.rare.probability import Points
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.cases.rare_pressure import (
    CASE,
    mean_pressure,
    pressure,
    probability_above,
)

DIMENSIONS = 3
SAMPLES = (1 << 10, 1 << 14, 1 << 18)
RARE_SAMPLES = (1 << 18, 1 << 22)
"""Plain draws of a rare event; fewer meet it hardly once."""
REPETITIONS = 16
COMMON_PA = 12e3
"""A pressure that one sample in twenty passes, about."""

IMPORTANCE: dict[str, Points] = {"importance": "random", "both": "sobol"}

Estimate = Callable[[int], float]
"""From a seed to an estimate."""


def montecarlo_points(
    samples: tuple[int, ...] = SAMPLES,
    rare_samples: tuple[int, ...] = RARE_SAMPLES,
    repetitions: int = REPETITIONS,
) -> list[BenchmarkPoint]:
    """Return cost and error of each way to a mean and to two probabilities.

    Args:
        samples: Of an estimate.
        rare_samples: Of plain draws of a rare event.
        repetitions: Of each estimate, which differ by the seed.
    """
    tell = in_words()
    found: list[BenchmarkPoint] = []

    def add(panel: str, method: str, number: int, true: float, estimate: Estimate):
        tell(f"{panel}: {method}, {number:,}")
        seconds, _ = best_of(lambda: estimate(0), 3)
        off = [estimate(seed) / true - 1 for seed in range(repetitions)]
        error = float(np.sqrt(np.mean(np.square(off))))
        how = ": importance by Sobol' points" if method == "both" else ""
        said = f"{number:,} samples, {repetitions} repetitions{how}"
        short = f"{number / 2**20:g}M" if number >= 2**20 else f"{number / 2**10:g}k"
        found.append(BenchmarkPoint(f"{method} {short}", seconds, error, said, panel))

    ways = {"plain": random_scores_of, "Sobol": sobol_scores}
    for name, scores in ways.items():
        for number in samples:
            add(
                "mean pressure",
                name,
                number,
                mean_pressure(),
                lambda seed, n=number, of=scores: float(
                    np.mean(pressures(of(n, DIMENSIONS, seed)))
                ),
            )
    for threshold, numbers in (
        (COMMON_PA, samples),
        (CASE.threshold_pa, rare_samples),
    ):
        true, edge = probability_above(threshold), margin_at(threshold)
        title = f"probability of {true:.2g}"
        for name, scores in ways.items():
            for number in numbers:
                add(
                    title,
                    name,
                    number,
                    true,
                    lambda seed, n=number, of=scores, p=threshold: float(
                        np.mean(pressures(of(n, DIMENSIONS, seed)) > p)
                    ),
                )
        for name, points in IMPORTANCE.items():
            for number in samples:
                add(
                    title,
                    name,
                    number,
                    true,
                    lambda seed, n=number, by=points, edge=edge: (
                        rare_probability(
                            edge, DIMENSIONS, n, seed=seed, points=by
                        ).probability
                    ),
                )
    return found


def random_scores_of(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Return draws by the keys of their numbers."""
    return random_scores(np.arange(count), dimensions, seed)


def margin_at(threshold_pa: float) -> Margin:
    """Return the margin of a pressure above a threshold."""
    return lambda u: jnp.log(pressure(u) / threshold_pa)


@jax.jit
def _pressures(scores):
    return jax.vmap(pressure)(scores)


def pressures(scores: np.ndarray) -> np.ndarray:
    """Return the pressures of draws [Pa]."""
    return np.asarray(_pressures(jnp.asarray(scores)))


register_benchmark(
    Benchmark(
        name="montecarlo",
        title="Monte Carlo: cost against standard error, by number of samples",
        cost="time of an estimate, the search for the event included",
        error="rms over repetitions, of the exact value",
        measure=montecarlo_points,
    )
)
