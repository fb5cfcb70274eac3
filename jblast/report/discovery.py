"""The answer of `jblast discover`: equations, and evidence against them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jblast.discovery.discover import (
    MIN_MEMBERS,
    SEGMENTS,
    SIGNIFICANCE,
    Discovery,
    Replay,
)
from jblast.discovery.law_search import certain
from jblast.report.words import joined, significant
from jblast.results import Document

COVERAGE = (0.73, 1.0)
"""Coverage of the 90 % intervals in simulated records with noise: least and largest of
the cases and noise levels, where the true terms were found
(calibration/results/discovery.txt)."""
MIN_SHARE = 0.05
"""Share of the ensemble from which an excluded term is reported: below 1 in 20 it is
chance at the 5 % level."""


MAX_JUMPS = 5
"""Largest number of rows listed."""


def discovery_text(
    found: Discovery, again: Replay, further: tuple[Discovery, Replay] | None = None
) -> str:
    """Return the equations with their terms, validation and warnings.

    Args:
        found: The equations.
        again: The integrated equations.
        further: Equations and integration with products of one column more, if tried.
    """
    lines = []
    for state, name in enumerate(found.states):
        doubt = doubts_text(found, again, state)
        if doubt:
            lines += [doubt, *_further_lines(further, state), ""]
        skill, skill_words = found.judged[state].skill, "the integration diverges"
        held = "held-out data"
        if found.segments > SEGMENTS:
            held += f", {found.segments} segments"
        if math.isfinite(skill):
            skill_words = (
                f"the squared error is {100.0 * max(skill, 0.0):.1f} % smaller than "
                "that of a constant prediction"
            )
        lines += [equation_text(found, state), ""]
        lines += _terms_lines(found, state)
        lines += [
            f"  {_replay_words(found, again, state)} (noise of {name}: "
            f"{significant(found.noise_sd[state])})",
            f"  {held}: {skill_words}",
            "",
        ]
    if found.repeated:
        lines += [
            "Terms left out, as sums of other terms equal them on this record: "
            f"{', '.join(found.repeated)}",
            "",
        ]
    return "\n".join(lines)


def _terms_lines(found: Discovery, state: int) -> list[str]:
    lines = []
    terms = kept_terms(found, state)
    width = max((len(kept.term) for kept in terms), default=0)
    for kept in terms:
        low, high = (significant(x, 4) for x in (kept.q05, kept.q95))
        lines.append(
            f"  {kept.term.ljust(width)}  {significant(kept.coefficient, 4)}, "
            f"{100.0 * found.level:.0f} % interval {low} to {high} (nominal); in "
            f"{100.0 * kept.inclusion:.0f} % of the ensemble"
        )
    others = left_out_terms(found, state)
    if others:
        words = (f"{o.term} {100.0 * o.inclusion:.0f} %" for o in others)
        lines.append(f"  excluded terms in part of the ensemble: {', '.join(words)}")
    return lines


def _further_lines(further: tuple[Discovery, Replay] | None, state: int) -> list[str]:
    """Return the equation with candidate terms of one degree more."""
    if further is None:
        return []
    if not further[0].terms(state):
        return ["One degree more: no term is certain either"]
    words = doubts(*further, state)
    verdict = (
        f"also doubtful: {'; '.join(words)}" if words else "without these problems"
    )
    return [f"One degree more: {equation_text(further[0], state)}, {verdict}"]


def _replay_words(found: Discovery, again: Replay, state: int) -> str:
    """Return the misfit of the integrated equation."""
    misfit = again.misfit[state]
    if not math.isfinite(misfit):
        return "integration from the first row: diverges, the data are not reproduced"
    verdict = "" if again.reproduced[state] else ", not reproduced"
    of = "integration from the first row"
    if again.nearest:
        of = (
            "nearest trajectory, as errors grow tenfold in "
            f"{significant(found.growth_s, 2)} s"
        )
    return (
        f"{of}: misfit {100.0 * misfit:.1f} % of the spread "
        f"of {found.states[state]}, noise removed{verdict}"
    )


@dataclass(frozen=True)
class ExchangeableTerms:
    """Two terms that this record does not distinguish.

    Attributes:
        term: A term of the equation.
        other: Nearly collinear candidate that could replace it.
    """

    term: str
    other: str


@dataclass(frozen=True)
class KeptTerm:
    """A term of an equation.

    Attributes:
        term: The term.
        coefficient: Its coefficient.
        q05: 5 % quantile of the coefficient over the ensemble.
        q95: 95 % quantile.
        inclusion: Share of the ensemble with this term.
    """

    term: str
    coefficient: float
    q05: float
    q95: float
    inclusion: float


@dataclass(frozen=True)
class LeftOutTerm:
    """An excluded term that a part of the ensemble had.

    Attributes:
        term: The term.
        inclusion: Share of the ensemble with this term.
    """

    term: str
    inclusion: float


def doubts(found: Discovery, again: Replay, state: int) -> list[str]:
    """Return the evidence against one equation, the most serious first."""
    judged, name = found.judged[state], found.states[state]
    if not found.terms(state):
        return ["no term is certain"]
    words = []
    if found.jumps:
        rows = joined([str(row + 1) for row in found.jumps[:MAX_JUMPS]])
        words.append(
            f"the states jump before row {rows}: if these are several runs, number "
            "them in a column run"
        )
    words += [
        f"{term} and {other} are exchangeable: they are nearly collinear on this "
        "record, and either fits"
        for term, other in found.exchangeable[state]
    ]
    if not judged.law:
        words.append("on held-out data it is hardly better than a constant prediction")
    if not again.reproduced[state]:
        failure = f"integrated from the first row it does not reproduce {name}"
        if math.isfinite(found.growth_s):
            failure += (
                ": errors of its trajectories grow tenfold in "
                f"{significant(found.growth_s, 2)} s, and no trajectory is near the "
                "record"
            )
        words.append(failure)
    if not judged.tested:
        words.append(
            "the residuals could not be tested: the test requires that every state is "
            f"reproduced, and {MIN_MEMBERS} or more records with new noise"
        )
    if judged.outside < SIGNIFICANCE:
        words.append(
            f"the residuals correlate with {judged.outside_term}, which is not a "
            f"candidate term (p = {significant(judged.outside, 2)})"
        )
    if judged.excess < SIGNIFICANCE:
        words.append(
            "the residuals are larger than the noise "
            f"(p = {significant(judged.excess, 2)})"
        )
    if judged.serial < SIGNIFICANCE:
        words.append(
            f"the residuals are correlated (p = {significant(judged.serial, 2)})"
        )
    return words


@dataclass(frozen=True)
class FoundEquation:
    """The equation of one column.

    Attributes:
        equation: The equation, as text.
        terms: Its terms.
        left_out: Excluded terms that a part of the ensemble had.
        exchangeable: Pairs of terms that this record does not distinguish. With such a
            pair the equation is not identified.
        noise_sd: Standard deviation of the column's noise.
        misfit: Misfit of the integrated equation, as a share of the column's spread.
        reproduced: Whether the integrated equation reproduces the column.
        law: Whether it predicts held-out data.
        doubts: Evidence against it, the most serious first.
        skill_not_seen: Reduction of the squared error on held-out data, relative to a
            constant prediction.
        p_excess: p value of the size of the residuals.
        p_serial: p value of their serial correlation.
        p_outside: p value of their correlation with a term that is not a candidate.
    """

    equation: str
    terms: tuple[KeptTerm, ...]
    left_out: tuple[LeftOutTerm, ...]
    exchangeable: tuple[ExchangeableTerms, ...]
    noise_sd: float
    misfit: float
    reproduced: bool
    law: bool
    doubts: tuple[str, ...]
    skill_not_seen: float
    p_excess: float
    p_serial: float
    p_outside: float


@dataclass(frozen=True)
class FurtherEquations:
    """The equations among products of one column more.

    Attributes:
        certain: Whether all of them are without evidence against them.
        equations: Equations by column, as text.
    """

    certain: bool
    equations: Mapping[str, str]


@dataclass(frozen=True)
class NominalInterval:
    """Nominal level and simulated coverage of the intervals.

    Attributes:
        nominal: Nominal level.
        held_when_simulated: Coverage in simulated noisy records, least and largest.
    """

    nominal: float
    held_when_simulated: tuple[float, float]


@dataclass(frozen=True)
class DiscoveryAnswer(Document):
    """The answer of `jblast discover`.

    Attributes:
        rows: Rows of the trajectory.
        state: Columns with an equation.
        input: Columns used as inputs.
        candidates: Candidate terms.
        threshold: Least share of a derivative that keeps a term.
        ensemble: Number of records with new noise.
        seed: Seed of that noise.
        certain: Whether all equations are without evidence against them.
        equations: Equations by column.
        one_degree_more: Equations with more candidates, if there is evidence against
            these.
        interval: Level and coverage of the intervals.
        repeated: Terms left out, as sums of other terms equal them on this record.
        reproduced: Whether the integrated equations reproduce the data.
        nearest: Whether misfits are those of the nearest trajectory of the equations,
            as errors of the first row grow, instead of its integration.
        error_growth_s: Mean time in which an error of the integrated equations grows
            tenfold; null if it does not.
        held_out_segments: Number of segments of the record, each held out once.
    """

    rows: int
    state: tuple[str, ...]
    input: tuple[str, ...]
    candidates: tuple[str, ...]
    threshold: float
    ensemble: int
    seed: int
    certain: bool
    equations: Mapping[str, FoundEquation]
    one_degree_more: FurtherEquations | None
    interval: NominalInterval
    repeated: tuple[str, ...]
    reproduced: bool
    nearest: bool
    error_growth_s: float | None
    held_out_segments: int


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
    """Return the answer on equations that were found.

    Args:
        found: The equations.
        again: The integrated equations.
        further: Equations and integration with products of one column more, if tried.
        rows: Rows of the trajectory.
        inputs: Columns used as inputs.
        threshold: Least share of a derivative that keeps a term.
        members: Size of the ensemble.
        seed: Seed of its noise.
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
        interval=NominalInterval(found.level, COVERAGE),
        repeated=tuple(found.repeated),
        reproduced=all(again.reproduced),
        nearest=again.nearest,
        error_growth_s=found.growth_s,
        held_out_segments=found.segments,
    )


def found_equation(found: Discovery, again: Replay, state: int) -> FoundEquation:
    """Return the answer on one equation."""
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
    """Return the excluded terms that at least `MIN_SHARE` of the ensemble had."""
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


def doubts_text(found: Discovery, again: Replay, state: int) -> str:
    """Return the evidence against one equation as a headline; "" if there is none."""
    words = doubts(found, again, state)
    if not words:
        return ""
    is_law = found.terms(state) and found.judged[state].law
    first = "Doubtful" if is_law else "No law found"
    return f"{first}, {found.states[state]}: {'; '.join(words)}"
