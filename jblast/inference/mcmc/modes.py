r"""Several modes, or a ridge: the shapes of a posterior that one interval hides.

Modes: each draw is joined to the most probable of its nearest neighbours, which leads
uphill to a peak; two peaks are one where the path between them falls by less than
`VALLEY` below the lower (Chazal, Guibas, Oudot & Skraba 2013, J. ACM 60:41). Where the
draws are sparse the path may miss a crest, so two peaks are also one where going from
one to the other along the crest (the most probable place in each plane across) falls by
no more. A curved ridge stays one mode, however long.

Ridge: the draws reach much further along some direction than the normal approximation
does. What lies at its two ends explains the log alike.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Float

from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.inference.whitening import Density, densities

VALLEY = 2.0
"""Two modes: ln-density falls by at least this between them."""
NEIGHBOURS = 12
"""Draws a draw is joined to; a mode of fewer than these among all is not seen."""
LOOKED_AT = 1000
POINTS = 64
"""Places on the way from mode to mode."""
CLIMBS = 8
"""Newton steps at each of them."""
STEEP = 1e-6
"""Curvature across below this is taken for this."""
LENGTHS = np.array([0.0, 1.0, 0.25, 0.06, 0.015, 0.004])
"""Of a Newton step: the best is taken."""
RIDGE_LENGTH = 3.0
"""Length of a ridge in units of the normal approximation."""
NORMAL_SPREAD = 2 * NORMAL_Q95
"""From the 5 % to the 95 % quantile of a unit normal."""
OUTER = 0.05, 0.15
"""The outer twentieth of the draws at an end, and the tenth next to it."""
FLAT = 0.3
"""ln-density that falls by less than this from the one to the other (a normal's falls
by 1.3) has no end: the posterior is improper."""


@dataclass(frozen=True)
class Mode:
    """A peak and the draws about it.

    Attributes:
        share: Of the draws.
        peak: The most probable draw.
        log_density: There.
        low: 5 % quantiles of its draws.
        high: 95 % quantiles of its draws.
    """

    share: float
    peak: Float[np.ndarray, " free"]
    log_density: float
    low: Float[np.ndarray, " free"]
    high: Float[np.ndarray, " free"]


@dataclass(frozen=True)
class Ridge:
    """A direction that the log constrains little.

    Attributes:
        longer: How many times as long as the normal approximation.
        ends: The middle of the draws at either end, a row each.
        endless: Whether the density no longer falls at an end: it is improper there.
    """

    longer: float
    ends: Float[np.ndarray, "2 free"]
    endless: bool


def modes(
    density: Density,
    draws: Float[np.ndarray, "draw free"],
    log_density: Float[np.ndarray, " draw"],
    axes: Float[np.ndarray, "free free"],
) -> tuple[Mode, ...]:
    """Find the modes of a posterior, that of most draws first.

    Args:
        density: The posterior in coordinates in which distances mean something.
        draws: Draws from it.
        log_density: ln of the density at each.
        axes: $A$: the modes are returned as $A w$.
    """
    some = _some(len(draws))
    w, value = draws[some], log_density[some]
    peak_of = _climbed(w, value)
    peaks = sorted(set(peak_of.tolist()), key=lambda i: -value[i])
    kept: list[int] = []
    for peak in peaks:
        joined = (o for o in kept if _valley(density, w[peak], w[o]) < VALLEY)
        into = next(joined, None)
        if into is None:
            kept.append(peak)
        else:
            peak_of[peak_of == peak] = into
    found = []
    for peak in kept:
        of = w[peak_of == peak]
        low, high = np.quantile(of @ axes.T, [0.05, 0.95], axis=0)
        top = axes @ w[peak]
        found.append(Mode(len(of) / len(w), top, float(value[peak]), low, high))
    return tuple(sorted(found, key=lambda mode: -mode.share))


def _some(count: int) -> np.ndarray:
    """Pick draws spread evenly over all."""
    return np.linspace(0, count - 1, min(count, LOOKED_AT)).astype(int)


def _climbed(w, value) -> np.ndarray:
    """Return the peak each draw leads to, by the shallowest path."""
    square = np.sum(w**2, axis=1)
    apart = square[:, None] + square[None, :] - 2 * w @ w.T
    count = min(NEIGHBOURS + 1, len(w))
    near = np.argpartition(apart, count - 1, axis=1)[:, :count]
    above = np.arange(len(w))

    def peak(i):
        while above[i] != i:
            above[i] = above[above[i]]
            i = above[i]
        return i

    order = np.argsort(-value, kind="stable")
    rank = np.empty(len(w), int)
    rank[order] = np.arange(len(w))
    for i in order:
        higher = near[i][rank[near[i]] < rank[i]]
        if not len(higher):
            continue
        above[i] = higher[np.argmin(rank[higher])]
        for j in higher:
            one, other = sorted((peak(i), peak(j)), key=lambda k: rank[k])
            if one != other and value[other] - value[i] < VALLEY:
                above[other] = one
    return np.array([peak(i) for i in range(len(w))])


def _valley(density, one, other) -> float:
    """Return how far ln-density falls along the crest from one place to another.

    It counts from the lower of the two; inf where the crest leads elsewhere.
    """
    start, end = jnp.asarray(one), jnp.asarray(other)
    value = np.asarray(crest(density, start, end))
    ends = np.asarray(densities(density, jnp.stack([start, end])))
    if not value[-1] >= ends[1] - VALLEY:
        return np.inf
    return float(ends.min() - value.min())


@jax.jit
def crest(density, start, end):
    """Return ln-density at the most probable place of each plane across the way."""
    along = end - start
    across = jnp.linalg.qr(along[:, None], mode="complete")[0][:, 1:]
    log_density = density.log_density

    def climb(_, w):
        slope = across.T @ jax.grad(log_density)(w)
        values, vectors = jnp.linalg.eigh(
            across.T @ jax.hessian(log_density)(w) @ across
        )
        step = vectors @ (vectors.T @ slope / jnp.maximum(jnp.abs(values), STEEP))
        places = w[None, :] + LENGTHS[:, None] * (across @ step)[None, :]
        return places[jnp.argmax(densities(density, places))]

    def go(w, _):
        w = w + along / POINTS
        w = lax.fori_loop(0, CLIMBS, climb, w) if len(start) > 1 else w
        return w, log_density(w)

    return lax.scan(go, start, length=POINTS)[1]


def ridge(
    draws: Float[np.ndarray, "draw free"], log_density: Float[np.ndarray, " draw"]
) -> Ridge | None:
    """Find a ridge among draws whose normal approximation is a unit normal."""
    some = _some(len(draws))
    w, value = draws[some], log_density[some]
    middle = np.median(w, axis=0)
    _, _, axes = np.linalg.svd(w - middle, full_matrices=False)
    along = (w - middle) @ axes[0]
    low, high = np.quantile(along, [0.05, 0.95])
    longer = float((high - low) / NORMAL_SPREAD)
    if longer < RIDGE_LENGTH:
        return None
    ends, falls = [], []
    for way in (along, -along):
        outer, inner = np.quantile(way, OUTER)
        ends.append(np.median(w[way <= outer], axis=0))
        next_to_it = (way > outer) & (way <= inner)
        falls.append(np.mean(value[next_to_it]) - np.mean(value[way <= outer]))
    return Ridge(longer, np.array(ends), bool(min(falls) < FLAT))
