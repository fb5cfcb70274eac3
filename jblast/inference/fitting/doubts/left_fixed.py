"""What the default scene holds fixed, and without which no scene fits a log."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from jblast.errors import InputError
from jblast.inference.fitting.findings import MoreToFree, WrongClock
from jblast.inference.fitting.goodness_of_fit import (
    FITS,
    chi_squared,
    p_value,
    standardised_residuals,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.suspects import explained_by, lies_far
from jblast.inference.mode.laplace import marginals
from jblast.inference.mode.row_subset import is_long
from jblast.observations import Observations
from jblast.observations.clocks import clocks_apart
from jblast.observations.scenes import PLACE, clocks_to_free
from jblast.parameters import CLOCK_OFFSET
from jblast.progress import each
from jblast.quantities import ARRIVALS, CLOCK_TIMES
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

SCATTER = 0.015
"""Of travel times, as a share of them: 1 % a shot and 1 % a record, declared."""
SLOWEST = 300.0
"""Of sound, in the coldest air that people stand in [m/s]."""
TIMES_SIGMA = 5.0
"""A difference of arrivals this large is no error of reading or of a law."""
FEWEST = 4
"""Arrivals, of which three tell a place and a time."""
Refit = Callable[[Observations, Sequence[str]], Solution]


def more_to_free(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    refit: Refit,
) -> MoreToFree | None:
    """Return what to free beside the mass so that a log fits; None if nothing does.

    Tried are the origin time, then the place too, then clocks that a flash and a bang
    set. Where none of these is enough, a clock that is wrong may be: it is free, too.
    At last all clocks are that the log names apart: more than one may be wrong.

    Args:
        observations: The log, which the default scene does not fit.
        uncertain: The scene.
        solution: What was found with it.
        refit: Solves for a log with more numbers free.
    """
    arrivals = np.isin(observations.quantity, ARRIVALS).sum()
    blind = uncertain.source == NO_SCENE
    if not blind or arrivals < FEWEST or is_long(solution.posterior):
        return None
    sets = each(_candidates(observations, uncertain), "sets of numbers freed")
    last: tuple[Solution, tuple[str, ...]] | None = None
    for last in _refits(sets, observations, refit):
        if found := _judged(*last):
            return found
    if last is None:
        return None
    freed, names = last
    wrong = explained_by(observations, freed, False, lambda log: refit(log, names))
    if wrong and isinstance(wrong[0], WrongClock) and wrong[0].parameter:
        first, both = wrong[0], (*names, wrong[0].parameter)
        return MoreToFree(both, first.p_value, first.estimates, first.name)
    sets = each(_all_clocks(observations, uncertain), "sets of clocks freed")
    tried = (_judged(*one) for one in _refits(sets, observations, refit))
    return next(filter(None, tried), None)


def _refits(
    sets: Iterable[tuple[str, ...]], observations: Observations, refit: Refit
) -> Iterator[tuple[Solution, tuple[str, ...]]]:
    """Go through what a log says with each set of numbers free, and the set."""
    for names in sets:
        try:
            freed = refit(observations, names)
        except InputError:  # the scene then leaves nothing a probability
            continue
        yield freed, names


def _all_clocks(
    observations: Observations, uncertain: UncertainScene
) -> list[tuple[str, ...]]:
    """Return every clock that the log names but the common one, and place and time."""
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
    """Return which of names are not free yet; none if the rows are too few for them."""
    new = tuple(name for name in names if name not in uncertain.beliefs)
    spare = len(observations) - len(uncertain.beliefs) - len(new)
    return new if spare > 0 else ()


def _candidates(
    observations: Observations, uncertain: UncertainScene
) -> list[tuple[str, ...]]:
    """Return what might be freed, the least first, as far as rows can tell it."""
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
        del found[1]  # a place at a known time is no more likely, and costs as much
    if len(found) > 1 and found[0] == origin and out_of_order(observations, uncertain):
        del found[0]  # each set is a program of its own to compile, some 10 s
    return found


def out_of_order(observations: Observations, uncertain: UncertainScene) -> bool:
    """Return whether a sensor heard the air wave well before a nearer one did.

    Then no origin time is enough: at a fixed place, in still air, any mass is heard the
    later the further off. Laws scatter by a share of the travel time, which is taken as
    that of sound.

    Args:
        observations: The log.
        uncertain: The scene; with a place that is free, or wind, nothing is said.
    """
    scene = uncertain.scene
    still = not (float(scene.air.wind_east) or float(scene.air.wind_north))
    free = {"wind_east_m_s", "wind_north_m_s", *PLACE} & set(uncertain.beliefs)
    if scene.others or scene.charge.range_m is not None or free or not still:
        return False
    heard = np.array(observations.quantity) == "air_arrival_s"
    place = observations.position - np.asarray(scene.charge.position_m, float)
    reach = np.where(heard, np.linalg.norm(place, axis=1), np.nan)
    allowed = np.hypot(np.nan_to_num(observations.sigma), SCATTER * reach / SLOWEST)
    earliest = observations.value - TIMES_SIGMA * allowed
    latest = observations.value + TIMES_SIGMA * allowed
    clocks = np.array(observations.clock)
    for clock in set(observations.clock):
        rows = np.flatnonzero((clocks == clock) & np.isfinite(earliest))
        rows = rows[np.argsort(reach[rows])]
        nearer = np.maximum.accumulate(earliest[rows])
        if np.any(nearer[:-1] > latest[rows[1:]]):
            return True
    return False


def _judged(freed: Solution, names: tuple[str, ...]) -> MoreToFree | None:
    """Return what is to be told of a solution, None if it is no answer."""
    normal = freed.laplace
    if not (normal.converged and all(freed.identifiability.determined)):
        return None
    if lies_far(freed):  # where every log fits
        return None
    posterior, z = freed.posterior, normal.z
    left = standardised_residuals(posterior, z)
    p = p_value(*chi_squared(posterior, z, left, z.size))
    if p is None or p < FITS:
        return None
    return MoreToFree(names, p, marginals(posterior.parameters, normal))
