r"""Probabilities of rare outcomes by importance sampling about design points.

In standard normal coordinates $u$ an event is where a margin $g(u)$ is positive. Its
point nearest to the origin, at the distance $\beta$, is its most probable one
(Hasofer and Lind 1974); the first-order probability is $P = \Phi(-\beta)$, exact where
$g$ is linear. This design point is found by the steps of Rackwitz and Fiessler (1978),

$$u_{k+1} = \frac{\nabla g^T u_k - g}{|\nabla g|^2}\,\nabla g,$$

each shortened until the merit $\tfrac12|u|^2 + c\,|g|$ falls (Zhang and Der Kiureghian
1995). An event may have several such points. Searches start at random and at the mirror
image of each point found. After $n$ searches that ended at $w$ different points the
expected number of points is (Boender and Rinnooy Kan 1987, Math. Program. 37:59, eq. 9)

$$\hat w = \frac{w\,(n - 1)}{n - w - 2},$$

and the search is complete when $\hat w < w + \tfrac12$, that is $n > 2w^2 + 3w + 2$.

Samples are drawn from a mixture of the prior, the prior moved to each design point, and
the prior outside the sphere of radius $\beta$ about the origin (Harbitz 1986, Struct.
Saf. 3:109), which contains the whole event if its nearest point is at the distance
$\beta$. The component of a sample is fixed by its number, so that the components have
their shares of any number of samples. The weight of a sample is the prior's density
over that of all components together (the balance heuristic: Veach and Guibas 1995; Owen
and Zhou 2000),

$$\frac{1}{w(u)} = \alpha_0 + \frac{\alpha_\beta\,[|u| > \beta]}{P(|u| > \beta)}
    + \sum_k \alpha_k\,\frac{\varphi(u - u_k)}{\varphi(u)}.$$

As one component is the prior itself, with the share $\alpha_0$, no weight is above
$1/\alpha_0$ (a defensive mixture: Hesterberg 1995). An event that no search found is
counted without bias, but few samples meet it.

Plain draws of an event of probability 1e-6 need 1e8 samples for a relative error of
10 %; these need some thousands. The estimate is unbiased, but its interval is only as
good as the search for regions of the event. The search is therefore checked by draws
that do not depend on it: from the prior outside the sphere through the nearest design
point. Their hits far from every design point start further searches. Such a hit among
the samples themselves marks the search as incomplete, and the samples stay: a second
drawing would depend on the outcome of the first. Where the check finds the search to be
incomplete, half of the samples are such draws, and the interval extends to the
bound that they alone give.
"""

from collections.abc import Callable
from functools import partial
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.special import gammaincc, gammainccinv, logsumexp, ndtr, ndtri
from scipy.stats import qmc, t as student

from jblast.study.statistics import LEVEL, wilson_interval

REPLICATES = 16
"""Scrambles of Sobol' points, whose scatter is their standard error.

With 15 degrees of freedom a 90 % interval is 7 % longer than with an infinite number.
"""
CHECK = 8
"""Samples for each draw of the check, of which there are 32 at least: an eighth more
calls."""
EXTERIOR = 0.1
"""Share of samples outside the sphere, after the prior's, if the search is complete: as
for the prior, it costs 5 % of precision."""
OPEN_EXTERIOR = 0.5
"""The same if the search is incomplete: these samples have to find the regions. It is
larger if more of the check's hits are far from every design point."""
HARMLESS_RATIO = 1.5
"""An incomplete search is accepted if samples that do not depend on it bound the
probability by this multiple of the estimate: less than half of it can be missing."""
MIN_OUTSIDE = 1e-280
"""Probability outside a sphere below which its densities are not computed: near the
smallest float, 2e-308, a ratio of densities loses its digits."""
Points = Literal["random", "sobol"]
DEFENSIVE = 0.1
"""Share of samples from the prior itself: it bounds each weight by 10, and costs 5 % of
precision."""
GOLDEN = 0.6180339887498949
"""The inverse of the golden ratio: its multiples fill (0, 1) as evenly as one number
can."""
BLOCK = 65_536
"""Samples computed together, to bound the memory of a batch."""
Margin = Callable[[Float[Array, " dimension"]], Float[Array, ""]]
"""Function of standard normal coordinates, positive inside the event."""
MAX_STEPS = 20
"""Largest number of steps of a search. At a strongly curved boundary it converges
slowly, and the rest is not worth its calls: a point is only the centre of a
component."""
CUTS = 0.5 ** np.array([0, 1, 2, 4, 6])
"""Shares of a step, down to 1/64, that are tried together: one call of a batch in place
of a line search."""
BATCH = 8
"""Searches that run together, as one batch of margins."""
MIN_STARTS = 32
"""Fewest searches: a region that one start in ten leads to is missed in 3 % of runs."""
MAX_STARTS = 1024
"""Largest number of searches; 22 equal regions need 1,036. More regions than that are a
continuum for practical purposes, and the search is reported as incomplete."""
SAME_POINT = 0.5
"""Distance below which two points are one: their components overlap by 80 %."""
MIN_SHARE = 1e-3
"""Density relative to the best point below which a point is ignored: its component
would contribute less than the standard error."""
TOLERANCE = 1e-3
"""Residual (`search`) below which the end of a search is a design point. The error of
its distance from the origin is of the order of the square, a millionth."""
CONVERGED = 1e-8
"""Residual below which a search takes no further step, about the root of the precision
of float64."""


class DesignPoints(NamedTuple):
    """Local most probable points of an event, the most probable first.

    Attributes:
        points: Points in standard normal coordinates.
        distance: Distance of each point from the origin, its reliability index;
            negative if the origin lies in the event.
        evaluations: Number of evaluations of the margin by the search.
        searches: Number of searches that converged to one of the points.
        complete: Whether no further point is expected from more searches.
    """

    points: Float[np.ndarray, "point dimension"]
    distance: Float[np.ndarray, " point"]
    evaluations: int
    searches: int = 0
    complete: bool = True


class RareProbability(NamedTuple):
    """Probability of an event.

    Attributes:
        probability: Unbiased estimate.
        standard_error: Standard error of the estimate, for the sampled regions.
        low: Lower bound of the 90 % interval.
        high: Upper bound, which includes regions that an incomplete search may have
            missed.
        samples: Number of samples, without search and check (`design.evaluations`).
        hits: Number of samples in the event.
        lost: Number of samples whose margin is NaN, counted as outside the event.
        effective_size: Effective sample size of the hits; if it is low, few hits carry
            the estimate.
        largest_weight: Largest weight of a sample, at most one over the prior's share.
        design: Design points of the event; none if no search found its boundary.
        first_order: First-order probability (flat boundary); NaN without a point.
        complete: Whether no region of the event is expected to be missing: the search
            met its stopping rule and the check hit no region that it cannot explain, or
            the check alone bounds the probability. If false, `high` is the bound of the
            check alone, and the truth may be well above `probability`.
        check: Number of samples of the check, including those outside the sphere.
        check_hits: Number of samples of the check in the event.
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
        margin: Differentiable margin of one sample, from standard normal coordinates;
            `constrain` of a prior converts them to parameters.
        dimensions: Number of random variables.
        samples: Number of samples; Sobol' points are in `REPLICATES` scrambles.
        seed: Seed of all samples.
        points: Kind of samples.
        defensive: Share of samples from the prior itself.
        design: Design points of the event, if they are known.

    Raises:
        ValueError: There are too few samples, or a weight is not finite.
    """
    if samples < 2 * REPLICATES:
        raise ValueError(f"samples: expected {2 * REPLICATES} or more, got {samples}")
    if design is None:
        design = explored(margin, dimensions, seed=seed)
    mixture_about(design.points, defensive)  # rejects an invalid share before the work
    # indices above those of the samples, so that the two are independent
    check = random_scores(
        2**31 + np.arange(max(samples // CHECK, 2 * REPLICATES)), dimensions, seed
    )
    design, mixture, first = _checked(margin, design, check, defensive)
    if points == "random":
        index = np.arange(samples)
        scores = random_scores(index, dimensions, seed)
        all_of = [_drawn(margin, scores, index, mixture)]
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
    inside = bool(np.any(design.distance < 0.0))
    if not inside and any(one.far for one in all_of):
        # samples drawn again after such a hit would favour low estimates: 0.68 of the
        # truth by 256 samples, where half of an event has no slope
        design = design._replace(complete=False)
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
        *(one.hits[one.parts == len(mixture.centres)] for one in all_of),
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
        design.complete or bool(bound < HARMLESS_RATIO * found),
        checked,
        check_hits,
        bound,
    )


class Mixture(NamedTuple):
    """Components that samples are drawn from.

    Attributes:
        centres: Centres of the normal components; the first is the prior.
        shares: Share of samples of each normal component, then of the exterior.
        radius: Radius of the sphere of the exterior; 0 stands for the prior again.
    """

    centres: Float[np.ndarray, "part dimension"]
    shares: Float[np.ndarray, " share"]
    radius: float = 0.0

    @property
    def outside(self) -> float:
        """Prior probability outside the sphere."""
        return outside_sphere(self.radius, self.centres.shape[1])


def _checked(
    margin: Margin,
    design: DesignPoints,
    scores: Float[np.ndarray, "sample dimension"],
    defensive: float,
) -> tuple[DesignPoints, Mixture, Bool[np.ndarray, " sample"]]:
    """Return design points, their mixture, and the hits among samples of a check.

    Hits far from every design point start searches. The search is incomplete if these
    converge to no new point.

    Args:
        margin: Margin of one sample.
        design: Known design points.
        scores: Standard normal samples of the check.
        defensive: Share of the prior.
    """
    inside = bool(np.any(design.distance < 0.0))
    while True:
        radius = 0.0 if inside else float(design.distance.min(initial=np.inf))
        if not outside_sphere(radius, scores.shape[1]) > MIN_OUTSIDE:
            radius = 0.0
        middles = np.zeros((0, scores.shape[1])) if inside else design.points
        usual = mixture_about(middles, defensive, radius=radius, exterior=EXTERIOR)
        beyond = placed(scores, np.full(len(scores), len(usual.centres)), usual)
        hits = _margins_of(margin, beyond) > 0
        design = design._replace(evaluations=design.evaluations + len(scores))
        if inside:  # not rare: plain samples suffice
            return design._replace(complete=True), usual, hits
        parts = parts_of(np.arange(len(scores)), usual)
        far = hits & far_from_points(beyond, parts, usual)
        many = searches_needed(len(design.points)) > MAX_STARTS
        if not np.any(far) or many:
            break
        more = extended(margin, design, beyond[far][:BATCH])
        if all(near(point, design.points) for point in more.points):
            # the hits belong to a region that searches cannot reach
            design = more._replace(complete=False)
            break
        design = more
    if design.complete:
        return design, usual, hits
    share = max(OPEN_EXTERIOR, float(np.sum(far)) / max(int(np.sum(hits)), 1))
    wide = mixture_about(middles, defensive, radius=radius, exterior=share)
    return design, wide, hits


class _Drawn(NamedTuple):
    """Samples of a mixture: weights, components, hits, lost and far hits."""

    weights: Float[np.ndarray, " sample"]
    parts: Int[np.ndarray, " sample"]
    hits: Bool[np.ndarray, " sample"]
    lost: int
    far: int

    def mean(self) -> float:
        """Return the unbiased estimate of the probability."""
        return float(np.sum(self.weights[self.hits]) / self.hits.size)

    def error(self) -> float:
        """Return the standard error; components are strata of fixed size."""
        values = np.where(self.hits, self.weights, 0.0)
        total = 0.0
        # stratified: the number of each component is fixed, so that only its own
        # scatter counts
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
    far = hits & far_from_points(moved, parts, mixture)
    return _Drawn(weights, parts, hits, int(np.isnan(values).sum()), int(np.sum(far)))


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
    """Return Wilson's interval for plain samples with the same standard error."""
    if error > 0:
        equal = found * (1 - found) / error**2
    else:
        equal = weights.sum() ** 2 / np.sum(weights**2)
    low, high = wilson_interval(float(found), float(equal))
    return float(low), float(high)


def outside_sphere(radius: float, dimensions: int) -> float:
    """Return the probability that standard normal coordinates lie outside a sphere."""
    return float(gammaincc(0.5 * dimensions, 0.5 * radius**2))


def mixture_about(
    points: Float[np.ndarray, "point dimension"],
    defensive: float = DEFENSIVE,
    *,
    radius: float = 0.0,
    exterior: float = 0.0,
) -> Mixture:
    """Return the mixture of the prior, the prior moved to points, and its exterior.

    Args:
        points: Centres of components, whose shares are proportional to their density.
        defensive: Share of the prior.
        radius: Radius of the sphere of the exterior.
        exterior: Share of the exterior.

    Raises:
        ValueError: The prior's share is not above 0 and at most 1.
    """
    if not 0 < defensive <= 1:
        raise ValueError(
            f"defensive: expected a share above 0 and at most 1, got {defensive:g}"
        )
    left = (1.0 - defensive) * (1.0 - exterior)
    # relative to the largest density: far from the origin all of them underflow
    logs = -0.5 * np.sum(points**2, axis=1)
    relative = np.exp(logs - logs.max(initial=-np.inf))
    found = left * relative / relative.sum() if len(points) else relative
    centres = np.concatenate([np.zeros((1, points.shape[1])), points])
    beyond = max(1.0 - defensive - found.sum(), 0.0)
    return Mixture(centres, np.concatenate([[defensive], found, [beyond]]), radius)


def parts_of(
    index: Int[np.ndarray, " sample"], mixture: Mixture
) -> Int[np.ndarray, " sample"]:
    """Return the component of each sample, spread evenly over the sample numbers."""
    # the additive recurrence of the golden ratio: any first n samples have the shares
    place = (0.5 + index * GOLDEN) % 1.0
    upto = np.cumsum(mixture.shares)[:-1]
    return np.searchsorted(upto, place, side="right")


def placed(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> Float[np.ndarray, "sample dimension"]:
    """Return samples of their components, from standard normal samples.

    A sample of the exterior keeps its direction. Its radius is the quantile at which
    the probability of a larger radius is that of the given radius, times that of the
    exterior.
    """
    count = len(mixture.centres)
    beyond = parts == count
    # the exterior starts from the prior, and is moved outwards below
    samples = scores + mixture.centres[np.where(beyond, 0, parts)]
    if mixture.radius > 0.0 and np.any(beyond):
        half = 0.5 * scores.shape[1]
        length = np.linalg.norm(samples[beyond], axis=1)
        exceeded = gammaincc(half, 0.5 * length**2) * mixture.outside
        moved = np.sqrt(2.0 * gammainccinv(half, exceeded))
        # the inverse may round to just inside, where the density is 0
        moved = np.maximum(moved, mixture.radius * (1.0 + 1e-12))
        samples[beyond] *= (moved / length)[:, None]
    return samples


def random_scores(
    index: Int[np.ndarray, " sample"], dimensions: int, seed: int
) -> Float[np.ndarray, "sample dimension"]:
    """Return standard normal samples, each from a key folded with its number."""
    key, found = jax.random.key(seed), np.empty((index.size, dimensions))
    for at in range(0, index.size, BLOCK):
        part = slice(at, at + BLOCK)
        found[part] = _scores(key, index[part].astype(np.uint32), dimensions)
    return found


@jax.jit(static_argnums=2)
def _scores(key, index, dimensions: int):
    keys = jax.vmap(jax.random.fold_in, (None, 0))(key, index)
    return jax.vmap(lambda one: jax.random.normal(one, (dimensions,)))(keys)


def sobol_scores(
    count: int, dimensions: int, seed: int
) -> Float[np.ndarray, "sample dimension"]:
    """Return the first scrambled Sobol' points as standard normal scores."""
    unit = qmc.Sobol(dimensions, scramble=True, bits=52, rng=seed)
    whole = unit.random_base2(max(0, int(np.ceil(np.log2(max(count, 1))))))[:count]
    tiny = 2.0**-53
    return ndtri(np.clip(whole, tiny, 1 - tiny))


def weights_of(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> Float[np.ndarray, " sample"]:
    """Return the weight of each sample: the prior's density over the mixture's.

    Raises:
        ValueError: A weight is not finite.
    """
    with np.errstate(invalid="ignore"):  # rejected below
        weights = np.exp(-np.logaddexp(*_log_densities(scores, parts, mixture)))
    bad = np.flatnonzero(~np.isfinite(weights))
    if bad.size:
        raise ValueError(
            f"weights: expected finite numbers, got {weights[bad[0]]} of sample "
            f"{bad[0]} and {bad.size - 1} more of {weights.size}"
        )
    return weights


def far_from_points(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> Bool[np.ndarray, " sample"]:
    """Return the samples whose most probable component is prior or exterior."""
    wide, near = _log_densities(scores, parts, mixture)
    return wide > near


def _log_densities(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> tuple[Float[np.ndarray, " sample"], Float[np.ndarray, " sample"]]:
    """Return ln density ratios to the prior: of wide components, of those at points."""
    counts = np.bincount(parts, minlength=len(mixture.shares))
    with np.errstate(divide="ignore"):
        shares = np.log(counts / parts.size)
    # ln of phi(u - u_k) / phi(u) is u . u_k - |u_k|^2 / 2
    ratios = scores @ mixture.centres.T - 0.5 * np.sum(mixture.centres**2, axis=1)
    ratios = ratios + shares[: len(mixture.centres)]
    beyond = np.full(len(scores), -np.inf)
    if len(mixture.shares) > len(mixture.centres):
        length = np.linalg.norm(scores, axis=1)
        beyond[length > mixture.radius] = shares[-1] - np.log(mixture.outside)
        beyond[np.isnan(length)] = np.nan
    wide = np.logaddexp(ratios[:, 0], beyond)
    if len(mixture.centres) == 1:
        return wide, np.full(len(scores), -np.inf)
    return wide, np.asarray(logsumexp(ratios[:, 1:], axis=1))


def design_points(
    margin: Margin, dimensions: int, *, starts: int = MIN_STARTS, seed: int = 0
) -> DesignPoints:
    """Search from random points about the origin until no new point is expected.

    Args:
        margin: Differentiable margin of one sample, finite near the origin.
        dimensions: Number of random variables.
        starts: Smallest number of searches.
        seed: Seed of the starts.

    Raises:
        ValueError: No search found the boundary of the event.
    """
    found = explored(margin, dimensions, starts=starts, seed=seed)
    if not len(found.points):
        raise ValueError(
            f"margin: expected an event boundary within reach of {starts} searches "
            "from the origin, got none: the event is impossible, or the margin is flat"
        )
    return found


def explored(
    margin: Margin, dimensions: int, *, starts: int = MIN_STARTS, seed: int = 0
) -> DesignPoints:
    """Return design points as `design_points`, or none if no search converged."""
    key = jax.random.fold_in(jax.random.key(seed), dimensions)
    inside = float(margin(jnp.zeros(dimensions))) > 0
    found = DesignPoints(np.zeros((0, dimensions)), np.zeros(0), 1, 0, complete=False)
    mirrored = np.zeros((0, dimensions))
    launched = 0
    while True:
        # every batch of starts has its own key
        key, own = jax.random.split(key)
        begin = np.array(jax.random.normal(own, (BATCH, dimensions)))
        if launched == 0:
            begin[0] = 1e-3  # at the origin itself a symmetric margin has no slope
        begin[: len(mirrored)] = mirrored[:BATCH]
        before = found.points
        found = extended(margin, found, begin, inside=inside)
        launched += BATCH
        new = np.array([p for p in found.points if not near(p, before)])
        mirrored = -new.reshape(-1, dimensions)
        # a new point may have a mirror image: search there before the rule may end
        if launched < starts or (found.complete and len(mirrored)):
            continue
        # launches in total, at the share of searches that have converged so far
        total = searches_needed(len(found.points)) * launched / max(found.searches, 1)
        if found.complete or not found.searches or total > MAX_STARTS:
            return found


def extended(
    margin: Margin,
    known: DesignPoints,
    begin: Float[np.ndarray, "start dimension"],
    *,
    inside: bool = False,
) -> DesignPoints:
    """Return known design points together with those of more searches.

    Args:
        margin: Margin of one sample.
        known: Known points.
        begin: Starts of searches, at most `BATCH`.
        inside: Whether the origin lies in the event.
    """
    # one batch size, hence one compiled program: repeat starts to fill it
    filled = np.resize(begin, (BATCH, begin.shape[1]))
    end, off, steps = search(margin, jnp.asarray(filled))
    ends, left_over = np.asarray(end)[: len(begin)], np.asarray(off)[: len(begin)]
    # an end that is not on the boundary is no design point
    good = (left_over < TOLERANCE) & np.isfinite(left_over)
    ends = ends[good]
    every = np.concatenate([known.points, ends])
    length = np.linalg.norm(every, axis=1)
    least = length.min(initial=np.inf)
    likely = 0.5 * (length**2 - least**2) <= -np.log(MIN_SHARE)
    kept: list[int] = []
    for n in range(len(every)):
        if likely[n] and not near(every[n], every[kept]):
            kept.append(n)
    kept.sort(key=lambda n: length[n])
    searches = known.searches + int(np.sum(likely[len(known.points) :]))
    return DesignPoints(
        every[kept],
        length[kept] * (-1 if inside else 1),
        known.evaluations + BATCH * (1 + int(steps) * (1 + len(CUTS))),
        searches,
        bool(kept) and searches > searches_needed(len(kept)),
    )


def near(
    point: Float[np.ndarray, " dimension"], others: Float[np.ndarray, "other dimension"]
) -> bool:
    """Return whether a point is closer than `SAME_POINT` to one of the others."""
    return bool(np.any(np.linalg.norm(others - point, axis=1) < SAME_POINT))


def searches_needed(points: int) -> int:
    """Return the number of searches that must be exceeded (module docstring)."""
    return 2 * points**2 + 3 * points + 2


@partial(jax.jit, static_argnums=0)
def search(
    margin: Margin, begin: Float[Array, "start dimension"]
) -> tuple[Float[Array, "start dimension"], Float[Array, " start"], Array]:
    """Return the ends of searches, their residuals and the number of steps.

    A residual is the larger of the distance to the boundary, along the slope, and of
    the last step relative to the distance from the origin. The batch ends when each
    search has converged or no shortened step lowers its merit.
    """
    cuts = jnp.asarray(CUTS, begin.dtype)

    def target(u):
        value, slope = jax.value_and_grad(margin)(u)
        # a flat margin has no step: guard the division, not its result (NaN gradients)
        steep = jnp.sum(slope**2)
        safe = jnp.where(steep > 0, steep, 1.0)
        there = jnp.where(steep > 0, (slope @ u - value) / safe * slope, jnp.nan)
        steep = jnp.sqrt(safe)
        away = jnp.linalg.norm(there - u) / (1.0 + jnp.linalg.norm(u))
        return value, steep, there, jnp.maximum(jnp.abs(value) / steep, away)

    def step(u, value, steep, there, off):
        # for c above |u| / |slope| the step is a descent direction of the merit
        size = 2 * jnp.maximum(jnp.linalg.norm(there), jnp.linalg.norm(u)) / steep
        penalty = size + 10.0 / steep

        def merit(v, g):
            return 0.5 * jnp.sum(v**2) + penalty * jnp.abs(g)

        tried = u[None] + cuts[:, None] * (there - u)[None]
        merits = jax.vmap(lambda v: merit(v, margin(v)))(tried)
        # a step to where the margin is undefined is never the best one
        merits = jnp.where(jnp.isfinite(merits), merits, jnp.inf)
        at = jnp.argmin(merits)
        better = (merits[at] < merit(u, value)) & ~(off < CONVERGED)
        return jnp.where(better, tried[at], u), better

    def going(state):
        _, _, moved, steps = state
        return jnp.any(moved) & (steps < MAX_STEPS)

    def advance(state):
        u, known, _, steps = state
        nearer, moved = jax.vmap(step)(u, *known)
        return nearer, jax.vmap(target)(nearer), moved, steps + 1

    known = jax.vmap(target)(begin)
    state = begin, known, jnp.ones(len(begin), bool), jnp.asarray(0)
    end, known, _, steps = jax.lax.while_loop(going, advance, state)
    return end, known[3], steps
