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
from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.fitting.wrong import ExchangedSensors, WrongClock, WrongSensor
from jblast.inference.identify import PlaceRegion, requested
from jblast.inference.posterior.parameters import Estimate
from jblast.parameters import CHARGE_POSITION, PARAMETERS, described
from jblast.registry import LAWS, law_for
from jblast.report.choice import law_reason
from jblast.report.estimates import printed_estimate
from jblast.report.fit.document import (
    ambiguity_sentence,
    cure_sentence,
    determined_lines,
    null_direction_sentence,
    outlier_lines,
    practically_unidentified,
)
from jblast.report.fit.goodness import goodness_numbers, goodness_p, goodness_sentence
from jblast.report.fit.place import earth_lines
from jblast.report.fit.rows import (
    Accepted,
    compare,
    estimate_rows,
    estimates_of,
    fitted_words,
    log_name,
    lower_bound_sentence,
)
from jblast.report.messages import (
    alarm,
    alarm_name,
    printed_p,
    sentence_of,
    sentences_of,
)
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
MAX_CONVERSIONS = 4
"""Conversions of a log that are printed without `--verbose`: with more of them the
answer of an ordinary fit would not fit one screen of 40 lines."""
SAFETY = (
    "For safety engineering, forensics and sensing; it designs no explosives. "
    "Decide nothing that concerns lives from this page alone."
)
MAX_TITLE = 4
"""Parameters that the first line names: with more it would not be one line, and the
table below it has their names."""
MASS = "charge_mass_kg"
REMEDIES = ("more_to_free", "clock_to_free")
"""Warnings that are printed with the problems, as they name what to do."""


def answers_text(answers: Mapping[str, Fit | InputError]) -> str:
    """Return one line a log: estimates, goodness of fit and warnings."""
    fits = {name: fit for name, fit in answers.items() if isinstance(fit, Fit)}
    # logs may have different free parameters: the table has a column for each
    names = list(dict.fromkeys(p for fit in fits.values() for p in fit.summary.free))
    rows = [("log", *map(parameter_words, names), "chi2 (chance)", "")]
    for name, fit in fits.items():
        found, p = fit.summary, goodness_p(fit.summary)
        cells = [
            _cell(n, found.estimates[n]) if n in found.estimates else "-" for n in names
        ]
        chance = "-" if p is None else significant(p)
        goodness = f"{found.chi2:.3g}/{found.dof} ({chance})"
        rows.append((name, *cells, goodness, _faults(fit)))
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
            # a cell without a number is empty in CSV, not "nan"
            numbers = {k: x for k, x in asdict(estimate).items() if not math.isnan(x)}
            rows.append({"log": name, "parameter": parameter} | numbers | of_log)
    return comma_separated([COLUMNS, *([row.get(c) for c in COLUMNS] for row in rows)])


def _cell(name: str, estimate: Estimate) -> str:
    printed = printed_estimate(name, estimate)
    # "not identified [-]" would repeat itself
    if printed.interval == "-" and not estimate.identified:
        return printed.value
    return f"{printed.value} [{printed.interval}]"


def _faults(fit: Fit) -> str:
    """Return the warnings of one log, for its line of the table."""
    found = fit.summary
    warnings = [alarm_name(problem) for problem in found.problems]
    if not found.law_valid and found.law_valid_rows and not found.extrapolated:
        warnings.append("outside its law's range")
    if found.suspected_outliers:
        warnings.append("outliers")
    return ", ".join(warnings)


def summary(
    fit: Fit,
    accepted: Accepted | None = None,
    out: str | Path | None = None,
    *,
    verbose: bool = False,
) -> str:
    """Return the answer for the terminal: estimates, reliability, assumptions.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source; printed next
            to the estimates, inside or outside the interval.
        out: Folder of report and figures, if they were written.
        verbose: Whether to add the reasons for the laws, the computation of the
            intervals and all conversions of the log.
    """
    found = fit.summary
    of = f" of {log_name(fit)}" if log_name(fit) else ""
    recordings, fitted = fitted_words(found)
    if len(found.free) > MAX_TITLE:
        fitted = f"{len(found.free)} parameters"
    lines = textwrap.wrap(f"Fit{of}: {recordings}, {fitted} fitted", WIDTH)
    lines.append("")
    # a reader who stops after the first lines must see that the numbers are unusable
    for problem in headline(fit) + assumed_place(fit):
        lines += textwrap.wrap(problem, WIDTH)
    lines += [""] if lines[-1] else []
    lines += _estimate_table(found, accepted)
    lines += section("", accepted_not_fitted(fit, accepted))
    lines += section("Place and time", earth_lines(fit))
    lines += section("Reliability", _reliability(fit))
    lines += section("Identified combinations", determined_lines(found.determined))
    lines += section("Suspected outliers", outlier_lines(found.suspected_outliers))
    lines += section("Warnings", [capitalised(one) for one in warnings_of(found)])
    assumptions = [capitalised(one) for one in sentences_of(found.assumptions)]
    lines += section("Assumptions", [law_sentence(fit).rstrip("."), *assumptions])
    conversions = sentences_of(found.understood)
    if len(conversions) > MAX_CONVERSIONS and not verbose:
        conversions = [f"{len(conversions)} conversions: --verbose lists them"]
    lines += section("Conversions of the log", conversions)
    if verbose:
        lines += _details(fit)
    if out is not None:
        lines += ["", f"Report and figures: {out}"]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _reliability(fit: Fit) -> list[str]:
    """Return the sentences that decide whether the estimates can be used."""
    found = fit.summary
    lines = [goodness_sentence(found), validity_sentence(fit)]
    if bounds := lower_bound_sentence(fit):
        lines.append(bounds)
    identified = ["All fitted parameters are identified."]
    return lines + (not_identified(found, found.estimates) or identified)


def _details(fit: Fit) -> list[str]:
    """Return laws with their reasons, chi2 and the computation of the intervals."""
    lines = law_lines(fit.summary, fit.scene.scatter)
    lines += section("Goodness of fit", [goodness_numbers(fit.summary)])
    reason = fit.posterior_reason
    intervals = [capitalised(sentence_of(reason))] if reason else []
    return lines + section("Intervals", intervals)


def _estimate_table(found: Summary, accepted: Accepted | None) -> list[str]:
    rows = [("Estimates", "value", "90 % interval", "accepted" if accepted else "")]
    rows += [
        (f"  {one.name}", one.value, one.interval, one.accepted)
        for one in estimate_rows(found, accepted)
    ]
    indent = max(len(row[0]) for row in rows) + GAP
    lines = []
    # a row that is too long has its accepted value below; the narrow layout keeps the
    # columns of such rows below each other
    whole, left = aligned(rows), aligned([row[:3] for row in rows])
    for i, row in enumerate(rows):
        if found.derived and i == len(found.estimates) + 1:
            lines.append("Derived")
        if len(whole[i]) <= WIDTH:
            lines.append(whole[i])
        else:
            lines += [left[i], *hanging(f"accepted: {row[3]}", 2, indent=indent)]
    return lines


def not_identified(
    found: Summary | BoundSummary, estimates: Mapping[str, Estimate]
) -> list[str]:
    """Return a line for each unidentified parameter, null direction or other mode."""
    lines = [f"{parameter_words(n)}: not identified" for n in found.unidentified]
    for name in practically_unidentified(estimates):
        log_sd = estimates[name].log_sd
        lines.append(
            f"{parameter_words(name)}: practically unidentified (sd of ln {log_sd:.2f})"
        )
    return lines + [line for pair in _unconstrained(found) for line in pair]


def _unconstrained(found: Summary | BoundSummary) -> list[tuple[str, str]]:
    """Return null directions and other modes, each with the data that resolve it."""
    # a null direction and another mode have the same remedy: more data
    directions = [
        (null_direction_sentence(one), cure_sentence(one))
        for one in found.null_directions
    ]
    modes = [(ambiguity_sentence(one), cure_sentence(one)) for one in found.ambiguities]
    return directions + modes


def section(title: str, entries: Sequence[str]) -> list[str]:
    """Return a titled list of entries, nothing if there are none."""
    if not entries:
        return []
    wrapped = [line for entry in entries for line in hanging(entry, 2)]
    return ["", title, *wrapped] if title else wrapped


def conclusion(fit: Fit, accepted: Accepted | None = None) -> list[str]:
    """Return the conclusions of a fit, the most important first, as sentences.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source.
    """
    found = fit.summary
    sentences = headline(fit) + assumed_place(fit)
    unknown = _unidentified_sentences(found)
    if found.unidentified:  # an unidentified parameter is the main result: it is first
        sentences, unknown = sentences + unknown, []
    for name, estimate in estimates_of(found).items():
        if estimate.identified and not _repeats(name, found):
            # sentences on a mass are worded for TNT
            made_of = fit.scene.charge.explosive if name == "charge_mass_kg" else ""
            sentences.append(_estimate_sentence(name, estimate, accepted, made_of))
    sentences += earth_lines(fit)
    sentences += unknown
    sentences.append(goodness_sentence(found))
    if bounds := lower_bound_sentence(fit):
        sentences.append(bounds)
    if outliers := outlier_lines(found.suspected_outliers):
        several = "recordings look" if len(outliers) > 1 else "recording looks"
        sentences.append(f"{len(outliers)} {several} wrong: {'; '.join(outliers)}.")
    sentences.append(f"{law_sentence(fit)} {validity_sentence(fit)}")
    return sentences


def limits(fit: Fit) -> list[str]:
    """Return the assumptions and limitations of the conclusions, as sentences."""
    # fixed numbers first: an answer is only as good as they are
    lines = [given_sentence(fit)]
    lines += [f"{capitalised(one)}." for one in sentences_of(fit.summary.assumptions)]
    if fit.posterior_reason is not None:
        lines.append(f"Intervals come from {sentence_of(fit.posterior_reason)}.")
    if fit.summary.estimates:
        lines.append(
            "Intervals include the errors given in the log and the scatter of the "
            "laws. They do not include a wrong law, a wrong sensor position or "
            "reflections."
        )
    return lines


def given_sentence(fit: Fit) -> str:
    """Return a sentence that lists the fixed parameters."""
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
    # still air is listed as an assumption
    if float(scene.air.wind_east) or float(scene.air.wind_north):
        names += ["wind_east_m_s", "wind_north_m_s"]
    # only ground and law numbers that a used law reads affect the answer
    arguments = {
        argument
        for pair in fit.summary.law.items()
        for argument in law_for(*pair).arguments()
    }
    names += [
        one.name
        for one in PARAMETERS.values()
        if one.key.table in ("ground", "law")
        and one.attribute.rpartition(".")[2] in arguments
    ]
    known = []
    for name in names:
        value = value_of(scene, name)
        if name not in free and value is not None:
            shown = printed_number(name, float(value), 6)
            known.append(f"{parameter_words(name)} {shown}")
    known += [_explosive_words(charge) for charge in scene.charges]
    return f"Fixed: {joined([k for k in known if k])}."


def _explosive_words(charge: Charge) -> str:
    """Return the explosive of a charge, its TNT equivalence and its curve set."""
    of = f"{charge.name}: " if charge.name else ""
    curves = charge.burst or "surface or free-air (by reading)"
    if charge.explosive == "TNT":
        return f"{of}{curves} burst"
    factors = EXPLOSIVES[charge.explosive]
    return (
        f"{of}{curves} burst of {charge.explosive}, TNT equivalence "
        f"{factors.pressure:g} by pressure and {factors.impulse:g} by impulse "
        f"({factors.source})"
    )


def _repeats(name: str, found: Summary) -> bool:
    """Return whether a TNT mass only repeats the charge mass."""
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


def _unidentified_sentences(found: Summary) -> list[str]:
    """Return sentences on null directions, other modes and very wide intervals."""
    sentences = [f"{sentence} {cure}" for sentence, cure in _unconstrained(found)]
    for name in practically_unidentified(found.estimates):
        # 1.645 sd on either side make the 90 % interval of a normal distribution
        factor = significant(2.718281828 ** (1.645 * found.estimates[name].log_sd))
        sentences.append(
            f"The {parameter_words(name)} is practically unidentified: its 90 % "
            f"interval reaches a factor of {factor} up and down."
        )
    return sentences


def accepted_not_fitted(fit: Fit, accepted: Accepted | None) -> list[str]:
    """Return a sentence for each accepted value of a parameter that was not fitted."""
    return [
        f"The accepted {parameter_words(name)} ({label}) was not fitted."
        for name, (_, label) in (accepted or {}).items()
        if name not in estimates_of(fit.summary)
    ]


@dataclass(frozen=True)
class LawUsed:
    """The law of one quantity, ready to print; "" where the registry has no entry."""

    quantity: str
    law: str
    reason: str
    range: str
    source: str
    scatter: str


def laws_used(found: Summary | BoundSummary, has_scatter: bool) -> list[LawUsed]:
    """Return the law of each quantity of the log, with reason, range and source.

    Args:
        found: Results of a fit, or of a bound.
        has_scatter: Whether the model includes the scatter of the laws.
    """
    used = []
    for quantity, name in found.law.items():
        law, reason = LAWS.get((quantity, name)), found.law_reason.get(quantity)
        used.append(
            LawUsed(
                quantity=quantity_words(quantity),
                law=name,
                reason=law_reason(reason) if reason else "",
                range=law.range if law else "",
                source=law.source if law else "",
                scatter=""
                if law is None
                else law.scatter_words()
                if has_scatter
                else "no model error",
            )
        )
    return used


def law_lines(found: Summary | BoundSummary, has_scatter: bool) -> list[str]:
    """Return the titled list of laws, each with the reason for it and its scatter."""
    used, lines = laws_used(found, has_scatter), ["", "Laws"]
    column = max((len(law.quantity) for law in used), default=0) + 2
    for law in used:
        text = "; ".join(part for part in (law.reason, law.scatter) if part)
        text = f"{law.law}: {text}" if text else law.law
        lines += hanging(law.quantity.ljust(column) + text, column)
    return lines


def quantities_by_law(law: Mapping[str, str], has_scatter: bool) -> str:
    """Return the quantities of each law: "air arrival by Wu-Hao; ..."."""
    by_law: dict[str, list[str]] = {}
    for quantity, name in law.items():
        by_law.setdefault(name, []).append(quantity_words(quantity))
    clauses = [f"{joined(of)} by {law_words(name)}" for name, of in by_law.items()]
    return "; ".join(clauses) + ("" if has_scatter else ", without model error")


def law_sentence(fit: Fit) -> str:
    """Return a sentence that lists the laws with their quantities."""
    return f"Laws used: {quantities_by_law(fit.summary.law, fit.scene.scatter)}."


def validity_sentence(fit: Fit) -> str:
    """Return a sentence on the range of validity of the laws."""
    if fit.summary.law_valid:
        return "The answer lies within the laws' range of validity."
    table, outside = fit.observations, []
    for band in fit.bands:
        # a band extends past the readings: its validity counts at the readings only
        along = table.time if band.axis == "time_s" else fit.distance
        x = along[np.isin(table.quantity, band.quantity) & np.isfinite(along)]
        nearest = np.abs(band.x[None, :] - x[:, None]).argmin(axis=1)
        if np.any(~band.valid[nearest]):
            outside.append(quantity_words(band.quantity))
    where = f" ({joined(outside)})" if outside else ""
    return (
        f"The answer lies outside the range of a law it uses{where}: it is an "
        "extrapolation, whose error the intervals do not include."
    )


def headline(fit: Fit) -> list[str]:
    """Return the problems of an answer, the most serious first; empty if there is none.

    Unidentified parameters come last, with their intervals if these are known.
    """
    found = fit.summary
    details = bearing_lines(found) + region_lines(found) + unidentified_lines(found)
    lines = [
        alarm(problem)
        for problem in found.problems
        # the details contain it, with intervals
        if problem.kind != "not_identifiable" or not details
    ]
    lines += [explanation(wrong) for wrong in found.explained_by]
    lines += [
        f"{capitalised(sentence_of(note))}."
        for note in found.warnings
        if note.kind in REMEDIES
    ]
    return lines + details


def warnings_of(found: Summary) -> list[str]:
    """Return the warnings that are not printed with the problems."""
    return sentences_of(n for n in found.warnings if n.kind not in REMEDIES)


def assumed_place(fit: Fit) -> list[str]:
    """Return the sentence on a charge assumed at the origin of sensors with positions.

    Beside ranges the origin is only a convention.
    """
    if np.isnan(fit.observations.position).any():
        return []
    return [
        f"{capitalised(sentence_of(note))}."
        for note in fit.summary.assumptions
        if note.kind == "no_scene_nor_place"
    ]


def bearing_lines(found: Summary) -> list[str]:
    """Return the answer of an array that identifies the bearing but not the range."""
    distance = found.derived.get("range_m")
    if distance is None:
        return []
    least = printed_number("range_m", distance.q05)
    bounds = f"at least {least}"
    if math.isfinite(distance.q95):
        bounds = f"{least} to {printed_number('range_m', distance.q95)}"
    arcs = [
        (f"{arc.bearing_deg.value:.1f} +- {arc.bearing_deg.sd:.1f} degrees", arc.share)
        for arc in found.bearing_arcs
    ]
    if not arcs:
        return [
            "The position of the charge is not identified: from the centre of the "
            f"sensors its range is {bounds}, its bearing any."
        ]
    shares = len(arcs) > 1
    named = [
        f"{bearing} ({share:.0%})" if shares else bearing for bearing, share in arcs
    ]
    return [
        f"Only the bearing of the charge is identified: {' or '.join(named)} "
        f"clockwise from north, from the centre of the sensors; the range is {bounds}."
    ]


def region_lines(found: Summary) -> list[str]:
    """Return the regions of a position if there are several, the first first."""
    if not found.regions:
        return []
    listed = [_region(one) for one in found.regions]
    return [
        f"The position is one of {len(listed)}: {'; or '.join(listed)}. The estimates "
        "are those of the first."
    ]


def _region(region: PlaceRegion) -> str:
    share = f"{region.share:.0%}"
    if not region.is_place:
        far = [printed_number("range_m", x) for x in _ends(region.range_m)]
        return f"{' to '.join(far)} from the centre of the sensors ({share})"
    place = [
        f"{parameter_words(name)} {printed_estimate(name, estimate).interval}"
        for name, estimate in region.estimates.items()
        if name.partition(".")[0] in CHARGE_POSITION[:2]
    ]
    mass = _mass({n: e for n, e in region.estimates.items() if e.identified})
    return f"{', '.join([*place, *([mass] if mass else [])])} ({share})"


def _ends(estimate: Estimate) -> tuple[float, float]:
    return estimate.q05, estimate.q95


def unidentified_lines(found: Summary) -> list[str]:
    """Return a sentence on the requested parameters that are not identified, or none.

    Coordinates that are all identified, or all not, are called the position.
    """
    known, unknown = {}, {}
    for name in requested(found.free):
        estimate = found.estimates[name]
        by = known if estimate.identified else unknown
        by.setdefault(_called(name), []).append((name, estimate))
    if not unknown:
        return []
    # of a position with one identified coordinate each coordinate is named
    for word in known.keys() & unknown.keys():
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
    """Return the short name of a parameter, for headlines."""
    stem, dot, label = name.partition(".")
    short = dict.fromkeys(CHARGE_POSITION, "position") | {"origin_time_s": "time"}
    if stem not in short:
        return parameter_words(name)
    return f"{short[stem]} of {label}" if dot else short[stem]


def _bounds(numbers: list[tuple[str, Estimate]]) -> str:
    """Return the 90 % intervals of unidentified parameters, in brackets."""
    printed = [
        (parameter_words(name), printed_estimate(name, estimate).interval)
        for name, estimate in numbers
    ]
    if any(interval == "-" for _, interval in printed):
        return ""
    if len(printed) == 1:
        return f" ({printed[0][1]})"
    return f" ({', '.join(f'{word} {interval}' for word, interval in printed)})"


def _mass(estimates: Mapping[str, Estimate]) -> str:
    """Return the masses among estimates, with their intervals."""
    return joined(
        [
            f"{parameter_words(number)} {printed.value} (90 %: {printed.interval})"
            for number, estimate in estimates.items()
            if number.partition(".")[0] == MASS
            for printed in [printed_estimate(number, estimate)]
        ]
    )


def explanation(wrong: WrongSensor) -> str:
    """Return the result of a fit without a wrong clock or sensor, and the remedy."""
    if isinstance(wrong, ExchangedSensors):
        text = (
            f"With the positions of {wrong.name} and {wrong.other} exchanged all "
            f"recordings fit (p {printed_p(wrong.p_value)})."
        )
        if mass := _mass(wrong.estimates):
            outside = "" if wrong.law_valid_rows else ", outside the laws"
            text += f" Then: {mass}{outside}."
        return f"{text} If they were swapped, exchange their positions in the log."
    name, fits = wrong.name, f"the others fit (p {printed_p(wrong.p_value)})"
    if isinstance(wrong, WrongClock):
        offset = wrong.offset_s
        ahead = "ahead" if offset > 0 else "behind"
        sd = printed_number("_s", wrong.offset_sd, 2)
        # two digits beyond the standard deviation; nine are all that a clock resolves
        more = math.log10(max(abs(offset) / wrong.offset_sd, 1.0))
        off = printed_number("_s", abs(offset), min(2 + int(more), 9))
        text = (
            f"Without the times of {name} {fits}: its clock is {off} {ahead} "
            f"(± {sd}), or its times are wrong."
        )
    else:
        text = f"Without the sensor {name} {fits}."
    if mass := _mass(wrong.estimates):
        outside = "" if wrong.law_valid_rows else ", outside the laws"
        text += f" Without it: {mass}{outside}."
    if isinstance(wrong, WrongClock) and wrong.parameter:
        return f"{text} To fit its clock: --free {wrong.parameter}."
    return f"{text} To leave it out, put a # before its rows."
