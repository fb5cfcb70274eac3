"""The posterior by an ensemble of walkers, until its quantiles are precise enough.

Walkers start from the normal approximation at every optimum of enough weight, and move
in coordinates in which the posterior is round: by emcee, or by the same moves in one
compiled loop. Each step is one of the kinds in `engines.SHARES`. Findings report a
chain that is too short, chains that disagree, several modes and long ridges.

Draws are exported in the schema of ArviZ, as one tree and one NetCDF file. Up to ArviZ
0.23 (Python 3.11) `from_dict` takes a keyword for each group and returns its own
InferenceData; from 1.0 (Python 3.12) it takes one mapping and returns xarray's
DataTree. Both give a DataTree here.
"""

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.files import replacing
from jblast.inference.identifiability import Identifiability
from jblast.inference.mcmc.convergence import (
    ALIKE,
    LONG_ENOUGH,
    Convergence,
    Report,
    to_listener,
)
from jblast.inference.mcmc.modes import Mode, Ridge, modes, ridge
from jblast.inference.mcmc.run import (
    MOST_STEPS,
    PRECISION,
    WALKERS,
    Sampler,
    Start,
    Store,
    sample,
)
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.search import SEPARATE, Optima
from jblast.inference.posterior.parameters import Finding, Parameters
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.whitening import (
    Whitened,
    non_finite_rows,
    root_of,
    whitened_density,
)
from jblast.observations import Observations

if TYPE_CHECKING:
    import xarray

UNLIKELY = 1e-3
"""An optimum with less of the posterior than this beside the best gets no walkers."""
NEEDED = "expected ArviZ and a writer: pip install arviz h5netcdf h5py"
MOST_DRAWS = 200_000
"""Steps are thinned so that no more draws than this are kept."""


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
        identifiability: Null directions of the log.
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
    """Return a mode in the fitted coordinates; it is given relative to a center."""
    return replace(
        mode,
        peak=mode.peak + center,
        low=mode.low + center,
        high=mode.high + center,
    )


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


def inference_data(
    ensemble: Ensemble,
    posterior: Posterior,
    observations: Observations,
    notes: Sequence[str] = (),
) -> "xarray.DataTree":
    """Return an ensemble in the schema of ArviZ, each walker a chain.

    Groups: `posterior` (every number, in the units of its name), `sample_stats` (`lp`,
    ln of the density per unit of the fitted coordinates), `observed_data`.

    Args:
        ensemble: The walk.
        posterior: What was walked.
        observations: The log.
        notes: Findings to store with the draws.

    Raises:
        InputError: ArviZ is not installed.
    """
    stride = max(-(-ensemble.log_density.size // MOST_DRAWS), 1)
    z = ensemble.z[:, ::stride]
    values = posterior.parameters.values_of_each(
        jnp.asarray(z.reshape(-1, z.shape[-1]))
    )
    rows = [
        f"{sensor} {quantity}"
        for sensor, quantity in zip(
            observations.sensor, observations.quantity, strict=True
        )
    ]
    groups: dict[str, dict[str, Any]] = {
        "posterior": {
            name: np.asarray(values[name]).reshape(z.shape[:2])
            for name in ensemble.names
        },
        "sample_stats": {"lp": ensemble.log_density[:, ::stride]},
        "observed_data": {"reading": np.asarray(observations.value)},
    }
    tree = _tree(groups, {"row": rows}, {"reading": ["row"]})
    tree["posterior"].attrs.update(_about(ensemble, stride, notes))
    return tree


def write_inference_data(tree: "xarray.DataTree", path: str | os.PathLike[str]) -> None:
    """Write a tree as a NetCDF file, whole or not at all.

    Raises:
        InputError: h5netcdf is not installed, or the file cannot be written.
    """
    try:
        with replacing(path) as temporary:
            tree.to_netcdf(temporary, engine="h5netcdf")
    except ImportError:
        raise InputError(f"{path}: {NEEDED}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def _tree(groups, coords, dims) -> "xarray.DataTree":
    try:
        with warnings.catch_warnings():  # 0.23 announces 1.0 when it is imported
            warnings.simplefilter("ignore", FutureWarning)
            import arviz
    except ImportError:
        raise InputError(f"the ArviZ schema: {NEEDED}") from None
    from_dict: Any = arviz.from_dict  # its arguments are those of one of two lines
    if int(arviz.__version__.split(".")[0]) < 1:
        return from_dict(**groups, coords=coords, dims=dims).to_datatree()
    return from_dict(groups, coords=coords, dims=dims)


def _about(ensemble: Ensemble, stride: int, notes: Sequence[str]) -> dict[str, Any]:
    """What NetCDF keeps beside the draws: numbers and text only."""
    judged = ensemble.convergence
    return {
        "inference_library": "emcee" if ensemble.sampler == "emcee" else "jblast",
        "sampling_time": ensemble.seconds,
        "tuning_steps": judged.warm_up,
        "thinned_by": stride,
        "converged": int(ensemble.converged),
        "autocorrelation_time": judged.tau,
        "effective_sample_size": judged.ess,
        "r_hat": judged.r_hat,
        "why": "; ".join(notes),
    }
