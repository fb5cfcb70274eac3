"""The answer of `jblast discover`: equations, and evidence against them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from jblast.discovery.discover import (
    MIN_MEMBERS,
    SEGMENTS,
    SIGNIFICANCE,
    Discovery,
    Replay,
)
from jblast.discovery.law_search import LawSearch, certain
from jblast.report.numbers import joined, significant
from jblast.report.output import PROBLEM, Answer
from jblast.report.view import Block, Column, Lines, Picture, Table, View
from jblast.results import Document, filled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COVERAGE = (0.73, 1.0)
"""Coverage of the 90 % intervals in simulated records with noise: least and largest of
the cases and noise levels, where the true terms were found
(calibration/results/discovery.txt)."""
MIN_SHARE = 0.05
"""Share of the ensemble from which an excluded term is reported: below 1 in 20 it is
chance at the 5 % level."""
DATA = "#b0b0b0"
MAX_JUMPS = 5
"""Largest number of rows listed."""


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


def discovery_answer(search: LawSearch) -> Answer:
    """Return the answer of a search."""
    data, found, again, further = search[:4]
    more = further and FurtherEquations(
        certain(*further),
        {name: equation_text(further[0], n) for n, name in enumerate(found.states)},
    )
    document = filled(
        DiscoveryAnswer,
        search,
        found,
        again,
        rows=len(data.time_s),
        state=tuple(found.states),
        input=tuple(data.names[len(found.states) :]),
        candidates=tuple(found.candidates.names),
        ensemble=search.members,
        equations={
            name: found_equation(found, again, state)
            for state, name in enumerate(found.states)
        },
        one_degree_more=more,
        interval=NominalInterval(found.level, COVERAGE),
        repeated=tuple(found.repeated),
        reproduced=all(again.reproduced),
        error_growth_s=found.growth_s,
        held_out_segments=found.segments,
    )

    draw = partial(discovery_figure, found, again, data.time_s, data.states)
    view = discovery_view(found, again, further, [Picture("discover.png", draw)])
    return Answer(document, view, code=0 if search.certain else PROBLEM)


def discovery_view(
    found: Discovery,
    again: Replay,
    further: tuple[Discovery, Replay] | None = None,
    blocks: list[Block] | None = None,
) -> View:
    """Return equations with their terms, validation and the evidence against them.

    Args:
        found: The equations.
        again: The integrated equations.
        further: Equations and integration with products of one column more, if tried.
        blocks: Blocks after those of the equations.
    """
    interval = f"{100.0 * found.level:.0f} % interval (nominal)"
    columns = [
        Column("term", lambda one: one.term),
        Column("coefficient", lambda one: significant(one.coefficient, 4), right=True),
        Column(interval, lambda one: _interval(one.q05, one.q95)),
        Column("ensemble", lambda one: f"{100.0 * one.inclusion:.0f} %", right=True),
    ]
    problems, equations = [], []
    for state, name in enumerate(found.states):
        if against := doubts(found, again, state):
            is_law = found.terms(state) and found.judged[state].law
            first = "Doubtful" if is_law else "No law found"
            problems.append(f"{first}, {name}: {'; '.join(against)}")
        left = left_out_terms(found, state)
        equation = equation_text(found, state)
        equations += [
            Table(columns, kept_terms(found, state), equation),
            Lines(
                "" if found.terms(state) else equation,
                [
                    "Excluded terms in part of the ensemble: "
                    + ", ".join(f"{o.term} {100.0 * o.inclusion:.0f} %" for o in left)
                    if left
                    else "",
                    _replay_words(found, again, state),
                    _held_out_words(found, state),
                ],
            ),
        ]
    repeated = ", ".join(found.repeated)
    return View(
        f"{'Equation' if len(found.states) == 1 else 'Equations'} of motion of "
        f"{joined(list(found.states))}",
        [
            Lines("One degree more", _further_lines(further, found, again)),
            *equations,
            Lines(
                "Terms left out, as sums of other terms equal them on this record",
                [repeated],
            ),
            *(blocks or []),
        ],
        problems=problems,
    )


def _interval(low: float, high: float) -> str:
    return f"{significant(low, 4)} to {significant(high, 4)}"


def _further_lines(
    further: tuple[Discovery, Replay] | None, found: Discovery, again: Replay
) -> list[str]:
    """Return the doubtful equations with candidate terms of one degree more."""
    lines = []
    for state in range(len(found.states)) if further else ():
        assert further is not None
        if not doubts(found, again, state):
            continue
        words = doubts(*further, state)
        verdict = "without these problems"
        if words:
            verdict = f"also doubtful: {'; '.join(words)}"
        lines.append(f"{equation_text(further[0], state)}, {verdict}")
    return lines


def _replay_words(found: Discovery, again: Replay, state: int) -> str:
    """Return the misfit of the integrated equation."""
    misfit, name = again.misfit[state], found.states[state]
    if not math.isfinite(misfit):
        return "Integration from the first row: diverges, the data are not reproduced"
    of = "Integration from the first row"
    if again.nearest:
        growth = significant(found.growth_s, 2)
        of = f"Nearest trajectory, as errors grow tenfold in {growth} s"
    return (
        f"{of}: misfit {100.0 * misfit:.1f} % of the spread of {name}, noise removed "
        f"({significant(found.noise_sd[state])})"
        + ("" if again.reproduced[state] else ", not reproduced")
    )


def _held_out_words(found: Discovery, state: int) -> str:
    """Return the error of the prediction of held-out segments."""
    skill = found.judged[state].skill
    held = "Held-out data"
    if found.segments > SEGMENTS:
        held += f", {found.segments} segments"
    if not math.isfinite(skill):
        return f"{held}: the integration diverges"
    return (
        f"{held}: the squared error is {100.0 * max(skill, 0.0):.1f} % smaller than "
        "that of a constant prediction"
    )


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


def discovery_figure(
    found: Discovery,
    again: Replay,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
) -> "Figure":
    """Draw each state with its integrated equation, and the inclusion of each term."""
    from jblast.report.figures import BLUE, VERMILLION, new_figure, quiet, titled

    rows = len(found.states)
    figure = new_figure(11.0, 0.8 + 3.0 * rows)
    grid = figure.subplots(rows, 2, squeeze=False, width_ratios=[2.6, 1.0])
    for state, (left, right) in enumerate(grid):
        name = found.states[state]
        quiet(left)
        doubtful = bool(doubts(found, again, state))
        words = "nearest trajectory" if again.nearest else "integrated"
        equations = f"equations, {words}{', doubtful' * doubtful}"
        colour = VERMILLION if doubtful else BLUE
        seen = states[:, state]
        left.plot(time_s, seen, ".", color=DATA, markersize=5, label="data")
        left.plot(time_s, again.states[:, state], color=colour, label=equations)
        spread = np.ptp(seen)
        left.set_ylim(np.min(seen) - 0.25 * spread, np.max(seen) + 0.25 * spread)
        left.set_ylabel(name)
        left.legend(frameon=False, fontsize=9, loc="upper left", ncols=2)
        titled(left, _cut(equation_text(found, state)))
        _inclusion(right, found, state)
    grid[-1][0].set_xlabel("time [s]")
    grid[-1][1].set_xlabel("share of the ensemble with the term")
    return figure


def _inclusion(axes: "Axes", found: Discovery, state: int) -> None:
    """Draw a bar a term: its share of the ensemble."""
    from jblast.report.figures import BLUE, INK, quiet

    quiet(axes)
    kept = found.coefficients[state] != 0.0
    share = found.inclusion[state]
    shown = np.flatnonzero(kept | (share > 0.0))[::-1]
    places = np.arange(len(shown))
    colours = [BLUE if kept[place] else "#c8c8c8" for place in shown]
    axes.barh(places, share[shown], height=0.6, color=colours)
    axes.set_yticks(places, [found.candidates.names[place] for place in shown])
    axes.set_ylim(-0.6, max(len(shown), 3) - 0.4)
    axes.set_xlim(0.0, 1.0)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    if not len(shown):
        axes.text(0.5, 1.0, "no term", ha="center", color=INK)


def _cut(words: str, longest: int = 84) -> str:
    """Return a title shortened at a term to the width of its plot [characters]."""
    if len(words) <= longest:
        return words
    kept = words[: longest - 4]
    return kept[: max(kept.rfind(" + "), kept.rfind(" - "))] + " ..."
