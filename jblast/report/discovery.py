"""The answer of `jblast discover`: equations, and doubts about them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jblast.discovery.discover import MIN_MEMBERS, SIGNIFICANCE, Discovery, Replay
from jblast.discovery.law_search import certain
from jblast.discovery.noise_sweep import Outcome
from jblast.discovery.shock import Slowing
from jblast.report.words import aligned, significant
from jblast.results import Document

COVERAGE = (0.73, 1.0)
"""Share of noisy records whose 90 % interval held the truth; least and greatest of the
cases and noises simulated, where the true terms came out
(calibration/results/discovery.txt)."""
MIN_SHARE = 0.05
"""Share of the ensemble from which an excluded term is reported."""


def discovery_text(
    found: Discovery, again: Replay, further: tuple[Discovery, Replay] | None = None
) -> str:
    """Return the equations, their terms with certainty, and whether they hold.

    Args:
        found: The equations.
        again: What they give, integrated.
        further: The same among products of one column more, where that was tried.
    """
    lines = []
    for state, name in enumerate(found.states):
        doubt = doubts_text(found, again, state)
        if doubt:
            lines += [doubt, *_further_lines(further, state), ""]
        lines += [equation_text(found, state), ""]
        lines += _terms_lines(found, state)
        lines += [
            f"  {_replay_words(found, again, state)} (noise of {name}: "
            f"{significant(found.noise_sd[state])})",
            f"  {_skill_words(found, state)}",
            "",
        ]
    if np.any(found.coefficients):
        low, high = (f"{100.0 * share:.0f}" for share in COVERAGE)
        lines += [
            "Intervals are nominal: those of 90 % held the true coefficient in "
            f"{low} to {high} % of",
            "simulated records with noise, case by case",
            "",
        ]
    if found.repeated:
        lines += [
            "Left out, since other terms add up to them on this record: "
            f"{', '.join(found.repeated)}",
            "",
        ]
    return "\n".join(lines)


def slowing_text(slowing: Slowing) -> str:
    """Return the answer on a shock's speed from a radius history."""
    found = slowing.discovery
    lines = [
        equation_text(found, 0).replace("d(R)/dt", "dR/dt"),
        *_terms_lines(found, 0),
        f"  one power: dR/dt ~ R^{slowing.exponent:.3f}, {100.0 * found.level:.0f} % "
        f"interval {slowing.low:.3f} to {slowing.high:.3f}; it leaves "
        f"{100.0 * slowing.misfit:.1f} %",
    ]
    return "\n".join(lines) + "\n"


def outcomes_text(outcomes: Sequence[Outcome]) -> str:
    """Return a table: a row for each noise of each equation."""
    rows = [
        (
            "of",
            "noise",
            "exact",
            "missing",
            "false",
            "error",
            "in 90 %",
            "holds",
            "law",
            "whole",
        )
    ]
    for o in outcomes:
        rows.append(
            (
                f"{o.case}, {o.state}",
                f"{100.0 * o.noise:g} %",
                f"{o.exact:.2f}",
                f"{o.missing:.2f}",
                f"{o.false:.2f}",
                "-" if math.isnan(o.error) else f"{100.0 * o.error:.2g} %",
                "-" if math.isnan(o.covered) else f"{o.covered:.2f}",
                f"{o.reproduced:.2f}",
                f"{o.law:.2f}",
                f"{o.whole:.2f}",
            )
        )
    return "\n".join(aligned(rows)) + "\n"


def _terms_lines(found: Discovery, state: int) -> list[str]:
    lines = []
    terms = kept_terms(found, state)
    width = max((len(kept.term) for kept in terms), default=0)
    for kept in terms:
        low, high = (significant(x, 4) for x in (kept.q05, kept.q95))
        lines.append(
            f"  {kept.term.ljust(width)}  {significant(kept.coefficient, 4)}, "
            f"{100.0 * found.level:.0f} % interval {low} to {high}; in "
            f"{100.0 * kept.inclusion:.0f} % of the ensemble"
        )
    others = left_out_terms(found, state)
    if others:
        words = (f"{o.term} {100.0 * o.inclusion:.0f} %" for o in others)
        lines.append(f"  left out, though some of the ensemble had: {', '.join(words)}")
    return lines


def _further_lines(further: tuple[Discovery, Replay] | None, state: int) -> list[str]:
    """Say what products of one column more give."""
    if further is None:
        return []
    if not further[0].terms(state):
        return ["One degree more: no term is certain either"]
    words = doubts(*further, state)
    verdict = "of which nothing of the kind is to be said"
    if words:
        verdict = f"in doubt too: {'; '.join(words)}"
    return [f"One degree more: {equation_text(further[0], state)}, {verdict}"]


def _skill_words(found: Discovery, state: int) -> str:
    """Say how an equation does where it has not been found."""
    skill = found.judged[state].skill
    if not math.isfinite(skill):
        return "over stretches that its coefficients have not seen it runs away"
    return (
        "over stretches that its coefficients have not seen it saves "
        f"{100.0 * max(skill, 0.0):.1f} % of the squared miss of a guess"
    )


def _replay_words(found: Discovery, again: Replay, state: int) -> str:
    """Say how the integrated equation compares with the data."""
    misfit = again.misfit[state]
    if not math.isfinite(misfit):
        return "integrated from the first row it runs away: not reproduced"
    verdict = "" if again.reproduced[state] else ": not reproduced"
    return (
        f"integrated from the first row it lies {100.0 * misfit:.1f} % of the spread "
        f"of {found.states[state]} off the data, noise aside{verdict}"
    )


@dataclass(frozen=True)
class ExchangeableTerms:
    """Two terms of which this record does not identify the right one.

    Attributes:
        term: A term of the equation.
        other: Nearly collinear candidate that could stand in its place.
    """

    term: str
    other: str


@dataclass(frozen=True)
class KeptTerm:
    """A term of an equation.

    Attributes:
        term: What it is.
        coefficient: Its coefficient.
        q05: 5 % quantile of that over the ensemble.
        q95: 95 % quantile.
        inclusion: Share of the ensemble that has it.
    """

    term: str
    coefficient: float
    q05: float
    q95: float
    inclusion: float


@dataclass(frozen=True)
class LeftOutTerm:
    """A term that only some of the ensemble had.

    Attributes:
        term: What it is.
        inclusion: Share of the ensemble that has it.
    """

    term: str
    inclusion: float


def doubts(found: Discovery, again: Replay, state: int) -> list[str]:
    """Return what speaks against one equation; the gravest first."""
    judged, name = found.judged[state], found.states[state]
    if not found.terms(state):
        return ["no term is certain"]
    words = [
        f"{term} and {other} are exchangeable: they are nearly collinear on this "
        "record, and either fits"
        for term, other in found.exchangeable[state]
    ]
    if not judged.law:
        words.append(
            "over stretches that its coefficients have not seen it comes hardly nearer "
            "than their start, or the mean elsewhere"
        )
    if not again.reproduced[state]:
        words.append(f"integrated from the first row it does not give {name} back")
    if not judged.tested:
        words.append(
            "whether what is left over is noise could not be judged: that takes "
            f"equations that give every state back, and {MIN_MEMBERS} or more "
            "records with new noise"
        )
    if judged.outside < SIGNIFICANCE:
        words.append(
            f"what is left over goes with {judged.outside_term}, which it was not "
            f"looked among (p = {significant(judged.outside, 2)})"
        )
    if judged.excess < SIGNIFICANCE:
        words.append(
            "more is left over than the noise would leave "
            f"(p = {significant(judged.excess, 2)})"
        )
    if judged.serial < SIGNIFICANCE:
        words.append(
            "what is left over is no independent noise "
            f"(p = {significant(judged.serial, 2)})"
        )
    return words


@dataclass(frozen=True)
class FoundEquation:
    """The equation of one column.

    Attributes:
        equation: In words.
        terms: Its terms.
        left_out: Terms that only some of the ensemble had.
        exchangeable: Pairs of terms that this record does not distinguish. The equation
            is not identified where there are any.
        noise_sd: Noise of the column.
        misfit: What the integrated equation misses, as a share of the column's spread.
        reproduced: Whether, integrated, it gives the column back.
        law: Whether it holds where its coefficients have not seen.
        doubts: What speaks against it, the gravest first.
        skill_not_seen: Share of the squared miss of a guess that it saves there.
        p_excess: Chance of noise that leaves more over.
        p_serial: Chance of noise whose remains go together more from row to row.
        p_outside: Chance of noise whose remains go more with a term not looked among.
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
        certain: Whether all of them are law.
        equations: By column, in words.
    """

    certain: bool
    equations: Mapping[str, str]


@dataclass(frozen=True)
class NominalInterval:
    """What the intervals are worth.

    Attributes:
        nominal: Their level.
        held_when_simulated: Share of noisy records that held the truth, least and most.
    """

    nominal: float
    held_when_simulated: tuple[float, float]


@dataclass(frozen=True)
class DiscoveryAnswer(Document):
    """What was asked, and what was found.

    Attributes:
        rows: Of the trajectory.
        state: Columns that equations were sought for.
        input: Columns that drive them.
        candidates: Terms that were looked among.
        threshold: Least share of a derivative for a term to stay.
        ensemble: Records with new noise.
        seed: Of that noise.
        certain: Whether all of it is law.
        equations: By column.
        one_degree_more: The same of more candidates, where there was a doubt.
        interval: What intervals are worth.
        repeated: Terms that others add up to on this record.
        reproduced: Whether the equations give the data back.
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
        interval=NominalInterval(found.level, COVERAGE),
        repeated=tuple(found.repeated),
        reproduced=all(again.reproduced),
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


def doubts_text(found: Discovery, again: Replay, state: int) -> str:
    """Return the doubt about one equation as its headline; "" if there is none."""
    words = doubts(found, again, state)
    if not words:
        return ""
    is_law = found.terms(state) and found.judged[state].law
    first = "In doubt" if is_law else "No law found"
    return f"{first}, {found.states[state]}: {'; '.join(words)}"
