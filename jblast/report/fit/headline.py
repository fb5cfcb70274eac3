"""What stands above every number: that there is no answer, why, and what would help."""

import math
from collections.abc import Mapping

from jblast.inference.fitting.findings import MoreToFree, WrongClock, WrongSensor
from jblast.inference.fitting.result import Fit
from jblast.inference.posterior.estimate import Estimate
from jblast.report.estimates import printed_estimate
from jblast.report.fit.goodness import goodness_p, printed_p
from jblast.report.numbers import printed_number
from jblast.report.words import joined, parameter_words

MASS = "charge_mass_kg"


def headline(fit: Fit) -> list[str]:
    """Return why no number is an answer, the gravest first; nothing if they are."""
    found, lines = fit.summary, []
    if not found.converged:
        lines.append("NOT CONVERGED: take no number below as an answer.")
    if fit.is_poor:
        p = goodness_p(found)
        lines.append(
            f"POOR FIT (p {printed_p(p or 0.0)}): the recordings disagree with the law "
            "by more than their errors allow; take no interval below as an answer."
        )
    if fit.is_outside:
        lines.append(
            "OUTSIDE THE LAWS: no recording lies where its law holds; take no number "
            "below as an answer."
        )
    if found.explained_by and not lines:
        lines.append("ONE READING SPOILS THE LOG: take no number below as an answer.")
    if len(found.explained_by) > 1:
        names = " or ".join(wrong.name for wrong in found.explained_by)
        lines.append(f"{names} is wrong; the log cannot say which.")
    lines += [explanation(wrong) for wrong in found.explained_by]
    more = (one for one in found.warnings if isinstance(one, MoreToFree))
    return lines + [freeing(one) for one in more]


def freeing(more: MoreToFree) -> str:
    """Say what a log tells with more numbers free, and what to type."""
    names = ",".join(more.parameters)
    free = joined([parameter_words(name) for name in more.parameters])
    clock = f", as the clock of {more.clock} is wrong," if more.clock else ""
    mass = _mass(more.estimates)
    return (
        f"With {free} free{clock} the recordings fit (p {printed_p(more.p_value)}"
        f"{f': {mass}' if mass else ''}). Type the command again and behind it: "
        f"--free {names}"
    )


def _mass(estimates: Mapping[str, Estimate]) -> str:
    """Return what is told of masses."""
    return joined(
        [
            f"{parameter_words(number)} {printed.value} (90 %: {printed.interval})"
            for number, estimate in estimates.items()
            if number.partition(".")[0] == MASS
            for printed in [printed_estimate(number, estimate)]
        ]
    )


def explanation(wrong: WrongSensor) -> str:
    """Say what a log tells without a clock or sensor, and what to type."""
    name, fits = wrong.name, f"the others fit (p {printed_p(wrong.p_value)})"
    if isinstance(wrong, WrongClock):
        offset = wrong.offset_s
        ahead = "ahead" if offset > 0 else "behind"
        sd = printed_number("_s", wrong.offset_sd, 2)
        more = math.log10(max(abs(offset) / wrong.offset_sd, 1.0))
        off = printed_number("_s", abs(offset), min(2 + int(more), 9))
        said = (
            f"Without the times of {name} {fits}: its clock is {off} {ahead} "
            f"(± {sd}), or they were read wrong."
        )
    else:
        said = f"Without the sensor {name} {fits}."
    if mass := _mass(wrong.estimates):
        outside = "" if wrong.law_valid_rows else ", outside the laws"
        said += f" Without it: {mass}{outside}."
    if isinstance(wrong, WrongClock) and wrong.parameter:
        return f"{said} To fit its clock: --free {wrong.parameter}."
    return f"{said} To leave it out, put a # before its rows."
