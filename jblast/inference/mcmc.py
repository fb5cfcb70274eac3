r"""The posterior by an ensemble of walkers, until its quantiles are precise enough.

Walkers start from weighted draws. emcee moves them in the coordinates of the density,
each step by one of the kinds in `SHARES`; linear numbers are drawn at each place.
Convergence is judged after the first `FIRST_JUDGED` steps, and then each time their
number has grown by `JUDGED_AGAIN`.

The autocorrelation time $\tau = 1 + 2 \sum \rho_t$ is Sokal's, truncated at the first
lag beyond $5 \tau$ (Goodman & Weare 2010, Comm. App. Math. Comp. Sci. 5:65;
Foreman-Mackey et al. 2013, PASP 125:306). Deviations are from the mean of *all*
walkers, not each walker's own as in emcee: a walker that never leaves its mode then
counts as one draw, however long it stays. $\hat R$ is the rank-normalised one (Vehtari
et al. 2021, Bayesian Analysis 16:667) over two halves of the walkers and two halves of
the steps.
"""

import itertools
import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtri

from jblast.errors import InputError
from jblast.inference.density import Density
from jblast.inference.sample import CENTRES_OF_FINAL, Draws, components
from jblast.progress import Level, Task
from jblast.results import Note, warning

SHARES = {"near": 0.7, "jump": 0.1, "stretch": 0.1, "independence": 0.1}
r"""Share of the moves of each kind.

near: $2.38/\sqrt{2 d}$ of the difference of two other walkers (ter Braak 2006, Stat.
Comput. 16:239). jump: the whole difference, which leads from mode to mode. stretch:
towards or away from another walker (Goodman & Weare 2010), for long tails.
independence: to a draw from the mixture about the weighted draws.
"""
WALKERS = 64
"""Fewest walkers. A fit has at least 4 per unknown: half of them move by differences of
the other half, which have to span all unknowns."""
PRECISION = 0.05
"""Largest Monte Carlo error of a quantile [sd]: the width of a 90 % interval is then
precise to 2 %. It takes some 1,800 effective samples of a normal."""
MAX_STEPS = 20_000
"""Enough for autocorrelation times up to 400 steps (`LONG_ENOUGH`). A chain that needs
more is reported, not continued."""
FIRST_JUDGED = 400
"""Steps of the first check. An earlier one could not pass: even an autocorrelation time
of 8 steps needs as many."""
JUDGED_AGAIN = 1.15
"""Factor on the number of steps from one check to the next: no more than 15 % of the
steps are superfluous, and the checks take a constant share of the time."""
REPORTED = 50
"""Steps between reports of progress."""
MAX_DRAWS = 8000
"""Largest number of draws that an answer is read from."""
WINDOW = 5.0
"""Sokal's window in autocorrelation times, the value of emcee: shorter ones are biased,
in longer ones the noise of the tail is summed."""
LONG_ENOUGH = 50.0
"""Autocorrelation times of a chain that make the estimate of one reliable (the advice
of emcee's manual). Shorter chains underestimate it."""
WARM_UP = 5.0
"""Autocorrelation times after the start that are discarded: a start is forgotten to
e^-5."""
ALIKE = 1.01
"""R-hat below which the halves of the chain agree (Vehtari et al. 2021)."""
RANKED = 100_000
"""Draws to which R-hat thins: every check sorts them."""
TAILS = (0.05, 0.95)
"""Bounds of the 90 % intervals that a fit reports."""


@dataclass(frozen=True)
class Convergence:
    """Convergence of an ensemble; one number for each coordinate.

    Attributes:
        steps: Number of steps after the warm-up.
        warm_up: Number of discarded steps.
        tau: Autocorrelation time [steps].
        ess: Effective sample size: independent draws with the same error of the mean.
        r_hat: Rank-normalised R-hat over halves of the walkers and of the steps.
        error: Monte Carlo error of the 5 % or 95 % quantile, the larger, in posterior
            standard deviations.
    """

    steps: int
    warm_up: int
    tau: Float[np.ndarray, " free"]
    ess: Float[np.ndarray, " free"]
    r_hat: Float[np.ndarray, " free"]
    error: Float[np.ndarray, " free"]

    def reached(self, precision: float) -> bool:
        """Return True if the quantiles are precise enough and the chain is reliable."""
        return self.steps >= self.steps_wanted(precision)

    def steps_wanted(self, precision: float) -> float:
        """Return the approximate number of steps after the warm-up for a precision."""
        # the error falls with the root of the steps, R-hat minus 1 with the steps
        by_error = self.steps * np.max(np.square(self.error / precision))
        by_halves = self.steps * np.max((self.r_hat - 1) / (ALIKE - 1))
        by_length = LONG_ENOUGH * np.max(self.tau)
        return float(np.max([by_error, by_halves, by_length]))  # NaN stays NaN


@dataclass(frozen=True)
class Ensemble:
    """Draws of a posterior, and their convergence.

    Attributes:
        names: Names of the numbers.
        u: Draws of the coordinates that were sampled, without the warm-up.
        values: All numbers in their units.
        log_density: ln of the posterior density at each, up to a constant.
        convergence: Autocorrelation times, effective sample sizes, R-hat, error of the
            quantiles, by coordinate.
        acceptance: Share of accepted moves.
        notes: Shortfalls of convergence.
        seconds: Duration.
    """

    names: tuple[str, ...]
    u: Float[np.ndarray, "walker step free"]
    values: Float[np.ndarray, "walker step name"]
    log_density: Float[np.ndarray, "walker step"]
    convergence: Convergence
    acceptance: float
    notes: tuple[Note, ...]
    seconds: float

    @property
    def converged(self) -> bool:
        """True if the requested precision was reached."""
        return not self.notes

    def as_draws(self, before: Draws) -> Draws:
        """Return the steps as draws of equal weight, at most `MAX_DRAWS`.

        Args:
            before: Weighted draws; their modes and laws stay.
        """
        flat = self.log_density.size
        some = np.unique(np.linspace(0, flat - 1, MAX_DRAWS).astype(int))

        def kept(x: np.ndarray) -> np.ndarray:
            return np.swapaxes(x, 0, 1).reshape(flat, *x.shape[2:])[some]

        return replace(
            before,
            u=kept(self.u),
            values=kept(self.values),
            log_density=kept(self.log_density),
            weights=np.full(len(some), 1 / len(some)),
            k_hat=-math.inf,
        )


def ensemble(
    density: Density,
    draws: Draws,
    *,
    seed: int = 0,
    walkers: int = WALKERS,
    precision: float = PRECISION,
    most_steps: int = MAX_STEPS,
) -> Ensemble:
    """Walk through a posterior until its quantiles are precise enough.

    Args:
        density: The density.
        draws: Weighted draws of it, from which the walkers start.
        seed: Seed of all random numbers.
        walkers: Fewest walkers; even.
        precision: Largest Monte Carlo error of the 5 and 95 % quantile of any
            coordinate, in its standard deviations.
        most_steps: Largest number of steps.

    Raises:
        InputError: An argument is out of range.
    """
    size = density.coordinates.size
    if walkers < 2 or walkers % 2:
        raise InputError(f"walkers: expected an even number, got {walkers}")
    if not (precision > 0 and most_steps > 0):
        raise InputError(
            "expected a positive precision and number of steps, got "
            f"{precision} and {most_steps}"
        )
    begun = time.monotonic()
    # at least twice the unknowns; four times lets half of the walkers span them
    walkers = max(walkers, 4 * size)
    report, wanted, check = Task(), float(most_steps), FIRST_JUDGED
    steps: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def judged() -> Convergence:
        return convergence(np.array([u for u, *_ in steps]))

    for state in walk(density, draws, seed=seed, walkers=walkers):
        steps.append(state)
        done = len(steps)
        if done % REPORTED == 0:
            report(Level(f"{done:,} steps", min(1.0, done / wanted), 0.0))
        if done >= most_steps:
            break
        if done == check:
            found = judged()
            if found.reached(precision):
                break
            wanted = min(found.warm_up + found.steps_wanted(precision), most_steps)
            check = int(check * JUDGED_AGAIN)
    found = judged()
    chain, height, values = (np.array(part) for part in zip(*steps, strict=True))
    axes = density.coordinates
    others = [axes.names[other.at] for other in axes.others]
    sampled = [axes.names[i] for pair in axes.places for i in pair] + others
    late = slice(found.warm_up, None)
    return Ensemble(
        names=axes.names,
        u=np.swapaxes(chain[late], 0, 1),
        values=np.swapaxes(values[late], 0, 1),
        log_density=height[late].T,
        convergence=found,
        # a walker that did not move in a step has rejected its proposal
        acceptance=float(np.mean((np.diff(chain, axis=0) != 0).any(axis=2)))
        if len(chain) > 1
        else 0.0,
        notes=tuple(shortfalls(found, sampled, precision)),
        seconds=time.monotonic() - begun,
    )


def walk(
    density: Density, draws: Draws, *, seed: int = 0, walkers: int = WALKERS
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield coordinates, ln of the density and all numbers of the walkers, without end.

    The density of a place is an unbiased estimate, which a walker keeps while it stays
    there: the chain then has the exact density (Andrieu & Roberts 2009, Ann. Statist.
    37:697).

    Args:
        density: Density to sample.
        draws: Weighted draws of it, from which the walkers start.
        seed: Seed of all random numbers.
        walkers: Number of walkers; even.
    """
    # imported here: fits without walkers do without it
    import emcee
    from emcee.moves import DEMove, MHMove, StretchMove

    rng = np.random.default_rng(seed)

    def value(u):
        height, gain, values, _ = density.exact(u, rng)
        return np.concatenate([(height + gain)[:, None], values], axis=1)

    mixture = components(draws.u, draws.weights, rng, CENTRES_OF_FINAL)

    def independent(u, random):
        there = mixture.draw(len(u), rng)
        return there, mixture.log_density(u) - mixture.log_density(there)

    sampler = emcee.EnsembleSampler(
        walkers,
        density.coordinates.size,
        value,
        moves=[
            (DEMove(), SHARES["near"]),
            (DEMove(gamma0=1.0), SHARES["jump"]),
            (StretchMove(), SHARES["stretch"]),
            (MHMove(independent), SHARES["independence"]),
        ],
        vectorize=True,
    )
    start = emcee.State(
        draws.u[draws.resampled(walkers, seed)],
        random_state=np.random.RandomState(seed).get_state(),
    )
    steps = sampler.sample(
        start, iterations=sys.maxsize, store=False, skip_initial_state_check=True
    )
    for now in steps:
        # emcee squeezes the only number of a log
        values = np.reshape(np.array(now.blobs), (walkers, -1))
        yield now.coords.copy(), np.array(now.log_prob), values


def convergence(chain: Float[np.ndarray, "step walker free"]) -> Convergence:
    """Return the convergence of an ensemble.

    Args:
        chain: All steps from the first, in any coordinates.
    """
    steps, walkers, free = chain.shape
    columns = range(free)
    # the warm-up is found from the second half, which has forgotten the start
    late = chain[steps // 2 :]
    slowest = max(autocorrelation_time(late[:, :, i]) for i in columns)
    warm_up = int(min(np.ceil(WARM_UP * min(slowest, steps)), steps // 2))
    kept = chain[warm_up:]
    tau = np.array([autocorrelation_time(kept[:, :, i]) for i in columns])
    return Convergence(
        steps=steps - warm_up,
        warm_up=warm_up,
        tau=tau,
        ess=(steps - warm_up) * walkers / tau,
        r_hat=np.array([r_hat(kept[:, :, i]) for i in columns]),
        error=np.array([_worst_tail(kept[:, :, i]) for i in columns]),
    )


def autocorrelation_time(
    x: Float[np.ndarray, "step walker"] | Bool[np.ndarray, "step walker"],
) -> float:
    """Return the autocorrelation time of an ensemble [steps]; inf if nothing moves."""
    steps = len(x)
    if (x == x[0]).all():
        return np.inf
    away = x - x.mean()
    length = 1 << (2 * steps - 1).bit_length()  # padding: no circular correlation
    # walker by walker: a transform of all at once takes their memory several times
    power = sum(np.square(np.abs(np.fft.rfft(one, length))) for one in away.T)
    covariance = np.fft.irfft(power, length)[:steps] / np.arange(steps, 0, -1)
    tau = 2 * np.cumsum(covariance / covariance[0]) - 1
    beyond = np.flatnonzero(np.arange(steps) >= WINDOW * tau)
    return max(float(tau[beyond[0] if len(beyond) else -1]), 1.0)


def r_hat(x: Float[np.ndarray, "step walker"]) -> float:
    """Return R-hat of ranks over two halves of the walkers and two of the steps."""
    x = x[:: -(-x.size // RANKED)]
    half, pack = len(x) // 2, x.shape[1] // 2
    if half < 2:
        return np.inf
    parts = np.array(
        [
            x[rows, columns].ravel()
            for rows, columns in itertools.product(
                (slice(half), slice(half, 2 * half)),
                (slice(pack), slice(pack, 2 * pack)),
            )
        ]
    )
    # also of the distances from the median: parts with equal means may have unequal
    # spreads (the folded R-hat of Vehtari et al. 2021)
    found = []
    for part in (parts, np.abs(parts - np.median(parts))):
        chains = _normal_scores(part)
        within = np.mean(np.var(chains, axis=1, ddof=1))
        between = np.var(chains.mean(axis=1), ddof=1)
        count = chains.shape[1]
        ratio = (count - 1) / count + between / within if within else np.inf
        found.append(float(np.sqrt(ratio)))
    return max(found)


def _normal_scores(x: np.ndarray) -> np.ndarray:
    """Return the normal scores of the ranks; equal numbers have their mean rank."""
    _, place, count = np.unique(x, return_inverse=True, return_counts=True)
    rank = (np.cumsum(count) - 0.5 * (count - 1))[place].reshape(x.shape)
    # Blom's offsets. By scipy: jax.scipy would compile for every length of a chain.
    return ndtri((rank - 0.375) / (x.size + 0.25))


def _worst_tail(x: Float[np.ndarray, "step walker"]) -> float:
    """Return the Monte Carlo error of the worse outer quantile, in standard deviations.

    The share of draws below a quantile has a standard error. The quantiles one standard
    error to either side differ by twice the error of the quantile (Vehtari et al. 2021,
    section 4.4).
    """
    sd = x.std()
    if not sd > 0:
        return np.inf
    errors = []
    for share in TAILS:
        effective = x.size / autocorrelation_time(x <= np.quantile(x, share))
        step = np.sqrt(share * (1 - share) / effective) if effective else 1.0
        low, high = np.quantile(x, np.clip([share - step, share + step], 0, 1))
        errors.append(0.5 * (high - low) / sd)
    return float(max(errors))


def shortfalls(
    judged: Convergence, names: Sequence[str], precision: float
) -> list[Note]:
    """Return the requirements of convergence that a chain does not meet."""
    notes: list[Note] = []
    worst = int(np.argmax(judged.error))
    named, error = names[worst], float(judged.error[worst])
    if not error <= precision:
        notes.append(
            warning(
                "quantiles_uncertain", parameter=named, error=error, wanted=precision
            )
        )
    worst = int(np.argmax(judged.tau))
    named, times = names[worst], float(judged.steps / judged.tau[worst])
    if not times >= LONG_ENOUGH:
        length = {"steps": judged.steps, "times": times, "wanted": LONG_ENOUGH}
        notes.append(warning("chain_too_short", parameter=named, **length))
    worst = int(np.argmax(judged.r_hat))
    named, r_hat = names[worst], float(judged.r_hat[worst])
    if not r_hat <= ALIKE:
        notes.append(
            warning("chains_disagree", parameter=named, r_hat=r_hat, wanted=ALIKE)
        )
    return notes
