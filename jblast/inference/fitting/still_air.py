r"""What an answer that took the air to be still owes to that.

Were the wind unknown beside the numbers $z$ that were fitted, normal about 0 with
standard deviation $s$ towards east and towards north, the covariance of $z$, which is
$P$ in still air, would be that of both together, the wind integrated out:

$$P + A\,(F_{ww} + s^{-2} - F_{wz} A)^{-1} A^T, \quad A = P F_{zw}$$

with $F$ the Fisher information of $z$ and the wind $w$ (the inverse of the block
matrix, by its Schur complement). It is linearised about the answer; nothing is fitted
again, and differences of what was compiled already give the slopes.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.solution import Solution
from jblast.inference.mode.starts import typical_step
from jblast.inference.posterior.finding import Finding
from jblast.inference.posterior.fisher_information import information_of_rows
from jblast.inference.posterior.posterior import Misfit, Posterior
from jblast.parameters import PARAMETERS
from jblast.quantities import made_with

WIND = PARAMETERS["wind_east_m_s"].spread.amount
"""Standard deviation of a wind that nobody measured, either way [m/s]."""
STEP = 1e-3
"""Of differences: that part of a standard deviation, or of a typical step."""
WIDER = 1.05
"""An interval that would be wider by less is not told of."""
SPEEDS = ("air_sound_speed_m_s", "air_temperature_k")
"""Of sound: one that is fitted stands for a wind along ranges."""
BY_AIR = made_with("air_arrival_s")
MOST = 3
"""So many numbers are named, those that widen most first."""


@dataclass(frozen=True)
class WindPassesForSoundSpeed(Finding):
    """Still air was taken, and a wind along the ranges would not be noticed.

    Attributes:
        parameter: What stands for it.
        is_fitted: Whether that is fitted; else a prior on it would do.
    """

    parameter: str
    is_fitted: bool


@dataclass(frozen=True)
class StillAir(Finding):
    """Still air was taken.

    Attributes:
        wind_sd: Of a wind towards east and north, were it unknown [m/s].
        wider: How many times wider the 90 % intervals would be then, those that widen
            most; empty where none would by much, None where that cannot be computed.
    """

    wind_sd: float
    wider: Mapping[str, float] | None


def still_air(solution: Solution) -> Finding | None:
    """Return what still air did to an answer; None where not taken, or not felt."""
    posterior = solution.posterior
    air = posterior.parameters.scene.air
    known_wind = any(name.startswith("wind_") for name in posterior.parameters.names)
    if known_wind or float(air.wind_east) or float(air.wind_north):
        return None
    arrivals = bool(set(BY_AIR) & set(posterior.layout.quantities()))
    factors = wider_with_wind(solution)
    if factors is None:
        decides = SPEEDS if air.sound_speed is None else SPEEDS[:1]
        fitted = [name for name in decides if name in posterior.parameters.names]
        if not arrivals:
            return None
        return WindPassesForSoundSpeed((fitted or SPEEDS)[0], bool(fitted))
    worst = sorted(
        (name for name, factor in factors.items() if factor >= WIDER),
        key=lambda name: -factors[name],
    )
    if worst:
        return StillAir(WIND, {name: factors[name] for name in worst[:MOST]})
    if not np.isfinite(list(factors.values())).all():
        return StillAir(WIND, None)
    return StillAir(WIND, {}) if arrivals else None


def wider_with_wind(solution: Solution, sd: float = WIND) -> dict[str, float] | None:
    """Return by what factor each interval would widen; None if no row feels a wind.

    NaN where predictions have no slopes.

    Args:
        solution: What was found in still air.
        sd: Of the wind's components [m/s].
    """
    posterior, normal = solution.posterior, solution.laplace
    here = posterior.misfit(jnp.asarray(normal.z))
    to_wind = _slopes_to_wind(posterior, normal.z)
    if not to_wind.any():
        return None
    sds = np.sqrt(np.diag(normal.covariance))
    typical = np.asarray(typical_step(posterior))
    steps = STEP * np.where(sds > 0, np.minimum(sds, typical), typical)
    to_fitted = np.stack(
        [
            _slope(*(posterior.misfit(jnp.asarray(normal.z + s)) for s in (-d, d)))
            / step
            for step, d in zip(steps, np.diag(steps), strict=True)
        ],
        axis=1,
    )
    weighted = _weighted(here, information_of_rows(posterior, here), to_wind)
    gain = normal.covariance @ to_fitted.T @ weighted
    left = to_wind.T @ weighted + np.eye(2) / sd**2 - weighted.T @ to_fitted @ gain
    if np.isfinite(left).all():
        left = np.linalg.pinv(left, hermitian=True)
    added = np.diag(gain @ left @ gain.T)
    return {
        name: float(np.sqrt(1 + max(more, 0.0) / one**2))
        for name, one, more in zip(posterior.parameters.names, sds, added, strict=True)
        if one > 0
    }


def _slopes_to_wind(posterior: Posterior, z) -> Float[np.ndarray, "row 2"]:
    """Return how predictions move with the wind towards east and north."""
    where = (
        lambda p: p.parameters.scene.air.wind_east,
        lambda p: p.parameters.scene.air.wind_north,
    )
    step = STEP * WIND
    columns = []
    for component in where:
        ends = (
            eqx.tree_at(component, posterior, component(posterior) + side * step)
            for side in (-1, 1)
        )
        columns.append(_slope(*(end.misfit(jnp.asarray(z)) for end in ends)) / step)
    return np.stack(columns, axis=1)


def _slope(before: Misfit, after: Misfit) -> Float[np.ndarray, " row"]:
    """Return half of what predictions rose by from one place to another."""
    return 0.5 * (np.asarray(before.residual) - np.asarray(after.residual))


def _weighted(here: Misfit, of_rows, columns: Float[np.ndarray, "row column"]):
    """Return columns times the inverse covariance of the rows, shared effects and all.

    By the Woodbury identity: no matrix of rows by rows.
    """
    weight = np.reshape(of_rows, (-1, 1)) / np.asarray(here.sd)[:, None] ** 2
    loading = np.asarray(here.loading)
    known = np.eye(loading.shape[1]) + loading.T @ (weight * loading)
    shared = np.linalg.solve(known, loading.T @ (weight * columns))
    return weight * (columns - loading @ shared)
