"""Does one clock, or one sensor, explain a log that no scene fits: without it.

Rows are left out by an error too large for them to count (`UNHEARD`): the log keeps its
layout, and nothing is compiled anew. An accused clock is one whose readings are left
out and not one whose offset is fitted: of one arrival that is the same.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError
from jblast.inference.fitting.findings import WrongClock, WrongSensor
from jblast.inference.fitting.goodness_of_fit import (
    FITS,
    POOR,
    bounds_kept,
    chi_squared,
    least_error,
    p_value,
    standardised_residuals,
    tail_probability,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.mode.laplace import marginals
from jblast.inference.mode.row_subset import is_long
from jblast.inference.mode.starts import layout_size
from jblast.inference.posterior.correlated_errors import own_and_shared_errors
from jblast.inference.posterior.error_density import log_noise
from jblast.inference.posterior.fisher_information import (
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.posterior import Posterior
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.times.clocks import has_common_clock
from jblast.parameter_table import CLOCK_OFFSET
from jblast.progress import each

UNHEARD = 1e6
"""Error of a row that is left out: seconds, radians or ln."""
WIDTH = 10.0
"""A wrong reading may be anything within so many seconds, radians or in ln."""
AS_LIKELY = 3.0
"""Who explains a log worse than the best by more in ln-density is let be."""
MOST = 8
"""So many are tried at most, those first that a linear law would accuse."""


class Suspect(NamedTuple):
    """Who may be wrong: a clock or a sensor, and its rows."""

    kind: str
    name: str
    rows: Int[np.ndarray, " left_out"]


def explained_by(
    observations: Observations,
    solution: Solution,
    fits: bool,
    refit: Callable[[Observations], Solution],
) -> tuple[WrongSensor, ...]:
    """Name each clock or sensor without which a log fits, and from which it is far.

    One is accused if the rest converges, identifies every number and fits; and if
    errors as stated would put one among all so far off once in a thousand logs. Where
    all rows together have an answer as well, perhaps of kilotons miles away where laws
    scatter by seconds, the rest must be a thousand times as probable, the rows left out
    being anything within `WIDTH`.

    Args:
        observations: The log.
        solution: What was found of all of it.
        fits: Whether that is an answer.
        refit: Solves for a log of the same rows.

    Returns:
        The most probable first.
    """
    posterior = solution.posterior
    if is_long(posterior):
        return ()
    known = len(observations) + int(np.sum(posterior.parameters.has_prior()))
    spare = known - solution.laplace.z.size
    possible = [s for s in suspects(observations, solution) if len(s.rows) < spare]
    found = []
    for suspect in each(_likeliest(solution, possible)[:MOST], "sensors left out"):
        try:
            rest = refit(_without(observations, suspect.rows))
        except InputError:  # no scene gives the others a probability
            continue
        density = float(rest.optima.log_density[0])
        left_out = float(log_noise(jnp.zeros(()), posterior.noise)) - math.log(UNHEARD)
        readings = int(np.sum(~observations.bounds()[suspect.rows]))
        density -= readings * (left_out + math.log(WIDTH))  # a bound has no density
        least = float(solution.optima.log_density[0]) - math.log(POOR / len(possible))
        if fits and density < least:
            continue
        if wrong := _judged(observations, rest, suspect, len(possible)):
            found.append((density, wrong))
    if any(wrong.law_valid_rows for _, wrong in found):
        found = [pair for pair in found if pair[1].law_valid_rows]
    found.sort(key=lambda pair: -pair[0])
    likely = [wrong for density, wrong in found if found[0][0] - density < AS_LIKELY]
    return tuple(likely)


def lies_far(solution: Solution) -> bool:
    """Return whether a place that was searched is further off than sensors spread.

    There laws scatter by more than any clock is off, and every log fits.
    """
    posterior = solution.posterior
    searched = {name.partition(".")[0] for name in posterior.parameters.names}
    if not searched & {"charge_east_m", "charge_north_m"}:
        return False
    reach = posterior.misfit(jax.device_put(solution.laplace.z)).slant_range
    return bool(np.min(np.asarray(reach)) > np.asarray(layout_size(posterior)))


def suspects(observations: Observations, solution: Solution) -> list[Suspect]:
    """Return every clock that is not free, and every sensor of other rows than it."""
    clocks = np.array(observations.clocks())
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    names = solution.posterior.parameters.names
    found = [
        Suspect("clock", name, np.flatnonzero(timed & (clocks == name)))
        for name in dict.fromkeys(clocks[timed].tolist())
        if f"{CLOCK_OFFSET}.{name}" not in names
    ]
    seen = {tuple(suspect.rows) for suspect in found}
    for name in dict.fromkeys(observations.sensor):
        rows = np.flatnonzero(np.array(observations.sensor) == name)
        if tuple(rows) not in seen:
            found.append(Suspect("sensor", name, rows))
    return found


def _without(observations: Observations, rows: Int[np.ndarray, " out"]) -> Observations:
    """Return a log some of whose rows tell nothing."""
    scale = observations.error_scale()
    sigma = observations.sigma.copy()
    given = np.where(np.isfinite(scale), scale / observations.sigma, 1.0)
    sigma[rows] = UNHEARD / given[rows]
    # what is not heard shares no errors: of equal shares it would tell that they are 0
    record = np.array(observations.records(), object)
    record[rows] = ""
    return replace(observations, sigma=sigma, record=tuple(record))


def _likeliest(solution: Solution, possible: Sequence[Suspect]) -> list[Suspect]:
    """Order suspects by how much chi squared would fall without each, laws linear."""
    posterior, z = solution.posterior, jnp.asarray(solution.laplace.z)
    misfit = posterior.misfit(z)
    missed = jnp.asarray(least_error(np.asarray(misfit.residual), posterior))
    moved = whitened_rows(posterior, misfit, missed[:, None])[:, 0]
    slopes = whitened_jacobian(posterior, z)[: len(moved)]
    moved, slopes = np.asarray(moved), np.asarray(slopes)
    if not (np.isfinite(moved).all() and np.isfinite(slopes).all()):
        return list(possible)
    basis = np.linalg.svd(slopes / np.maximum(np.abs(slopes).max(0), 1e-300), False)[0]
    left = moved - basis @ (basis.T @ moved)

    def fall(suspect: Suspect) -> float:
        free = np.eye(len(suspect.rows)) - basis[suspect.rows] @ basis[suspect.rows].T
        return float(left[suspect.rows] @ np.linalg.pinv(free) @ left[suspect.rows])

    return sorted(possible, key=fall, reverse=True)


def _judged(
    observations: Observations, rest: Solution, suspect: Suspect, among: int
) -> WrongSensor | None:
    """Return what a log says without a suspect; None if that does not explain it."""
    normal, found = rest.laplace, rest.identifiability
    if not (normal.converged and all(found.determined)):
        return None
    posterior, z = rest.posterior, normal.z
    left = standardised_residuals(posterior, z)
    chi2, dof = chi_squared(posterior, z, left, z.size)
    dof -= len(suspect.rows) - int(
        np.sum(bounds_kept(left.own, posterior)[suspect.rows])
    )
    p = p_value(chi2, dof)
    if p is None or p < FITS:
        return None
    valid = np.delete(np.asarray(posterior.misfit(jnp.asarray(z)).valid), suspect.rows)
    own, shared = own_and_shared_errors(observations)
    as_read = replace(
        posterior,
        sigma=jnp.asarray(own),
        shared_error=jnp.asarray(shared) if shared.size else None,
        error_blocks=(),
    )
    missed, covariance = _missed(as_read, rest, suspect.rows)
    clock: dict[str, Any] = {}
    if suspect.kind == "clock":
        weights = np.linalg.solve(covariance, np.ones(len(missed)))
        offset = float(weights @ missed / weights.sum())
        sd = float(weights.sum() ** -0.5)
        apart = missed - offset
        alike = p_value(
            float(apart @ np.linalg.solve(covariance, apart)), len(missed) - 1
        )
        if alike is not None and alike < FITS:
            return None
        rarity = float(tail_probability(np.array([offset / sd]), posterior.noise)[0])
        first = next((clock for clock in observations.clock if clock), "")
        is_set = suspect.name == first and not has_common_clock(observations)
        parameter = None if is_set else f"{CLOCK_OFFSET}.{suspect.name}"
        clock = {"offset_s": offset, "offset_sd": sd, "parameter": parameter}
    else:
        far = missed / np.sqrt(np.diag(covariance))
        rarity = float(tail_probability(far, posterior.noise).min()) * len(missed)
    if rarity * among > POOR:
        return None
    return (WrongClock if clock else WrongSensor)(
        name=suspect.name,
        chi2=chi2,
        dof=dof,
        p_value=p,
        law_valid_rows=int(valid.sum()),
        estimates=marginals(posterior.parameters, normal),
        **clock,
    )


def _missed(
    posterior: Posterior, rest: Solution, rows: Int[np.ndarray, " out"]
) -> tuple[Float[np.ndarray, " out"], Float[np.ndarray, "out out"]]:
    """Return by how much rows miss what the rest says of them, and its covariance."""
    z = rest.laplace.z
    values, vectors = np.linalg.eigh(rest.laplace.covariance)
    axes = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    misfit = posterior.misfit(jnp.asarray(z))
    moved = [
        0.5
        * np.asarray(
            posterior.misfit(jnp.asarray(z + axis)).residual
            - posterior.misfit(jnp.asarray(z - axis)).residual
        )[rows]
        for axis in axes
    ]
    parts = np.column_stack([*moved, np.asarray(misfit.loading)[rows]])
    own = np.diag(np.square(np.asarray(misfit.sd)[rows]))
    missed = least_error(np.asarray(misfit.residual), posterior)
    return missed[rows], parts @ parts.T + own
