"""The answer of a fit on the terminal."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.inference.design.cramer_rao import BoundSummary
from jblast.inference.fitting.findings import (
    AsAsked,
    ExchangedSensors,
    MoreToFree,
    WrongClock,
    WrongSensor,
)
from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.fitting.unidentified import requested
from jblast.inference.importance import RangeFollowed
from jblast.inference.posterior.parameters import Estimate
from jblast.parameters import CHARGE_POSITION, PARAMETERS, described
from jblast.registry import LAWS, Law, law_for
from jblast.report.choice import law_reasons
from jblast.report.estimates import printed_estimate
from jblast.report.fit.document import (
    ambiguity_sentence,
    cure_sentence,
    determined_lines,
    null_direction_sentence,
    outlier_lines,
    practically_unidentified,
)
from jblast.report.fit.findings import (
    all_words,
    goodness_numbers,
    goodness_p,
    goodness_sentence,
    printed_p,
    reason_words,
)
from jblast.report.fit.place import earth_lines
from jblast.report.fit.rows import (
    Accepted,
    compare,
    estimate_rows,
    estimates_of,
    fitted_words,
    log_name,
    lower_bound_sentence,
    not_fitted,
)
from jblast.report.understood import understood_lines
from jblast.report.words import (
    GAP,
    WIDTH,
    aligned,
    capitalised,
    comma_separated,
    hanging,
    joined,
    law_words,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
    split_name,
)
from jblast.scene import EXPLOSIVES, Charge
from jblast.scene.uncertain import value_of

NUMBERS = ("value", "sd", "log_sd", "q05", "q50", "q95", "identified")
OF_LOG = ("converged", "identifiable", "law_valid", "chi2", "dof", "n_observations")
COLUMNS: tuple[str, ...] = ("log", "parameter", *NUMBERS, *OF_LOG, "error")
HELD = {True: (86, 89), False: (85, 88)}
"""In 100 of the logs of `HELD_IN`, by whether draws are weighted: the number told worst
and best (`calibration/results/coverage_default.txt`)."""
HELD_IN = "400 simulated logs of seven microphones, four unknowns"
SAFETY = (
    "For safety engineering, forensics and sensing; it designs no explosives. "
    "Decide nothing that concerns lives from this page alone."
)
MASS = "charge_mass_kg"


def answers_text(answers: Mapping[str, Fit | InputError]) -> str:
    """Return one line a log: what was found of each number, and what is doubtful."""
    fits = {name: fit for name, fit in answers.items() if isinstance(fit, Fit)}
    names = list(dict.fromkeys(p for fit in fits.values() for p in fit.summary.free))
    rows = [("log", *map(parameter_words, names), "chi2 (chance)", "")]
    for name, fit in fits.items():
        found = fit.summary.estimates
        cells = [_cell(p, found[p]) if p in found else "-" for p in names]
        rows.append((name, *cells, _goodness(fit), _doubts(fit)))
    failed = [
        line
        for name, error in answers.items()
        if isinstance(error, InputError)
        for line in textwrap.wrap(f"{name}: {error}", WIDTH, subsequent_indent="  ")
    ]
    of = f"{len(fits)} of {len(answers)} logs fitted; 90 % intervals in brackets"
    parts = [of, "", *(aligned(rows) if fits else [])]
    return "\n".join([*parts, *(["", "Not fitted", *failed] if failed else [])]) + "\n"


def answers_csv(answers: Mapping[str, Fit | InputError]) -> str:
    """Return a tidy table: one row a log and parameter, one for a log that failed."""
    rows: list[dict[str, Any]] = []
    for name, fit in answers.items():
        if isinstance(fit, InputError):
            rows.append({"log": name, "error": str(fit)})
            continue
        of_log = {k: getattr(fit.summary, k) for k in OF_LOG}
        for parameter, estimate in fit.summary.estimates.items():
            numbers = _numbers(estimate)
            rows.append({"log": name, "parameter": parameter} | numbers | of_log)
    return comma_separated([COLUMNS, *([row.get(c) for c in COLUMNS] for row in rows)])


def _numbers(estimate: Estimate) -> dict[str, float]:
    """Return the entries of an estimate that are known."""
    return {k: x for k, x in asdict(estimate).items() if not math.isnan(x)}


def _cell(name: str, estimate: Estimate) -> str:
    printed = printed_estimate(name, estimate)
    if printed.interval == "-" and not estimate.identified:
        return printed.value
    return f"{printed.value} [{printed.interval}]"


def _goodness(fit: Fit) -> str:
    p = goodness_p(fit.summary)
    chance = "-" if p is None else significant(p)
    return f"{fit.summary.chi2:.3g}/{fit.summary.dof} ({chance})"


def _doubts(fit: Fit) -> str:
    found = fit.summary
    doubts = [
        word
        for word, doubtful in (
            ("not converged", not found.converged),
            ("not identifiable", not found.identifiable),
            ("nothing identified", found.identifiable and found.identifies_nothing),
            ("poor fit", fit.is_poor),
            ("no row within its law", found.law_valid_rows == 0),
            ("rests on rows outside their law", bool(found.extrapolated)),
            ("outside its law", not found.law_valid and not fit.is_outside),
            *((_fits(wrong), True) for wrong in found.explained_by),
            ("outliers", bool(found.suspected_outliers)),
        )
        if doubtful
    ]
    return ", ".join(doubts)


def _fits(wrong: WrongSensor) -> str:
    if isinstance(wrong, ExchangedSensors):
        return f"with {wrong.name} and {wrong.other} exchanged it fits"
    return f"without {wrong.name} it fits"


def summary(
    fit: Fit, accepted: Accepted | None = None, out: str | Path | None = None
) -> str:
    """Return the answer for the terminal.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with where it comes from;
            printed beside the estimates with whether they lie inside.
        out: Where the figures were written, if they were.
    """
    found = fit.summary
    lines = [_title(fit), *_how_intervals_held(fit), ""]
    if doubts := headline(fit):  # above every line but the title
        said = (line for doubt in doubts for line in textwrap.wrap(doubt, WIDTH))
        lines[1:1] = ["", *said, ""]
    lines += _estimate_table(found, accepted)
    lines += section("", accepted_not_fitted(fit, accepted))
    lines += section("Where and when", earth_lines(fit))
    lines += ["", "Laws"]
    used = laws_used(fit)
    column = max((len(law.quantity) for law in used), default=0) + 2
    for law in used:
        text = "; ".join(part for part in (law.reason, law.scatter) if part)
        text = f"{law.law}: {text}" if text else law.law
        lines += hanging(law.quantity.ljust(column) + text, column)
    lines += hanging(validity_sentence(fit))
    lines += ["", "Goodness of fit", *hanging(goodness_numbers(found))]
    lines += hanging(goodness_sentence(found))
    if bounds := lower_bound_sentence(fit):
        lines += hanging(bounds)
    lines += section("Intervals", _intervals(fit))
    nothing = ["nothing: the recordings, or a prior, identify every fitted number"]
    untold = cannot_tell(found, found.estimates) or nothing
    lines += section("What the recordings cannot tell", untold)
    lines += section("What they do tell", determined_lines(found.determined))
    lines += section("Suspected outliers", outlier_lines(found.suspected_outliers))
    lines += section("How the log was read", understood_lines(found.understood))
    lines += section("Assumptions", all_words(found.assumptions))
    lines += section("Warnings", all_words(found.warnings))
    if out is not None:
        lines += ["", f"Report and figures: {out}"]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _how_intervals_held(fit: Fit) -> list[str]:
    """Say how an approximate posterior's intervals held in simulated logs.

    Those were fitted well, with weighted draws or as asked for: no other is like them.
    """
    if fit.summary.posterior != "laplace" or not fit.summary.converged:
        return []
    if isinstance(fit.posterior_reason, RangeFollowed):
        return ["90 % intervals by draws along the range of the charge"]
    how = "weighted by the posterior" if fit.weighted else "alone"
    said = f"90 % intervals by a normal approximation, {how}"
    if fit.exit_code == 0 and (
        fit.weighted or isinstance(fit.posterior_reason, AsAsked)
    ):
        least, most = HELD[fit.weighted]
        said += f": in {HELD_IN}, they held the truth in {least} to {most} of 100"
    return hanging(said, indent=0)


def _intervals(fit: Fit) -> list[str]:
    reason = reason_words(fit.posterior_reason)
    return [f"{fit.summary.posterior}: {reason}"] if reason else []


def _title(fit: Fit) -> str:
    of = f" of {log_name(fit)}" if log_name(fit) else ""
    recordings, fitted = fitted_words(fit.summary)
    title = f"Fit{of}: {recordings}, {fitted} fitted"
    return "\n".join(textwrap.wrap(title, WIDTH))


def _estimate_table(found: Summary, accepted: Accepted | None) -> list[str]:
    rows = [("Estimates", "value", "90 % interval", "accepted" if accepted else "")]
    rows += [
        (f"  {one.name}", one.value, one.interval, one.accepted)
        for one in estimate_rows(found, accepted)
    ]
    indent = max(len(row[0]) for row in rows) + GAP
    lines = []
    whole, left = aligned(rows), aligned([row[:3] for row in rows])
    for i, row in enumerate(rows):
        if found.derived and i == len(found.estimates) + 1:
            lines.append("Derived")
        if len(whole[i]) <= WIDTH:
            lines.append(whole[i])
        else:
            lines += [left[i], *hanging(f"accepted: {row[3]}", 2, indent=indent)]
    return lines


def cannot_tell(
    found: Summary | BoundSummary, estimates: Mapping[str, Estimate]
) -> list[str]:
    """Return a line for each number, direction or second solution left open."""
    lines = [f"{parameter_words(n)}: not identified" for n in found.unidentified]
    for name in practically_unidentified(estimates):
        log_sd = estimates[name].log_sd
        lines.append(
            f"{parameter_words(name)}: practically unidentified (sd of ln {log_sd:.2f})"
        )
    for direction in found.null_directions:
        lines += [null_direction_sentence(direction), cure_sentence(direction)]
    for other in found.ambiguities:
        lines += [ambiguity_sentence(other), cure_sentence(other)]
    return [line for line in lines if line]


def section(title: str, entries: Sequence[str]) -> list[str]:
    """Return a titled list of entries, nothing if there are none."""
    if not entries:
        return []
    wrapped = [line for entry in entries for line in hanging(entry, 2)]
    return ["", title, *wrapped] if title else wrapped


def conclusion(fit: Fit, accepted: Accepted | None = None) -> list[str]:
    """Return what the fit concludes, most wanted first, one sentence or two an entry.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with where it comes from.
    """
    found = fit.summary
    said = headline(fit)
    doubts = _cannot_tell(found)
    if found.unidentified:  # then this is the news, and comes first
        said, doubts = said + doubts, []
    for name, estimate in estimates_of(found).items():
        if estimate.identified and not _repeats(name, found):
            made_of = fit.scene.charge.explosive if name == "charge_mass_kg" else ""
            said.append(_estimate_sentence(name, estimate, accepted, made_of))
    said += earth_lines(fit)
    said += doubts
    said.append(goodness_sentence(found))
    if bounds := lower_bound_sentence(fit):
        said.append(bounds)
    if outliers := outlier_lines(found.suspected_outliers):
        several = "recordings look" if len(outliers) > 1 else "recording looks"
        said.append(f"{len(outliers)} {several} wrong: {'; '.join(outliers)}.")
    said.append(f"{law_sentence(fit)} {validity_sentence(fit)}")
    return said


def limits(fit: Fit) -> list[str]:
    """Return what the conclusion rests on and does not cover."""
    how = {
        "laplace": "Intervals come from the curvature of the posterior at its maximum "
        "(Laplace); where they span a factor of several, read them as rough.",
        "weighted": "Intervals come from draws of a normal approximation, weighted by "
        "the posterior (importance sampling).",
        "emcee": "Intervals come from draws of the posterior by an ensemble of walkers "
        "(emcee).",
    }
    lines = [given_sentence(fit)]
    lines += [f"{capitalised(one)}." for one in all_words(fit.summary.assumptions)]
    if posterior := "weighted" if fit.weighted else fit.summary.posterior:
        reason = reason_words(fit.posterior_reason)
        why = f" Why: {reason}." if reason else ""
        lines.append(how.get(posterior, f"Intervals come from: {posterior}.") + why)
    if fit.summary.estimates:
        lines.append(
            "Intervals count the errors given in the log and the scatter of the laws; "
            "they do not count a wrong law, a wrong sensor position or reflections."
        )
    return lines


def given_sentence(fit: Fit) -> str:
    """Say which numbers were taken as known."""
    scene, free = fit.scene, set(fit.summary.free)
    names = []
    for charge in scene.charges:
        label = scene.label(charge)
        place = CHARGE_POSITION if charge.range_m is None else ("charge_range_m",)
        names += [f"{n}{label}" for n in ("charge_mass_kg", *place, "origin_time_s")]
        if charge.tnt_factor is not None:
            names.append(f"tnt_factor{label}")
    if scene.air.sound_speed is not None:
        names += ["air_sound_speed_m_s"]
    elif scene.air.altitude is not None:
        names += ["air_altitude_m"]
    else:
        names += ["air_temperature_k", "air_pressure_pa"]
    if float(scene.air.wind_east) or float(scene.air.wind_north):
        names += ["wind_east_m_s", "wind_north_m_s"]
    names += _asked_by_laws(fit.summary.law)
    known = []
    for name in names:
        value = value_of(scene, name)
        if name not in free and value is not None:
            shown = printed_number(name, float(value), 6)
            known.append(f"{parameter_words(name)} {shown}")
    known += [_explosive_words(charge) for charge in scene.charges]
    return f"Taken as known: {joined([k for k in known if k])}."


def _asked_by_laws(laws: Mapping[str, str]) -> list[str]:
    """Return the numbers of the ground, and of laws themselves, that laws ask for."""
    asked = {a for pair in laws.items() for a in law_for(*pair).arguments()}
    return [
        one.name
        for one in PARAMETERS.values()
        if one.key.table in ("ground", "law")
        and one.attribute.rpartition(".")[2] in asked
    ]


def _explosive_words(charge: Charge) -> str:
    """Say what a charge is of, what that is worth in TNT, and which curves hold."""
    of = f"{charge.name}: " if charge.name else ""
    curves = charge.burst or "surface or free-air (by reading)"
    if charge.explosive == "TNT":
        return f"{of}{curves} burst"
    factors = EXPLOSIVES[charge.explosive]
    return (
        f"{of}{curves} burst of {charge.explosive}, worth {factors.pressure:g} "
        f"of its mass in TNT by pressure and {factors.impulse:g} by impulse "
        f"({factors.source})"
    )


def _repeats(name: str, found: Summary) -> bool:
    """Tell whether a TNT mass only repeats the charge mass."""
    base, dot, label = name.partition(".")
    mass = found.estimates.get(f"charge_mass_kg{dot}{label}", Estimate())
    tnt = found.derived.get(name, Estimate())
    return base == "charge_tnt_mass_kg" and mass.value == tnt.value


def _estimate_sentence(
    name: str,
    estimate: Estimate,
    accepted: Accepted | None,
    explosive: str = "",
) -> str:
    printed = printed_estimate(name, estimate)
    known, label = described(name), split_name(name)[2]
    opening = known.opening if known and not label else ""
    opening = opening.replace("of TNT", f"of {explosive}") if explosive else opening
    opening = opening or f"The {parameter_words(name)} was {{}}"
    value = printed.value
    if printed.beside and name == "charge_energy_j":
        value = f"{value}, as much as {printed.beside},"
        value = value.removesuffix(",")
    sentence = opening.format(value)
    if printed.interval != "-":
        sentence += f" (90 %: {printed.interval})"
    comparison = compare(name, estimate, accepted)
    if comparison is None:
        return sentence + "."
    verdict = {
        True: "lies inside the interval",
        False: "lies outside the interval",
        None: "has no interval to lie in",
    }[comparison.inside]
    return (
        f"{sentence}. The accepted {comparison.value} ({comparison.label}) {verdict}."
    )


def _cannot_tell(found: Summary) -> list[str]:
    said = []
    for direction in found.null_directions:
        cure = cure_sentence(direction)
        said.append(f"{null_direction_sentence(direction)} {cure}".strip())
    for other in found.ambiguities:
        cure = cure_sentence(other)
        said.append(f"{ambiguity_sentence(other)} {cure}".strip())
    for name in practically_unidentified(found.estimates):
        factor = significant(2.718281828 ** (1.645 * found.estimates[name].log_sd))
        said.append(
            f"The {parameter_words(name)} is practically unidentified: known only "
            f"within a factor of {factor} either way."
        )
    return said


def accepted_not_fitted(fit: Fit, accepted: Accepted | None) -> list[str]:
    """Say which accepted values nothing here can be compared with."""
    return [
        f"The accepted {parameter_words(name)} ({label}) was not fitted."
        for name in not_fitted(fit.summary, accepted)
        for label in [(accepted or {})[name][1]]
    ]


@dataclass(frozen=True)
class LawUsed:
    """One quantity's law, ready to print; "" where the registry knows no more."""

    quantity: str
    law: str
    reason: str
    range: str
    source: str
    scatter: str


def laws_used(fit: Fit) -> list[LawUsed]:
    """Return the law of each quantity in the log, with reason, range and source."""
    used = []
    reasons = law_reasons(fit.summary.law_reason)
    for quantity, name in fit.summary.law.items():
        law = LAWS.get((quantity, name))
        used.append(
            LawUsed(
                quantity=quantity_words(quantity),
                law=name,
                reason=reasons.get(quantity, ""),
                range=law.range if law else "",
                source=law.source if law else "",
                scatter=_scatter(fit, law),
            )
        )
    return used


def _scatter(fit: Fit, law: Law | None) -> str:
    if law is None:
        return ""
    return law.scatter_words() if fit.scene.scatter else "taken as exact"


def law_sentence(fit: Fit) -> str:
    """Say which law read what: one clause a law."""
    by_law: dict[str, list[str]] = {}
    for quantity, name in fit.summary.law.items():
        by_law.setdefault(name, []).append(quantity_words(quantity))
    clauses = [
        f"{joined(quantities)} by {law_words(name)}"
        for name, quantities in by_law.items()
    ]
    exact = "" if fit.scene.scatter else ", taken as exact"
    return f"Laws used: {'; '.join(clauses)}{exact}."


def validity_sentence(fit: Fit) -> str:
    """Say whether the answer lies where its laws were made for."""
    if fit.summary.law_valid:
        return "The answer lies where these laws hold."
    outside = [
        quantity_words(b.quantity) for b in fit.bands if _leaves_its_range(fit, b)
    ]
    where = f" ({joined(outside)})" if outside else ""
    return (
        f"The answer lies outside the range of a law it uses{where}: it is an "
        "extrapolation, and its interval does not count that."
    )


def _leaves_its_range(fit: Fit, band) -> bool:
    rows = np.array([q == band.quantity for q in fit.observations.quantity])
    along = fit.observations.time if band.axis == "time_s" else fit.distance
    x = along[rows & np.isfinite(along)]
    nearest = np.abs(band.x[None, :] - x[:, None]).argmin(axis=1)
    return bool(np.any(~band.valid[nearest]))


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
    """Return the lines on masses."""
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
