"""What an ensemble's walk showed: where it falls short, modes, a ridge."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from jblast.inference.mcmc.convergence import ALIKE, LONG_ENOUGH, Convergence
from jblast.inference.mcmc.modes import Mode, Ridge
from jblast.inference.posterior.finding import Finding
from jblast.inference.posterior.parameters import Parameters


@dataclass(frozen=True)
class Interrupted(Finding):
    """The walk was stopped by hand.

    Attributes:
        steps: It had taken by then.
    """

    steps: int


@dataclass(frozen=True)
class QuantilesUncertain(Finding):
    """Quantiles are known less well than was wanted.

    Attributes:
        parameter: Those of which are known worst.
        error: Their Monte Carlo error, in standard deviations of the number.
        wanted: What it should have been at most.
    """

    parameter: str
    error: float
    wanted: float


@dataclass(frozen=True)
class ChainTooShort(Finding):
    """The walk is short beside its autocorrelation time.

    Attributes:
        parameter: That with the longest.
        steps: The walk's length.
        times: So many autocorrelation times that is.
        wanted: What it should have been at least.
    """

    parameter: str
    steps: int
    times: float
    wanted: float


@dataclass(frozen=True)
class ChainsDisagree(Finding):
    """Walkers differ among themselves.

    Attributes:
        parameter: Where they do most.
        r_hat: Their R-hat.
        wanted: What it should have been less than.
    """

    parameter: str
    r_hat: float
    wanted: float


@dataclass(frozen=True)
class SeveralModes(Finding):
    """The posterior has several modes.

    Attributes:
        shares: Of the posterior, one a mode.
        peaks: Where each is, by the numbers in which they differ.
    """

    shares: tuple[float, ...]
    peaks: tuple[Mapping[str, float], ...]


@dataclass(frozen=True)
class LongRidge(Finding):
    """The posterior is far longer than its normal approximation.

    Attributes:
        longer: How many times.
        low: Where it begins, by the numbers in which its ends differ.
        high: Where it ends.
        is_endless: Whether the density does not fall beyond: it is improper.
    """

    longer: float
    low: Mapping[str, float]
    high: Mapping[str, float]
    is_endless: bool


def shortfalls(
    judged: Convergence, names: Sequence[str], precision: float
) -> list[Finding]:
    """Return in what a walk falls short of what was wanted."""
    found: list[Finding] = []
    worst = int(np.argmax(judged.error))
    error = float(judged.error[worst])
    if not error <= precision:
        found.append(QuantilesUncertain(names[worst], error, precision))
    worst = int(np.argmax(judged.tau))
    times = float(judged.steps / judged.tau[worst])
    if not judged.steps >= LONG_ENOUGH * judged.tau[worst]:
        found.append(ChainTooShort(names[worst], judged.steps, times, LONG_ENOUGH))
    worst = int(np.argmax(judged.r_hat))
    r_hat = float(judged.r_hat[worst])
    if not r_hat < ALIKE:
        found.append(ChainsDisagree(names[worst], r_hat, ALIKE))
    return found


def several_modes(modes: Sequence[Mode], parameters: Parameters) -> list[Finding]:
    """Return the modes by the numbers in which they differ, if there are several."""
    if len(modes) < 2:
        return []
    first = modes[0]
    differ = np.zeros(len(parameters.names), bool)
    for mode in modes[1:]:  # in what the 90 % intervals do not meet
        differ |= (mode.low > first.high) | (mode.high < first.low)
    if not differ.any():
        differ[:] = True
    peaks = _values(parameters, np.array([mode.peak for mode in modes]), differ)
    return [SeveralModes(tuple(float(mode.share) for mode in modes), peaks)]


def long_ridge(ridge: Ridge | None, parameters: Parameters) -> list[Finding]:
    """Return the ends of a ridge, if there is one."""
    if ridge is None:
        return []
    values = parameters.values_of_each(jnp.asarray(ridge.ends))
    differ = np.array(
        [
            abs(np.diff(np.asarray(values[name]))[0])
            > 0.01 * np.abs(np.asarray(values[name])).max()
            for name in parameters.names
        ]
    )
    if not differ.any():
        differ[:] = True
    low, high = _values(parameters, ridge.ends, differ)
    return [LongRidge(float(ridge.longer), low, high, bool(ridge.endless))]


def _values(parameters: Parameters, z, which) -> tuple[dict[str, float], ...]:
    values = parameters.values_of_each(jnp.asarray(z))
    return tuple(
        {
            name: float(values[name][i])
            for name, asked in zip(parameters.names, which, strict=True)
            if asked
        }
        for i in range(len(z))
    )
