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

A long log is searched by some of its rows, spread over quantities, charges and clocks:
the modes of all rows lie near those of the subset, and climbs by all rows begin there.

The reliability of the weights is the shape $\hat k$ of the tail of their distribution
(Vehtari, Simpson, Gelman, Yao & Gabry 2024, JMLR 25(72); fit of Zhang & Stephens 2009,
Technometrics 51:316).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.errors import InputError
from jblast.inference.coordinates import log_student
from jblast.inference.density import NOWHERE, Density, Scored
from jblast.inference.likelihood import log_sum

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
STEPS, GAIN = 40, 1e-3
"""Largest number of steps of a climb, and the gain in ln of the density of its last."""
MOST_DAMPING = 100.0
"""Damping of a climb beyond which a step is a hundredth of a Newton step."""
SCAN = 12
"""Values of each flat number tried at a start: one may be wrong by 20 e-folds."""
SAME = 4.0
"""Squared distance within which two climbs end at one mode [variances]."""
SMOOTH_REACH = 3.0
"""Standard deviations beyond which the exact gain of a long log is constant."""
BEARINGS_OF_ROUND = 8
"""Bearings in which each draw is repeated if no row depends on it."""
WEIGHTLESS = 15.0
"""Fall of ln of a weight from the largest beyond which a draw is dropped."""
POLISHES, POLISH_STEP = 3, 0.1
"""Newton steps to the top of each mode, and the differences of its slope [sd]."""
MODES = 12
"""Largest number of modes in the final mixture."""


class Effort(NamedTuple):
    """Number of climbs and draws.

    Attributes:
        starts: Climbs.
        wanted: Effective draws at which the rounds end.
        final: Draws of the frozen mixture.
    """

    starts: int
    wanted: float
    final: int


ORDINARY = Effort(starts=30, wanted=300.0, final=2000)
LARGE = Effort(starts=40, wanted=600.0, final=3000)
FEW = 200.0
"""Effective draws below which the larger run follows."""
SEARCHED = 200
"""Rows with which a long log is searched: it has more than five times as many."""
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
    def enough(self) -> bool:
        """True if there are enough effective draws for quantiles."""
        return self.effective >= FEW

    @property
    def reliable(self) -> bool:
        """True if averages over the draws can be believed."""
        return self.k_hat <= RELIABLE and self.enough and self.modes.met > 1

    def resampled(
        self,
        count: int,
        seed: int = 0,
        *,
        among: Bool[np.ndarray, " draw"] | None = None,
    ) -> Int[np.ndarray, " sample"]:
        """Return indices of draws of equal weight, systematically resampled.

        Args:
            count: Number of indices.
            seed: Seed of their offset and order.
            among: Draws that may be taken; by default all.
        """
        rng = np.random.default_rng(seed)
        summed = np.cumsum(self.weights if among is None else self.weights * among)
        at = (np.arange(count) + rng.random()) / count * summed[-1]
        found = np.searchsorted(summed, at)
        return rng.permutation(found.clip(0, len(self.u) - 1))


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
        return log_sum(np.stack(each), axis=0) - math.log(len(self.mean))

    def joined(self, other: "Mixture") -> "Mixture":
        """Return the components of both."""
        return Mixture(
            *(np.concatenate(pair) for pair in zip(self, other, strict=True))
        )


def solve(density: Density, seed: int = 0) -> tuple[Density, Draws]:
    """Return weighted draws, and the density by the laws that were chosen for them."""
    few, begin = density.of_few(SEARCHED), None
    if few is density:
        density = density.with_laws_of(
            density.chosen_over(density.coordinates.start(seed))
        )
    else:
        few, of_few = solve(few, seed)
        density = density.with_laws_of(few)
        ends = np.stack([few.best(u) for u in of_few.modes.u])
        begin = density.coordinates.of_values(ends), of_few.modes.met
    best: tuple[Density, Draws] | None = None
    tried: list[Mapping[str, str]] = []
    while density.laws not in tried and len(tried) < ROUNDS_OF_LAWS:
        tried.append(density.laws)
        known = best[1] if best else None
        found = sample(density, seed, begin=begin, known=known)
        if not found.reliable:
            found = sample(density, seed + 1, LARGE, begin)
        if best and found.valid < best[1].valid - 0.01:
            break  # the exchanged laws lead to where they are not valid
        best = density, found
        density = density.with_laws(density.laws_at(found.u, found.weights))
    assert best is not None
    return best


def sample(
    density: Density,
    seed: int = 0,
    effort: Effort = ORDINARY,
    begin: tuple[Float[np.ndarray, "mode free"], int] | None = None,
    known: Draws | None = None,
) -> Draws:
    """Return weighted draws of a density.

    Args:
        density: The density.
        seed: Seed of all random numbers.
        effort: How much is done.
        begin: Modes by some of the rows, and `Modes.met`; by default they are searched.
        known: Draws by other laws, from which to begin.
    """
    rng = np.random.default_rng(seed)
    axes = density.coordinates
    if not axes.size:
        return _of_linear(density, effort.final, rng)
    u = axes.start(seed)[: 0 if begin else None]
    started = len(u)
    value = density(u) if started else np.zeros(0)
    nearby = (known.modes.u, known.modes.met) if known else begin
    if nearby:
        ends, score = climb(density, nearby[0], scan=0)
        modes = _distinct(density, ends, score, nearby[1])
    else:
        modes = modes_of(density, u, value, effort.starts)
    refuse_without_density(density, modes)
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
        tempered = np.exp(beta * log_ratio - log_sum(beta * log_ratio))
        # no draw counts as more than five of these: one alone has no covariance
        tempered = np.minimum(tempered, 5 / TEMPERED)
        mixture = components(u, tempered / tempered.sum(), rng)
        count = ROUND if beta >= 1 else FIRST_ROUND
    frozen = components(u, weights, rng, CENTRES_OF_FINAL).joined(about)
    count = effort.final if density.has_few_rows else effort.final // 2
    return _weighed(density, frozen, modes, count, rng, (u[:started], value[:started]))


def refuse_without_density(density: Density, modes: Modes) -> None:
    """Reject a log to which no place gives a probability.

    Raises:
        InputError: The density is zero or NaN everywhere; the message names the rows.
    """
    if modes.log_density.max() > 0.1 * NOWHERE:
        return
    log = density.observations
    seen, rows = density.seen(density.coordinates.start(0)), density.rows
    with np.errstate(invalid="ignore"):
        missed = rows.measured - seen.predicted + rows.sigma + seen.record_sd
    wrong = np.flatnonzero(~np.isfinite(missed).any(axis=0))
    where = [log.where(int(row)) for row in wrong]
    more = f" and {len(where) - 5} more" if len(where) > 5 else ""
    raise InputError(
        f"{log.source or 'observations'}: no value of "
        f"{', '.join(density.coordinates.names)} gives the log a probability; "
        "expected readings, sigmas and a scene that one charge could explain"
        + (f", got NaN for {', '.join(where[:5])}{more}" if where else "")
    )


def _weighed(
    density: Density,
    frozen: Mixture,
    modes: Modes,
    count: int,
    rng: np.random.Generator,
    start: tuple[np.ndarray, np.ndarray],
) -> Draws:
    """Return draws of a frozen mixture and of the start, by the exact likelihood.

    Args:
        density: The density.
        frozen: The mixture.
        modes: Modes of the density.
        count: Number of draws of the mixture.
        rng: Random numbers.
        start: Draws of the start, and ln of the density there.
    """
    axes, started = density.coordinates, len(start[0])
    new = frozen.draw(count, rng)
    u = np.concatenate([start[0], new])
    value = np.concatenate([start[1], density(new)])
    both = [(started, axes.log_start), (count, frozen.log_density)]
    log_ratio = value - _balance(both, u)
    some = log_ratio > log_ratio.max() - WEIGHTLESS
    u, value, log_ratio = u[some], value[some], log_ratio[some]
    _, gain, values, valid = density.exact(u, rng)
    if not density.has_few_rows:
        # by chance the mean of few scales varies the more, the more rows there are
        gain = smoothed(u, gain, np.exp(log_ratio - log_sum(log_ratio)))
    log_ratio = log_ratio + gain
    log_weights, k_hat = pareto_smoothed(log_ratio)
    weights = np.exp(log_weights)
    if density.is_round:  # each draw is as probable in any bearing
        u, values = (np.repeat(x, BEARINGS_OF_ROUND, axis=0) for x in (u, values))
        value, valid = (np.repeat(x, BEARINGS_OF_ROUND) for x in (value, valid))
        weights = np.repeat(weights, BEARINGS_OF_ROUND) / BEARINGS_OF_ROUND
        angle = rng.uniform(0, 2 * math.pi, len(u))
        length = np.hypot(u[:, 0], u[:, 1])
        u[:, :2] = length[:, None] * np.stack([np.sin(angle), np.cos(angle)], 1)
        values[:, list(axes.places[0])] = axes.at_place(u)[2]
    return Draws(
        u=u,
        values=values,
        weights=weights,
        log_density=value,
        k_hat=k_hat,
        log_evidence=float(log_sum(log_ratio)) - math.log(started + count),
        modes=modes,
        laws=density.laws,
        valid=float(weights @ valid),
    )


def smoothed(
    u: Float[np.ndarray, "draw free"],
    x: Float[np.ndarray, " draw"],
    weights: Float[np.ndarray, " draw"],
) -> Float[np.ndarray, " draw"]:
    """Return a quadratic in the coordinates through noisy values, by least squares.

    Beyond the values of most weight it is constant.
    """
    middle = weights @ u
    away = (u - middle) / np.sqrt(weights @ (u - middle) ** 2 + 1e-300)
    away = np.clip(away, -SMOOTH_REACH, SMOOTH_REACH)
    first, second = np.triu_indices(u.shape[1])
    terms = np.concatenate(
        [np.ones((len(u), 1)), away, away[:, first] * away[:, second]], axis=1
    )
    root = np.sqrt(weights)[:, None]
    found = np.linalg.lstsq(root * terms, root[:, 0] * x, rcond=1e-10)[0]
    return terms @ found


def _of_linear(density: Density, count: int, rng: np.random.Generator) -> Draws:
    """Return draws of a density all of whose numbers are linear."""
    u = np.zeros((count, 0))
    height, gain, values, valid = density.exact(u, rng)
    modes = Modes(u[:1], np.zeros((1, 0, 0)), height[:1], met=2)
    refuse_without_density(density, modes)
    log_weights, k_hat = pareto_smoothed(gain)
    weights = np.exp(log_weights)
    return Draws(
        u=u,
        values=values,
        weights=weights,
        log_density=height,
        k_hat=k_hat,
        log_evidence=float(height[0] + log_sum(gain)) - math.log(count),
        modes=modes,
        laws=density.laws,
        valid=float(valid.mean()),
    )


def _balance(proposals: list[tuple[int, Callable]], u: np.ndarray) -> np.ndarray:
    """Return ln of the density of all proposals together (Veach's balance)."""
    whole = sum(count for count, _ in proposals)
    parts = [of(u) + math.log(count / whole) for count, of in proposals if count]
    return log_sum(np.stack(parts), axis=0)


def temperature(log_ratio: Float[np.ndarray, " draw"]) -> float:
    """Return the power of the weights that leaves `TEMPERED` effective draws, to 1."""

    def effective(beta: float) -> float:
        scaled = beta * log_ratio
        return float(1 / np.sum(np.exp(2 * (scaled - log_sum(scaled)))))

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
    score = Scored(height, np.concatenate([one.slope for one in scores]), known)
    return _distinct(density, z, score, met)


def _distinct(
    density: Density, z: Float[np.ndarray, "end free"], score: Scored, met: int
) -> Modes:
    """Return the distinct ends of climbs, each at the top of the density."""
    height, known = score.log_density, score.information
    kept: list[int] = []
    for i in np.argsort(-height):
        apart = [(z[i] - z[j]) @ known[j] @ (z[i] - z[j]) for j in kept]
        if height[i] > height.max() - NEAR and min(apart, default=math.inf) > SAME:
            kept.append(int(i))
    kept = kept[:MODES]
    z, height, known = z[kept], height[kept], known[kept]
    # the slope of the whole density, its covariances included, by differences
    size = z.shape[1]
    step = POLISH_STEP / np.sqrt(np.diagonal(known, axis1=1, axis2=2))
    for _ in range(POLISHES):
        moved = step[:, None] * np.concatenate([np.eye(size), -np.eye(size)])
        ends = density((z[:, None] + moved).reshape(-1, size)).reshape(len(z), 2, size)
        slope = (ends[:, 0] - ends[:, 1]) / (2 * step)
        there = z + np.linalg.solve(known, slope[..., None])[..., 0]
        better = (top := density(there)) > height
        z = np.where(better[:, None], there, z)
        height = np.where(better, top, height)
    order = np.argsort(-height)
    # of the inverse of L L' the transposed inverse of L is a root too
    root = np.swapaxes(np.linalg.inv(np.linalg.cholesky(known[order])), 1, 2)
    return Modes(z[order], root, height[order], met)


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
    axes, z = density.coordinates, z.copy()
    first = 2 * len(axes.places)
    for j, other in enumerate(axes.others):
        if other.kind == "score" or not scan:
            continue
        tried = np.repeat(z[:, None], scan + 1, axis=1)
        share = (np.arange(scan) + 0.5) / scan
        tried[:, :scan, first + j] = other.low + (other.high - other.low) * share
        value = density(tried.reshape(-1, axes.size), rounds=1)
        value = value.reshape(len(z), scan + 1)
        place = np.arange(len(z))
        best = tried[place, value.argmax(1)]
        # another mode in this number alone: the best of its other peaks
        inner = value[:, :scan]
        beside = np.pad(inner, ((0, 0), (1, 1)), constant_values=-np.inf)
        is_peak = (inner > beside[:, :-2]) & (inner >= beside[:, 2:])
        is_peak[place, inner.argmax(1)] = False
        beside = np.where(is_peak, inner, -np.inf)
        some = beside.max(1) > value.max() - NEAR
        z = np.concatenate([best, tried[place, beside.argmax(1)][some]])
    here = density.scored(z)
    damping = np.full(len(z), 0.1)
    longest = axes.longest_steps()
    diagonal = np.arange(axes.size)
    going = np.ones(len(z), bool)
    for turn in range(STEPS):
        at = np.flatnonzero(going)
        matrix = here.information[at]
        matrix[:, diagonal, diagonal] *= 1 + damping[at, None]
        step = np.linalg.solve(matrix, here.slope[at, :, None])[..., 0]
        step /= np.maximum(1, np.abs(step / longest).max(1))[:, None]
        there = density.scored(z[at] + step)
        gain = there.log_density - here.log_density[at]
        better = gain > 0
        z[at[better]] += step[better]
        here = here.replaced(at[better], there.only(better))
        damping[at] = np.where(better, damping[at] / 5, damping[at] * 4)
        # a step that fails with much damping is rounding
        ended = np.where(better, gain < GAIN, damping[at] > MOST_DAMPING)
        top = here.log_density.max()
        # a climb from afar gains most in its first steps
        fall = NEAR if turn >= 5 else 4 * NEAR if turn >= 3 else math.inf
        going[at] = ~ended & (here.log_density[at] > top - fall)
        if not going.any():
            break
    kept = here.log_density > here.log_density.max() - NEAR
    return z[kept], here.only(kept)


def pareto_smoothed(
    log_ratio: Float[np.ndarray, " draw"],
) -> tuple[Float[np.ndarray, " draw"], float]:
    """Return normalised ln weights, the largest smoothed, and the shape k-hat.

    Weights that end at a bound may look heavy from farther down, if many are close to
    it. The quarter of the tail then has a negative shape, and is taken instead.
    """
    log_ratio = log_ratio - log_ratio.max()
    count = len(log_ratio)
    whole = int(min(0.2 * count, 3 * math.sqrt(count)))
    order = np.argsort(log_ratio)
    fits = []
    for tail in (whole, whole // 4):
        cut = math.exp(log_ratio[order[-tail - 1]])
        excess = np.exp(log_ratio[order[-tail:]]) - cut
        if tail >= 5 and excess[-1] > 1e-300:
            fits.append((*generalised_pareto(np.maximum(excess, 1e-300)), cut, tail))
    if not fits:
        return log_ratio - log_sum(log_ratio), -math.inf
    k, sigma, cut, tail = fits[-1] if fits[-1][0] < 0 else fits[0]
    share = (np.arange(tail) + 0.5) / tail
    with np.errstate(over="ignore"):  # 1 is the largest anyway
        smooth = cut + sigma * np.expm1(-k * np.log1p(-share)) / k
    smoothed = log_ratio.copy()
    smoothed[order[-tail:]] = np.log(np.minimum(smooth, 1.0))
    return smoothed - log_sum(smoothed), k


def generalised_pareto(x: Float[np.ndarray, " excess"]) -> tuple[float, float]:
    """Return shape and scale of a generalised Pareto distribution of sorted numbers."""
    count = len(x)
    grid = 30 + int(math.sqrt(count))
    quarter = x[int(count / 4 + 0.5) - 1]
    b = 1 / x[-1] + (1 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))) / (3 * quarter)
    k = np.log1p(-b[:, None] * x).mean(1)
    log_profile = count * (np.log(np.maximum(-b / k, 1e-300)) - k - 1)
    mean = float(np.exp(log_profile - log_sum(log_profile)) @ b)
    shape = float(np.log1p(-mean * x).mean())
    # towards 0.5 with the weight of ten excesses (Vehtari et al. 2024)
    return (shape * count + 5) / (count + 10), -shape / mean
