"""The probability of a rare event, by draws about where it is least improbable.

For an event of 1e-6 plain draws need 1e8 samples to know it to 10 %; these need some
hundreds, and are as free of bias. What is found says what to doubt: how many samples
carry it, how large a weight became, and how far the first-order answer is off.
"""

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import ndtr
from scipy.stats import t as student

from jblast.study.rare.design_point import DesignPoints, Margin, design_points
from jblast.study.rare.mixture import (
    BLOCK,
    DEFENSIVE,
    Mixture,
    mixture_about,
    parts_of,
    random_scores,
    sobol_scores,
    weights_of,
)
from jblast.study.statistics import LEVEL, wilson_interval

REPLICATES = 16
"""Scrambles of Sobol' points, whose scatter is their standard error."""
Points = Literal["random", "sobol"]


class RareProbability(NamedTuple):
    """How probable an event is.

    Attributes:
        probability: Estimated without bias.
        standard_error: Of it.
        low: Lower end of its 90 % interval.
        high: Upper end.
        samples: Drawn, without those of the search.
        hits: Samples of the event.
        lost: Samples whose margin is NaN, counted as none of the event.
        effective_size: Of the hits, by their weights: few carry all where it is low.
        largest_weight: Of any sample, at most one over the share of the prior.
        design: Where the event is least improbable.
        first_order: Its probability were its edge flat.
    """

    probability: float
    standard_error: float
    low: float
    high: float
    samples: int
    hits: int
    lost: int
    effective_size: float
    largest_weight: float
    design: DesignPoints
    first_order: float


def rare_probability(
    margin: Margin,
    dimensions: int,
    samples: int = 4096,
    *,
    seed: int = 0,
    points: Points = "random",
    defensive: float = DEFENSIVE,
    design: DesignPoints | None = None,
) -> RareProbability:
    """Return how probable it is that a margin is positive.

    Args:
        margin: Of one sample, from standard normal coordinates: `constrain` of a prior
            makes a number of one. Differentiable.
        dimensions: How many numbers are drawn.
        samples: To draw; of Sobol' points in `REPLICATES` scrambles.
        seed: Of all draws.
        points: How they are drawn.
        defensive: Share of samples that are drawn from the prior itself.
        design: Where the event is least improbable, if that is known.

    Raises:
        ValueError: There is no sample, the event was not found, or a weight is not
            finite.
    """
    if samples < 2 * REPLICATES:
        raise ValueError(f"samples: expected {2 * REPLICATES} or more, got {samples}")
    if design is None:
        design = design_points(margin, dimensions, seed=seed)
    mixture = mixture_about(design.points, defensive)
    if points == "random":
        index = np.arange(samples)
        scores = random_scores(index, dimensions, seed)
        one = _drawn(margin, scores, index, mixture)
        found, error, all_of = one.mean(), one.error(), [one]
        low, high = _interval(found, error, one.weights)
    else:
        each = samples // REPLICATES
        all_of = [
            _drawn(
                margin,
                sobol_scores(each, dimensions, seed * REPLICATES + n),
                np.arange(each),
                mixture,
            )
            for n in range(REPLICATES)
        ]
        means = np.array([one.mean() for one in all_of])
        found, error = means.mean(), means.std(ddof=1) / np.sqrt(REPLICATES)
        half = float(student.ppf(0.5 + LEVEL / 2, REPLICATES - 1)) * error
        low, high = max(found - half, 0.0), min(found + half, 1.0)
    hit = np.concatenate([one.weights[one.hits] for one in all_of])
    return RareProbability(
        float(found),
        float(error),
        float(low),
        float(high),
        sum(one.hits.size for one in all_of),
        hit.size,
        sum(one.lost for one in all_of),
        float(hit.sum() ** 2 / np.sum(hit**2)) if hit.size else 0.0,
        max(float(one.weights.max()) for one in all_of),
        design,
        float(ndtr(-design.distance[0])),
    )


class _Drawn(NamedTuple):
    """Samples of a mixture: their weights, parts, and which are of the event."""

    weights: Float[np.ndarray, " sample"]
    parts: Int[np.ndarray, " sample"]
    hits: Bool[np.ndarray, " sample"]
    lost: int

    def mean(self) -> float:
        """Return the probability, without bias."""
        return float(np.sum(self.weights[self.hits]) / self.hits.size)

    def error(self) -> float:
        """Return its standard error: of the parts, each with its own number."""
        values = np.where(self.hits, self.weights, 0.0)
        total = 0.0
        for part in np.unique(self.parts):
            own = values[self.parts == part]
            total += own.size * (np.var(own, ddof=1) if own.size > 1 else own[0] ** 2)
        return float(np.sqrt(total) / values.size)


def _drawn(
    margin: Margin,
    scores: Float[np.ndarray, "sample dimension"],
    index: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> _Drawn:
    parts = parts_of(index, mixture)
    moved = scores + mixture.middles[parts]
    weights = weights_of(moved, parts, mixture)
    values = np.concatenate(
        [
            np.asarray(_margins(margin, jnp.asarray(moved[at : at + BLOCK])))
            for at in range(0, len(moved), BLOCK)
        ]
    )
    return _Drawn(weights, parts, values > 0, int(np.isnan(values).sum()))


@jax.jit(static_argnums=0)
def _margins(margin, scores):
    return jax.vmap(margin)(scores)


def _interval(
    found: float, error: float, weights: Float[np.ndarray, " sample"]
) -> tuple[float, float]:
    """Return Wilson's interval for as many plain draws as would have the same error."""
    if error > 0:
        equal = found * (1 - found) / error**2
    else:
        equal = weights.sum() ** 2 / np.sum(weights**2)
    low, high = wilson_interval(float(found), float(equal))
    return float(low), float(high)
