r"""Convergence of an ensemble of walkers: autocorrelation, R-hat, error of quantiles.

The autocorrelation time $\tau = 1 + 2 \sum \rho_t$ is Sokal's, truncated at the first
lag beyond $5 \tau$ (Goodman & Weare 2010, Comm. App. Math. Comp. Sci. 5:65;
Foreman-Mackey et al. 2013, PASP 125:306). Deviations are from the mean of *all*
walkers, not each walker's own as in emcee: a walker that never leaves its mode then
counts as one draw, however long it stays. $\hat R$ is the rank-normalised one (Vehtari
et al. 2021, Bayesian Analysis 16:667) over two halves of the walkers and two halves of
the steps.

Progress is reported as steps and effective samples, with an estimate of the number
required.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtri

from jblast.progress import Level, Task

# Sokal's window in autocorrelation times, the value of emcee: shorter ones are biased,
# in longer ones the noise of the tail is summed.
WINDOW = 5.0
LONG_ENOUGH = 50.0
"""Autocorrelation times of a chain that make the estimate of one reliable (the advice
of emcee's manual). Shorter chains underestimate it."""
WARM_UP = 5.0
"""Autocorrelation times after the start that are discarded: a start is forgotten to
e^-5."""
ALIKE = 1.01
"""R-hat below which the halves of the chain agree (Vehtari et al. 2021)."""
WATCHED = 64
"""Largest number of walkers whose autocorrelation is averaged: its error falls with the
root of their number, while time and memory grow with it."""
# Every check sorts the draws. Thinning to this number leaves their R-hat nearly the
# same.
RANKED = 100_000
TAILS = (0.05, 0.95)  # bounds of the 90 % intervals that a fit reports


def r_hat(x: Float[np.ndarray, "step walker"]) -> float:
    """Return R-hat of ranks over two halves of the walkers and two of the steps."""
    steps, walkers = x.shape
    stride = -(-steps * walkers // RANKED)
    x = x[::stride]
    half, pack = len(x) // 2, walkers // 2
    if half < 2:
        return np.inf
    parts = np.array(
        [
            x[rows, columns].ravel()
            for rows in (slice(0, half), slice(half, 2 * half))
            for columns in (slice(0, pack), slice(pack, 2 * pack))
        ]
    )
    # also of the distances from the median: parts with equal means may have unequal
    # spreads (the folded R-hat of Vehtari et al. 2021)
    folded = np.abs(parts - np.median(parts))
    found = []
    for part in (parts, folded):
        chains = _normal_scores(part)
        within = np.mean(np.var(chains, axis=1, ddof=1))
        between = np.var(chains.mean(axis=1), ddof=1)
        count = chains.shape[1]
        ratio = (count - 1) / count + between / within if within else np.inf
        found.append(float(np.sqrt(ratio)))
    return max(found)


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
        return bool(
            np.all(self.error <= precision)
            and np.all(self.steps >= LONG_ENOUGH * self.tau)
            and np.all(self.r_hat < ALIKE)
        )

    def steps_wanted(self, precision: float) -> float:
        """Return the approximate number of steps after the warm-up for a precision."""
        # the error falls with the root of the steps, R-hat minus 1 with the steps
        by_error = self.steps * np.max(np.square(self.error / precision))
        by_halves = self.steps * np.max((self.r_hat - 1) / (ALIKE - 1))
        return float(max(by_error, by_halves, LONG_ENOUGH * np.max(self.tau)))


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
    steps, walkers = x.shape
    some = np.linspace(0, walkers - 1, min(walkers, WATCHED)).astype(int)
    away = x[:, some] - x.mean()
    length = 1 << (2 * steps - 1).bit_length()  # padding: no circular correlation
    power = np.square(np.abs(np.fft.rfft(away, length, axis=0))).mean(axis=1)
    covariance = np.fft.irfft(power, length)[:steps] / np.arange(steps, 0, -1)
    if not covariance[0] > 0 or (x == x[0]).all():
        return np.inf
    tau = 2 * np.cumsum(covariance / covariance[0]) - 1
    beyond = np.flatnonzero(np.arange(steps) >= WINDOW * tau)
    return max(float(tau[beyond[0] if len(beyond) else -1]), 1.0)


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


@dataclass(frozen=True)
class Progress:
    """Progress of a sampler.

    Attributes:
        steps: Number of steps so far.
        steps_wanted: Estimated total; NaN before the first check.
        ess: Effective sample size so far, of the worst coordinate; NaN before it.
        ess_wanted: Estimated effective sample size at the end; NaN before it.
    """

    steps: int
    steps_wanted: float
    ess: float
    ess_wanted: float

    def words(self) -> str:
        """Return the progress as text."""
        if not np.isfinite(self.steps_wanted):
            return f"{self.steps:,} steps"
        return (
            f"{self.steps:,} of about {self.steps_wanted:,.0f} steps, "
            f"{self.ess:,.0f} of {self.ess_wanted:,.0f} effective samples"
        )

    def share(self) -> float:
        """Return the completed share of the chain; 0 before the first check."""
        if not np.isfinite(self.steps_wanted):
            return 0.0
        return min(1.0, self.steps / max(self.steps_wanted, 1.0))


Report = Callable[[Progress], None]


def nothing(_: Progress) -> None:
    """Report nothing."""


def to_listener() -> Report:
    """Return a function that reports progress to the listener (`jblast.progress`)."""
    task = Task()
    return lambda progress: task(Level("", progress.words(), progress.share(), 0.0))


@dataclass
class Pace:
    """Estimates progress from steps and convergence.

    Attributes:
        done: Number of steps so far.
        most: Largest number of steps.
        walkers: Number of walkers.
        precision: Requested precision.
        checks: Numbers of steps at which convergence is checked, ascending.
        judged: Result of the last check.
    """

    done: int
    most: int
    walkers: int
    precision: float
    checks: Sequence[int]
    judged: Convergence | None = None

    def now(self) -> Progress:
        """Return the progress."""
        wanted = ess = ess_wanted = np.nan
        if self.judged is not None:
            tau = np.max(self.judged.tau)
            total = self.judged.warm_up + self.judged.steps_wanted(self.precision)
            later = [check for check in self.checks if check >= max(total, self.done)]
            wanted = float(min([self.most, *later]))
            ess = float((self.done - self.judged.warm_up) * self.walkers / tau)
            ess_wanted = float((wanted - self.judged.warm_up) * self.walkers / tau)
        return Progress(self.done, wanted, ess, ess_wanted)
