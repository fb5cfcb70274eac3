r"""Weighted draws of a posterior, by one method for every log.

1. Stratified draws of the prior (`Coordinates.start`).
2. Climbs from the best of each ring of ranges, after a scan of each flat number. Fewer
   than two climbs at the best mode: as many starts again. Several charges: each by its
   own rows first, then all together from the best three of each.
3. Rounds of draws of a mixture of Student-t components about weighted points, at a
   temperature that leaves `TEMPERED` effective draws, until it is 1.
4. `FINAL` draws of a frozen mixture, so that their weights do not depend on them. Each
   is weighted by the exact likelihood. Where the weights are poor, all is done once
   again with more.
5. Laws are chosen over the prior, and again at the answer, until they stay.

The reliability of the weights is the shape $\hat k$ of the tail of their distribution
(Vehtari, Simpson, Gelman, Yao & Gabry 2024, JMLR 25(72); fit of Zhang & Stephens 2009,
Technometrics 51:316).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from jblast.inference.coordinates import log_student
from jblast.inference.density import Density, Scored

FREEDOM = 5.0
"""Degrees of freedom of a component: tails heavier than those of most posteriors."""
CENTRES, CENTRES_OF_FINAL = 24, 36
"""Components of the mixture of a round, and of the final one."""
SHARES = (0.06, 0.2, 1.0, 0.06, 0.2, 0.5)
"""Share of the weight in the nearest points that give a component its covariance.
Small shares follow a ridge that bends, large ones cover a normal."""
FIRST_ROUND, ROUND = 250, 500
"""Draws of a round while it is tempered, and after."""
TEMPERED = 60.0
"""Effective draws that set the temperature of a round."""
ROUNDS = 14
"""Largest number of rounds."""
RELIABLE = 0.7
"""Largest shape of reliable weights (Vehtari et al. 2024)."""
NEAR = 30.0
"""Fall of ln of the density from the best beyond which a climb is dropped."""
STEPS = 10
"""Steps of a climb."""
SCAN = 12
"""Values of each flat number tried at a start: one may be wrong by 20 e-folds."""
SAME = 4.0
"""Squared distance within which two climbs end at one mode [variances]."""
MODES = 12
"""Largest number of modes in the final mixture."""


class Effort(NamedTuple):
    """How much is done.

    Attributes:
        starts: Climbs.
        wanted: Effective draws at which the rounds end.
        final: Draws of the frozen mixture.
    """

    starts: int
    wanted: float
    final: int


ORDINARY = Effort(starts=30, wanted=300.0, final=1000)
LARGE = Effort(starts=40, wanted=600.0, final=1500)
FEW = 200.0
"""Effective draws below which the larger run follows."""
ROUNDS_OF_LAWS = 3
"""Largest number of times that laws are chosen."""


@dataclass(frozen=True)
class Modes:
    """Distinct modes of a density.

    Attributes:
        u: Their coordinates, the best first.
        root: Cholesky factors of their covariances.
        log_density: ln of the density at each.
        met: Number of climbs that ended at the best.
    """

    u: Float[np.ndarray, "mode free"]
    root: Float[np.ndarray, "mode free free"]
    log_density: Float[np.ndarray, " mode"]
    met: int


@dataclass(frozen=True)
class Draws:
    """Weighted draws of a posterior.

    Attributes:
        u: Coordinates.
        values: All numbers in their units.
        weights: Weight of each draw; the sum is 1.
        log_density: ln of the approximate density.
        k_hat: Shape of the tail of the weights.
        log_evidence: ln of the probability of the log.
        modes: The modes.
        laws: The laws.
        valid: Weighted share of the rows within their laws.
    """

    u: Float[np.ndarray, "draw free"]
    values: Float[np.ndarray, "draw name"]
    weights: Float[np.ndarray, " draw"]
    log_density: Float[np.ndarray, " draw"]
    k_hat: float
    log_evidence: float
    modes: Modes
    laws: Mapping[str, str]
    valid: float

    @property
    def effective(self) -> float:
        """Effective number of draws."""
        return float(1 / np.sum(self.weights**2))

    @property
    def reliable(self) -> bool:
        """True if averages over the draws can be believed."""
        return self.k_hat <= RELIABLE and self.effective >= FEW and self.modes.met > 1


class Mixture(NamedTuple):
    """An equal mixture of Student-t components."""

    mean: Float[np.ndarray, "component free"]
    root: Float[np.ndarray, "component free free"]

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw from it."""
        of = rng.integers(len(self.mean), size=count)
        unit = rng.standard_normal((count, self.mean.shape[1]))
        unit *= np.sqrt(FREEDOM / rng.chisquare(FREEDOM, count))[:, None]
        return self.mean[of] + np.einsum("nij,nj->ni", self.root[of], unit)

    def log_density(self, u: np.ndarray) -> np.ndarray:
        """Return ln of its density."""
        each = [log_student(u, *of, FREEDOM) for of in zip(*self, strict=True)]
        return logsumexp(np.stack(each), axis=0) - math.log(len(self.mean))

    def joined(self, other: "Mixture") -> "Mixture":
        """Return the components of both."""
        return Mixture(
            *(np.concatenate(pair) for pair in zip(self, other, strict=True))
        )


def solve(density: Density, seed: int = 0) -> tuple[Density, Draws]:
    """Return weighted draws, and the density by the laws that were chosen for them."""
    density = density.chosen_over(density.coordinates.start(seed))
    best: tuple[Density, Draws] | None = None
    tried: list[Mapping[str, str]] = []
    while density.laws not in tried and len(tried) < ROUNDS_OF_LAWS:
        tried.append(density.laws)
        found = sample(density, seed, known=best[1] if best else None)
        if not found.reliable:
            found = sample(density, seed + 1, LARGE)
        if best and found.valid < best[1].valid - 0.01:
            break  # the exchanged laws lead to where they are not valid
        best = density, found
        there = density.scene_at(found.values[found.weights.argmax()])
        density = density.with_laws(there, density.laws_at(found.u, found.weights))
    assert best is not None
    return best


def sample(
    density: Density,
    seed: int = 0,
    effort: Effort = ORDINARY,
    known: Draws | None = None,
) -> Draws:
    """Return weighted draws of a density.

    Args:
        density: The density.
        seed: Seed of all random numbers.
        effort: How much is done.
        known: Draws by other laws, from which to begin.
    """
    rng = np.random.default_rng(seed)
    axes = density.coordinates
    u = axes.start(seed)
    started = len(u)
    value = density(u)
    modes = known.modes if known else modes_of(density, u, value, effort.starts)
    about = Mixture(modes.u, modes.root)
    mixture, count, beta = about, FIRST_ROUND, 0.0
    if known:
        mixture = mixture.joined(components(known.u, known.weights, rng))
    proposals: list[tuple[int, Callable]] = [(started, axes.log_start)]
    weights = np.zeros(started)
    for _ in range(ROUNDS):
        new = mixture.draw(count, rng)
        u, value = np.concatenate([u, new]), np.concatenate([value, density(new)])
        proposals.append((count, mixture.log_density))
        log_ratio = value - _balance(proposals, u)
        log_weights, k_hat = pareto_smoothed(log_ratio)
        weights = np.exp(log_weights)
        enough = 1 / np.sum(weights**2) > effort.wanted and k_hat < RELIABLE
        if beta >= 1 and enough:
            break
        beta = temperature(log_ratio)
        tempered = np.exp(beta * log_ratio - logsumexp(beta * log_ratio))
        tempered = np.minimum(tempered, 5 / TEMPERED)
        mixture = components(u, tempered / tempered.sum(), rng)
        count = ROUND if beta >= 1 else FIRST_ROUND
    frozen = components(u, weights, rng, CENTRES_OF_FINAL).joined(about)
    new = frozen.draw(effort.final, rng)
    u = np.concatenate([u[:started], new])
    value = np.concatenate([value[:started], density(new)])
    both = [proposals[0], (effort.final, frozen.log_density)]
    log_ratio = value - _balance(both, u)
    values = axes.values(u)
    some = log_ratio > log_ratio.max() - 15  # the others have no weight
    gain, values[some] = density.exact(u[some], rng)
    log_ratio[some] += gain
    log_weights, k_hat = pareto_smoothed(log_ratio)
    weights = np.exp(log_weights)
    valid = density.seen_with(values).valid.mean(axis=1)
    return Draws(
        u=u,
        values=values,
        weights=weights,
        log_density=value,
        k_hat=k_hat,
        log_evidence=float(logsumexp(log_ratio)) - math.log(len(log_ratio)),
        modes=modes,
        laws=density.laws,
        valid=float(weights @ valid),
    )


def _balance(proposals: list[tuple[int, Callable]], u: np.ndarray) -> np.ndarray:
    """Return ln of the density of all proposals together (Veach's balance)."""
    whole = sum(count for count, _ in proposals)
    parts = [of(u) + math.log(count / whole) for count, of in proposals]
    return logsumexp(np.stack(parts), axis=0)


def temperature(log_ratio: Float[np.ndarray, " draw"]) -> float:
    """Return the power of the weights that leaves `TEMPERED` effective draws, to 1."""

    def effective(beta: float) -> float:
        scaled = beta * log_ratio
        return float(1 / np.sum(np.exp(2 * (scaled - logsumexp(scaled)))))

    if effective(1.0) >= TEMPERED:
        return 1.0
    low, high = 1e-4, 1.0
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if effective(middle) > TEMPERED else (low, middle)
    return low


def components(
    u: Float[np.ndarray, "draw free"],
    weights: Float[np.ndarray, " draw"],
    rng: np.random.Generator,
    count: int = CENTRES,
) -> Mixture:
    """Return components about weighted points, of the points nearest to each."""
    size = u.shape[1]
    away = u - weights @ u
    whole = (away * weights[:, None]).T @ away + 1e-12 * np.eye(size)
    metric = np.linalg.inv(whole)
    places = (np.arange(count) + rng.random()) / count
    centres = np.searchsorted(np.cumsum(weights), places).clip(0, len(u) - 1)
    means, roots = [], []
    for j, centre in enumerate(centres):
        share = SHARES[j % len(SHARES)]
        off = u - u[centre]
        near = np.argsort(np.einsum("ij,jk,ik->i", off, metric, off))
        held = int(np.searchsorted(np.cumsum(weights[near]), share))
        some = near[: max(held + 1, 3 * size)]
        own = weights[some] / weights[some].sum()
        mean = own @ u[some]
        covariance = ((u[some] - mean) * own[:, None]).T @ (u[some] - mean)
        # few points give a poor covariance: the shape of the whole fills it up
        effective = 1 / np.sum(own**2)
        shrink = size / (effective + size)
        scale = max(float(np.trace(covariance @ metric)) / size, 1e-8)
        covariance = (1 - shrink) * covariance + (shrink * scale + 1e-9) * whole
        means.append(mean if share == 1.0 else 0.5 * (u[centre] + mean))
        roots.append(np.linalg.cholesky(1.1 * covariance))
    return Mixture(np.array(means), np.array(roots))


def modes_of(
    density: Density,
    u: Float[np.ndarray, "draw free"],
    value: Float[np.ndarray, " draw"],
    starts: int,
) -> Modes:
    """Return the distinct modes, from the best starts of each ring."""
    axes = density.coordinates

    def best(value, turn: int, place: int = 0) -> np.ndarray:
        ring = axes.ring(u, place)
        rings = np.unique(ring)
        each = max(starts // len(rings), 1)
        return u[
            np.concatenate(
                [
                    (of := np.flatnonzero(ring == one))[np.argsort(-value[of])][
                        turn * each : (turn + 1) * each
                    ]
                    for one in rings
                ]
            )
        ]

    first = _by_charges(density, best, u) if len(axes.places) > 1 else None
    ends, scores = [], []
    met = 0
    for turn in (0, 1):
        if turn == 0 and first is not None:
            end, score = climb(density, first, scan=0)
        else:
            end, score = climb(density, best(value, turn))
        ends.append(end)
        scores.append(score)
        z = np.concatenate(ends)
        height = np.concatenate([one.log_density for one in scores])
        known = np.concatenate([one.information for one in scores])
        top = int(height.argmax())
        off = z - z[top]
        same = np.einsum("ij,jk,ik->i", off, known[top], off) < SAME
        met = int((same & (height > height[top] - 2)).sum())
        if met >= 2:
            break
    kept: list[int] = []
    for i in np.argsort(-height):
        apart = [(z[i] - z[j]) @ known[j] @ (z[i] - z[j]) for j in kept]
        if height[i] > height[top] - NEAR and min(apart, default=math.inf) > SAME:
            kept.append(int(i))
    kept = kept[:MODES]
    root = np.linalg.cholesky(np.linalg.inv(known[kept]))
    return Modes(z[kept], root, height[kept], met)


def _by_charges(density: Density, best, u: np.ndarray) -> np.ndarray:
    """Return starts of several charges: all combinations of the best of each alone."""
    axes = density.coordinates
    whole = None
    for place in range(len(axes.places)):
        alone = density.of_shot(place)
        end, score = climb(alone, best(alone(u), 0, place))
        order = np.argsort(-score.log_density)[:3]
        own = axes.of_charge(place)
        if whole is None:
            whole = end[order[:1]]
        found = np.repeat(whole, len(order), axis=0)
        found[:, own] = np.tile(end[order][:, own], (len(whole), 1))
        whole = found
    assert whole is not None
    return whole


def climb(
    density: Density, z: Float[np.ndarray, "place free"], scan: int = SCAN
) -> tuple[Float[np.ndarray, "end free"], Scored]:
    """Return the ends of Levenberg-Marquardt climbs, all places at once.

    Each flat number is scanned first. Places far below the best are dropped.
    """
    axes = density.coordinates
    first = 2 * len(axes.places)
    for j, other in enumerate(axes.others):
        if other.kind == "score" or not scan:
            continue
        tried = np.repeat(z[:, None], scan + 1, axis=1)
        share = (np.arange(scan) + 0.5) / scan
        tried[:, :scan, first + j] = other.low + (other.high - other.low) * share
        value = density(tried.reshape(-1, axes.size), rounds=1)
        pick = value.reshape(len(z), scan + 1).argmax(1)
        z = tried[np.arange(len(z)), pick]
    here = density.scored(z)
    damping = np.full(len(z), 0.1)
    longest = axes.longest_steps()
    diagonal = np.arange(axes.size)
    for turn in range(STEPS):
        matrix = here.information.copy()
        matrix[:, diagonal, diagonal] *= 1 + damping[:, None]
        step = np.linalg.solve(matrix, here.slope[..., None])[..., 0]
        step /= np.maximum(1, np.abs(step / longest).max(1))[:, None]
        there = density.scored(z + step)
        better = there.log_density > here.log_density
        z = np.where(better[:, None], z + step, z)
        here = here.where(better, there)
        damping = np.where(better, damping / 5, damping * 4)
        if turn >= 3:
            fall = NEAR * (4 if turn < 5 else 1)
            live = here.log_density > here.log_density.max() - fall
            z, damping, here = z[live], damping[live], here.only(live)
    return z, here


def pareto_smoothed(
    log_ratio: Float[np.ndarray, " draw"],
) -> tuple[Float[np.ndarray, " draw"], float]:
    """Return normalised ln weights, the largest smoothed, and the shape k-hat."""
    log_ratio = log_ratio - log_ratio.max()
    count = len(log_ratio)
    tail = int(min(0.2 * count, 3 * math.sqrt(count)))
    order = np.argsort(log_ratio)
    largest = order[-tail:]
    cut = math.exp(log_ratio[order[-tail - 1]])
    excess = np.exp(log_ratio[largest]) - cut
    if tail < 5 or excess[-1] <= 1e-300:
        return log_ratio - logsumexp(log_ratio), -math.inf
    k, sigma = generalised_pareto(np.maximum(excess, 1e-300))
    share = (np.arange(tail) + 0.5) / tail
    smooth = cut + sigma * np.expm1(-k * np.log1p(-share)) / k
    smoothed = log_ratio.copy()
    smoothed[largest] = np.log(np.minimum(smooth, 1.0))
    return smoothed - logsumexp(smoothed), k


def generalised_pareto(x: Float[np.ndarray, " excess"]) -> tuple[float, float]:
    """Return shape and scale of a generalised Pareto distribution of sorted numbers."""
    count = len(x)
    grid = 30 + int(math.sqrt(count))
    quarter = x[int(count / 4 + 0.5) - 1]
    b = 1 / x[-1] + (1 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))) / (3 * quarter)
    k = np.log1p(-b[:, None] * x).mean(1)
    log_profile = count * (np.log(np.maximum(-b / k, 1e-300)) - k - 1)
    mean = float(np.exp(log_profile - logsumexp(log_profile)) @ b)
    shape = float(np.log1p(-mean * x).mean())
    # towards 0.5 with the weight of ten excesses (Vehtari et al. 2024)
    return (shape * count + 5) / (count + 10), -shape / mean
