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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError
from jblast.inference.answer import Answer, layout_size
from jblast.inference.density import LEFT_OUT_SIGMA
from jblast.inference.fitting.goodness_of_fit import (
    FITS,
    POOR,
    goodness,
    p_value,
    tail_probability,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.wrong import (
    ExchangedSensors,
    SuspectedOutlier,
    WrongClock,
    WrongSensor,
)
from jblast.inference.noise import log_noise
from jblast.inference.posterior.parameters import Estimate
from jblast.inference.posterior.posterior import own_and_shared_errors
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.clocks import clocks_apart, has_common_clock
from jblast.observations.scenes import PLACE, clocks_to_free
from jblast.parameters import CLOCK_OFFSET
from jblast.progress import each
from jblast.quantities import ARRIVALS
from jblast.results import Note, warning
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

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
LONG = 100
"""Largest number of rows of a log whose sensors are left out: each is a fit, and one
wrong sensor of many changes little."""
PREDICTED = 400
"""Draws of the other rows by which rows left out are predicted: their covariance is
then precise to 5 %."""
MIN_ARRIVALS = 4
"""Smallest number of arrivals: three determine a position and a time."""


Refit = Callable[[Observations, Sequence[str]], Solution]
"""Function that solves for a log of the same rows with more numbers free."""


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
    clock or sensor is named if the other rows fit, and its readings deviate from them
    by more than stated errors explain in one of a thousand logs. In addition, either
    all rows together have no answer, but the other rows have one; or the explanation is
    a thousand times as probable as that of all rows (perhaps kilotons far away, where
    laws scatter by seconds), with the rows left out uniform within `WIDTH`.

    Args:
        observations: The log.
        solution: Solution of the whole log.
        fits: True if that is an answer.
        refit: Function that solves for a log of the same rows.

    Returns:
        The most probable first.
    """
    if is_long(observations):
        return ()
    names = solution.answer.names
    spare = len(observations) + int(solution.answer.has_prior.sum()) - len(names)
    possible = [s for s in suspects(observations, solution) if len(s.rows) < spare]
    evidence_of_all = solution.draws.log_evidence
    noise = solution.density.noise
    # the density of a left-out row by its huge error is replaced by that of a uniform
    # value
    left_out = float(log_noise(jnp.zeros(()), noise)) - math.log(LEFT_OUT_SIGMA)
    found: list[tuple[float, WrongSensor]] = []
    for suspect in each(
        _likeliest(solution.answer, possible)[:MAX_SUSPECTS], "sensors left out"
    ):
        try:
            rest = refit(_without(observations, suspect.rows), ())
        except InputError:  # no scene gives the others a probability
            continue
        readings = int(np.sum(~observations.bounds()[suspect.rows]))
        evidence = rest.draws.log_evidence
        evidence -= readings * (left_out + math.log(WIDTH))  # a bound has no density
        is_better = evidence > evidence_of_all - math.log(POOR / len(possible))
        if not is_better and (fits or not rest.is_answer):
            continue
        if wrong := _judged(observations, rest, suspect, len(possible)):
            found.append((evidence, wrong))
    for exchanged in _exchanges(observations, solution):
        try:
            rest = refit(exchanged.log, ())
        except InputError:
            continue
        evidence = rest.draws.log_evidence
        if evidence < evidence_of_all - math.log(POOR):
            continue
        if wrong := _exchange(rest, exchanged):
            found.append((evidence, wrong))
    if any(wrong.law_valid_rows for _, wrong in found):
        found = [pair for pair in found if pair[1].law_valid_rows]
    found.sort(key=lambda pair: -pair[0])
    likely = [
        wrong for evidence, wrong in found if found[0][0] - evidence < EXPLANATION_FALL
    ]
    return tuple(likely)


def is_long(observations: Observations) -> bool:
    """Return True for a log with too many rows to be fitted again and again."""
    return len(observations) > LONG


def lies_far(solution: Solution) -> bool:
    """Return True if a fitted position is farther away than the extent of the layout.

    Laws then scatter by more than any clock error, and every log fits.
    """
    answer = solution.answer
    searched = {name.partition(".")[0] for name in answer.names}
    if not searched & {"charge_east_m", "charge_north_m"}:
        return False
    return bool(answer.slant_range.min() > layout_size(solution.density))


def suspects(observations: Observations, solution: Solution) -> list[Suspect]:
    """Return every clock that is not free, and every sensor with different rows."""
    clocks = np.array(observations.clocks())
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    names = solution.answer.names
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


def _likeliest(answer: Answer, possible: Sequence[Suspect]) -> list[Suspect]:
    """Return suspects in the order of the fall of chi squared without each (linear)."""
    falls = _falls(answer, possible)
    order = (
        np.argsort(-np.array(falls), kind="stable") if falls else range(len(possible))
    )
    return [possible[int(k)] for k in order]


def _falls(answer: Answer, possible: Sequence[Suspect]) -> list[float]:
    """Return the fall of chi squared without each suspect, for linear predictions.

    Without finite slopes the list is empty.
    """
    precision, left = _linear_fit(answer)
    if precision is None:
        return []

    def fall(suspect: Suspect) -> float:
        # the residual of rows left out, and its covariance, from those of all rows
        part = precision[np.ix_(suspect.rows, suspect.rows)]
        own = left[suspect.rows]
        return float(own @ np.linalg.pinv(part, hermitian=True) @ own)

    return [fall(suspect) for suspect in possible]


def _linear_fit(answer: Answer):
    """Return the precision of the rows, and it times the residual.

    The fitted numbers are integrated out. Without finite slopes there is None.
    """
    unit = np.eye(len(answer.missed))
    weighted = answer.weigh(np.concatenate([answer.slopes, unit], axis=1))
    count = len(answer.names)
    by_slopes, precision = weighted[:, :count], weighted[:, count:]
    known = answer.slopes.T @ by_slopes + np.diag(answer.has_prior)
    if not np.isfinite(known).all():
        return None, np.zeros(0)
    left = precision - by_slopes @ np.linalg.pinv(known, hermitian=True) @ by_slopes.T
    missed = np.where(answer.rows.is_bound, 0.0, answer.missed)
    return left, left @ missed


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
    answer = solution.answer
    names = np.array(observations.sensor, object)
    place = observations.position
    placed = np.isnan(observations.slant_range) & np.isfinite(place).all(axis=1)
    sensors = [
        Suspect("sensor", name, rows)
        for name in dict.fromkeys(observations.sensor)
        for rows in [np.flatnonzero(names == name)]
        if placed[rows].all() and not np.ptp(place[rows], axis=0).any()
    ]
    precision, left = _linear_fit(answer)
    if precision is None:
        return []
    missed = np.where(answer.rows.is_bound, 0.0, answer.missed)
    found = []
    likely = _likeliest(answer, sensors)[:MAX_SUSPECTS]
    for one, other in combinations(likely, 2):
        moved = place.copy()
        moved[one.rows], moved[other.rows] = place[other.rows[0]], place[one.rows[0]]
        layout = replace(answer.density.layout, position=jnp.asarray(moved))
        there = replace(answer, density=replace(answer.density, layout=layout))
        then, after = _linear_fit(there)
        if then is None:
            continue
        of_other = np.where(there.rows.is_bound, 0.0, there.missed)
        if (chi2 := float(of_other @ after)) < missed @ left:
            log = replace(observations, position=moved)
            found.append((chi2, (one.name, other.name), log))
    found.sort(key=lambda entry: entry[0])
    return [Exchanged(pair, log) for _, pair, log in found[:MAX_EXCHANGES]]


def _exchange(rest: Solution, exchanged: Exchanged) -> ExchangedSensors | None:
    """Return the finding of an exchange; None if the log does not fit with it."""
    if not rest.is_answer:
        return None
    chi2, dof = goodness(rest)
    p = p_value(chi2, dof)
    if p is None or p < FITS:
        return None
    return ExchangedSensors(
        name=exchanged.names[0],
        chi2=chi2,
        dof=dof,
        p_value=p,
        law_valid_rows=int(rest.answer.valid.sum()),
        estimates=rest.identified.found,
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
) -> list[Note]:
    """Return the sensors that explain a log as well as that of the largest outlier.

    Without one of them chi squared would fall by as much, within `EXPLANATION_FALL` in
    ln density. With one degree of freedom this is true for every sensor.
    """
    if not suspected or is_long(observations):
        return []
    names = np.array(observations.sensor, object)
    sensors = [
        Suspect("sensor", name, np.flatnonzero(names == name))
        for name in dict.fromkeys(observations.sensor)
    ]
    without = _falls(solution.answer, sensors)
    falls = dict(zip((s.name for s in sensors), without, strict=False))
    worst = suspected[0].sensor
    others = tuple(
        name
        for name, fall in falls.items()
        if name != worst and fall > falls[worst] - 2 * EXPLANATION_FALL
    )
    if not others:
        return []
    return [warning("several_explanations", suspected=worst, others=others)]


def _judged(
    observations: Observations, rest: Solution, suspect: Suspect, among: int
) -> WrongSensor | None:
    """Return the finding about a suspect; None if it does not explain the log."""
    if not rest.draws.reliable:
        return None
    chi2, dof = goodness(rest)
    kept = rest.answer.rows.is_bound & (rest.answer.own == 0)
    dof -= len(suspect.rows) - int(kept[suspect.rows].sum())
    p = p_value(chi2, dof)
    if p is None or p < FITS:
        return None
    valid = np.delete(rest.answer.valid, suspect.rows)
    missed, covariance = _missed(observations, rest, suspect.rows)
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
        rarity = float(tail_probability(np.array([offset / sd]), rest.density.noise)[0])
        first = next((clock for clock in observations.clock if clock), "")
        is_set = suspect.name == first and not has_common_clock(observations)
        parameter = None if is_set else f"{CLOCK_OFFSET}.{suspect.name}"
        clock = {"offset_s": offset, "offset_sd": sd, "parameter": parameter}
    else:
        far = missed / np.sqrt(np.diag(covariance))
        rarity = float(tail_probability(far, rest.density.noise).min()) * len(missed)
    # Bonferroni: any of the suspects could have been the worst by chance
    if rarity * among > POOR:
        return None
    return (WrongClock if clock else WrongSensor)(
        name=suspect.name,
        chi2=chi2,
        dof=dof,
        p_value=p,
        law_valid_rows=int(valid.sum()),
        estimates=rest.identified.found,
        **clock,
    )


def _missed(
    observations: Observations, rest: Solution, rows: Int[np.ndarray, " out"]
) -> tuple[Float[np.ndarray, " out"], Float[np.ndarray, "out out"]]:
    """Return the residuals of rows from the prediction by the rest, and covariance."""
    draws, answer = rest.draws, rest.answer
    there = rest.identified.resampled(PREDICTED)
    predicted = rest.density.seen_with(draws.values[there]).predicted[:, rows]
    spread = np.atleast_2d(np.cov(predicted.T))
    sigma, shared = own_and_shared_errors(observations)
    shared = shared[rows]
    own = sigma[rows] ** 2 + answer.own_scatter[rows]
    missed = np.where(answer.rows.is_bound, answer.own * answer.own_sd, answer.missed)
    of_laws = answer.effects_among(rows)
    return missed[rows], spread + shared @ shared.T + of_laws + np.diag(own)


def more_to_free(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    refit: Refit,
    *,
    fits: bool,
) -> list[Note]:
    """Return the parameters to free so that a log fits, if that helps.

    The origin time is tried first, then the position as well, then clocks that a flash
    and an arrival synchronise. If these are not enough, one wrong clock is searched and
    freed. Finally all clocks that the log distinguishes are freed: several may be
    wrong.

    Args:
        observations: The log, which the default scene does not fit.
        uncertain: The scene.
        solution: Solution with it.
        refit: Function that solves for a log with more numbers free.
        fits: True if the solution fits, without a place: far away every log does. The
            freed numbers must then be a thousand times as probable, clocks uniform
            within `WIDTH`.
    """
    arrivals = np.isin(observations.quantity, ARRIVALS).sum()
    blind = uncertain.source == NO_SCENE
    if not blind or arrivals < MIN_ARRIVALS or is_long(observations):
        return []
    sets = each(_candidates(observations, uncertain), "sets of numbers freed")
    last: tuple[Solution, tuple[str, ...]] | None = None
    least = solution.draws.log_evidence - math.log(POOR) if fits else -math.inf
    for last in _refits(sets, observations, refit):
        if found := _as_more_to_free(*last, least):
            return found
    if last is not None and not fits:
        freed, names = last

        def refit_freed(log, names_too):
            return refit(log, (*names, *names_too))

        wrong = explained_by(observations, freed, False, refit_freed)
        if wrong and isinstance(wrong[0], WrongClock) and wrong[0].parameter:
            first, both = wrong[0], (*names, wrong[0].parameter)
            return [_to_free(both, first.p_value, first.estimates, first.name)]
    sets = each(_all_clocks(observations, uncertain), "sets of clocks freed")
    tried = (
        _as_more_to_free(*one, least) for one in _refits(sets, observations, refit)
    )
    return next(filter(None, tried), [])


def _refits(
    sets: Iterable[tuple[str, ...]], observations: Observations, refit: Refit
) -> Iterator[tuple[Solution, tuple[str, ...]]]:
    """Yield the solution of a log with each set of numbers free, and the set."""
    for names in sets:
        try:
            freed = refit(observations, names)
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


def _as_more_to_free(
    freed: Solution, names: tuple[str, ...], least: float
) -> list[Note]:
    """Return the note on a solution, if it fits.

    Args:
        freed: The solution.
        names: Freed numbers.
        least: Smallest ln of the evidence.
    """
    clocks = sum(name.startswith(f"{CLOCK_OFFSET}.") for name in names)
    if freed.draws.log_evidence - clocks * math.log(WIDTH) < least:
        return []
    if not freed.is_answer or lies_far(freed):  # every log fits far away
        return []
    p = p_value(*goodness(freed))
    if p is None or p < FITS:
        return []
    return [_to_free(names, p, freed.identified.found)]


def _to_free(
    names: tuple[str, ...], p: float, estimates: Mapping[str, Estimate], clock: str = ""
) -> Note:
    """Return the note on parameters to free, with the masses that follow."""
    masses = {
        name: estimate
        for name, estimate in estimates.items()
        if name.partition(".")[0] == "charge_mass_kg"
    }
    found = {"parameters": names, "p_value": p, "masses": masses}
    if clock:
        return warning("clock_to_free", clock=clock, **found)
    return warning("more_to_free", **found)
