"""Explanations of a log that no scene fits: clocks, sensors, fixed numbers.

A log may fit without one clock or sensor, or with the positions of two sensors
exchanged. Rows are left out by an error too large for them to matter
(`LEFT_OUT_SIGMA`): the log keeps its layout, and nothing is compiled again. An accused
clock is one whose readings are left out, not one whose offset is fitted; with one
arrival the two are the same.

A log without a scene is fitted with the default scene, which fixes position, time and
clocks. Where it does not fit, these are freed one set after another, and the first set
that fits and is identified is named. That set need not be the cause.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError
from jblast.inference.fitting.findings import (
    ExchangedSensors,
    MoreToFree,
    SeveralExplanations,
    SuspectedOutlier,
    WrongClock,
    WrongSensor,
)
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
from jblast.inference.mode.range_profile import range_profile
from jblast.inference.mode.search import is_long
from jblast.inference.mode.starts import layout_size
from jblast.inference.posterior.fisher_information import (
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.likelihood import log_noise
from jblast.inference.posterior.posterior import Posterior, own_and_shared_errors
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.clocks import clocks_apart, has_common_clock
from jblast.observations.scenes import PLACE, clocks_to_free
from jblast.parameters import CLOCK_OFFSET
from jblast.progress import each
from jblast.quantities import ARRIVALS
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

LEFT_OUT_SIGMA = 1e6
"""Error of a row that is left out: seconds, radians or ln. Its information is 1e-12 of
that of a reading to a second, and the square does not overflow."""
WIDTH = 10.0
"""Range of the values of a wrong reading: seconds, radians or ln. Its density, one over
this, is the price of leaving a reading out."""
EXPLANATION_FALL = 3.0
"""Largest difference in ln-density from the best explanation, a factor of 20. Less
probable explanations are not reported."""
MAX_SUSPECTS = 8
"""Largest number of clocks and sensors that are left out in turn, in the order of a
linear fit. Each is a search: a few seconds."""
MAX_EXCHANGES = 3
"""Largest number of exchanges that are solved for, those that lower chi squared most:
each is a search."""
MIN_ARRIVALS = 4
"""Smallest number of arrivals: three determine a position and a time."""


@runtime_checkable
class Refit(Protocol):
    """Function that solves for a log of the same rows with more numbers free."""

    def __call__(
        self, log: Observations, names: Sequence[str], /, *, follow_range: bool
    ) -> Solution:
        """Return the solution, with `range_profile` if `follow_range`."""
        ...


class Suspect(NamedTuple):
    """A clock or a sensor that may be wrong, and its rows."""

    kind: str
    name: str
    rows: Int[np.ndarray, " left_out"]


def explained_by(
    observations: Observations,
    solution: Solution,
    fits: bool,
    refit: Refit,
) -> tuple[WrongSensor, ...]:
    """Return the clocks and sensors without one of which a log fits.

    Pairs of sensors with whose positions exchanged all rows fit are returned as well. A
    clock or sensor is named if the other rows converge, identify every number and fit,
    and if its readings deviate from them by more than stated errors explain in one of a
    thousand logs. If all rows together have an answer too (perhaps kilotons far away,
    where laws scatter by seconds), the explanation must be a thousand times as
    probable, with the rows left out uniform within `WIDTH`.

    Args:
        observations: The log.
        solution: Solution of the whole log.
        fits: True if that is an answer.
        refit: Function that solves for a log of the same rows. The range of a charge
            outside a small array is computed for explanations only: it takes most of
            the time of a fit, and the density of the best optimum is enough to reject
            the others.

    Returns:
        The most probable first.
    """
    posterior = solution.posterior
    if is_long(posterior):
        return ()
    density_of_all = float(np.max(np.asarray(solution.optima.log_density)))
    known = len(observations) + int(np.sum(posterior.parameters.has_prior()))
    spare = known - solution.laplace.z.size
    possible = [s for s in suspects(observations, solution) if len(s.rows) < spare]
    found = []
    for suspect in each(
        _likeliest(*_densest(solution), possible)[:MAX_SUSPECTS], "sensors left out"
    ):
        try:
            log = _without(observations, suspect.rows)
            rest = refit(log, (), follow_range=False)
        except InputError:  # no scene gives the others a probability
            continue
        density = float(rest.optima.log_density[0])
        # the density of a left-out row by its huge error is replaced by that of a
        # uniform value
        left_out = float(log_noise(jnp.zeros(()), posterior.noise)) - math.log(
            LEFT_OUT_SIGMA
        )
        readings = int(np.sum(~observations.bounds()[suspect.rows]))
        density -= readings * (left_out + math.log(WIDTH))  # a bound has no density
        if fits and density < density_of_all - math.log(POOR / len(possible)):
            continue
        if not _judged(observations, rest, suspect, len(possible)):
            continue
        if range_profile(rest.posterior, rest.optima) is not None:
            rest = refit(log, (), follow_range=True)
        if wrong := _judged(observations, rest, suspect, len(possible)):
            found.append((density, wrong))
    for exchanged in _exchanges(observations, solution):
        try:
            rest = refit(exchanged.log, (), follow_range=False)
        except InputError:
            continue
        density = float(rest.optima.log_density[0])
        if density < density_of_all - math.log(POOR) or not _exchange(rest, exchanged):
            continue
        if range_profile(rest.posterior, rest.optima) is not None:
            rest = refit(exchanged.log, (), follow_range=True)
        if wrong := _exchange(rest, exchanged):
            found.append((density, wrong))
    if any(wrong.law_valid_rows for _, wrong in found):
        found = [pair for pair in found if pair[1].law_valid_rows]
    found.sort(key=lambda pair: -pair[0])
    likely = [
        wrong for density, wrong in found if found[0][0] - density < EXPLANATION_FALL
    ]
    return tuple(likely)


def lies_far(solution: Solution) -> bool:
    """Return True if a fitted position is farther away than the extent of the layout.

    Laws then scatter by more than any clock error, and every log fits.
    """
    posterior = solution.posterior
    searched = {name.partition(".")[0] for name in posterior.parameters.names}
    if not searched & {"charge_east_m", "charge_north_m"}:
        return False
    reach = posterior.misfit(jax.device_put(solution.laplace.z)).slant_range
    return bool(np.min(np.asarray(reach)) > np.asarray(layout_size(posterior)))


def is_contradicted(solution: Solution) -> bool:
    """Return True if the optimum of highest density is not the answer and does not fit.

    Far positions can be more probable in total than a position among the sensors that a
    single wrong reading contradicts.
    """
    posterior, z = _densest(solution)
    if np.array_equal(z, solution.laplace.z):
        return False
    left = standardised_residuals(posterior, z)
    p = p_value(*chi_squared(posterior, z, left, z.size))
    return p is not None and p < FITS


def _densest(solution: Solution) -> tuple[Posterior, Float[np.ndarray, " free"]]:
    """Return the optimum of highest density, and the posterior weighted there."""
    best = np.nanargmax(np.asarray(solution.optima.log_density))
    z = np.asarray(solution.optima.z)[best]
    return solution.posterior.weighed(jnp.asarray(z)), z


def suspects(observations: Observations, solution: Solution) -> list[Suspect]:
    """Return every clock that is not free, and every sensor with different rows."""
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
    """Return a log in which some rows have no weight."""
    scale = observations.error_scale()
    sigma = observations.sigma.copy()
    # sigma in the unit of the reading, for an error of LEFT_OUT_SIGMA on the error
    # scale
    given = np.where(np.isfinite(scale), scale / observations.sigma, 1.0)
    sigma[rows] = LEFT_OUT_SIGMA / given[rows]
    # These rows leave their record: as large shared errors they would fix the errors of
    # the other rows at 0.
    record = np.array(observations.records(), object)
    record[rows] = ""
    return replace(observations, sigma=sigma, record=tuple(record))


def _likeliest(
    posterior: Posterior, z: Float[np.ndarray, " free"], possible: Sequence[Suspect]
) -> list[Suspect]:
    """Return suspects in the order of the fall of chi squared without each (linear)."""
    falls = _falls(posterior, z, possible)
    order = (
        np.argsort(-np.array(falls), kind="stable") if falls else range(len(possible))
    )
    return [possible[int(k)] for k in order]


def _falls(
    posterior: Posterior, z: Float[np.ndarray, " free"], possible: Sequence[Suspect]
) -> list[float]:
    """Return the fall of chi squared without each suspect, for linear predictions.

    Without finite slopes the list is empty.
    """
    linear = _linear_fit(posterior, z)
    if linear is None:
        return []
    basis, left = linear

    def fall(suspect: Suspect) -> float:
        # leave-out formula of linear regression: r^T (1 - H)^-1 r of the rows left out
        free = np.eye(len(suspect.rows)) - basis[suspect.rows] @ basis[suspect.rows].T
        return float(left[suspect.rows] @ np.linalg.pinv(free) @ left[suspect.rows])

    return [fall(suspect) for suspect in possible]


def _linear_fit(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> tuple[Float[np.ndarray, "row rank"], Float[np.ndarray, " row"]] | None:
    """Return the column space of the slopes at a place, and the least-squares residual.

    Both are in standard deviations; None without finite slopes.
    """
    at = jnp.asarray(z)
    misfit = posterior.misfit(at)
    missed = jnp.asarray(least_error(np.asarray(misfit.residual), posterior))
    moved = np.asarray(whitened_rows(posterior, misfit, missed[:, None])[:, 0])
    slopes = np.asarray(whitened_jacobian(posterior, at)[: len(moved)])
    if not (np.isfinite(moved).all() and np.isfinite(slopes).all()):
        return None
    basis = np.linalg.svd(slopes / np.maximum(np.abs(slopes).max(0), 1e-300), False)[0]
    return basis, moved - basis @ (basis.T @ moved)


class Exchanged(NamedTuple):
    """A log with the positions of two sensors exchanged."""

    names: tuple[str, str]
    log: Observations


def _exchanges(observations: Observations, solution: Solution) -> list[Exchanged]:
    """Return the exchanges of two sensors' positions that lower chi squared most.

    Chi squared is that of a least-squares step from the optimum of highest density.
    Exchanged are the sensors without which it would fall most (`MAX_SUSPECTS`). Only
    exchanges that lower it are returned: none for a correct log.
    """
    posterior, z = _densest(solution)
    names = np.array(observations.sensor, object)
    place = observations.position
    placed = np.isnan(observations.slant_range) & np.isfinite(place).all(axis=1)
    sensors = [
        Suspect("sensor", name, rows)
        for name in dict.fromkeys(observations.sensor)
        for rows in [np.flatnonzero(names == name)]
        if placed[rows].all() and not np.ptp(place[rows], axis=0).any()
    ]
    now = _linear_fit(posterior, z)
    if now is None:
        return []
    found = []
    for one, other in combinations(_likeliest(posterior, z, sensors)[:MAX_SUSPECTS], 2):
        moved = place.copy()
        moved[one.rows], moved[other.rows] = place[other.rows[0]], place[one.rows[0]]
        layout = replace(posterior.layout, position=jnp.asarray(moved))
        then = _linear_fit(replace(posterior, layout=layout), z)
        if then is not None and np.sum(then[1] ** 2) < np.sum(now[1] ** 2):
            log = replace(observations, position=moved)
            found.append((float(np.sum(then[1] ** 2)), (one.name, other.name), log))
    found.sort(key=lambda entry: entry[0])
    return [Exchanged(pair, log) for _, pair, log in found[:MAX_EXCHANGES]]


def _exchange(rest: Solution, exchanged: Exchanged) -> ExchangedSensors | None:
    """Return the finding of an exchange; None if the log does not fit with it."""
    normal = rest.laplace
    if not (normal.converged and all(rest.identifiability.determined)):
        return None
    posterior, z = rest.posterior, normal.z
    left = standardised_residuals(posterior, z)
    chi2, dof = chi_squared(posterior, z, left, z.size)
    p = p_value(chi2, dof)
    if p is None or p < FITS:
        return None
    valid = np.asarray(posterior.misfit(jnp.asarray(z)).valid)
    return ExchangedSensors(
        name=exchanged.names[0],
        chi2=chi2,
        dof=dof,
        p_value=p,
        law_valid_rows=int(valid.sum()),
        estimates=marginals(posterior.parameters, normal),
        other=exchanged.names[1],
    )


def accused_sensors(
    observations: Observations, wrong: Sequence[WrongSensor]
) -> set[str]:
    """Return the sensors with wrong readings by any of the explanations."""
    names: set[str] = set()
    for one in wrong:
        if isinstance(one, WrongClock):
            of_clock = zip(observations.sensor, observations.clocks(), strict=True)
            names |= {sensor for sensor, clock in of_clock if clock == one.name}
        else:
            names.add(one.name)
        if isinstance(one, ExchangedSensors):
            names.add(one.other)
    return names


def other_explanations(
    observations: Observations,
    solution: Solution,
    suspected: Sequence[SuspectedOutlier],
) -> tuple[SeveralExplanations, ...]:
    """Return the sensors that explain a log as well as that of the largest outlier.

    Without one of them chi squared would fall by as much, within `EXPLANATION_FALL` in
    ln density. With one degree of freedom this is true for every sensor.
    """
    if not suspected or is_long(solution.posterior):
        return ()
    names = np.array(observations.sensor, object)
    sensors = [
        Suspect("sensor", name, np.flatnonzero(names == name))
        for name in dict.fromkeys(observations.sensor)
    ]
    without = _falls(solution.posterior, solution.laplace.z, sensors)
    falls = dict(zip((s.name for s in sensors), without, strict=False))
    worst = suspected[0].sensor
    others = tuple(
        name
        for name, fall in falls.items()
        if name != worst and fall > falls[worst] - 2 * EXPLANATION_FALL
    )
    return (SeveralExplanations(worst, others),) if others else ()


def _judged(
    observations: Observations, rest: Solution, suspect: Suspect, among: int
) -> WrongSensor | None:
    """Return the finding about a suspect; None if it does not explain the log."""
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
        # generalised least squares: one offset for all readings of the clock
        weights = np.linalg.solve(covariance, np.ones(len(missed)))
        offset = float(weights @ missed / weights.sum())
        sd = float(weights.sum() ** -0.5)
        apart = missed - offset
        alike = p_value(
            float(apart @ np.linalg.solve(covariance, apart)), len(missed) - 1
        )
        # readings that differ among themselves are not explained by an offset of their
        # clock
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
    # Bonferroni: any of the suspects could have been the worst by chance
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
    """Return the residuals of rows from the prediction by the rest, and covariance."""
    z = rest.laplace.z
    values, vectors = np.linalg.eigh(rest.laplace.covariance)
    axes = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    misfit = posterior.misfit(jnp.asarray(z))
    # central differences along the axes of the normal approximation: one standard
    # deviation is the scale on which the prediction has to be linear
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


def more_to_free(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    refit: Refit,
) -> MoreToFree | None:
    """Return the parameters to free so that a log fits; None if nothing helps.

    The origin time is tried first, then the position as well, then clocks that a flash
    and an arrival synchronise. If these are not enough, one wrong clock is searched and
    freed. Finally all clocks that the log distinguishes are freed: several may be
    wrong.

    Args:
        observations: The log, which the default scene does not fit.
        uncertain: The scene.
        solution: Solution with it.
        refit: Function that solves for a log with more numbers free.
    """
    arrivals = np.isin(observations.quantity, ARRIVALS).sum()
    blind = uncertain.source == NO_SCENE
    if not blind or arrivals < MIN_ARRIVALS or is_long(solution.posterior):
        return None
    sets = each(_candidates(observations, uncertain), "sets of numbers freed")
    last: tuple[Solution, tuple[str, ...]] | None = None
    for last in _refits(sets, observations, refit):
        if found := _as_more_to_free(*last):
            return found
    if last is not None:
        freed, names = last

        def refit_freed(log, names_too, /, *, follow_range):
            return refit(log, (*names, *names_too), follow_range=follow_range)

        wrong = explained_by(observations, freed, False, refit_freed)
        if wrong and isinstance(wrong[0], WrongClock) and wrong[0].parameter:
            first, both = wrong[0], (*names, wrong[0].parameter)
            return MoreToFree(both, first.p_value, first.estimates, first.name)
    sets = each(_all_clocks(observations, uncertain), "sets of clocks freed")
    tried = (_as_more_to_free(*one) for one in _refits(sets, observations, refit))
    return next(filter(None, tried), None)


def _refits(
    sets: Iterable[tuple[str, ...]], observations: Observations, refit: Refit
) -> Iterator[tuple[Solution, tuple[str, ...]]]:
    """Yield the solution of a log with each set of numbers free, and the set."""
    for names in sets:
        try:
            freed = refit(observations, names, follow_range=True)
        except InputError:  # the scene then leaves nothing a probability
            continue
        yield freed, names


def _all_clocks(
    observations: Observations, uncertain: UncertainScene
) -> list[tuple[str, ...]]:
    """Return sets of all clocks but the common one, with time, and with position."""
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    read = set(np.array(observations.clock, object)[timed])
    apart = [name for name in clocks_apart(observations) if name in read]
    if len(apart) < 2:
        return []
    every = tuple(f"{CLOCK_OFFSET}.{name}" for name in apart)
    return [
        new
        for names in (("origin_time_s",), (*PLACE, "origin_time_s"))
        if (new := _not_free((*names, *every), observations, uncertain))
    ]


def _not_free(
    names: Sequence[str], observations: Observations, uncertain: UncertainScene
) -> tuple[str, ...]:
    """Return the names that are not free yet; () if there are too few rows."""
    new = tuple(name for name in names if name not in uncertain.beliefs)
    spare = len(observations) - len(uncertain.beliefs) - len(new)
    return new if spare > 0 else ()


def _candidates(
    observations: Observations, uncertain: UncertainScene
) -> list[tuple[str, ...]]:
    """Return sets of parameters that rows can identify, the smallest first."""
    timed = bool(set(CLOCK_TIMES) & set(observations.quantity))
    origin = ("origin_time_s",) if timed else ()
    placed = bool(np.isnan(observations.slant_range).all())
    spread = np.unique(observations.position, axis=0)
    place = PLACE if placed and len(spread) >= 3 else ()
    clocks = tuple(f"{CLOCK_OFFSET}.{name}" for name in clocks_to_free(observations))
    found: list[tuple[str, ...]] = []
    for names in (origin, place, (*place, *origin), (*place, *origin, *clocks)):
        new = _not_free(names, observations, uncertain)
        if new and new not in found:
            found.append(new)
    if place and len(found) > 2 and found[1] == place:
        # a known time with an unknown position is no more probable, and costs a search
        del found[1]
    return found


def _as_more_to_free(freed: Solution, names: tuple[str, ...]) -> MoreToFree | None:
    """Return the finding of a solution; None if it does not fit."""
    normal = freed.laplace
    if not (normal.converged and all(freed.identifiability.determined)):
        return None
    if lies_far(freed):  # every log fits there
        return None
    posterior, z = freed.posterior, normal.z
    left = standardised_residuals(posterior, z)
    p = p_value(*chi_squared(posterior, z, left, z.size))
    if p is None or p < FITS:
        return None
    return MoreToFree(names, p, marginals(posterior.parameters, normal))
