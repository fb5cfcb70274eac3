"""Effective samples a second of each sampler, and the error of its 90 % interval.

Five microphones, four unknowns (mass, place in the plane, time), Student-t errors, laws
exact, as in `coverage`; 256 walkers. Effective samples are those of the worst unknown,
by its autocorrelation time, and the seconds those of sampling alone, compiled before,
the best of `REPEATS` runs.
The error is that of the interval's ends, the worst of all unknowns, in posterior
standard deviations, beside a run of the compiled sampler of `REFERENCE` steps; for a
sampler it is that of the whole run timed.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import emcee
import equinox as eqx
import jax
import numpy as np

from jblast.fidelity.timing import best_of
from jblast.inference.importance import importance
from jblast.inference.mcmc.convergence import convergence
from jblast.inference.mcmc.engines import Emcee, Scan, Segment, moves, of_emcee
from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.inference.whitening import densities
from jblast.verification.benchmark.fits import REFERENCE_SEED, solved, weighted_ends
from jblast.verification.sampling_cases import (
    RECORDS,
    WALKERS,
    interval_ends,
    timed_walk,
    unit_normal,
)

STEPS = 2000
REFERENCE = 40_000
REPEATS = 3


class Free(eqx.Module):
    """A density that costs nothing: what is left is the sampler."""

    def log_density(self, w):
        """Return ln of a unit normal."""
        return -0.5 * w @ w


def samplers_text() -> str:
    """Measure and return the table."""
    with jax.enable_x64(True):
        return _text()


def _text() -> str:
    what = solved()
    normal, density = what.normal, what.density
    free = normal.z.size
    axes = np.asarray(density.root)
    long = timed_walk(Scan(), density, free, REFERENCE, REFERENCE_SEED)[0] @ axes.T
    true, sd = interval_ends(long), long.reshape(-1, free).std(axis=0)

    lines = [
        f"Samplers: {jax.devices()[0].platform}, {os.cpu_count()} cores, emcee "
        f"{emcee.__version__}, jax {jax.__version__}, {len(RECORDS)} readings at each "
        f"of five microphones, {free} unknowns, {WALKERS} walkers",
        "",
        f"{'':38}{'ESS/s':>10}{'density/s':>12}{'tau':>8}{'error of ends':>16}",
    ]

    def row(name, rate=None, called=None, tau=None, ends=None):
        error = "" if ends is None else f"{np.max(np.abs(ends - true) / sd):.3f}"
        told = [
            f"{rate:,.0f}" if rate else "",
            f"{called:,.0f}" if called else "",
            f"{tau:.1f}" if tau else "",
        ]
        lines.append(
            f"{name:38}{told[0]:>10}{told[1]:>12}{told[2]:>8}{error:>16}".rstrip()
        )

    rates = {}
    alone = emcee.moves.StretchMove()
    for name, sampler, of in (
        ("emcee", Emcee(), density),
        ("emcee, stretch move alone", Alone(_by_jax, alone), density),
        (
            "emcee, density free",
            Alone(_by_numpy, moves(unit_normal(free))),
            Free(),
        ),
        ("emcee, stretch alone, density free", Alone(_by_numpy, alone), Free()),
        ("one lax.scan", Scan(), density),
        ("one lax.scan, density free", Scan(), Free()),
    ):
        chain, seconds = timed_walk(sampler, of, free, STEPS, repeats=REPEATS)
        kept = chain @ (axes.T if of is density else np.eye(free))
        tau = float(np.max(convergence(kept).tau))
        rates[name] = WALKERS * STEPS / tau / seconds
        ends = interval_ends(kept) if of is density else None
        row(name, rates[name], WALKERS * STEPS / seconds, tau, ends)
    seconds, weighted = best_of(lambda: importance(what.posterior, normal), REPEATS)
    count = len(weighted.z)
    row(
        "importance sampling",
        weighted.ess / seconds,
        count / seconds,
        ends=weighted_ends(weighted, normal),
    )
    sds = np.sqrt(np.diag(normal.covariance))
    row("Laplace", ends=np.outer([-NORMAL_Q95, NORMAL_Q95], sds))
    ceiling = rates["emcee"] / rates["emcee, density free"]
    lines += [
        "",
        f"emcee over its ceiling (the same moves, density free): {100 * ceiling:.0f} %",
        f"one lax.scan over emcee: {rates['one lax.scan'] / rates['emcee']:.1f}",
        f"k-hat {weighted.k_hat:.2f}; importance sampling draws {count} in all",
    ]
    return "\n".join(lines)


def _by_numpy(density):
    """Return the density that costs nothing, as a line of NumPy."""
    return lambda w: -0.5 * np.einsum("ij,ij->i", w, w)


def _by_jax(density):
    return lambda w: np.asarray(densities(density, w))


@dataclass(frozen=True)
class Alone:
    """emcee by itself, with some moves.

    Attributes:
        function_of: What it calls, of a density.
        moves: Its moves.
    """

    function_of: Callable
    moves: Any
    tick_steps: int = 1

    def first_random(self, seed: int) -> dict[str, np.ndarray]:
        """Return what the random numbers start from, as ours do."""
        return Emcee().first_random(seed)

    def walk(self, density, mixture, state, steps, tick) -> Segment:
        """Walk as `run_mcmc` does."""
        count, free = state.walkers.shape
        sampler = emcee.EnsembleSampler(
            count, free, self.function_of(density), moves=self.moves, vectorize=True
        )
        start = emcee.State(
            state.walkers,
            log_prob=state.log_density,
            random_state=of_emcee(state.random),
        )
        sampler.run_mcmc(start, steps)
        chain, value = sampler.get_chain(), sampler.get_log_prob()
        return Segment(np.asarray(chain), np.asarray(value), state.random)
