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

WINDOW = 5.0
LONG_ENOUGH = 50.0
"""So many autocorrelation times make an estimate of one trustworthy."""
WARM_UP = 5.0
"""So many autocorrelation times after the start are left out."""
ALIKE = 1.01
"""R-hat below this: the halves agree."""
WATCHED = 64
"""Walkers whose autocorrelation is averaged: more would cost time and add nothing."""
RANKED = 100_000
TAILS = (0.05, 0.95)


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
    # the same for what lies far from the middle, so that unequal spreads are seen too
    folded = np.abs(parts - np.median(parts))
    return max(_r_hat_of(_normal_scores(part)) for part in (parts, folded))


@dataclass(frozen=True)
class Convergence:
    """Convergence of an ensemble; one number for each coordinate.

    Attributes:
        steps: Steps behind the numbers, after the warm-up.
        warm_up: Steps left out before them.
        tau: Autocorrelation time [steps].
        ess: Effective sample size: independent draws that give as good a mean.
        r_hat: Of ranks, over halves of the walkers and of the steps.
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
        """Whether the quantiles are as precise as wanted, and may be believed."""
        return bool(
            np.all(self.error <= precision)
            and np.all(self.steps >= LONG_ENOUGH * self.tau)
            and np.all(self.r_hat < ALIKE)
        )

    def steps_wanted(self, precision: float) -> float:
        """Return about how many steps after the warm-up the precision takes."""
        by_error = self.steps * np.max(np.square(self.error / precision))
        by_halves = self.steps * np.max((self.r_hat - 1) / (ALIKE - 1))
        return float(max(by_error, by_halves, LONG_ENOUGH * np.max(self.tau)))


def convergence(chain: Float[np.ndarray, "step walker free"]) -> Convergence:
    """Judge an ensemble.

    Args:
        chain: Every step from the first on, in any coordinates.
    """
    steps, walkers, free = chain.shape
    columns = range(free)
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
    length = 1 << (2 * steps - 1).bit_length()  # so that the ends do not meet
    power = np.square(np.abs(np.fft.rfft(away, length, axis=0))).mean(axis=1)
    covariance = np.fft.irfft(power, length)[:steps] / np.arange(steps, 0, -1)
    if not covariance[0] > 0 or (x == x[0]).all():
        return np.inf
    tau = 2 * np.cumsum(covariance / covariance[0]) - 1
    beyond = np.flatnonzero(np.arange(steps) >= WINDOW * tau)
    return max(float(tau[beyond[0] if len(beyond) else -1]), 1.0)


def _normal_scores(x: np.ndarray) -> np.ndarray:
    """Replace numbers by the normal scores of their ranks; equal ones share theirs."""
    _, place, count = np.unique(x, return_inverse=True, return_counts=True)
    rank = (np.cumsum(count) - 0.5 * (count - 1))[place].reshape(x.shape)
    # by scipy: jax.scipy's would be compiled again for every length of a walk
    return ndtri((rank - 0.375) / (x.size + 0.25))


def _r_hat_of(chains: np.ndarray) -> float:
    within = np.mean(np.var(chains, axis=1, ddof=1))
    between = np.var(chains.mean(axis=1), ddof=1)
    count = chains.shape[1]
    return float(np.sqrt((count - 1) / count + between / within)) if within else np.inf


def _worst_tail(x: Float[np.ndarray, "step walker"]) -> float:
    """Return the Monte Carlo error of the worse outer quantile, in standard deviations.

    The share of draws below a quantile is known to a standard error; the quantiles of
    those shares differ by twice the quantile's (Vehtari et al. 2021, section 4.4).
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
        steps: Done so far.
        steps_wanted: About how many it will take in all; NaN until that is known.
        ess: Effective sample size so far, of the worst coordinate; NaN likewise.
        ess_wanted: Likewise at the end.
    """

    steps: int
    steps_wanted: float
    ess: float
    ess_wanted: float

    def words(self) -> str:
        """Return all this in words."""
        if not np.isfinite(self.steps_wanted):
            return f"{self.steps:,} steps"
        return (
            f"{self.steps:,} of about {self.steps_wanted:,.0f} steps, "
            f"{self.ess:,.0f} of {self.ess_wanted:,.0f} effective samples"
        )

    def share(self) -> float:
        """Return how much of the walk is done; zero as long as that is not known."""
        if not np.isfinite(self.steps_wanted):
            return 0.0
        return min(1.0, self.steps / max(self.steps_wanted, 1.0))


Report = Callable[[Progress], None]


def nothing(_: Progress) -> None:
    """Report nothing."""


def to_listener() -> Report:
    """Return a report to whoever listens."""
    tell = Task()
    return lambda progress: tell(Level("", progress.words(), progress.share(), 0.0))


@dataclass
class Pace:
    """Turns steps and judgements into progress.

    Attributes:
        done: Steps so far.
        most: Steps at which it ends whatever is reached.
        walkers: How many walk.
        precision: What is wanted.
        checks: After how many steps it is judged, rising.
        judged: The last judgement.
    """

    done: int
    most: int
    walkers: int
    precision: float
    checks: Sequence[int]
    judged: Convergence | None = None

    def now(self) -> Progress:
        """Return how far it has come."""
        wanted = ess = ess_wanted = np.nan
        if self.judged is not None:
            tau = np.max(self.judged.tau)
            total = self.judged.warm_up + self.judged.steps_wanted(self.precision)
            later = [check for check in self.checks if check >= max(total, self.done)]
            wanted = float(min([self.most, *later]))
            ess = float((self.done - self.judged.warm_up) * self.walkers / tau)
            ess_wanted = float((wanted - self.judged.warm_up) * self.walkers / tau)
        return Progress(self.done, wanted, ess, ess_wanted)
