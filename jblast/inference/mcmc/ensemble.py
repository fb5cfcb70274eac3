"""The posterior by an ensemble of walkers, until its quantiles are precise enough.

Walkers start from the normal approximation at every optimum of enough weight. They move
in whitened coordinates, by emcee or by the same moves in one compiled loop. Each step
is one of the kinds in `engines.SHARES`. Findings report a chain that is too short,
chains that disagree, several modes and long ridges.

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
    MAX_STEPS,
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
"""Smallest share of the posterior of an optimum, relative to the best, for walkers: a
smaller one hardly moves a 90 % interval."""
# a user without ArviZ reads this: the packages are optional
NEEDED = "expected ArviZ and a writer: pip install arviz h5netcdf h5py"
MAX_EXPORTED_DRAWS = 200_000
"""Largest number of exported draws: steps are thinned. 12 numbers each take 20 MB."""


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
        converged: True if the requested precision was reached and the posterior is
            proper.
        interrupted: True if Ctrl-C ended it.
        modes: Modes in the fitted coordinates, that of most draws first. On a ridge
            without end only the first is given.
        ridge: A direction far longer than the normal approximation, or None.
        findings: Shortfalls of convergence, modes and ridge.
        sampler: "emcee" or "scan".
        resumed: Number of steps stored by earlier runs.
        seconds: Duration of this run.
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
    sampler: Sampler = "emcee",
    store: str | os.PathLike[str] | None = None,
    rows: Sequence[str] = (),
    report: Report | None = None,
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
        sampler: "emcee", or "scan" for the same moves compiled.
        store: Folder in which the chain is stored. An unfinished chain of this
            posterior is resumed, with the same result as an unbroken one.
        rows: Name of each row of the log in messages.
        report: Function that is called with `Progress`; None for the listener of
            `jblast.progress`.

    Raises:
        InputError: The posterior is improper or not finite at its optimum, there are
            too few walkers, or `store` has the chain of another posterior.
    """
    density = whitened_density(posterior, normal, identifiability)
    _refuse_non_finite(posterior, normal.z, rows)
    # in whitened coordinates the optimum is the origin
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
    # on an endless ridge the peaks are those of the part that was reached so far
    if valley is not None and valley.endless:
        peaks = peaks[:1]
    elif len(peaks) > 1:
        valley = None
    # back from coordinates relative to the optimum to the fitted ones
    fitted_modes = tuple(
        replace(
            mode,
            peak=mode.peak + normal.z,
            low=mode.low + normal.z,
            high=mode.high + normal.z,
        )
        for mode in peaks
    )
    fitted_ridge = valley and replace(valley, ends=normal.z + valley.ends @ axes.T)
    findings: list[Finding] = []
    if found.interrupted:
        findings.append(Interrupted(len(found.chain)))
    if not found.reached:
        findings += shortfalls(found.convergence, names, precision)
    findings += several_modes(fitted_modes, posterior.parameters)
    findings += long_ridge(fitted_ridge, posterior.parameters)
    return Ensemble(
        names=names,
        z=(normal.z + chain @ axes.T).transpose(1, 0, 2),
        log_density=value.T,
        convergence=found.convergence,
        # a walker that did not move in a step has rejected its proposal
        acceptance=float(np.mean((np.diff(found.chain, axis=0) != 0).any(axis=2)))
        if len(found.chain) > 1
        else 0.0,
        converged=found.reached and not (valley is not None and valley.endless),
        interrupted=found.interrupted,
        modes=fitted_modes,
        ridge=fitted_ridge,
        findings=tuple(findings),
        sampler=sampler,
        resumed=found.resumed,
        seconds=found.seconds,
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


@dataclass(frozen=True)
class Interrupted(Finding):
    """The chain was interrupted by the user.

    Attributes:
        steps: Number of steps by then.
    """

    steps: int


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


@dataclass(frozen=True)
class SeveralModes(Finding):
    """The posterior has several modes.

    Attributes:
        shares: Share of the posterior of each mode.
        peaks: Position of each, by the parameters in which they differ.
    """

    shares: tuple[float, ...]
    peaks: tuple[Mapping[str, float], ...]


@dataclass(frozen=True)
class LongRidge(Finding):
    """The posterior is far longer than its normal approximation.

    Attributes:
        longer: Length relative to the normal approximation.
        low: Position of one end, by the parameters in which the ends differ.
        high: Position of the other end.
        is_endless: True if the density does not fall beyond: it is improper.
    """

    longer: float
    low: Mapping[str, float]
    high: Mapping[str, float]
    is_endless: bool


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
    if not judged.steps >= LONG_ENOUGH * judged.tau[worst]:
        found.append(ChainTooShort(names[worst], judged.steps, times, LONG_ENOUGH))
    worst = int(np.argmax(judged.r_hat))
    r_hat = float(judged.r_hat[worst])
    if not r_hat < ALIKE:
        found.append(ChainsDisagree(names[worst], r_hat, ALIKE))
    return found


def several_modes(modes: Sequence[Mode], parameters: Parameters) -> list[Finding]:
    """Return a finding about several modes, by the parameters in which they differ."""
    if len(modes) < 2:
        return []
    first = modes[0]
    differ = np.zeros(len(parameters.names), bool)
    for mode in modes[1:]:  # parameters whose 90 % intervals are disjoint
        differ |= (mode.low > first.high) | (mode.high < first.low)
    if not differ.any():
        differ[:] = True
    peaks = _values(parameters, np.array([mode.peak for mode in modes]), differ)
    return [SeveralModes(tuple(float(mode.share) for mode in modes), peaks)]


def long_ridge(ridge: Ridge | None, parameters: Parameters) -> list[Finding]:
    """Return a finding about a ridge, with its ends."""
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
            for name, is_used in zip(parameters.names, which, strict=True)
            if is_used
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
        ensemble: The draws.
        posterior: The posterior.
        observations: The log.
        notes: Findings to store with the draws.

    Raises:
        InputError: ArviZ is not installed.
    """
    # rounded up: the limit is never exceeded
    stride = max(-(-ensemble.log_density.size // MAX_EXPORTED_DRAWS), 1)
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
    """Write a tree as a NetCDF file, completely or not at all.

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
        # ArviZ 0.23 warns of the changes of 1.0 at import
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)
            import arviz
    except ImportError:
        raise InputError(f"the ArviZ schema: {NEEDED}") from None
    from_dict: Any = arviz.from_dict  # the signature depends on the version
    if int(arviz.__version__.split(".")[0]) < 1:
        return from_dict(**groups, coords=coords, dims=dims).to_datatree()
    return from_dict(groups, coords=coords, dims=dims)


def _about(ensemble: Ensemble, stride: int, notes: Sequence[str]) -> dict[str, Any]:
    """Return the attributes of the NetCDF file: numbers and text only."""
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
