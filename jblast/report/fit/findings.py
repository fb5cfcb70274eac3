"""Findings printed with the answer of a fit."""

from collections.abc import Iterable
from functools import singledispatch

from jblast.inference import mcmc
from jblast.inference.fitting import findings as fitting
from jblast.inference.fitting.assumptions import StillAir, WindPassesForSoundSpeed
from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.solution import SamplesRoughlyCounted
from jblast.inference.fitting.summary import Summary
from jblast.inference.identify import Cure, OtherMode, ResolvingDatum
from jblast.inference.posterior.parameters import Finding
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import QUANTITIES
from jblast.report.words import finite, joined, parameter_words, printed_number

MARGINAL = 0.01
"""p below which a fit is called marginal; below `POOR`, 0.001, it is called poor. One
good fit in a hundred falls below it by chance."""
MAX_NAMED = 5
"""Largest number of sensors that one warning names; the rest is a count."""
RANGING = "range = sound speed times the delay after the flash"
WHERE = {
    "sensor": "at a sensor of the log",
    "place": "at a new position",
    "aside": "at a new position off the sensors' line",
    "range": "at a new range",
    "later": "at a later time",
}
TEMPLATES: dict[type[Finding], str] = {
    fitting.ModeFoundOnce: "the best solution was found by one search only; there may "
    "be a better one",
    fitting.WeightsUnreliable: "the intervals are rough: few draws have most of the "
    "weight (k-hat {0.k_hat:.2f}, effective sample size {0.effective:.0f})",
    SamplesRoughlyCounted: "the log-likelihood of the samples is accurate to "
    "{0.known:.2g} between the points where it was computed, required {0.wanted:g}: "
    "the intervals are rough; fit the picks instead",
    fitting.BurstsUnsettled: "the curve sets for the height of burst at the answer "
    'differ from those of the fit; set burst = "surface" or "free-air" of the charge',
    fitting.FarFromItsLaw: "the whole shot, or a path, departs from its law by "
    "{0.times:.1f} times the expected scatter: the law may not apply to this setting",
    fitting.HeightOfBurst: "{0.note}",
    fitting.Walked: "MCMC (emcee)",
    fitting.DrawsWeighted: "draws of a mixture, weighted by the posterior (importance "
    "sampling, k-hat {0.k_hat:.2f}, effective sample size {0.effective:.0f})",
    mcmc.QuantilesUncertain: "the quantiles of {0.parameter} have a standard error of "
    "{0.error:.2g} sd, required {0.wanted:g}",
    mcmc.ChainTooShort: "{0.steps} steps are {0.times:.0f} autocorrelation times of "
    "{0.parameter}, required {0.wanted:.0f}",
    mcmc.ChainsDisagree: "R-hat of {0.parameter} is {0.r_hat:.3g}, required "
    "{0.wanted:g}",
}
"""Sentences with fields of the finding only; other findings have a function."""


def goodness_p(found: Summary) -> float | None:
    """Return the p value of the chi2; None without degrees of freedom."""
    chi2 = finite(found.chi2)
    return None if chi2 is None else p_value(chi2, found.dof)


def goodness_sentence(found: Summary) -> str:
    """Return a sentence on the chi2 of the fit."""
    p = goodness_p(found)
    if p is None and found.dof > 0:
        return "Goodness of fit is unknown: there is no chi2."
    if p is None:
        return (
            "Goodness of fit is unknown: there are no more recordings than free "
            "parameters."
        )
    if p < POOR:
        return (
            f"The fit is poor (p {printed_p(p)}): the recordings disagree with the law "
            "by more than their errors allow, and the intervals are likely too narrow."
        )
    if p < MARGINAL:
        return (
            f"The fit is marginal (p {printed_p(p)}): the stated errors give so large "
            "a disagreement in less than 1 % of logs."
        )
    # as improbable as a poor fit, on the other side
    if p > 1 - POOR:
        return (
            f"The recordings lie closer to the law than their errors allow "
            f"(p {printed_p(p)}): the errors may be overstated."
        )
    return f"The recordings agree with the law within their errors (p {printed_p(p)})."


def goodness_numbers(found: Summary) -> str:
    """Return chi2, degrees of freedom and p value in one line."""
    chi2, p = finite(found.chi2), goodness_p(found)
    shown = "unknown" if chi2 is None else f"{chi2:.1f}"
    line = f"chi2 = {shown} on {found.dof} degrees of freedom"
    return line if p is None else f"{line}, p {printed_p(p)}"


def printed_p(p: float) -> str:
    """Return a probability with its comparison sign: "= 0.27", "< 0.001"."""
    if p < POOR:
        return f"< {POOR}"
    return f"> {1 - POOR}" if p > 1 - POOR else f"= {p:.2g}"


def cure_words(cure: Cure) -> str:
    """Return the priors, measurements or data that resolve a null direction."""
    known = f"a prior on, or a measurement of, {' or '.join(cure.parameters)}"
    added = "; ".join(datum_words(datum) for datum in cure.data)
    return f"{known}; or {added}" if added else known


def datum_words(datum: ResolvingDatum) -> str:
    """Return the quantity to record, with its location."""
    quantity = QUANTITIES[datum.quantity].with_article()
    bang = f" (of the bang: {RANGING})" if datum.is_bang else ""
    clock = ", on a correct clock" if datum.on_right_clock else ""
    return f"{quantity}{bang} {WHERE[datum.where]}{clock}"


def other_mode_words(other: OtherMode) -> str:
    """Return the parameters in which another optimum differs, and its chi2."""
    kind = "position" if set(CHARGE_POSITION) & set(other.differ) else "solution"
    names = ", ".join(sorted(other.differ)) or "all"
    return (
        f"another {kind} in {names} explains the log nearly as well (chi squared "
        f"differs by {other.delta_chi2:.2g})"
    )


def all_words(findings: Iterable[Finding]) -> list[str]:
    """Return a sentence for each finding."""
    return [words(finding) for finding in findings]


@singledispatch
def words(finding: Finding) -> str:
    """Return a finding as a sentence, without its full stop."""
    if type(finding) not in TEMPLATES:
        raise NotImplementedError(f"no words for {type(finding).__name__}")
    return TEMPLATES[type(finding)].format(finding)


@words.register
def _(finding: fitting.PoorFit) -> str:
    text = (
        f"poor fit: chi squared {finding.chi2:.1f} on {finding.dof} degrees of "
        f"freedom, p = {finding.p_value:.1g}"
    )
    if not finding.log:
        return text
    return (
        f"{text}; `jblast check {finding.log}` searches for wrong units, clocks and "
        f"positions; `jblast scene {finding.log}` writes a scene to which air, ground "
        "and priors can be added"
    )


@words.register
def _(finding: fitting.MoreToFree) -> str:
    return (
        f"the recordings fit (p = {finding.p_value:.2g}) with more parameters free: "
        f"--free {','.join(finding.parameters)}"
    )


@words.register
def _(finding: fitting.LawsUnsettled) -> str:
    options = " ".join(f"--law {law}" for law in finding.laws)
    return (
        "the automatic choice of law at the answer differs from the law of the fit; "
        f"its choice there: {options}"
    )


@words.register
def _(finding: fitting.FlatGround) -> str:
    far, off = (printed_number("_m", x, 2) for x in (finding.range_m, finding.error_m))
    return (
        f"flat ground was assumed: at {finding.sensor}, {far} away, the error of the "
        f"distance is {off}, {finding.sigmas:.2g} sigma of its {finding.quantity}"
    )


@words.register
def _(finding: fitting.PriorConflict) -> str:
    at = ", ".join(f"{name} = {value:.4g}" for name, value in finding.values.items())
    return (
        f"without priors the log fits well, at {at}, which a prior excludes; correct "
        "or widen the prior, or correct the readings"
    )


@words.register
def _(finding: fitting.LawOutOfRange) -> str:
    deeper = " at the lower bound of the 90 % interval" if finding.is_deeper else ""
    limits = "; ".join(f"range of {law}: {where}" for law, where in finding.ranges)
    return (
        f"{finding.rows} of {finding.of} rows lie outside their law's range{deeper} "
        f"({', '.join(finding.quantities)}); {limits}"
    )


@words.register
def _(finding: fitting.NoScene) -> str:
    air = "sea-level air"
    if finding.altitude_m:
        air = f"the standard atmosphere at {finding.altitude_m:.0f} m"
    if not finding.freed:
        position = "at the origin at time 0, in"
        return f"no scene was given: a surface charge of TNT {position} {air}"
    clocks = [name for name in finding.freed if name.startswith(f"{CLOCK_OFFSET}.")]
    names = [parameter_words(name) for name in finding.freed if name not in clocks]
    if clocks:
        offsets = "clock offset" if len(clocks) == 1 else "clock offsets"
        names.append(f"{len(clocks)} {offsets}")
    free = joined(names)
    return f"no scene was given: a surface charge of TNT in {air}; also free: {free}"


@words.register
def _(finding: fitting.SlowerThanSound) -> str:
    shown = finding.sensors[:MAX_NAMED]
    more = len(finding.sensors) - len(shown)
    names = joined([*shown, f"{more} more sensors"] if more else shown)
    return (
        f"slower than sound: the arrivals at {names} imply mean speeds down to "
        f"{finding.speed_m_s:.0f} m/s (speed of sound {finding.sound_m_s:.0f} m/s), "
        "more than scatter explains; check clocks, distances, and temperature and "
        "wind of the scene"
    )


@words.register
def _(finding: fitting.NothingLearned) -> str:
    names = ", ".join(finding.parameters)
    return f"intervals of {names} are those of the prior: the log does not narrow them"


@words.register
def _(finding: fitting.DeepCharge) -> str:
    which = f"the charge {finding.charge}" if finding.charge else "the charge"
    return (
        f"{which} was {finding.scaled_depth:.2g} m/kg^(1/3) deep; of its burial the "
        "laws used include the longer path only"
    )


@words.register
def _(finding: fitting.NoPointSource) -> str:
    return (
        f"{' and '.join(finding.laws)} applies to a point source, and a charge of "
        f"{finding.explosive} is not one: near the charge the estimated mass can be "
        'many times too small; for a nuclear burst set explosive = "nuclear"'
    )


@words.register
def _(finding: fitting.ClocksTakenToAgree) -> str:
    one = len(finding.clocks) == 1
    which = f"the clock {finding.clocks[0]} and the common clock"
    which = which if one else f"the clocks {', '.join(finding.clocks)}"
    needed = ""
    if finding.resting:
        verb = "is" if len(finding.resting) == 1 else "are"
        needed = f" (otherwise {joined(finding.resting)} {verb} not identified)"
    return (
        f"{which} were assumed to agree{needed}; "
        f"--free {','.join(finding.parameters)} fits their offsets"
    )


@words.register
def _(finding: fitting.PathsTakenAsIndependent) -> str:
    taken = (
        f"the scatter of {finding.paths:,} paths was assumed independent (correlation "
        f"is modelled for at most {finding.limit:,} paths)"
    )
    remedy = f"fit {finding.limit:,} paths or fewer to include the correlation"
    if not finding.beyond_array:
        return (
            f"{taken}; the scatter of neighbouring paths is correlated, so intervals "
            f"of position and time are too narrow; {remedy}"
        )
    return (
        f"{taken}; the sensors are close together compared with the range, so the "
        "scatter of their paths is correlated: the intervals of bearing and range are "
        f"too narrow, and the range may be too small; {remedy}"
    )


@words.register
def _(finding: fitting.FlashesSetAside) -> str:
    names = joined(finding.clocks)
    one = len(finding.clocks) == 1
    verb, clock = ("has", "clock") if one else ("have", "clocks")
    offsets = ",".join(f"{CLOCK_OFFSET}.{name}" for name in finding.clocks)
    return (
        f"the flash times on the {clock} {names} were not used: {names} {verb} "
        "no other readings that relate it to the other clocks; if it agrees with "
        "them, write their name in the column clock, or set offset_s in the scene; "
        f"--free {offsets} fits its offset"
    )


@words.register
def _(finding: WindPassesForSoundSpeed) -> str:
    name = finding.parameter
    absorbs = f"the fitted {name}" if finding.is_fitted else f"a prior on {name}"
    return (
        "still air; wind along the paths acts like a change of the sound speed, and "
        f"{absorbs} covers it"
    )


@words.register
def _(finding: StillAir) -> str:
    unknown = f"still air; with unknown wind (sd {finding.wind_sd:g} m/s per component)"
    if finding.wider is None:
        return f"{unknown} the intervals would widen by an unknown factor"
    if not finding.wider:
        return f"{unknown} no 90 % interval would widen by 5 %"
    wide = ", ".join(
        f"{parameter_words(name)} {by:.2g} times" for name, by in finding.wider.items()
    )
    return f"{unknown} 90 % intervals would be wider: {wide}"


@words.register
def _(finding: fitting.SeveralExplanations) -> str:
    others = " or ".join(finding.others)
    return (
        f"the recordings of {finding.suspected} are suspected, but without those of "
        f"{others} the log fits as well; the log does not determine which is wrong"
    )
