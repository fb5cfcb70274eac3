"""The posterior by an ensemble of walkers, until its quantiles are known well enough.

Walkers start from the normal approximation at every optimum that counts, and walk in
coordinates in which the posterior is round: by emcee, or by the same moves in one
compiled loop. Each step is one of the kinds in `state.SHARES`.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.inference.identifiability.null_space import Identifiability
from jblast.inference.importance.whitening import (
    Whitened,
    non_finite_rows,
    root_of,
    whitened_density,
)
from jblast.inference.mcmc.checkpoint import Store
from jblast.inference.mcmc.convergence import Convergence
from jblast.inference.mcmc.findings import (
    Interrupted,
    long_ridge,
    several_modes,
    shortfalls,
)
from jblast.inference.mcmc.modes import Mode, Ridge, modes, ridge
from jblast.inference.mcmc.progress import Report, to_listener
from jblast.inference.mcmc.run import (
    MOST_STEPS,
    PRECISION,
    WALKERS,
    Sampler,
    Start,
    sample,
)
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.search import SEPARATE, Optima
from jblast.inference.posterior.finding import Finding
from jblast.inference.posterior.posterior import Posterior

UNLIKELY = 1e-3
"""An optimum with less of the posterior than this beside the best gets no walkers."""


@dataclass(frozen=True)
class Ensemble:
    """Draws of a posterior, and whether to believe them.

    Attributes:
        names: Of the coordinates.
        z: Draws in the fitted coordinates, warm-up left out.
        log_density: ln of the posterior density at each, up to a constant.
        convergence: Autocorrelation times, effective sample sizes, R-hat, error of the
            quantiles.
        acceptance: Share of the moves that were made.
        converged: Whether the precision wanted was reached, of a proper posterior.
        interrupted: Whether Ctrl-C ended it.
        modes: Peaks in the fitted coordinates, mostly one; that of most draws first,
            and it alone on a ridge without end.
        ridge: A direction far longer than the normal approximation, if there is one.
        findings: Where the walk falls short, modes and ridge.
        sampler: "emcee" or "scan".
        resumed: Steps that were kept from an earlier run.
        seconds: Taken by this one.
    """

    names: tuple[str, ...]
    z: Float[np.ndarray, "walker step free"]
    log_density: Float[np.ndarray, "walker step"]
    convergence: Convergence
    acceptance: float
    converged: bool
    interrupted: bool
    modes: tuple[Mode, ...]
    ridge: Ridge | None
    findings: tuple[Finding, ...]
    sampler: str
    resumed: int
    seconds: float

    def draws(self, most: int | None = None) -> Float[np.ndarray, "draw free"]:
        """Return all draws in a row, or so many spread evenly over them."""
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
    most_steps: int = MOST_STEPS,
    sampler: Sampler = "emcee",
    store: str | os.PathLike[str] | None = None,
    rows: Sequence[str] = (),
    report: Report | None = None,
) -> Ensemble:
    """Draw from a posterior until its quantiles are known well enough.

    Args:
        posterior: The posterior.
        normal: Its normal approximation.
        identifiability: What the log tells.
        optima: Where searches ended; walkers start at those that count. Without them
            all start from the normal approximation.
        seed: Of all random numbers.
        walkers: How many; even, and at least twice the unknowns.
        precision: Largest Monte Carlo error of the 5 and 95 % quantile of any
            coordinate, in its standard deviations.
        most_steps: Stop here whatever was reached.
        sampler: "emcee", or "scan" for the same moves compiled.
        store: Folder in which the walk is kept; one that holds an unfinished walk of
            this posterior is gone on with, to the result an unbroken one has.
        rows: What to call each row of the log in messages.
        report: What to call with `Progress`; None: who listens (`jblast.progress`).

    Raises:
        InputError: The posterior is improper or no number at its optimum, the walkers
            are too few, or what is kept in `store` is of another posterior.
    """
    density = whitened_density(posterior, normal, identifiability)
    _refuse_non_finite(posterior, normal.z, rows)
    starts = [Start(np.zeros(normal.z.size), np.eye(normal.z.size), 1.0)]
    if optima is not None:
        starts += _others(density, normal, identifiability, optima)
    axes = np.asarray(density.root)
    found = sample(
        density,
        starts,
        axes,
        seed=seed,
        walkers=walkers,
        precision=precision,
        most_steps=most_steps,
        sampler=sampler,
        store=None if store is None else Store(Path(store)),
        report=report or to_listener(),
    )
    names = posterior.parameters.names
    warm_up = found.convergence.warm_up
    chain, value = found.chain[warm_up:], found.log_density[warm_up:]
    w = chain.reshape(-1, len(names))
    valley = ridge(w, value.ravel())
    peaks = modes(density, w, value.ravel(), axes)
    if valley is not None and valley.endless:  # a crest walked in part: no peaks yet
        peaks = peaks[:1]
    elif len(peaks) > 1:
        valley = None
    told_modes = tuple(_mode_about(normal.z, mode) for mode in peaks)
    told_ridge = valley and replace(valley, ends=normal.z + valley.ends @ axes.T)
    findings: list[Finding] = []
    if found.interrupted:
        findings.append(Interrupted(len(found.chain)))
    if not found.reached:
        findings += shortfalls(found.convergence, names, precision)
    findings += several_modes(told_modes, posterior.parameters)
    findings += long_ridge(told_ridge, posterior.parameters)
    return Ensemble(
        names=names,
        z=(normal.z + chain @ axes.T).transpose(1, 0, 2),
        log_density=value.T,
        convergence=found.convergence,
        acceptance=float(np.mean((np.diff(found.chain, axis=0) != 0).any(axis=2)))
        if len(found.chain) > 1
        else 0.0,
        converged=found.reached and not (valley is not None and valley.endless),
        interrupted=found.interrupted,
        modes=told_modes,
        ridge=told_ridge,
        findings=tuple(findings),
        sampler=sampler,
        resumed=found.resumed,
        seconds=found.seconds,
    )


def _refuse_non_finite(posterior: Posterior, z, rows: Sequence[str]) -> None:
    """Refuse a posterior that is no number where the walkers start."""
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
        "the posterior density is no number where the walkers start ("
        + ", ".join(f"{name} {float(value):.4g}" for name, value in at.items())
        + "): expected finite predictions and errors, got none for "
        + (", ".join(named) or "the priors")
    )


def _others(density: Whitened, normal, identifiability, optima: Optima) -> list[Start]:
    """Return the other optima that hold a part of the posterior worth walkers.

    The share of each is its density times its volume, beside the best.
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
        share = float(np.exp(np.clip(value - best + volume, -700, 700)))
        kept.append((z, there))
        if share > UNLIKELY:
            starts.append(Start(away[:, 0], away[:, 1:], share))
    return starts


def _mode_about(center, mode: Mode) -> Mode:
    """Put a mode where it is."""
    return replace(
        mode,
        peak=mode.peak + center,
        low=mode.low + center,
        high=mode.high + center,
    )
