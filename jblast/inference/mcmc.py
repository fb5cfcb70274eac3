r"""The posterior by an ensemble of walkers, until its quantiles are precise enough.

Walkers start from the normal approximation at every optimum of enough weight. emcee
moves them in whitened coordinates, each step by one of the kinds in `SHARES`.
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
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp, ndtri

from jblast.errors import InputError
from jblast.inference.identifiability import Identifiability
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.search import SEPARATE, Optima
from jblast.inference.posterior.parameters import Finding
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.whitening import (
    Density,
    Whitened,
    densities,
    non_finite_rows,
    root_of,
    whitened_density,
)
from jblast.progress import Level, Task

SHARES = {"near": 0.7, "jump": 0.1, "stretch": 0.1, "independence": 0.1}
r"""Share of the moves of each kind.

near: $2.38/\sqrt{2 d}$ of the difference of two other walkers (ter Braak 2006, Stat.
Comput. 16:239). jump: the whole difference, which leads from mode to mode. stretch:
towards or away from another walker (Goodman & Weare 2010), for long tails.
independence: to a draw from the normals about the known optima, wherever the walker is.
Five microphones, four unknowns, 64 walkers: the autocorrelation time is 11 steps,
without the independence move 17, with the stretch move alone 59. For a charge beside a
line of microphones and its mirror image it is 36, without the independence move some
460.
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
UNLIKELY = 1e-3
"""Smallest share of the posterior of an optimum, relative to the best, for walkers: a
smaller one hardly moves a 90 % interval."""
TRIES = 40
"""Halvings of the distance from the optimum of a walker whose density is zero: 0.5^40
is 1e-12, so that it starts at the optimum itself."""
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


class Start(NamedTuple):
    """A normal from which a share of the walkers starts, and of the independence moves.

    Attributes:
        center: Mean.
        root: One standard deviation along each axis, one column each.
        share: Share of the walkers.
    """

    center: Float[np.ndarray, " free"]
    root: Float[np.ndarray, "free free"]
    share: float


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
        names: Names of the coordinates.
        z: Draws in the fitted coordinates, without the warm-up.
        log_density: ln of the posterior density at each, up to a constant.
        convergence: Autocorrelation times, effective sample sizes, R-hat, error of the
            quantiles.
        acceptance: Share of accepted moves.
        findings: Shortfalls of convergence.
        seconds: Duration.
    """

    names: tuple[str, ...]
    z: Float[np.ndarray, "walker step free"]
    log_density: Float[np.ndarray, "walker step"]
    convergence: Convergence
    acceptance: float
    findings: tuple[Finding, ...]
    seconds: float

    @property
    def converged(self) -> bool:
        """True if the requested precision was reached."""
        return not self.findings

    def draws(self, most: int | None = None) -> Float[np.ndarray, "draw free"]:
        """Return all draws as one array, or at most `most`, evenly spaced."""
        flat = self.z.transpose(1, 0, 2).reshape(-1, len(self.names))
        if most is None or most >= len(flat):
            return flat
        return flat[np.linspace(0, len(flat) - 1, most).astype(int)]


def ensemble(
    posterior: Posterior,
    normal: Laplace,
    identifiability: Identifiability,
    optima: Optima | None = None,
    *,
    seed: int = 0,
    walkers: int = WALKERS,
    precision: float = PRECISION,
    most_steps: int = MAX_STEPS,
    rows: Sequence[str] = (),
) -> Ensemble:
    """Draw from a posterior until its quantiles are precise enough.

    Args:
        posterior: The posterior.
        normal: Its normal approximation.
        identifiability: Null directions of the log.
        optima: Optima of the search. Walkers start at those of enough weight; without
            optima all start from the normal approximation.
        seed: Seed of all random numbers.
        walkers: Number of walkers; even, and at least twice the unknowns.
        precision: Largest Monte Carlo error of the 5 and 95 % quantile of any
            coordinate, in its standard deviations.
        most_steps: Largest number of steps.
        rows: Name of each row of the log in messages.

    Raises:
        InputError: The posterior is improper or not finite at its optimum, or an
            argument is out of range.
    """
    if walkers < 2 * normal.z.size or walkers % 2:
        raise InputError(
            f"walkers: expected an even number, at least twice the {normal.z.size} "
            f"unknowns, got {walkers}"
        )
    if not (precision > 0 and most_steps > 0):
        raise InputError(
            "expected a positive precision and number of steps, got "
            f"{precision} and {most_steps}"
        )
    begun = time.monotonic()
    density = whitened_density(posterior, normal, identifiability)
    _refuse_non_finite(posterior, normal.z, rows)
    # in whitened coordinates the optimum is the origin
    starts = [Start(np.zeros(normal.z.size), np.eye(normal.z.size), 1.0)]
    if optima is not None:
        starts += _others(density, normal, identifiability, optima)
    axes = np.asarray(density.root)
    report, wanted, check = Task(), float(most_steps), FIRST_JUDGED
    steps: list[tuple[np.ndarray, np.ndarray]] = []

    def judged() -> Convergence:
        return convergence(np.array([w for w, _ in steps]) @ axes.T)

    for state in walk(density, starts, seed=seed, walkers=walkers):
        steps.append(state)
        done = len(steps)
        if done % REPORTED == 0:
            report(Level("", f"{done:,} steps", min(1.0, done / wanted), 0.0))
        if done >= most_steps:
            break
        if done == check:
            found = judged()
            if found.reached(precision):
                break
            wanted = min(found.warm_up + found.steps_wanted(precision), most_steps)
            check = int(check * JUDGED_AGAIN)
    found = judged()
    chain = np.array([w for w, _ in steps])
    names = posterior.parameters.names
    return Ensemble(
        names=names,
        z=(normal.z + chain[found.warm_up :] @ axes.T).transpose(1, 0, 2),
        log_density=np.array([value for _, value in steps[found.warm_up :]]).T,
        convergence=found,
        # a walker that did not move in a step has rejected its proposal
        acceptance=float(np.mean((np.diff(chain, axis=0) != 0).any(axis=2)))
        if len(chain) > 1
        else 0.0,
        findings=tuple(shortfalls(found, names, precision)),
        seconds=time.monotonic() - begun,
    )


def walk(
    density: Density, starts: Sequence[Start], *, seed: int = 0, walkers: int = WALKERS
) -> Iterator[tuple[Float[np.ndarray, "walker free"], Float[np.ndarray, " walker"]]]:
    """Yield the places of the walkers and ln of the densities there, without end.

    Args:
        density: Density to sample.
        starts: Normals from which the walkers start.
        seed: Seed of all random numbers.
        walkers: Number of walkers; even.
    """
    # imported here: fits without walkers do without it
    import emcee
    from emcee.moves import DEMove, MHMove, StretchMove

    def value(w):
        # most moves are of half of the walkers: one program serves all
        halves = np.split(w, len(w) // (walkers // 2))
        return np.concatenate(
            [np.asarray(densities(density, jnp.asarray(half))) for half in halves]
        )

    sampler = emcee.EnsembleSampler(
        walkers,
        len(starts[0].center),
        value,
        moves=[
            (DEMove(), SHARES["near"]),
            (DEMove(gamma0=1.0), SHARES["jump"]),
            (StretchMove(), SHARES["stretch"]),
            (MHMove(independence_move(starts)), SHARES["independence"]),
        ],
        vectorize=True,
    )
    start = emcee.State(
        first_places(value, starts, seed, walkers),
        random_state=np.random.RandomState(seed).get_state(),
    )
    steps = sampler.sample(
        start, iterations=sys.maxsize, store=False, skip_initial_state_check=True
    )
    for now in steps:
        yield now.coords.copy(), np.array(now.log_prob)


def independence_move(starts: Sequence[Start]):
    r"""Return a move from any place $w$ to a draw $w'$ of the mixture of starts.

    It returns $w'$ and $\ln q(w) - \ln q(w')$, which is added to ln of the ratio of
    densities (Hastings 1970, Biometrika 57:97).
    """
    center, root, share = map(np.array, zip(*starts, strict=True))
    share = share / share.sum()
    inverse = np.linalg.inv(root)
    log_height = np.log(share) - np.linalg.slogdet(root)[1]

    def log_mixture(w) -> np.ndarray:
        u = np.einsum("kij,nkj->nki", inverse, w[:, None] - center)
        return np.asarray(logsumexp(log_height - 0.5 * np.sum(u**2, axis=2), axis=1))

    def move(w, random):
        of = random.choice(len(share), size=len(w), p=share)
        unit = random.standard_normal(w.shape)
        there = center[of] + np.einsum("nij,nj->ni", root[of], unit)
        return there, log_mixture(w) - log_mixture(there)

    return move


def first_places(
    value, starts: Sequence[Start], seed: int, walkers: int
) -> Float[np.ndarray, "walker free"]:
    """Draw the starting points of the walkers, each with a finite density."""
    shares = np.cumsum([start.share for start in starts])
    # systematic sampling: each start gets its share of the walkers, rounded
    of = np.searchsorted(shares / shares[-1], (np.arange(walkers) + 0.5) / walkers)
    center = np.array([start.center for start in starts])[of]
    root = np.array([start.root for start in starts])[of]
    unit = np.random.default_rng(seed).standard_normal(center.shape)
    away = np.einsum("nij,nj->ni", root, unit)
    for _ in range(TRIES):
        finite = np.isfinite(value(center + away))
        if finite.all():
            return center + away
        away = np.where(finite[:, None], away, 0.5 * away)
    raise InputError(
        "the posterior density is zero or NaN at the optimum from which the walkers "
        "start; expected a finite density"
    )


def _refuse_non_finite(posterior: Posterior, z, rows: Sequence[str]) -> None:
    """Reject a posterior that is not finite at the optimum, and name the rows."""
    if np.isfinite(float(posterior.log_density(jnp.asarray(z)))):
        return
    wrong = non_finite_rows(posterior, z)
    layout = posterior.layout
    named = [
        rows[row] if row < len(rows) else f"row {row + 1} ({layout.quantity[row]})"
        for row in wrong
    ]
    at = posterior.parameters.values(jnp.asarray(z))
    raise InputError(
        "the posterior density is not finite where the walkers start ("
        + ", ".join(f"{name} {float(value):.4g}" for name, value in at.items())
        + "): expected finite predictions and errors, got NaN for "
        + (", ".join(named) or "the priors")
    )


def _others(density: Whitened, normal, identifiability, optima: Optima) -> list[Start]:
    """Return starts at the other optima that contain a share of the posterior.

    The share of each is its density times its volume, relative to the best.
    """
    root = np.asarray(density.root)
    kept = [(normal.z, root)]
    starts = []
    best = float(density.posterior.log_density(jnp.asarray(normal.z)))
    for z, value in zip(*map(np.asarray, optima), strict=True):
        if not np.isfinite(value):
            continue
        if any(np.linalg.norm(np.linalg.solve(r, z - y)) < SEPARATE for y, r in kept):
            continue
        other = laplace(density.posterior, z, identifiability.identified_basis)
        if not other.converged:
            continue
        there = root_of(other)
        away = np.linalg.solve(root, np.column_stack([z - normal.z, there]))
        _, volume = np.linalg.slogdet(away[:, 1:])
        # clipped to the range of doubles: an optimum may have a far larger volume
        share = float(np.exp(np.clip(value - best + volume, -700, 700)))
        kept.append((z, there))
        if share > UNLIKELY:
            starts.append(Start(away[:, 0], away[:, 1:], share))
    return starts


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


@dataclass(frozen=True)
class QuantilesUncertain(Finding):
    """Quantiles are less precise than requested.

    Attributes:
        parameter: Parameter with the least precise quantiles.
        error: Their Monte Carlo error, in standard deviations of the parameter.
        wanted: Requested precision.
    """

    parameter: str
    error: float
    wanted: float


@dataclass(frozen=True)
class ChainTooShort(Finding):
    """The chain is short compared with its autocorrelation time.

    Attributes:
        parameter: Parameter with the longest autocorrelation time.
        steps: Length of the chain.
        times: Length in autocorrelation times.
        wanted: Required length in autocorrelation times.
    """

    parameter: str
    steps: int
    times: float
    wanted: float


@dataclass(frozen=True)
class ChainsDisagree(Finding):
    """Walkers differ among themselves.

    Attributes:
        parameter: Parameter with the largest R-hat.
        r_hat: Its R-hat.
        wanted: Limit of R-hat.
    """

    parameter: str
    r_hat: float
    wanted: float


def shortfalls(
    judged: Convergence, names: Sequence[str], precision: float
) -> list[Finding]:
    """Return the requirements of convergence that a chain does not meet."""
    found: list[Finding] = []
    worst = int(np.argmax(judged.error))
    error = float(judged.error[worst])
    if not error <= precision:
        found.append(QuantilesUncertain(names[worst], error, precision))
    worst = int(np.argmax(judged.tau))
    times = float(judged.steps / judged.tau[worst])
    if not times >= LONG_ENOUGH:
        found.append(ChainTooShort(names[worst], judged.steps, times, LONG_ENOUGH))
    worst = int(np.argmax(judged.r_hat))
    r_hat = float(judged.r_hat[worst])
    if not r_hat <= ALIKE:
        found.append(ChainsDisagree(names[worst], r_hat, ALIKE))
    return found
