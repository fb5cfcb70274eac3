"""What is to be told of a discovery: its equations, their terms, what is doubtful."""

import numpy as np

from jblast.report.discovery.answer import (
    DiscoveryAnswer,
    ExchangeableTerms,
    FoundEquation,
    FurtherEquations,
    KeptTerm,
    LeftOutTerm,
    NominalInterval,
)
from jblast.report.discovery.doubts import certain, doubts
from jblast.report.numbers import significant
from jblast.study.discovery.discover import Discovery
from jblast.study.discovery.replay import Replay

HELD = (0.73, 1.0)
"""Share of noisy records whose 90 % interval held the truth; least and greatest of the
cases and noises simulated, where the true terms came out
(calibration/results/discovery.txt)."""
MIN_SHARE = 0.05
"""Share of the ensemble from which a term left out is told of."""


def discovery_answer(
    found: Discovery,
    again: Replay,
    further: tuple[Discovery, Replay] | None = None,
    *,
    rows: int,
    inputs: tuple[str, ...],
    threshold: float,
    members: int,
    seed: int,
) -> DiscoveryAnswer:
    """Return what is to be told of equations that were found.

    Args:
        found: The equations.
        again: What they give, integrated.
        further: The same among products of one column more, where that was tried.
        rows: Of the trajectory.
        inputs: Columns that drive it.
        threshold: Least share of a derivative for a term to stay.
        members: Of the ensemble.
        seed: Of its noise.
    """
    more = None
    if further is not None:
        words = {
            name: equation_text(further[0], state)
            for state, name in enumerate(found.states)
        }
        more = FurtherEquations(certain(*further), words)
    return DiscoveryAnswer(
        rows=rows,
        state=tuple(found.states),
        input=inputs,
        candidates=tuple(found.candidates.names),
        threshold=threshold,
        ensemble=members,
        seed=seed,
        certain=certain(found, again),
        equations={
            name: found_equation(found, again, state)
            for state, name in enumerate(found.states)
        },
        one_degree_more=more,
        interval=NominalInterval(found.level, HELD),
        repeated=tuple(found.repeated),
        reproduced=all(again.reproduced),
    )


def found_equation(found: Discovery, again: Replay, state: int) -> FoundEquation:
    """Return what is to be told of one equation."""
    judged = found.judged[state]
    return FoundEquation(
        equation=equation_text(found, state),
        terms=kept_terms(found, state),
        left_out=left_out_terms(found, state),
        exchangeable=tuple(
            ExchangeableTerms(term, other) for term, other in found.exchangeable[state]
        ),
        noise_sd=float(found.noise_sd[state]),
        misfit=float(again.misfit[state]),
        reproduced=again.reproduced[state],
        law=bool(found.terms(state)) and judged.law,
        doubts=tuple(doubts(found, again, state)),
        skill_not_seen=judged.skill,
        p_excess=judged.excess,
        p_serial=judged.serial,
        p_outside=judged.outside,
    )


def kept_terms(found: Discovery, state: int) -> tuple[KeptTerm, ...]:
    """Return the terms of an equation."""
    return tuple(
        KeptTerm(
            term=found.candidates.names[place],
            coefficient=float(found.coefficients[state, place]),
            q05=float(found.low[state, place]),
            q95=float(found.high[state, place]),
            inclusion=float(found.inclusion[state, place]),
        )
        for place in np.flatnonzero(found.coefficients[state])
    )


def left_out_terms(found: Discovery, state: int) -> tuple[LeftOutTerm, ...]:
    """Return the terms that only some of the ensemble had, if not few of it."""
    share = found.inclusion[state]
    left = (found.coefficients[state] == 0.0) & (share >= MIN_SHARE)
    return tuple(
        LeftOutTerm(found.candidates.names[place], float(share[place]))
        for place in np.flatnonzero(left)
    )


def equation_text(found: Discovery, state: int) -> str:
    """Return one equation: d(u)/dt = -0.45 u - 0.01 |u| u."""
    row = found.coefficients[state]
    words = []
    for place in np.flatnonzero(row):
        sign = "-" if row[place] < 0.0 else "+"
        term = found.candidates.names[place]
        words.append(
            f"{sign} {significant(abs(row[place]), 4)}"
            + ("" if term == "1" else f" {term}")
        )
    right = " ".join(words).removeprefix("+ ") or "0 (no term is certain)"
    if right.startswith("- "):
        right = "-" + right[2:]
    return f"d({found.states[state]})/dt = {right}"
