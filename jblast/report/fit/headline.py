"""Headline of an answer: why it is none, what is not identified, what would help."""

import math
from collections.abc import Mapping

from jblast.inference.fitting.findings import (
    ExchangedSensors,
    MoreToFree,
    WrongClock,
    WrongSensor,
)
from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.fitting.unidentified import requested
from jblast.inference.posterior.estimate import Estimate
from jblast.parameter_table import CHARGE_POSITION
from jblast.report.estimates import printed_estimate
from jblast.report.fit.goodness import goodness_p, printed_p
from jblast.report.numbers import printed_number
from jblast.report.words import joined, parameter_words

MASS = "charge_mass_kg"


def headline(fit: Fit) -> list[str]:
    """Return what is wrong with an answer, the gravest first; nothing if all is well.

    What is not identified comes last, with its interval where that is known.
    """
    found, lines = fit.summary, []
    if not found.converged:
        lines.append("NOT CONVERGED: take no number below as an answer.")
    if fit.is_poor:
        p = goodness_p(found)
        lines.append(
            f"POOR FIT (p {printed_p(p or 0.0)}): the recordings disagree with the law "
            "by more than their errors allow; take no interval below as an answer."
        )
    if found.law_valid_rows == 0:
        lines.append(
            "OUTSIDE THE LAWS: no recording lies where its law holds; take no number "
            "below as an answer."
        )
    elif fit.is_outside:
        names = joined([parameter_words(name) for name in found.extrapolated])
        lines.append(
            f"OUTSIDE THE LAWS: most of the information about the {names} is from "
            f"recordings outside the range of their laws; do not use "
            f"{'these values' if len(found.extrapolated) > 1 else 'this value'}."
        )
    if found.explained_by and not lines:
        lines.append("ONE READING SPOILS THE LOG: take no number below as an answer.")
    if len(found.explained_by) > 1:
        names = " or ".join(_accused(wrong) for wrong in found.explained_by)
        lines.append(f"{names} is wrong; the log cannot say which.")
    lines += [explanation(wrong) for wrong in found.explained_by]
    more = (one for one in found.warnings if isinstance(one, MoreToFree))
    lines += [freeing(one) for one in more]
    return lines + bearing_lines(found) + unidentified_lines(found)


def bearing_lines(found: Summary) -> list[str]:
    """Return the answer of an array that identifies the bearing and not the place."""
    distance = found.derived.get("range_m")
    bearings = [
        f"{of.value:.1f} +- {of.sd:.1f} degrees"
        for name in ("bearing_deg", "other_bearing_deg")
        if (of := found.derived.get(name)) is not None
    ]
    if distance is None or not bearings:
        return []
    least = printed_number("range_m", distance.q05)
    bounds = f"at least {least}"
    if math.isfinite(distance.q95):
        bounds = f"{least} to {printed_number('range_m', distance.q95)}"
    return [
        f"Of the place only the bearing is identified: {' or '.join(bearings)} "
        f"clockwise from north, from the middle of the sensors; the range is {bounds}."
    ]


def unidentified_lines(found: Summary) -> list[str]:
    """Return a sentence on the requested numbers that are not identified, or none.

    Coordinates that share their fate are called the position.
    """
    known, unknown = {}, {}
    for name in requested(found.free):
        estimate = found.estimates[name]
        by = known if estimate.identified else unknown
        by.setdefault(_called(name), []).append((name, estimate))
    if not unknown:
        return []
    split = known.keys() & unknown.keys()  # one coordinate is known, another is not
    for word in split:
        for by in (known, unknown):
            for one in by.pop(word):
                by[parameter_words(one[0])] = [one]
    if len(unknown) == 1:
        ((word, of),) = unknown.items()
        sentence = f"The {word} is not identified{_bounds(of)}"
    else:
        listed = joined([f"{word}{_bounds(of)}" for word, of in unknown.items()])
        sentence = f"The {listed} are not identified"
    if known:
        sentence += f"; {joined(list(known))} {'is' if len(known) == 1 else 'are'}"
    return [f"{sentence}."]


def _called(name: str) -> str:
    """Return what a headline calls a number."""
    stem, dot, label = name.partition(".")
    short = dict.fromkeys(CHARGE_POSITION, "position") | {"origin_time_s": "time"}
    if stem not in short:
        return parameter_words(name)
    return f"{short[stem]} of {label}" if dot else short[stem]


def _bounds(numbers: list[tuple[str, Estimate]]) -> str:
    """Return the 90 % intervals of numbers without a value, in brackets."""
    printed = [
        (parameter_words(name), printed_estimate(name, estimate).interval)
        for name, estimate in numbers
    ]
    if any(interval == "-" for _, interval in printed):
        return ""
    if len(printed) == 1:
        return f" ({printed[0][1]})"
    return f" ({', '.join(f'{word} {interval}' for word, interval in printed)})"


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


def _accused(wrong: WrongSensor) -> str:
    """Return the name of a clock or sensor, or of two whose places are exchanged."""
    if isinstance(wrong, ExchangedSensors):
        return f"the order of {wrong.name} and {wrong.other}"
    return wrong.name


def explanation(wrong: WrongSensor) -> str:
    """Return what a log says without a clock or sensor, and what to type."""
    if isinstance(wrong, ExchangedSensors):
        said = (
            f"With the places of {wrong.name} and {wrong.other} exchanged all "
            f"recordings fit (p {printed_p(wrong.p_value)})."
        )
        if mass := _mass(wrong.estimates):
            outside = "" if wrong.law_valid_rows else ", outside the laws"
            said += f" Then: {mass}{outside}."
        return f"{said} If they were swapped, exchange their positions in the log."
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
