"""At which noise discovery breaks: the same laws looked for in worse and worse data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jblast.errors import InputError
from jblast.study.discovery.cases import Case
from jblast.study.discovery.discover import THRESHOLD, Discovery, discover
from jblast.study.discovery.replay import replay
from jblast.study.discovery.shock import shock_slowing

NOISES = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Shares of a state's standard deviation; of the radius itself for a shock."""
SEEDS = 20
MEMBERS = 40
"""Of each ensemble: enough for what is most likely, and for rough quantiles."""


@dataclass(frozen=True)
class Outcome:
    """What came out of the noisy records of one equation.

    Attributes:
        case: What was to be found.
        state: Whose equation.
        noise: Share of the state's standard deviation, or of the radius.
        seeds: Records tried.
        exact: Share of them in which exactly the true terms came out.
        missing: Mean number of true terms that did not.
        false: Mean number of terms that are not true.
        error: Median over the exact ones of the largest relative error of a
            coefficient; NaN where none was exact.
        covered: Share of the true coefficients of the exact ones inside their 90 %
            intervals, which are nominal.
        reproduced: Share whose equations, integrated, give the clean record back.
        law: Share judged to foretell stretches its coefficients have not seen.
        whole: Share of which nothing is left over that noise would not leave.
    """

    case: str
    state: str
    noise: float
    seeds: int
    exact: float
    missing: float
    false: float
    error: float
    covered: float
    reproduced: float
    law: float
    whole: float


def noise_sweep(
    case: Case, noises: Sequence[float] = NOISES, seeds: int = SEEDS
) -> list[Outcome]:
    """Look for a case's equations in records with noise, seed after seed."""
    return [
        outcome for noise in noises for outcome in _outcomes(case, noise, range(seeds))
    ]


def noisy_states(case: Case, noise: float, seed: int) -> np.ndarray:
    """Return a record with normal noise, independent from row to row."""
    drawn = noise * np.random.default_rng(seed).standard_normal(case.states.shape)
    if case.shock:
        return case.states * np.exp(drawn)
    return case.states + drawn * np.std(case.states, axis=0)


def found_in(case: Case, states: np.ndarray, seed: int) -> Discovery:
    """Look for the equations of a case in a record of it."""
    if case.shock:
        slowing = shock_slowing(
            case.time_s, states[:, 0], threshold=THRESHOLD, members=MEMBERS, seed=seed
        )
        return slowing.discovery
    return discover(
        case.time_s,
        states,
        case.inputs,
        names=case.names,
        candidates=case.candidates,
        outside=case.outside,
        held=case.held,
        members=MEMBERS,
        seed=seed,
    )


def _outcomes(case: Case, noise: float, seeds: Sequence[int]) -> list[Outcome]:
    """Return one outcome for each state."""
    rows: list[list[tuple[float, ...]]] = [[] for _ in case.truth]
    for seed in seeds:
        try:
            found = found_in(case, noisy_states(case, noise, seed), seed)
        except InputError:  # noise so large that the radius shrinks somewhere
            for row, true in zip(rows, case.truth.values(), strict=True):
                row.append((0.0, float(len(true)), 0.0, np.nan, np.nan, 0.0, 0.0, 0.0))
            continue
        again = replay(
            found, case.time_s, case.states, case.inputs, held=case.held, noise=False
        )
        for state, true in enumerate(case.truth.values()):
            judged = found.judged[state]
            rest = again.reproduced[state], judged.law, judged.whole
            rows[state].append((*_against(found, state, true), *map(float, rest)))
    return [
        Outcome(case.name, state, noise, len(row), *_summary(row))
        for state, row in zip(case.truth, rows, strict=True)
    ]


def _against(
    found: Discovery, state: int, true: dict[str, float]
) -> tuple[float, float, float, float, float]:
    """Return whether exact, terms missing, false ones, error and share covered."""
    terms = set(found.terms(state))
    missing, false = float(len(set(true) - terms)), float(len(terms - set(true)))
    if missing or false:
        return 0.0, missing, false, np.nan, np.nan
    place = [found.candidates.names.index(name) for name in true]
    value = np.array(list(true.values()))
    error = np.max(np.abs(found.coefficients[state, place] / value - 1.0))
    inside = (found.low[state, place] <= value) & (value <= found.high[state, place])
    return 1.0, 0.0, 0.0, float(error), float(np.mean(inside))


def _summary(rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
    """Return the means, and the median of the errors of the exact ones."""
    exact, missing, false, error, covered, *shares = np.array(rows, float).T
    any_exact = bool(np.any(exact))
    return (
        float(np.mean(exact)),
        float(np.mean(missing)),
        float(np.mean(false)),
        float(np.nanmedian(error)) if any_exact else np.nan,
        float(np.nanmean(covered)) if any_exact else np.nan,
        *(float(np.mean(share)) for share in shares),
    )
