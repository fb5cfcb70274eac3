r"""What rare events are drawn from: the prior, and the prior moved to where they are.

A sample's part of the mixture is fixed by its number, so that the parts have their
shares of any number of samples, and its weight is the prior's density over that of all
parts together, in the shares there are (the balance heuristic: Veach and Guibas 1995;
Owen and Zhou 2000),

$$w(u) = \frac{\varphi(u)}{\sum_k \alpha_k\,\varphi(u - u_k)}.$$

As one part is the prior itself, with the share $\alpha_0$, no weight is above
$1/\alpha_0$ (a defensive mixture: Hesterberg 1995), and what no search found is still
counted without bias.
"""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp, ndtri
from scipy.stats import qmc

DEFENSIVE = 0.1
"""Share of samples that are drawn from the prior itself."""
GOLDEN = 0.6180339887498949
BLOCK = 65_536
"""Samples drawn at once."""


class Mixture(NamedTuple):
    """Parts that samples are drawn from.

    Attributes:
        middles: Of the parts; the first is the prior, about the origin.
        shares: Of samples that each gets.
    """

    middles: Float[np.ndarray, "part dimension"]
    shares: Float[np.ndarray, " part"]


def mixture_about(
    points: Float[np.ndarray, "point dimension"], defensive: float = DEFENSIVE
) -> Mixture:
    """Return the mixture of the prior and its likes about points.

    Those have shares as their own densities are.

    Raises:
        ValueError: The prior's share is not above 0 and at most 1.
    """
    if not 0 < defensive <= 1:
        raise ValueError(
            f"defensive: expected a share above 0 and at most 1, got {defensive:g}"
        )
    logs = -0.5 * np.sum(points**2, axis=1)
    relative = np.exp(logs - logs.max())
    found = (1 - defensive) * relative / relative.sum()
    middles = np.concatenate([np.zeros((1, points.shape[1])), points])
    return Mixture(middles, np.concatenate([[defensive], found]))


def parts_of(
    index: Int[np.ndarray, " sample"], mixture: Mixture
) -> Int[np.ndarray, " sample"]:
    """Return the part each sample belongs to, evenly spread over their numbers."""
    place = (0.5 + index * GOLDEN) % 1.0
    upto = np.cumsum(mixture.shares)[:-1]
    return np.searchsorted(upto, place, side="right")


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
    counts = np.bincount(parts, minlength=len(mixture.shares))
    with np.errstate(divide="ignore"):
        shares = np.log(counts / parts.size)
    # ln of phi(u - u_k) / phi(u) is u . u_k - |u_k|^2 / 2
    ratios = scores @ mixture.middles.T - 0.5 * np.sum(mixture.middles**2, axis=1)
    weights = np.exp(-np.asarray(logsumexp(ratios + shares, axis=1)))
    bad = np.flatnonzero(~np.isfinite(weights))
    if bad.size:
        raise ValueError(
            f"weights: expected finite ones, got {weights[bad[0]]} of sample "
            f"{bad[0]} and {bad.size - 1} more of {weights.size}"
        )
    return weights
