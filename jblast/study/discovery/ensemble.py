"""How sure equations are: coefficients, and what is left over, in records made anew."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.progress import counted
from jblast.study.discovery.candidate_terms import Candidates
from jblast.study.discovery.flow import CLOSE, flow, misfit
from jblast.study.discovery.judge import PER_TERM, left_over, unlikely
from jblast.study.discovery.record import Record, Sides
from jblast.study.discovery.weak_form import PER_HALF_WIDTH


class Sureness(NamedTuple):
    """How sure the equations of some states are.

    Attributes:
        low: Lower end of the interval of each coefficient (`interval_level`).
        high: Upper end.
        odds: p of so much, so like itself and so like terms outside being left over,
            state by state (`Judgement`).
        likest: Name of the likest of the terms outside, state by state.
    """

    low: Float[np.ndarray, "state term"]
    high: Float[np.ndarray, "state term"]
    odds: list[tuple[float, float, float]]
    likest: list[str]


LEVEL = 0.9
"""Of an interval, nominal."""
FEWEST_OF_INTERVAL = 19
"""Members of which the 5 and 95 % quantiles are the least and the greatest."""


def interval_level(members: int) -> float:
    """Return the nominal level of an interval: 90 %, of fewer than 19 members less.

    The least and the greatest of them hold one more with (members - 1)/(members + 1).
    """
    return min(LEVEL, (members - 1) / (members + 1))


def basic_interval(
    own: Float[np.ndarray, "..."], off: Float[np.ndarray, "member ..."]
) -> Float[np.ndarray, "2 ..."]:
    """Return the ends of an interval: a number less how far off members come.

    Quantile p of so many members is the (members + 1) p-th of them, and the least or
    the greatest where there is none: its level is `interval_level`.
    """
    tail = 0.5 * (1.0 - LEVEL)
    return own - np.quantile(off, (1.0 - tail, tail), axis=0, method="weibull")


def ensemble_uncertainty(
    record: Record,
    candidates: Candidates,
    others: Candidates | None,
    own: Float[np.ndarray, "state term"],
    kept: Bool[np.ndarray, "state term"],
    members: int,
    rng: np.random.Generator,
) -> Sureness:
    """Make records with new noise, and find the coefficients in each.

    The equations make them; where they do not give the record back (`misfit`, all
    states), the smoothed states do, and there is no p.

    Args:
        record: What the equations were found in.
        candidates: Terms they were looked for among.
        others: Terms that what is left over is held against.
        own: Coefficients found.
        kept: Which terms they have.
        members: Of the ensemble.
        rng: Of the noise.
    """
    made = flow(
        candidates.evaluate,
        own,
        record.smooth[0],
        record.time_s,
        record.inputs,
        np.std(record.states, axis=0),
        held=record.held,
    )
    off = misfit(made, record.states, record.noise_in_unit)
    reproduced = bool(np.all(off <= CLOSE))
    if record.relative:
        reproduced = reproduced and bool(np.all(made > 0.0))
    base = made if reproduced else record.smooth
    apart = 2 * PER_HALF_WIDTH

    def numbers(sides: Sides):
        terms = integrals(record, sides, candidates)
        beyond = np.zeros((len(terms), 0))
        if others is not None:
            beyond = integrals(record, sides, others)
        coefficients = coefficients_of(terms, sides.left, kept)
        over = [
            left_over(terms[:, row], sides.left[:, state], beyond, apart)
            for state, row in enumerate(kept)
        ]
        return coefficients, np.stack([o[0] for o in over]), [o[1] for o in over]

    through = counted(members, "records with new noise")
    found, over = [], []
    for member in range(members):
        sides = record.sides_of(record.with_noise(base, rng))
        coefficients, over_by, _ = numbers(sides)
        found.append(coefficients)
        over.append(over_by)
        through(member + 1)
    middle = own if reproduced else numbers(record.sides_of(base))[0]
    low, high = basic_interval(own, np.stack(found) - middle)
    _, numbers_own, shares = numbers(record.sides)
    odds = np.full((len(own), 3), np.nan)
    if reproduced:
        for state in range(len(own)):
            odds[state] = unlikely(numbers_own[state], np.stack(over)[:, state])
    likest = [""] * len(own)
    if others is None:
        odds[:, 2] = np.nan
    else:
        likest = [others.names[int(np.argmax(share))] for share in shares]
    chances = [(float(a), float(b), float(c)) for a, b, c in odds]
    return Sureness(low, high, chances, likest)


def outside_terms(
    record: Record,
    candidates: Candidates,
    outside: Candidates | None,
) -> Candidates | None:
    """Return the terms outside, if they are numbers and few enough to tell."""
    if outside is None:
        return None
    new = np.array([name not in candidates.names for name in outside.names])
    names = tuple(np.asarray(outside.names)[new].tolist())
    with np.errstate(over="ignore", invalid="ignore"):  # not tried then
        finite = np.all(np.isfinite(outside.evaluate(record.sides.columns)))
    few = PER_TERM * len(names) <= len(record.windows.centre)
    if not (names and finite and few):
        return None
    return Candidates(names, lambda values: outside.evaluate(values)[:, new])


def integrals(
    record: Record, sides: Sides, candidates: Candidates
) -> Float[np.ndarray, "window term"]:
    """Return the integral of each candidate over each window."""
    values = candidates.evaluate(sides.columns) * record.rate[:, None]
    return record.windows.integral @ values


def coefficients_of(
    terms: Float[np.ndarray, "window term"],
    left: Float[np.ndarray, "window state"],
    kept: Bool[np.ndarray, "state term"],
) -> Float[np.ndarray, "state term"]:
    """Return each state's coefficients by least squares, zero for terms not kept."""
    found = np.zeros(kept.shape)
    for state, row in enumerate(kept):
        found[state, row] = np.linalg.lstsq(terms[:, row], left[:, state])[0]
    return found
