r"""Probabilities of rare outcomes by importance sampling about design points.

In standard normal coordinates $u$ an event is where a margin $g(u)$ is positive. Its
point nearest to the origin, at the distance $\beta$, is its most probable one
(Hasofer and Lind 1974); the first-order probability is $P = \Phi(-\beta)$, exact where
$g$ is linear. This design point is found by the steps of Rackwitz and Fiessler (1978),

$$u_{k+1} = \frac{\nabla g^T u_k - g}{|\nabla g|^2}\,\nabla g,$$

each cut until the merit $\tfrac12|u|^2 + c\,|g|$ falls (Zhang and Der Kiureghian 1995).
An event may have several such points. Searches start at random and at the mirror image
of each point found. After $n$ searches that ended at $w$ different points the expected
number of points is (Boender and Rinnooy Kan 1987, Math. Program. 37:59, eq. 9)

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
DEFENSIVE = 0.1
"""Share of samples that are drawn from the prior itself."""
GOLDEN = 0.6180339887498949
"""The inverse of the golden ratio: its multiples fill (0, 1) as evenly as one number
can."""
BLOCK = 65_536
"""Samples drawn at once."""
Margin = Callable[[Float[Array, " dimension"]], Float[Array, ""]]
"""From standard normal coordinates to a number that is positive where the event is."""
STEPS = 20
"""Most steps of a search. Where the edge curves much they converge slowly, and the
remainder is not worth its calls: a point is the middle of a part of the samples."""
CUTS = 0.5 ** np.array([0, 1, 2, 4, 6])
"""Shares of a step, down to 1/64, that are tried together: one call of a batch in place
of a line search."""
BATCH = 8
"""Searches that run together."""
STARTS = 32
"""Fewest searches: a region that one start in ten leads to is missed in 3 % of runs."""
MOST_STARTS = 1024
"""Most searches; 22 equal regions need 1,036. More regions than that are a continuum
for practical purposes, and the search is reported as incomplete."""
SAME_POINT = 0.5
"""Points closer than this are one."""
LEAST_SHARE = 1e-3
"""A point so much less probable than the best is left out."""
TOLERANCE = 1e-3
"""Residual (`search`) below which an end is a design point. The error of its distance
from the origin is of the order of the square, a millionth."""
ENOUGH = 1e-8
"""Residual below which a search makes no further step."""


class DesignPoints(NamedTuple):
    """Local most probable points of an event, the most probable first.

    Attributes:
        points: In standard normal coordinates.
        distance: Of each from the origin, its reliability index; negative where the
            origin itself lies in the event.
        evaluations: Of the margin, that the search took.
        searches: Searches that ended at one of the points.
        complete: No further point is expected from more searches.
    """

    points: Float[np.ndarray, "point dimension"]
    distance: Float[np.ndarray, " point"]
    evaluations: int
    searches: int = 0
    complete: bool = True


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


class Mixture(NamedTuple):
    """Parts that samples are drawn from.

    Attributes:
        middles: Of the normal parts; the first is the prior, about the origin.
        shares: Of samples, of the normal parts and then of the part outside a sphere.
        radius: Of that sphere; 0 is the prior once more.
    """

    middles: Float[np.ndarray, "part dimension"]
    shares: Float[np.ndarray, " share"]
    radius: float = 0.0

    @property
    def outside(self) -> float:
        """Probability of the prior outside the sphere."""
        return outside_sphere(self.radius, self.middles.shape[1])


def _checked(
    margin: Margin,
    design: DesignPoints,
    scores: Float[np.ndarray, "sample dimension"],
    defensive: float,
) -> tuple[DesignPoints, Mixture, Bool[np.ndarray, " sample"]]:
    """Return design points, the mixture about them, and which draws of a check hit.

    Hits far from every design point start searches. The search is incomplete if these
    end at no new point.

    Args:
        margin: Of one sample.
        design: Design points found before.
        scores: Standard normal draws of the check.
        defensive: Share of the prior.
    """
    inside = bool(np.any(design.distance < 0.0))
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
        if not np.any(far) or many:
            break
        more = extended(margin, design, beyond[far][:BATCH])
        if all(near(point, design.points) for point in more.points):
            # no search explains these starts
            design = more._replace(complete=False)
            break
        design = more
    if design.complete:
        return design, usual, hits
    share = max(OPEN_EXTERIOR, float(np.sum(far)) / max(int(np.sum(hits)), 1))
    wide = mixture_about(middles, defensive, radius=radius, exterior=share)
    return design, wide, hits


class _Drawn(NamedTuple):
    """Samples of a mixture: weights, parts, hits, lost ones, hits far from points."""

    weights: Float[np.ndarray, " sample"]
    parts: Int[np.ndarray, " sample"]
    hits: Bool[np.ndarray, " sample"]
    lost: int
    far: int

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
    """Return Wilson's interval for as many plain draws as would have the same error."""
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
    """Return the mixture of the prior, its likes about points and its exterior.

    Args:
        points: Middles of parts, which share what is left as their own densities are.
        defensive: Share of the prior.
        radius: Of the sphere outside of which one part lies.
        exterior: Share of that part.

    Raises:
        ValueError: The prior's share is not above 0 and at most 1, or that of both
            parts is above 1.
    """
    if not 0 < defensive <= 1:
        raise ValueError(
            f"defensive: expected a share above 0 and at most 1, got {defensive:g}"
        )
    left = (1.0 - defensive) * (1.0 - exterior)
    # shares by the density at each point, relative to the largest: far out all
    # underflow
    logs = -0.5 * np.sum(points**2, axis=1)
    relative = np.exp(logs - logs.max(initial=-np.inf))
    found = left * relative / relative.sum() if len(points) else relative
    middles = np.concatenate([np.zeros((1, points.shape[1])), points])
    beyond = max(1.0 - defensive - found.sum(), 0.0)
    return Mixture(middles, np.concatenate([[defensive], found, [beyond]]), radius)


def parts_of(
    index: Int[np.ndarray, " sample"], mixture: Mixture
) -> Int[np.ndarray, " sample"]:
    """Return the part each sample belongs to, evenly spread over their numbers."""
    place = (0.5 + index * GOLDEN) % 1.0
    upto = np.cumsum(mixture.shares)[:-1]
    return np.searchsorted(upto, place, side="right")


def placed(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> Float[np.ndarray, "sample dimension"]:
    """Return samples of their parts, from standard normal draws.

    One outside the sphere keeps its direction. Its radius is the one whose probability
    of being exceeded is that of the drawn radius, times that of the sphere's.
    """
    count = len(mixture.middles)
    beyond = parts == count
    samples = scores + mixture.middles[np.where(beyond, 0, parts)]
    if mixture.radius > 0.0 and np.any(beyond):
        half = 0.5 * scores.shape[1]
        length = np.linalg.norm(samples[beyond], axis=1)
        exceeded = gammaincc(half, 0.5 * length**2) * mixture.outside
        moved = np.sqrt(2.0 * gammainccinv(half, exceeded))
        # the inverse may round to just inside
        moved = np.maximum(moved, mixture.radius * (1.0 + 1e-12))
        samples[beyond] *= (moved / length)[:, None]
    return samples


def random_scores(
    index: Int[np.ndarray, " sample"], dimensions: int, seed: int
) -> Float[np.ndarray, "sample dimension"]:
    """Return standard normal draws, each by the key of its own number."""
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
    """Return scrambled Sobol' points as standard normal draws, the first ones."""
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
        ValueError: One is not finite.
    """
    with np.errstate(invalid="ignore"):  # refused below
        weights = np.exp(-np.logaddexp(*_log_densities(scores, parts, mixture)))
    bad = np.flatnonzero(~np.isfinite(weights))
    if bad.size:
        raise ValueError(
            f"weights: expected finite ones, got {weights[bad[0]]} of sample "
            f"{bad[0]} and {bad.size - 1} more of {weights.size}"
        )
    return weights


def far_from_points(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> Bool[np.ndarray, " sample"]:
    """Return which samples are more probable of the prior and exterior parts."""
    wide, near = _log_densities(scores, parts, mixture)
    return wide > near


def _log_densities(
    scores: Float[np.ndarray, "sample dimension"],
    parts: Int[np.ndarray, " sample"],
    mixture: Mixture,
) -> tuple[Float[np.ndarray, " sample"], Float[np.ndarray, " sample"]]:
    """Return ln density over the prior's: of the wide parts, of those at points."""
    counts = np.bincount(parts, minlength=len(mixture.shares))
    with np.errstate(divide="ignore"):
        shares = np.log(counts / parts.size)
    # ln of phi(u - u_k) / phi(u) is u . u_k - |u_k|^2 / 2
    ratios = scores @ mixture.middles.T - 0.5 * np.sum(mixture.middles**2, axis=1)
    ratios = ratios + shares[: len(mixture.middles)]
    beyond = np.full(len(scores), -np.inf)
    if len(mixture.shares) > len(mixture.middles):
        length = np.linalg.norm(scores, axis=1)
        beyond[length > mixture.radius] = shares[-1] - np.log(mixture.outside)
        beyond[np.isnan(length)] = np.nan
    wide = np.logaddexp(ratios[:, 0], beyond)
    if len(mixture.middles) == 1:
        return wide, np.full(len(scores), -np.inf)
    return wide, np.asarray(logsumexp(ratios[:, 1:], axis=1))


def design_points(
    margin: Margin, dimensions: int, *, starts: int = STARTS, seed: int = 0
) -> DesignPoints:
    """Search from random points about the origin until no new point is expected.

    Args:
        margin: Of one sample; differentiable, and finite near the origin.
        dimensions: Number of random variables.
        starts: Fewest searches.
        seed: Of the starts.

    Raises:
        ValueError: No search found the edge of the event.
    """
    found = explored(margin, dimensions, starts=starts, seed=seed)
    if not len(found.points):
        raise ValueError(
            f"margin: expected an edge that {starts} searches from the origin can "
            "reach, found none: the event may not happen at all, or the margin be flat"
        )
    return found


def explored(
    margin: Margin, dimensions: int, *, starts: int = STARTS, seed: int = 0
) -> DesignPoints:
    """Return design points as `design_points` does, none where no search found any."""
    key = jax.random.fold_in(jax.random.key(seed), dimensions)
    inside = float(margin(jnp.zeros(dimensions))) > 0
    found = DesignPoints(np.zeros((0, dimensions)), np.zeros(0), 1, 0, complete=False)
    mirrored = np.zeros((0, dimensions))
    launched = 0
    while True:
        key, own = jax.random.split(key)
        begin = np.array(jax.random.normal(own, (BATCH, dimensions)))
        if launched == 0:
            begin[0] = 1e-3
        begin[: len(mirrored)] = mirrored[:BATCH]
        before = found.points
        found = extended(margin, found, begin, inside=inside)
        launched += BATCH
        new = np.array([p for p in found.points if not near(p, before)])
        mirrored = -new.reshape(-1, dimensions)
        if launched < starts or (found.complete and len(mirrored)):
            continue
        # searches still to come, at the rate at which they have ended at a point
        total = searches_needed(len(found.points)) * launched / max(found.searches, 1)
        if found.complete or not found.searches or total > MOST_STARTS:
            return found


def extended(
    margin: Margin,
    known: DesignPoints,
    begin: Float[np.ndarray, "start dimension"],
    *,
    inside: bool = False,
) -> DesignPoints:
    """Return design points with those that searches from more starts end at.

    Args:
        margin: Of one sample.
        known: Points found before.
        begin: Starts, at most `BATCH`.
        inside: The origin lies in the event.
    """
    filled = np.resize(begin, (BATCH, begin.shape[1]))
    end, off, steps = search(margin, jnp.asarray(filled))
    ends, left_over = np.asarray(end)[: len(begin)], np.asarray(off)[: len(begin)]
    good = (left_over < TOLERANCE) & np.isfinite(left_over)
    ends = ends[good]
    every = np.concatenate([known.points, ends])
    length = np.linalg.norm(every, axis=1)
    least = length.min(initial=np.inf)
    likely = 0.5 * (length**2 - least**2) <= -np.log(LEAST_SHARE)
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
    """Return whether a point is one of others, within `SAME_POINT`."""
    return bool(np.any(np.linalg.norm(others - point, axis=1) < SAME_POINT))


def searches_needed(points: int) -> int:
    """Return the number of searches that must be exceeded (module docstring)."""
    return 2 * points**2 + 3 * points + 2


@partial(jax.jit, static_argnums=0)
def search(
    margin: Margin, begin: Float[Array, "start dimension"]
) -> tuple[Float[Array, "start dimension"], Float[Array, " start"], Array]:
    """Return the ends of searches, their residuals and the number of steps.

    A residual is the larger of the distance to the edge, along the slope, and of the
    last step, a share of the distance from the origin. Steps end when every search has
    converged or no cut of its step lowers its merit.
    """
    cuts = jnp.asarray(CUTS, begin.dtype)

    def target(u):
        value, slope = jax.value_and_grad(margin)(u)
        steep = jnp.sum(slope**2)
        safe = jnp.where(steep > 0, steep, 1.0)
        there = jnp.where(steep > 0, (slope @ u - value) / safe * slope, jnp.nan)
        steep = jnp.sqrt(safe)
        away = jnp.linalg.norm(there - u) / (1.0 + jnp.linalg.norm(u))
        return value, steep, there, jnp.maximum(jnp.abs(value) / steep, away)

    def step(u, value, steep, there, off):
        # above |u| / |slope| the step is one downwards
        size = 2 * jnp.maximum(jnp.linalg.norm(there), jnp.linalg.norm(u)) / steep
        penalty = size + 10.0 / steep

        def merit(v, g):
            return 0.5 * jnp.sum(v**2) + penalty * jnp.abs(g)

        tried = u[None] + cuts[:, None] * (there - u)[None]
        merits = jax.vmap(lambda v: merit(v, margin(v)))(tried)
        merits = jnp.where(jnp.isfinite(merits), merits, jnp.inf)
        at = jnp.argmin(merits)
        better = (merits[at] < merit(u, value)) & ~(off < ENOUGH)
        return jnp.where(better, tried[at], u), better

    def going(state):
        _, _, moved, steps = state
        return jnp.any(moved) & (steps < STEPS)

    def advance(state):
        u, known, _, steps = state
        nearer, moved = jax.vmap(step)(u, *known)
        return nearer, jax.vmap(target)(nearer), moved, steps + 1

    known = jax.vmap(target)(begin)
    state = begin, known, jnp.ones(len(begin), bool), jnp.asarray(0)
    end, known, _, steps = jax.lax.while_loop(going, advance, state)
    return end, known[3], steps
