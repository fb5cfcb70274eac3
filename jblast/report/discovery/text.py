"""Equations found in a trajectory, in words, and at which noise they are found."""

import math
from collections.abc import Sequence

import numpy as np

from jblast.report.discovery.document import (
    HELD,
    equation_text,
    kept_terms,
    left_out_terms,
)
from jblast.report.discovery.doubts import doubts, doubts_text
from jblast.report.numbers import significant
from jblast.report.tables import aligned
from jblast.study.discovery.discover import Discovery
from jblast.study.discovery.noise_sweep import Outcome
from jblast.study.discovery.replay import Replay
from jblast.study.discovery.shock import Slowing


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
        low, high = (f"{100.0 * share:.0f}" for share in HELD)
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
    """Return what a radius history says of a shock's speed."""
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
