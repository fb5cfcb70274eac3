r"""What rare events are drawn from: a mixture of parts of known density.

The parts are the prior, the prior moved to each design point, and the prior outside the
sphere of radius $\beta$ about the origin (Harbitz 1986, Struct. Saf. 3:109), where all
of an event lies whose nearest point is at the distance $\beta$. The part of a sample is
fixed by its number, so that the parts have their shares of any number of samples. Its
weight is the prior's density over that of all parts together (the balance heuristic:
Veach and Guibas 1995; Owen and Zhou 2000),

$$\frac{1}{w(u)} = \alpha_0 + \frac{\alpha_\beta\,[|u| > \beta]}{P(|u| > \beta)}
    + \sum_k \alpha_k\,\frac{\varphi(u - u_k)}{\varphi(u)}.$$

As one part is the prior itself, with the share $\alpha_0$, no weight is above
$1/\alpha_0$ (a defensive mixture: Hesterberg 1995). An event that no search found is
counted without bias, but few samples meet it.
"""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import gammaincc, gammainccinv, logsumexp, ndtri
from scipy.stats import qmc

DEFENSIVE = 0.1
"""Share of samples that are drawn from the prior itself."""
GOLDEN = 0.6180339887498949
BLOCK = 65_536
"""Samples drawn at once."""


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
