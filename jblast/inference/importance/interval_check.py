r"""By how much the ends of the normal approximation's 90 % intervals are off.

Importance sampling tells (see `importance`), with draws that reach further than the
normal's: half of them are Student-t. Draws of the normal alone, which miss the tails of
Student-t errors, put the ends of one of twelve simulated logs of four microphones off
by 0.6 sd that were off by 0.1. Where few of the draws have all the weight, they are
drawn anew along the ridge that the readings allow (see `rto_proposal`).

The same draws, weighted once for the posterior and once for the normal, give both their
ends: what chance does to one it does to the other.
"""

import itertools
from dataclasses import dataclass
from math import lgamma, nan

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.importance.findings import IntervalsOff
from jblast.inference.importance.marginals import weighted_quantiles
from jblast.inference.importance.psis import HELD, MAX_QUANTILE_ERROR, pareto_smoothed
from jblast.inference.importance.ridge_proposal import rto_proposal
from jblast.inference.importance.whitening import (
    Whitened,
    densities_of_draws,
    root_of,
)
from jblast.inference.mode.laplace import NORMAL_Q95, Laplace
from jblast.inference.posterior.posterior import Posterior

DRAWS = (1000, 4000, 16000)
"""More only where fewer leave it open."""
FEWEST = 200
WORK = 400_000_000
"""Numbers that all draws may need before there are fewer of them: a tenth of what
`posterior="auto"` takes."""
FREEDOM = 3
"""Of the Student-t half: tails heavier than those of one reading."""
RELIABLE = 0.7
"""Weights of a larger k-hat need not settle, however many (Vehtari et al. 2024)."""
SHARED = 0.5
"""Effective draws for each draw: 0.9 for a normal posterior. Where a single weight is
this heavy or heavier there are fewer: then k-hat decides."""
BLOCKS = 8
"""Of draws, whose spread tells how far chance moves an end."""
PRECISE = 0.1
"""Standard deviations to which an end that is off is told."""
SURE = 2.0
"""Standard errors by which an end has to be further off than `MAX_QUANTILE_ERROR`."""


@dataclass(frozen=True)
class Drawn:
    """Weighted draws of a posterior, and what they make of its normal approximation.

    Attributes:
        z: Coordinates.
        weights: What each counts; they add to 1.
        straight: The same draws, of the normal approximation.
        of_normal: What each of those counts for it.
        quantiles: 5, 50 and 95 % of each coordinate: the normal's, moved by what the
            same draws say that the posterior's lie away from it.
    """

    z: Float[np.ndarray, "draw free"]
    weights: Float[np.ndarray, " draw"]
    straight: Float[np.ndarray, "draw free"]
    of_normal: Float[np.ndarray, " draw"]
    quantiles: Float[np.ndarray, "3 free"]


@dataclass(frozen=True)
class IntervalError:
    """The end that is surely off by most.

    Attributes:
        name: Of which number.
        off: By how many of its standard deviations.
        error: Standard error of that.
        k_hat: Shape of the tail of the weights.
        share: Effective draws for each draw.
        settled: Whether more draws would say the same, of every end.
        drawn: The posterior by these draws.
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
        """Whether importance sampling can tell."""
        return self.k_hat <= RELIABLE or self.share >= SHARED

    def finding(self) -> IntervalsOff | None:
        """Return what is wrong with the intervals; None if nothing is."""
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
    """Judge the normal approximation of a proper posterior by its intervals' ends.

    Args:
        posterior: The posterior.
        normal: Its normal approximation, without null directions.
        seed: Of the draws.
    """
    found = _judged(posterior, normal, seed, along=False)
    return found if found.share >= SHARED else _judged(posterior, normal, seed, True)


def _judged(posterior, normal, seed: int, along: bool) -> IntervalError:
    """Draw until it is clear; along the ridge or not."""
    at = jnp.asarray(normal.z)
    misfit = jax.eval_shape(posterior.misfit, at)
    of_one = misfit.loading.size + 8 * misfit.residual.size
    if along:
        of_one *= 1 + normal.z.size
    most = max(WORK // of_one, FEWEST)
    part = min(HELD // of_one + 1, DRAWS[0], most)
    *fewer, last = sorted({min(draws, most) // part for draws in DRAWS})
    for parts in fewer:
        found = _by_draws(posterior, normal, seed, parts, part, along)
        if found.settled or found.share < SHARED:
            return found
    return _by_draws(posterior, normal, seed, last, part, along)


def _by_draws(
    posterior, normal, seed, parts: int, part: int, along: bool
) -> IntervalError:
    """Judge by so many parts of so many draws."""
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
    """Draw from half a normal, half a Student-t.

    Args:
        count: Of draws.
        free: Unknowns.
        rng: Where chance comes from.

    Returns:
        The draws, and ln of the density they are from and of the normal there, both up
        to the same constant.
    """
    w = rng.standard_normal((count, free))
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
    """Return both ends of the 90 % interval of each coordinate, the median between."""
    with np.errstate(invalid="ignore"):  # a block of draws of no weight at all: nan
        return np.array(
            [weighted_quantiles(x, weights, (0.05, 0.5, 0.95)) for x in z.T]
        ).T


def _ends(z, weights):
    """Return both ends alone."""
    return _quantiles(z, weights)[::2]
