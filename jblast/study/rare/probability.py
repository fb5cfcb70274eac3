"""Probability of a rare event by importance sampling about its design points.

For an event of 1e-6 plain draws need 1e8 samples to reach 10 %; these need some
thousands. The estimate is free of bias. Its interval is only as good as the search for
regions of the event, so the search is checked by draws that do not depend on it: from
the prior outside the sphere through the nearest design point, which contains the whole
event. Their hits far from every design point start further searches. Where the search
stays incomplete, half of the samples are such draws, and the interval extends to the
bound that they alone give.
"""

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import ndtr
from scipy.stats import t as student

from jblast.study.rare.design_point import (
    BATCH,
    MOST_STARTS,
    DesignPoints,
    Margin,
    explored,
    extended,
    near,
    searches_needed,
)
from jblast.study.rare.mixture import (
    BLOCK,
    DEFENSIVE,
    Mixture,
    far_from_points,
    mixture_about,
    outside_sphere,
    parts_of,
    placed,
    random_scores,
    sobol_scores,
    weights_of,
)
from jblast.study.statistics import LEVEL, wilson_interval

REPLICATES = 16
"""Scrambles of Sobol' points, whose scatter is their standard error."""
CHECK = 8
"""One draw of the check for so many samples, 32 at least: a tenth more calls."""
EXTERIOR = 0.1
"""Share of samples outside the sphere, after the prior's, where the search is complete:
as for the prior, it costs 5 % of precision."""
OPEN_EXTERIOR = 0.5
"""The same where it is not, at least: these draws have to find the regions. It is more
where more of the check's hits are far from every design point."""
MISSED = 1.5
"""An incomplete search is harmless where draws that do not depend on it bound the
probability by so many times the estimate: less than half of it can be missing."""
LEAST_OUTSIDE = 1e-280
"""Probability outside a sphere below which its densities are not computed."""
Points = Literal["random", "sobol"]


class RareProbability(NamedTuple):
    """Probability of an event.

    Attributes:
        probability: Estimated without bias.
        standard_error: Of it, for the regions that were sampled.
        low: Lower bound of its 90 % interval.
        high: Upper bound. It includes what an incomplete search may have missed.
        samples: Drawn. Those of search and check are in `design.evaluations`.
        hits: Samples of the event.
        lost: Samples whose margin is NaN, counted as none of the event.
        effective_size: Of the hits, by their weights: few carry all where it is low.
        largest_weight: Of any sample, at most one over the share of the prior.
        design: Design points of the event; none where no search found its edge.
        first_order: Its probability were its edge flat; NaN without a design point.
        complete: No region of the event is expected to be missing: the search met its
            stopping rule and the check hit no region that it cannot explain, or the
            check alone bounds the probability. Where false, the search is incomplete:
            `high` is the bound of the check alone, and the truth may be well above
            `probability`.
        check: Draws of the check, of the samples those outside the sphere included.
        check_hits: Draws of the check in the event.
        check_high: Upper bound of the probability by the check alone (90 % interval).
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
    complete: bool
    check: int
    check_hits: int
    check_high: float


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
    """Return the probability that a margin is positive.

    Args:
        margin: Of one sample, from standard normal coordinates: `constrain` of a prior
            makes a number of one. Differentiable.
        dimensions: Number of random variables.
        samples: To draw; of Sobol' points in `REPLICATES` scrambles.
        seed: Of all draws.
        points: Kind of draws.
        defensive: Share of samples that are drawn from the prior itself.
        design: Design points of the event, if they are known.

    Raises:
        ValueError: There are too few samples, or a weight is not finite.
    """
    if samples < 2 * REPLICATES:
        raise ValueError(f"samples: expected {2 * REPLICATES} or more, got {samples}")
    if design is None:
        design = explored(margin, dimensions, seed=seed)
    mixture_about(design.points, defensive)  # refuses a wrong share before the draws
    # indices above those of the samples, so that the two are independent
    check = random_scores(
        2**31 + np.arange(max(samples // CHECK, 2 * REPLICATES)), dimensions, seed
    )
    far = np.zeros((0, dimensions))
    drawn = 0
    while True:
        design, mixture, first = _checked(margin, design, check, far, defensive)
        if points == "random":
            index = drawn + np.arange(samples)
            scores = random_scores(index, dimensions, seed)
            all_of = [_drawn(margin, scores, index, mixture)]
        else:
            each = samples // REPLICATES
            all_of = [
                _drawn(
                    margin,
                    sobol_scores(
                        each, dimensions, seed * REPLICATES + n + 2**32 * drawn
                    ),
                    np.arange(each),
                    mixture,
                )
                for n in range(REPLICATES)
            ]
        far = np.concatenate([one.far for one in all_of])
        inside = bool(np.any(design.distance < 0.0))
        if inside or not len(far) or not design.complete:
            break
        # a region that search and check missed: these samples become part of the search
        drawn += samples
        design = design._replace(evaluations=design.evaluations + samples)
    if points == "random":
        found, error = all_of[0].mean(), all_of[0].error()
        low, high = _interval(found, error, all_of[0].weights)
    else:
        means = np.array([one.mean() for one in all_of])
        found, error = means.mean(), means.std(ddof=1) / np.sqrt(REPLICATES)
        half = float(student.ppf(0.5 + LEVEL / 2, REPLICATES - 1)) * error
        low, high = max(found - half, 0.0), min(found + half, 1.0)
    exterior = [
        first,
        *(one.hits[one.parts == len(mixture.middles)] for one in all_of),
    ]
    check_hits = int(sum(np.sum(part) for part in exterior))
    checked = sum(part.size for part in exterior)
    bound = mixture.outside * float(wilson_interval(check_hits / checked, checked)[1])
    if not design.complete:
        high = max(high, bound)
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
        float(ndtr(-design.distance[0])) if len(design.distance) else np.nan,
        design.complete or bool(bound < MISSED * found),
        checked,
        check_hits,
        bound,
    )


def _checked(
    margin: Margin,
    design: DesignPoints,
    scores: Float[np.ndarray, "sample dimension"],
    start: Float[np.ndarray, "start dimension"],
    defensive: float,
) -> tuple[DesignPoints, Mixture, Bool[np.ndarray, " sample"]]:
    """Return design points, the mixture about them, and which draws of a check hit.

    Hits far from every design point start searches. The search is incomplete if these
    end at no new point.

    Args:
        margin: Of one sample.
        design: Design points found before.
        scores: Standard normal draws of the check.
        start: Hits of earlier samples that are far from every design point.
        defensive: Share of the prior.
    """
    inside = bool(np.any(design.distance < 0.0))
    new = True
    if len(start):
        design, new = _grown(margin, design, start)
    while True:
        radius = 0.0 if inside else float(design.distance.min(initial=np.inf))
        if not outside_sphere(radius, scores.shape[1]) > LEAST_OUTSIDE:
            radius = 0.0
        middles = np.zeros((0, scores.shape[1])) if inside else design.points
        usual = mixture_about(middles, defensive, radius=radius, exterior=EXTERIOR)
        beyond = placed(scores, np.full(len(scores), len(usual.middles)), usual)
        hits = _margins_of(margin, beyond) > 0
        design = design._replace(evaluations=design.evaluations + len(scores))
        if inside:  # not rare: plain draws need no search
            return design._replace(complete=True), usual, hits
        parts = parts_of(np.arange(len(scores)), usual)
        far = hits & far_from_points(beyond, parts, usual)
        many = searches_needed(len(design.points)) > MOST_STARTS
        if not np.any(far) or not new or many:
            break
        design, new = _grown(margin, design, beyond[far])
        if not new:
            break
    if design.complete:
        return design, usual, hits
    share = max(OPEN_EXTERIOR, float(np.sum(far)) / max(int(np.sum(hits)), 1))
    wide = mixture_about(middles, defensive, radius=radius, exterior=share)
    return design, wide, hits


def _grown(
    margin: Margin, design: DesignPoints, start: Float[np.ndarray, "start dimension"]
) -> tuple[DesignPoints, bool]:
    """Return design points after more searches, and whether these ended at a new one.

    If they did not, no search explains their starts: it is incomplete.
    """
    more = extended(margin, design, start[:BATCH])
    new = any(not near(point, design.points) for point in more.points)
    return (more if new else more._replace(complete=False)), new


class _Drawn(NamedTuple):
    """Samples of a mixture: weights, parts, hits, and hits far from design points."""

    weights: Float[np.ndarray, " sample"]
    parts: Int[np.ndarray, " sample"]
    hits: Bool[np.ndarray, " sample"]
    lost: int
    far: Float[np.ndarray, "hit dimension"]

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
    moved = placed(scores, parts, mixture)
    weights = weights_of(moved, parts, mixture)
    values = _margins_of(margin, moved)
    hits = values > 0
    far = moved[hits & far_from_points(moved, parts, mixture)]
    return _Drawn(weights, parts, hits, int(np.isnan(values).sum()), far)


def _margins_of(
    margin: Margin, samples: Float[np.ndarray, "sample dimension"]
) -> Float[np.ndarray, " sample"]:
    return np.concatenate(
        [
            np.asarray(_margins(margin, jnp.asarray(samples[at : at + BLOCK])))
            for at in range(0, len(samples), BLOCK)
        ]
    )


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
