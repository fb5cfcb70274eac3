r"""Importance sampling: checks of the normal approximation, and weighted draws.

Draws from the normal approximation are weighted by posterior over normal. The largest
weights are smoothed by a generalised Pareto distribution, whose shape $\hat k$ measures
how reliable the weights are (Vehtari, Simpson, Gelman, Yao & Gabry 2024, JMLR 25(72);
the fit is that of Zhang & Stephens 2009, Technometrics 51:316). Weighted quantiles are
the marginal intervals of each number.

The bounds of the normal approximation's 90 % intervals are checked with draws that
extend further: half of them are Student-t. Draws of the normal alone miss the tails of
Student-t errors: for one of twelve simulated logs of four microphones they gave an
error of 0.6 sd for bounds that were off by 0.1 sd. The same draws are weighted once for
the posterior and once for the normal, so the Monte Carlo error largely cancels in the
difference of the bounds. Where few draws have all the weight, new ones are made along
the ridge that the readings allow (see `whitening.rto_proposal`).
"""

import itertools
import math
from dataclasses import dataclass
from math import lgamma, nan

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.mode.laplace import NORMAL_Q95, Laplace
from jblast.inference.posterior.parameters import Estimate, Finding, Parameters
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.whitening import (
    Whitened,
    densities,
    densities_of_draws,
    root_of,
    rto_proposal,
)
from jblast.scene import parameter_named

# k-hat is estimated from a tail of 190 draws: its standard error is about 0.1, against
# limits that are 0.2 apart.
DRAWS = 4000
MIN_DRAWS = 500
"""Draws for a long log: k-hat is then estimated from a tail of 67."""
MEMORY_NUMBERS = 40_000_000
"""Largest number of values (8 bytes each) for the densities of one block of draws."""
WORK = 4_000_000_000
"""Largest number of values that all draws may need; longer logs get fewer draws."""
GOOD_SHAPE = 0.5
"""k-hat below which the weights have a finite variance (Vehtari et al. 2024): the
normal is close enough to the posterior to replace it."""
NARROW = 0.1
"""Standard deviation in ln below which laws are nearly linear over the posterior: a
power law curves by its square, 1 %."""
MAX_QUANTILE_ERROR = 0.3
"""Largest accepted error of the bounds of 90 % intervals, in standard deviations. Of
327 simulated logs that passed, 89 % of the intervals contained the truth. Of 394 logs
judged by the other two limits alone it was 86 %
(`calibration/scenes/pressure.toml`)."""
INTERVAL_DRAWS = (1000, 4000, 16000)
"""Numbers of draws in turn, until the verdict on every bound is clear."""
# The 5 % quantile then rests on ten draws: its Monte Carlo error is at most some 0.15
# sd, half of `MAX_QUANTILE_ERROR`.
MIN_INTERVAL_DRAWS = 200
INTERVAL_WORK = 400_000_000
"""Largest number of values that the draws of this check may need: a tenth of `WORK`,
because every fit runs it."""
FREEDOM = 3
"""Degrees of freedom of the Student-t half of the draws. The tails are heavier than
those of one reading (4), so the weights are bounded."""
RELIABLE = 0.7
"""Largest k-hat of reliable weights. Above it averages may not converge with any
practical number of draws (Vehtari et al. 2024)."""
SHARED = 0.5
"""Effective draws per draw above which weights are reliable whatever k-hat is. A normal
posterior has 0.9."""
BLOCKS = 8
"""Blocks of draws, whose spread estimates the Monte Carlo error of a bound to a quarter
of itself: 1 / sqrt(2 * 7)."""
PRECISE = 0.1
"""Monte Carlo error to which a bound that is off is estimated [sd]."""
SURE = 2.0
"""Standard errors by which the error of a bound must exceed `MAX_QUANTILE_ERROR`: 2.3 %
of bounds exactly at the limit do so by chance."""


@dataclass(frozen=True)
class Importance:
    """Weighted draws of a posterior.

    Attributes:
        z: Draws from the normal approximation.
        weights: Weight of each draw, the largest smoothed; the sum is 1.
        k_hat: Shape of the tail of the weights.
        ess: Effective sample size.
    """

    z: Float[np.ndarray, "draw free"]
    weights: Float[np.ndarray, " draw"]
    k_hat: float
    ess: float


def importance(
    posterior: Posterior, normal: Laplace, *, seed: int = 0, draws: int = DRAWS
) -> Importance:
    """Weight draws from the normal approximation so that they follow the posterior.

    The posterior must be proper. Along null directions, which the normal approximation
    does not have, nothing is drawn.
    """
    root = root_of(normal)
    of_one = _numbers_of_a_draw(posterior, normal)
    draws = min(draws, max(WORK // of_one, MIN_DRAWS))
    w = np.random.default_rng(seed).standard_normal((draws, normal.z.size))
    density = Whitened(posterior, jnp.asarray(normal.z), jnp.asarray(root))
    # blocks that fit into memory
    parts = np.array_split(w, -(-draws * of_one // MEMORY_NUMBERS))
    value = np.concatenate(
        [np.asarray(densities(density, jnp.asarray(part))) for part in parts]
    )
    log_ratio = value + 0.5 * np.sum(w**2, axis=1)
    log_weights, k_hat = pareto_smoothed(log_ratio)
    weights = np.exp(log_weights)
    return Importance(
        z=normal.z + w @ root.T,
        weights=weights,
        k_hat=k_hat,
        ess=float(1 / np.sum(weights**2)),
    )


def _numbers_of_a_draw(posterior: Posterior, normal: Laplace) -> int:
    """Return the approximate number of values in memory for the density of a draw."""
    # evaluated, not traced for its shape: this program is compiled already
    misfit = posterior.misfit(jnp.asarray(normal.z))
    return misfit.loading.size + 8 * misfit.residual.size


def laplace_holds(k_hat: float, log_sd: float, off: float) -> bool:
    """Return True if the normal approximation may replace the posterior.

    Args:
        k_hat: Shape of the tail of the importance weights.
        log_sd: Largest sd in ln of any number (see `largest_log_sd`).
        off: Largest error of its intervals (see `largest_quantile_error`).
    """
    return k_hat < GOOD_SHAPE and log_sd < NARROW and off < MAX_QUANTILE_ERROR


def largest_quantile_error(found: Importance, normal: Laplace) -> float:
    """Return the largest error of a bound of a 90 % interval, in standard deviations.

    It is the difference between the normal approximation and its weighted draws.
    """
    sd = np.sqrt(np.diag(normal.covariance))
    ends = [weighted_quantiles(z, found.weights, (0.05, 0.95)) for z in found.z.T]
    off = (np.array(ends).T - normal.z) / sd - np.array([[-NORMAL_Q95], [NORMAL_Q95]])
    return float(np.max(np.abs(off)))


def largest_log_sd(posterior: Posterior, normal: Laplace) -> float:
    """Return the largest relative standard deviation of any number.

    For a coordinate of the charge it is the sd over the nearest range. Numbers that are
    neither positive nor coordinates, like clock offsets, are not considered.
    """
    parameters = posterior.parameters
    sds = np.sqrt(np.diag(normal.covariance))
    values = parameters.values(jnp.asarray(normal.z))
    slopes = parameters.values_of_each(
        jnp.asarray(normal.z + np.array([[-0.5], [0.5]]) * sds)
    )
    # laws curve most at the nearest sensor
    nearest = float(np.min(posterior.misfit(jnp.asarray(normal.z)).slant_range))
    largest = 0.0
    for name in parameters.names:
        moved = float(np.abs(np.diff(np.asarray(slopes[name]))[0]))
        if parameter_named(name).positive:
            largest = max(largest, moved / max(abs(float(values[name])), 1e-300))
        elif name.startswith(("charge_east", "charge_north", "charge_up")):
            largest = max(largest, moved / max(nearest, 1e-300))
    return largest


def pareto_smoothed(
    log_ratio: Float[np.ndarray, " draw"],
) -> tuple[Float[np.ndarray, " draw"], float]:
    """Smooth the largest importance ratios.

    Returns:
        ln of the weights, which add to 1, and k-hat: 0 if all ratios are equal, inf if
        too few draws have any weight.
    """
    count = len(log_ratio)
    # tail length by Vehtari et al. (2024), section 3
    tail = int(np.ceil(min(0.2 * count, 3 * np.sqrt(count))))
    top = np.max(log_ratio)
    if not np.isfinite(top) or tail < 5:
        return np.full(count, -np.log(count)), np.inf
    log_weights = np.where(np.isfinite(log_ratio), log_ratio - top, -np.inf)
    order = np.argsort(log_weights)[count - tail :]
    # exp(-700) is close to the smallest double, exp(-708): lower excesses would be zero
    cut = max(log_weights[np.argsort(log_weights)[count - tail - 1]], -700.0)
    order = order[log_weights[order] > cut]
    if len(order) < 5:  # all ratios are equal, or one has all the weight
        flat = np.ptp(log_weights) < 1e-10
        return _normalised(log_weights), 0.0 if flat else np.inf
    excess = np.exp(log_weights[order]) - np.exp(cut)
    k_hat, scale = generalised_pareto(excess)
    if np.isfinite(k_hat):
        shares = (np.arange(len(order)) + 0.5) / len(order)
        smooth = np.expm1(-k_hat * np.log1p(-shares)) * scale / k_hat + np.exp(cut)
        log_weights[order] = np.log(smooth)
        # a smoothed weight may not exceed the largest raw one (Vehtari et al. 2024)
        log_weights = np.minimum(log_weights, 0.0)
    return _normalised(log_weights), float(k_hat)


def _normalised(log_weights):
    return log_weights - np.logaddexp.reduce(log_weights)


def generalised_pareto(x: Float[np.ndarray, " excess"]) -> tuple[float, float]:
    """Fit a generalised Pareto distribution to positive numbers in ascending order.

    Returns:
        Shape, with a prior of 0.5 that counts as ten observations, and scale.
    """
    # Zhang & Stephens (2009): the profile likelihood in theta = -k / sigma, averaged
    # over a grid of theta whose spacing follows its prior. No search is needed.
    count = len(x)
    grid = 30 + int(np.sqrt(count))
    quartile = x[int(count / 4 + 0.5) - 1]
    steps = np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))
    theta = (1 - steps) / (3 * quartile) + 1 / x[-1]
    shape = np.mean(np.log1p(-theta[:, None] * x[None, :]), axis=1)
    profile = count * (np.log(-theta / shape) - shape - 1)
    weight = np.exp(profile - np.logaddexp.reduce(profile))
    mean = float(np.sum(theta * weight))
    k = float(np.mean(np.log1p(-mean * x)))
    return (k * count + 5) / (count + 10), -k / mean


@dataclass(frozen=True)
class Drawn:
    """Weighted draws of a posterior, and the same draws for its normal approximation.

    Attributes:
        z: Coordinates.
        weights: Weight of each draw for the posterior; the sum is 1.
        straight: The same draws for the normal approximation.
        of_normal: Weight of each of these for the normal approximation.
        quantiles: 5, 50 and 95 % quantiles of each coordinate: those of the normal plus
            the difference between posterior and normal by the same draws.
    """

    z: Float[np.ndarray, "draw free"]
    weights: Float[np.ndarray, " draw"]
    straight: Float[np.ndarray, "draw free"]
    of_normal: Float[np.ndarray, " draw"]
    quantiles: Float[np.ndarray, "3 free"]


@dataclass(frozen=True)
class IntervalsOff(Finding):
    """The 90 % intervals of the normal approximation are wrong or could not be checked.

    Attributes:
        parameter: Number with the largest significant error of a bound.
        off: That error in standard deviations; NaN if no error is significant.
        k_hat: Shape of the weights' tail if importance sampling fails, else NaN.
    """

    parameter: str
    off: float
    k_hat: float


@dataclass(frozen=True)
class IntervalError:
    """The largest significant error of a bound of a 90 % interval.

    Attributes:
        name: Name of the number.
        off: Error of the bound in standard deviations of the number.
        error: Standard error of `off`.
        k_hat: Shape of the tail of the weights.
        share: Effective draws per draw.
        settled: True if more draws would not change the verdict on any bound.
        drawn: The weighted draws.
    """

    name: str
    off: float
    error: float
    k_hat: float
    share: float
    settled: bool = False
    drawn: Drawn | None = None

    @property
    def believed(self) -> bool:
        """True if the weights are reliable."""
        return self.k_hat <= RELIABLE or self.share >= SHARED

    def finding(self) -> IntervalsOff | None:
        """Return the finding about the intervals; None if they are accurate."""
        surely = self.off - SURE * self.error > MAX_QUANTILE_ERROR
        if self.believed and not surely:
            return None
        return IntervalsOff(
            parameter=self.name,
            off=self.off if surely else nan,
            k_hat=nan if self.believed else self.k_hat,
        )


def check_intervals(
    posterior: Posterior, normal: Laplace, *, seed: int = 0
) -> IntervalError:
    """Check the interval bounds of the normal approximation of a proper posterior.

    Args:
        posterior: The posterior.
        normal: Its normal approximation, without null directions.
        seed: Seed of the draws.
    """
    found = _judged(posterior, normal, seed, along=False)
    return found if found.share >= SHARED else _judged(posterior, normal, seed, True)


def _judged(posterior, normal, seed: int, along: bool) -> IntervalError:
    """Draw until the verdict is clear; `along` the ridge or not."""
    of_one = _numbers_of_a_draw(posterior, normal)
    if along:  # each Newton step differentiates by every coordinate
        of_one *= 1 + normal.z.size
    most = max(INTERVAL_WORK // of_one, MIN_INTERVAL_DRAWS)
    part = min(MEMORY_NUMBERS // of_one + 1, INTERVAL_DRAWS[0], most)
    *fewer, last = sorted({min(draws, most) // part for draws in INTERVAL_DRAWS})
    for parts in fewer:
        found = _by_draws(posterior, normal, seed, parts, part, along)
        if found.settled or found.share < SHARED:
            return found
    return _by_draws(posterior, normal, seed, last, part, along)


def _by_draws(
    posterior, normal, seed, parts: int, part: int, along: bool
) -> IntervalError:
    """Check by `parts` times `part` draws."""
    root = root_of(normal)
    w, log_drawn, log_normal = reaching(
        parts * part, normal.z.size, np.random.default_rng(seed)
    )
    straight = normal.z + w @ root.T
    center, axes = jnp.asarray(normal.z), jnp.asarray(root)
    if along:
        placed = [
            rto_proposal(posterior, center, axes, jnp.asarray(x))
            for x in np.split(w, parts)
        ]
        z = np.concatenate([np.asarray(p.z) for p in placed])
        value = np.concatenate([np.asarray(p.log_ratio) for p in placed])
    else:
        density = Whitened(posterior, center, axes)
        z = straight
        value = np.concatenate(
            [densities_of_draws(density, x) for x in np.split(w, parts)]
        )
    log_weights, k_hat = pareto_smoothed(value - log_drawn)
    weights, of_normal = np.exp(log_weights), np.exp(log_normal - log_drawn)
    sd = np.sqrt(np.diag(normal.covariance))

    def off(draws: slice):
        # the difference by the same draws: most of the Monte Carlo error cancels
        of_posterior = _ends(z[draws], weights[draws])
        return (of_posterior - _ends(straight[draws], of_normal[draws])) / sd

    away = _quantiles(z, weights) - _quantiles(straight, of_normal)
    at = np.array([-NORMAL_Q95, 0.0, NORMAL_Q95])[:, None]
    drawn = Drawn(z, weights, straight, of_normal, normal.z + at * sd + away)
    edges = np.linspace(0, len(w), BLOCKS + 1).astype(int)
    blocks = [off(slice(*block)) for block in itertools.pairwise(edges)]
    error = np.std(blocks, axis=0, ddof=1) / np.sqrt(BLOCKS)
    by = np.abs(off(slice(None)))
    worst = np.unravel_index(np.argmax(by - SURE * error), by.shape)
    quiet = np.all(by + SURE * error < MAX_QUANTILE_ERROR)
    loud = (
        by[worst] - 2 * SURE * error[worst] > MAX_QUANTILE_ERROR
        and error[worst] < PRECISE
    )
    return IntervalError(
        name=posterior.parameters.names[worst[1]],
        off=float(by[worst]),
        error=float(error[worst]),
        k_hat=k_hat,
        share=float(np.isfinite(k_hat) / np.sum(weights**2)) / len(weights),
        settled=bool((quiet or loud) and k_hat <= RELIABLE),
        drawn=drawn,
    )


def reaching(count: int, free: int, rng: np.random.Generator):
    """Draw from an equal mixture of a normal and a Student-t distribution.

    Args:
        count: Number of draws.
        free: Number of unknowns.
        rng: Random generator.

    Returns:
        The draws, ln of the density of the mixture, and ln of that of the normal, both
        up to the same constant.
    """
    w = rng.standard_normal((count, free))
    # alternately, not at random: every block has the same share of each
    w[::2] *= np.sqrt(FREEDOM / rng.chisquare(FREEDOM, len(w[::2])))[:, None]
    square = np.sum(w**2, axis=1)
    half = 0.5 * (FREEDOM + free)
    log_student = (
        lgamma(half)
        - lgamma(0.5 * FREEDOM)
        - 0.5 * free * np.log(0.5 * FREEDOM)
        - half * np.log1p(square / FREEDOM)
    )
    return w, np.logaddexp(-0.5 * square, log_student), -0.5 * square


def _quantiles(z, weights):
    """Return the 5, 50 and 95 % quantiles of each coordinate."""
    with np.errstate(invalid="ignore"):  # a block without any weight gives NaN
        return np.array(
            [weighted_quantiles(x, weights, (0.05, 0.5, 0.95)) for x in z.T]
        ).T


def _ends(z, weights):
    """Return the bounds of the 90 % interval of each coordinate."""
    return _quantiles(z, weights)[::2]


def marginals_of_draws(
    parameters: Parameters,
    z: Float[np.ndarray, "draw free"],
    weights: Float[np.ndarray, " draw"] | None = None,
    quantiles: Float[np.ndarray, "3 free"] | None = None,
) -> dict[str, Estimate]:
    """Return the marginal estimate of each number; its value is the median.

    Args:
        parameters: Fitted parameters.
        z: Draws of the coordinates.
        weights: Weight of each draw; equal weights without them.
        quantiles: 5, 50 and 95 % quantiles of each coordinate, if known more precisely.
    """
    if weights is None:
        weights = np.full(len(z), 1 / len(z))
    values = parameters.values_of_each(jax.device_put(z))
    known = (
        None
        if quantiles is None
        else parameters.values_of_each(jax.device_put(quantiles))
    )
    answer = {}
    for name in parameters.names:
        value = np.asarray(values[name])
        q05, q50, q95 = (
            weighted_quantiles(value, weights, (0.05, 0.5, 0.95))
            if known is None
            else map(float, np.asarray(known[name]))
        )
        answer[name] = Estimate(
            value=q50,
            sd=_sd(value, weights),
            log_sd=_log_sd(value, weights)
            if parameter_named(name).positive
            else math.nan,
            q05=q05,
            q50=q50,
            q95=q95,
        )
    return answer


def weighted_quantiles(
    x: Float[np.ndarray, " draw"],
    weights: Float[np.ndarray, " draw"],
    shares: tuple[float, ...],
) -> tuple[float, ...]:
    """Return quantiles of weighted draws; for equal weights those of `numpy.quantile`.

    Each draw is placed at the middle of its weight. The scale is stretched so that the
    smallest draw is at 0 and the largest at 1.
    """
    order = np.argsort(x)
    w = weights[order]
    middle = np.cumsum(w) - 0.5 * w
    at = (middle - middle[0]) / (middle[-1] - middle[0]) if len(x) > 1 else middle
    return tuple(float(q) for q in np.interp(shares, at, x[order]))


def _sd(x, weights) -> float:
    weights = weights / np.sum(weights)
    with np.errstate(over="ignore", invalid="ignore"):  # e.g. a mass nothing bounds
        return float(np.sqrt(weights @ np.square(x - weights @ x)))


def _log_sd(x, weights) -> float:
    """Standard deviation of ln, without draws where a normal prior is negative."""
    positive = x > 0
    return _sd(np.log(x[positive]), weights[positive])


@dataclass(frozen=True)
class ImportanceCannotTell(Finding):
    """The weights of importance sampling are unreliable.

    Attributes:
        k_hat: Shape of their tail.
    """

    k_hat: float


@dataclass(frozen=True)
class FewEffectiveDraws(Finding):
    """The effective sample size of importance sampling is small.

    Attributes:
        effective: Effective sample size.
        wanted: Smallest effective sample size for intervals.
    """

    effective: float
    wanted: int


@dataclass(frozen=True)
class NormalIntervals(Finding):
    """The 90 % intervals are those of a normal approximation: too few effective draws.

    Attributes:
        because: Effective sample size of importance sampling.
    """

    because: FewEffectiveDraws


@dataclass(frozen=True)
class RangeFollowed(Finding):
    """Intervals are of draws that follow the range of a charge beside a small array.

    Attributes:
        ranges: Ranges at which the posterior was integrated over all other numbers.
    """

    ranges: int


@dataclass(frozen=True)
class DrawsWeighted(Finding):
    """Draws of the normal approximation were weighted by the posterior.

    Attributes:
        k_hat: Shape of the weights' tail.
        effective: Effective sample size.
    """

    k_hat: float
    effective: float


@dataclass(frozen=True)
class NormalJudged(Finding):
    """The normal approximation was checked; walkers run if it fails.

    Attributes:
        holds: True if the approximation passed.
        k_hat: Shape of the weights' tail.
        log_sd: Largest standard deviation of any ln.
        off: Largest error of an interval bound, in standard deviations.
        most_k_hat: Limit of `k_hat`.
        most_log_sd: Limit of `log_sd`.
        most_off: Limit of `off`.
    """

    holds: bool
    k_hat: float
    log_sd: float
    off: float
    most_k_hat: float
    most_log_sd: float
    most_off: float
