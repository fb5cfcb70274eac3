r"""Modes and ridges of a posterior, which one interval per number does not show.

Modes: each draw is linked to the most probable of its nearest neighbours, which leads
uphill to a peak. Two peaks are merged if the density on the path between them falls by
less than `VALLEY` below the lower (Chazal, Guibas, Oudot & Skraba 2013, J. ACM 60:41).
With sparse draws the path may miss a crest. So two peaks are also merged if ln-density
falls by no more along the crest (the most probable place in each plane across the line
from one to the other). A curved ridge is one mode, however long.

Ridge: the draws extend much further along some direction than the normal approximation.
Both ends explain the log equally well.
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
"""Smallest fall in ln-density between two modes, a factor of 7. Shallower dents appear
by chance among sparse draws."""
NEIGHBOURS = 12
"""Neighbours to which a draw is linked. A mode with fewer draws than this is not
found."""
# All pairs are compared: 1000 draws take 8 MB. A mode of 1.2 % has `NEIGHBOURS` of
# them.
MAX_DRAWS = 1000
POINTS = 64
"""Planes between two modes: a step of a few tenths of a standard deviation for modes 20
apart."""
CLIMBS = 8
"""Newton steps in each plane. They start from the crest in the previous plane."""
STEEP = 1e-6
"""Smallest curvature across the path, in unit-normal coordinates: along a flat
direction the Newton step stays finite."""
LENGTHS = np.array([0.0, 1.0, 0.25, 0.06, 0.015, 0.004])
"""Trial lengths of a Newton step, of which the best is used. 0 makes it monotonic."""
RIDGE_LENGTH = 3.0
"""Smallest length of a ridge, relative to the normal approximation."""
NORMAL_SPREAD = 2 * NORMAL_Q95
"""Distance of the 5 and 95 % quantiles of a unit normal."""
OUTER = 0.05, 0.15
"""Quantiles at the end of a ridge: the outermost twentieth of the draws, and the tenth
next to it."""
ENDLESS_FALL = 0.3
"""Fall of ln-density from the one to the other (1.3 for a normal) below which a ridge
has no end: the posterior is improper."""


@dataclass(frozen=True)
class Mode:
    """A peak and the draws about it.

    Attributes:
        share: Share of the draws.
        peak: The most probable draw.
        log_density: ln of the density at the peak.
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
    """A direction that the log hardly constrains.

    Attributes:
        longer: Length relative to the normal approximation.
        ends: Median of the draws at either end, one row each.
        endless: True if the density does not fall at an end: it is improper.
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
        density: The posterior in whitened coordinates.
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
        joined = (o for o in kept if _fall_between(density, w[peak], w[o]) < VALLEY)
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
    """Return evenly spaced indices of at most `MAX_DRAWS` draws."""
    return np.linspace(0, count - 1, min(count, MAX_DRAWS)).astype(int)


def _climbed(w, value) -> np.ndarray:
    """Return the index of the peak to which each draw leads."""
    square = np.sum(w**2, axis=1)
    # by one matrix product instead of differences: no array of draws by draws by
    # unknowns
    apart = square[:, None] + square[None, :] - 2 * w @ w.T
    count = min(NEIGHBOURS + 1, len(w))
    near = np.argpartition(apart, count - 1, axis=1)[:, :count]
    above = np.arange(len(w))

    def peak(i):
        # union-find with path halving
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
        # a draw that links two peaks is the saddle between them: their persistence
        # decides
        for j in higher:
            one, other = sorted((peak(i), peak(j)), key=lambda k: rank[k])
            if one != other and value[other] - value[i] < VALLEY:
                above[other] = one
    return np.array([peak(i) for i in range(len(w))])


def _fall_between(density, one, other) -> float:
    """Return the fall of ln-density along the crest between two places.

    It is relative to the lower of the two; inf if the crest does not reach the second.
    """
    start, end = jnp.asarray(one), jnp.asarray(other)
    value = np.asarray(crest(density, start, end))
    ends = np.asarray(densities(density, jnp.stack([start, end])))
    if not value[-1] >= ends[1] - VALLEY:
        return np.inf
    return float(ends.min() - value.min())


@jax.jit
def crest(density, start, end):
    """Return ln-density at the most probable place of each plane across the path."""
    along = end - start
    across = jnp.linalg.qr(along[:, None], mode="complete")[0][:, 1:]
    log_density = density.log_density

    def climb(_, w):
        slope = across.T @ jax.grad(log_density)(w)
        values, vectors = jnp.linalg.eigh(
            across.T @ jax.hessian(log_density)(w) @ across
        )
        # uphill along every axis, also where the density curves upwards
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
    # medians and quantiles: a few draws in a far tail are no ridge
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
    for inward in (along, -along):
        outer, inner = np.quantile(inward, OUTER)
        ends.append(np.median(w[inward <= outer], axis=0))
        next_to_it = (inward > outer) & (inward <= inner)
        falls.append(np.mean(value[next_to_it]) - np.mean(value[inward <= outer]))
    return Ridge(longer, np.array(ends), bool(min(falls) < ENDLESS_FALL))
