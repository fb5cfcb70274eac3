"""The conclusion in sentences, and its limits."""

from collections.abc import Mapping

from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.posterior.estimate import Estimate
from jblast.parameter_table import CHARGE_POSITION, PARAMETERS, described
from jblast.registry import law_for
from jblast.report.estimates import printed_estimate
from jblast.report.fit.findings import all_words, reason_words
from jblast.report.fit.goodness import goodness_sentence
from jblast.report.fit.headline import headline
from jblast.report.fit.identifiability import (
    ambiguity_sentence,
    cure_sentence,
    null_direction_sentence,
    outlier_lines,
    practically_unidentified,
)
from jblast.report.fit.laws import law_sentence, validity_sentence
from jblast.report.fit.place.earth_words import earth_lines
from jblast.report.fit.reference_values import (
    Accepted,
    compare,
    estimates_of,
    not_fitted,
)
from jblast.report.fit.rows import lower_bound_sentence
from jblast.report.numbers import printed_number, significant
from jblast.report.words import capitalised, joined, parameter_words, split_name
from jblast.scene import EXPLOSIVES, Charge
from jblast.scene.parameters import value_of

SAFETY = (
    "For safety engineering, forensics and sensing; it designs no explosives. "
    "Decide nothing that concerns lives from this page alone."
)


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
