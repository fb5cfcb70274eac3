"""The answer of `jblast discover`: equations, and evidence against them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import starmap
from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from jblast.discovery.equations import Discovery
from jblast.discovery.law_search import LawSearch
from jblast.report.colours import BLUE, VERMILLION
from jblast.report.messages import sentence
from jblast.report.numbers import joined, significant
from jblast.report.output import PROBLEM, Answer
from jblast.report.view import Block, Column, Lines, Picture, Table, View
from jblast.results import Document, filled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COVERAGE = (0.91, 1.0)
"""Coverage of the 90 % intervals in simulated records with noise: least and largest of
the cases and noise levels, where the true terms were found
(calibration/results/discovery_intervals.txt)."""
MIN_SHARE = 0.05
"""Share of the ensemble from which an excluded term is reported: below 1 in 20 it is
chance at the 5 % level."""
DATA = "#b0b0b0"
MAX_TITLE = 84
"""Width of a plot [characters of its title]."""


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
        p_outside: p value of the correlation of the residuals with terms that are no
            candidates; null if the record is too short for this test.
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
        error_growth_s: Mean time in which an error of the integrated equations grows
            tenfold, after which the integration restarts; null if it does not.
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
    error_growth_s: float | None
    held_out_segments: int


def discovery_answer(search: LawSearch) -> Answer:
    """Return the answer of a search."""
    data, found, further = search[:3]
    more = None
    if further is not None:
        equations = found_equations(further).items()
        texts = {name: one.equation for name, one in equations}
        more = FurtherEquations(further.certain, texts)
    document = filled(
        DiscoveryAnswer,
        search,
        found,
        rows=len(data.time_s),
        state=found.states,
        input=data.names[len(found.states) :],
        candidates=tuple(found.candidates.names),
        ensemble=search.members,
        certain=search.certain,
        equations=found_equations(found),
        one_degree_more=more,
        interval=NominalInterval(found.level, COVERAGE),
        reproduced=all(found.reproduced),
        error_growth_s=found.growth_s,
        held_out_segments=found.segments,
    )
    draw = partial(discovery_figure, found, data.time_s, data.states)
    view = discovery_view(found, further, [Picture("discover.png", draw)])
    return Answer(document, view, code=0 if search.certain else PROBLEM)


def discovery_view(
    found: Discovery,
    further: Discovery | None = None,
    blocks: Sequence[Block] = (),
) -> View:
    """Return equations with their terms, validation and the evidence against them.

    Args:
        found: The equations.
        further: Equations with products of one column more, if tried.
        blocks: Blocks after those of the equations.
    """
    equations = found_equations(found)
    doubtful = {name: one for name, one in equations.items() if one.doubts}
    more = found_equations(further) if further else {}
    columns = [
        Column("term", lambda one: one.term),
        Column("coefficient", lambda one: significant(one.coefficient, 4), right=True),
        Column(
            f"{100.0 * found.level:.0f} % interval (nominal)",
            lambda one: f"{significant(one.q05, 4)} to {significant(one.q95, 4)}",
        ),
        Column("ensemble", lambda one: _percent(one.inclusion), right=True),
    ]
    tables: list[Block] = []
    for name, one in equations.items():
        misfit = "restarted" if found.growing_s else "integrated"
        misfit = misfit if math.isfinite(one.misfit) else "diverges"
        held = "held_out" if math.isfinite(one.skill_not_seen) else "held_out_diverges"
        left = ", ".join(f"{o.term} {_percent(o.inclusion)}" for o in one.left_out)
        tables += [
            Table(columns, one.terms, one.equation),
            Lines(
                "" if one.terms else one.equation,
                [
                    f"Excluded terms in part of the ensemble: {left}" if left else "",
                    sentence(
                        f"discover.{misfit}",
                        one,
                        name=name,
                        growth_s=found.growth_s,
                        percent=100.0 * one.misfit,
                        fails="" if one.reproduced else ", not reproduced",
                    ),
                    sentence(
                        f"discover.{held}",
                        segments=found.segments,
                        percent=100.0 * max(one.skill_not_seen, 0.0),
                    ),
                ],
            ),
        ]
    return View(
        f"{'Equation' if len(equations) == 1 else 'Equations'} of motion of "
        f"{joined(found.states)}",
        [
            Lines(
                "One degree more",
                [
                    f"{more[name].equation}, "
                    + (_listed("also doubtful", more[name]) or "without these problems")
                    for name in doubtful
                    if more
                ],
            ),
            *tables,
            Lines(
                "Terms left out, as sums of other terms equal them on this record",
                [", ".join(found.repeated)],
            ),
            *blocks,
        ],
        problems=[
            _listed(f"{'Doubtful' if one.law else 'No law found'}, {name}", one)
            for name, one in doubtful.items()
        ],
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _listed(title: str, equation: FoundEquation) -> str:
    """Return the evidence against an equation; "" without."""
    return f"{title}: {'; '.join(equation.doubts)}" if equation.doubts else ""


def doubts(found: Discovery, state: int) -> list[str]:
    """Return the evidence against one equation, the most serious first."""
    judged = found.judged[state]
    if not found.terms(state):
        return ["no term is certain"]
    pairs = [f"{term} and {other}" for term, other in found.exchangeable[state]]
    kinds = {
        "jumps": bool(found.jumps),
        "exchangeable": bool(pairs),
        "not_predicted": not judged.law,
        "not_reproduced": not found.reproduced[state],
        "untested": math.isnan(judged.outside),
        "outside": not judged.whole and not math.isnan(judged.outside),
    }
    numbers = {
        "jumped": [str(row + 1) for row in found.jumps],
        "pairs": pairs,
        "name": found.states[state],
    }
    return [
        sentence(f"discover.{kind}", judged, **numbers)
        for kind, holds in kinds.items()
        if holds
    ]


def found_equations(found: Discovery) -> dict[str, FoundEquation]:
    """Return the answer on each equation, by column."""
    return {
        name: _found_equation(found, state) for state, name in enumerate(found.states)
    }


def _found_equation(found: Discovery, state: int) -> FoundEquation:
    judged, row = found.judged[state], found.coefficients[state]
    share = found.inclusion[state]
    columns = row, found.low[state], found.high[state], share
    numbers = np.column_stack(columns).tolist()
    names = found.candidates.names
    left = np.flatnonzero((row == 0.0) & (share >= MIN_SHARE))
    return FoundEquation(
        equation=equation_text(found, state),
        terms=tuple(KeptTerm(names[n], *numbers[n]) for n in np.flatnonzero(row)),
        left_out=tuple(LeftOutTerm(names[n], float(share[n])) for n in left),
        exchangeable=tuple(starmap(ExchangeableTerms, found.exchangeable[state])),
        noise_sd=float(found.noise_sd[state]),
        misfit=float(found.misfit[state]),
        reproduced=found.reproduced[state],
        law=bool(found.terms(state)) and judged.law,
        doubts=tuple(doubts(found, state)),
        skill_not_seen=judged.skill,
        p_outside=judged.outside,
    )


def equation_text(found: Discovery, state: int) -> str:
    """Return one equation: d(u)/dt = -0.45 u - 0.01 |u| u."""
    words = ""
    for place in np.flatnonzero(row := found.coefficients[state]):
        sign = "-" if row[place] < 0.0 else "+"
        name = found.candidates.names[place].removeprefix("1")
        words += f" {sign} {significant(abs(row[place]), 4)} {name}".rstrip()
    right = words.removeprefix(" + ").replace(" - ", "-", not words.startswith(" + "))
    return f"d({found.states[state]})/dt = {right or '0 (no term is certain)'}"


def discovery_figure(
    found: Discovery,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
) -> "Figure":
    """Draw each state with its integrated equation, and the inclusion of each term."""
    from jblast.report.figures import new_figure, quiet, titled

    rows = len(found.states)
    figure = new_figure(11.0, 0.8 + 3.0 * rows)
    grid = figure.subplots(rows, 2, squeeze=False, width_ratios=[2.6, 1.0])
    for state, (left, right) in enumerate(grid):
        name = found.states[state]
        quiet(left)
        doubtful = bool(doubts(found, state))
        words = "integrated" + ", restarted" * bool(found.growing_s)
        equations = f"equations, {words}{', doubtful' * doubtful}"
        colour = VERMILLION if doubtful else BLUE
        seen = states[:, state]
        left.plot(time_s, seen, ".", color=DATA, markersize=5, label="data")
        left.plot(time_s, found.predicted[:, state], color=colour, label=equations)
        spread = np.ptp(seen)
        left.set_ylim(np.min(seen) - 0.25 * spread, np.max(seen) + 0.25 * spread)
        left.set_ylabel(name)
        left.legend(frameon=False, fontsize=9, loc="upper left", ncols=2)
        titled(
            left, shorten(equation_text(found, state), MAX_TITLE, placeholder=" ...")
        )
        _inclusion(right, found, state)
    grid[-1][0].set_xlabel("time [s]")
    grid[-1][1].set_xlabel("share of the ensemble with the term")
    return figure


def _inclusion(axes: "Axes", found: Discovery, state: int) -> None:
    """Draw a bar a term: its share of the ensemble."""
    from jblast.report.figures import quiet

    quiet(axes)
    kept, share = found.coefficients[state] != 0.0, found.inclusion[state]
    shown = np.flatnonzero(kept | (share > 0.0))[::-1]
    names = [found.candidates.names[place] for place in shown]
    axes.barh(names, share[shown], height=0.6, color=np.where(kept, BLUE, DATA)[shown])
    # a bar alone would fill the plot
    axes.set_ylim(-0.6, max(len(shown), 3) - 0.4)
    axes.set_xlim(0.0, 1.0)
