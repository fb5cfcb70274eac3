"""Findings printed with the answer of a fit."""

from collections.abc import Iterable, Mapping
from functools import singledispatch

import numpy as np

from jblast.inference import importance
from jblast.inference.fitting import findings as fitting
from jblast.inference.fitting.assumptions import StillAir, WindPassesForSoundSpeed
from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.solution import SamplesRoughlyCounted
from jblast.inference.fitting.summary import Summary
from jblast.inference.identifiability import Cure, OtherMode, ResolvingDatum
from jblast.inference.mcmc import ensemble as mcmc
from jblast.inference.posterior.parameters import Finding
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import QUANTITIES
from jblast.report.words import finite, joined, parameter_words, printed_number

MARGINAL = 0.01
MOST_NAMED = 5
"""Sensors named in one warning: more of them are a line of their own."""
RANGING = "its range is the sound speed times what it comes after the flash"
WHERE = {
    "sensor": "at a sensor of the log",
    "place": "at a new place",
    "aside": "at a new place off the sensors' line",
    "range": "at a new range",
    "later": "at a later time",
}
NORMAL = "the 90 % intervals are those of a normal approximation"


def goodness_p(found: Summary) -> float | None:
    """Return the chance of a worse chi2 than this by luck; None without freedom."""
    chi2 = finite(found.chi2)
    return None if chi2 is None else p_value(chi2, found.dof)


def goodness_sentence(found: Summary) -> str:
    """Return a sentence on the chi2 of the fit."""
    p = goodness_p(found)
    if p is None and found.dof > 0:
        return "There is no chi2, so nothing says whether the law fits the recordings."
    if p is None:
        return (
            "There are no more recordings than unknowns, so the recordings cannot say "
            "whether the law fits them."
        )
    if p < POOR:
        return (
            f"The fit is poor (p {printed_p(p)}): the recordings disagree with the law "
            "by more than their errors allow, and the intervals are likely too narrow."
        )
    if p < MARGINAL:
        return (
            f"The fit is marginal (p {printed_p(p)}): by luck alone, errors as stated "
            "seldom disagree with the law so much."
        )
    if p > 1 - POOR:
        return (
            f"The recordings lie closer to the law than their errors allow "
            f"(p {printed_p(p)}): the errors may be overstated."
        )
    return f"The recordings agree with the law within their errors (p {printed_p(p)})."


def goodness_numbers(found: Summary) -> str:
    """Return chi2, degrees of freedom and p in one line."""
    chi2, p = finite(found.chi2), goodness_p(found)
    shown = "unknown" if chi2 is None else f"{chi2:.1f}"
    line = f"chi2 = {shown} on {found.dof} degrees of freedom"
    return line if p is None else f"{line}, p {printed_p(p)}"


def printed_p(p: float) -> str:
    """Print a probability with its sign of comparison: "= 0.27", "< 0.001"."""
    if p < POOR:
        return f"< {POOR}"
    return f"> {1 - POOR}" if p > 1 - POOR else f"= {p:.2g}"


def cure_words(cure: Cure) -> str:
    """Say which prior, measurement or datum would end a null direction."""
    known = f"a prior on, or a measurement of, {' or '.join(cure.parameters)}"
    added = "; ".join(datum_words(datum) for datum in cure.data)
    return f"{known}; or {added}" if added else known


def datum_words(datum: ResolvingDatum) -> str:
    """Say what to record, and where."""
    what = QUANTITIES[datum.quantity].with_article()
    bang = f" (the bang: {RANGING})" if datum.is_bang else ""
    clock = ", on a clock that is right" if datum.on_right_clock else ""
    return f"{what}{bang} {WHERE[datum.where]}{clock}"


def other_mode_words(other: OtherMode) -> str:
    """Say why another optimum is one."""
    what = "place" if set(CHARGE_POSITION) & set(other.differ) else "solution"
    names = ", ".join(sorted(other.differ)) or "all"
    return (
        f"another {what} of {names} explains the log nearly as well (chi squared "
        f"differs by {other.delta_chi2:.2g})"
    )


def all_words(findings: Iterable[Finding]) -> list[str]:
    """Return a sentence for each finding."""
    return [words(finding) for finding in findings]


def reason_words(reason: Finding | None) -> str:
    """Say why intervals come from the method they come from, or ""."""
    if reason is None:
        return ""
    if isinstance(reason, fitting.NotAtOptimum):
        return "the search did not arrive at an optimum"
    return words(reason)


@singledispatch
def words(finding: Finding) -> str:
    """Say what was found."""
    return posterior_words(finding)


@words.register
def _(finding: fitting.PoorFit) -> str:
    text = (
        f"poor fit: chi squared {finding.chi2:.1f} with {finding.dof} degrees of "
        f"freedom has a chance of {finding.p_value:.1g}"
    )
    if not finding.log:
        return text
    return (
        f"{text}; `jblast check {finding.log}` looks for slips of units, clocks and "
        f"places, `jblast scene {finding.log}` writes a scene that says more about the "
        "setting"
    )


@words.register
def _(finding: fitting.MoreToFree) -> str:
    return (
        f"the recordings fit (p {finding.p_value:.2g}) with more numbers free: "
        f"--free {','.join(finding.parameters)}"
    )


@words.register
def _(finding: fitting.FlatGround) -> str:
    far, off = (printed_number("_m", x, 2) for x in (finding.range_m, finding.error_m))
    return (
        f"the ground was taken as flat: the distance of {finding.sensor}, {far}, is "
        f"{off} off by that, {finding.sigmas:.2g} sigma of its {finding.quantity}"
    )


@words.register
def _(finding: fitting.PriorConflict) -> str:
    at = ", ".join(f"{name} = {value:.4g}" for name, value in finding.values.items())
    return (
        f"without priors the log fits well, at {at}: a prior rules that out; widen "
        "or correct it, or the readings"
    )


@words.register
def _(finding: fitting.LawOutOfRange) -> str:
    deeper = " as deep as the 90 % interval reaches" if finding.is_deeper else ""
    limits = "; ".join(f"{law} holds for {where}" for law, where in finding.ranges)
    return (
        f"{finding.rows} of {finding.of} rows lie outside their law's range{deeper} "
        f"({', '.join(finding.quantities)}); {limits}"
    )


@words.register
def _(finding: fitting.NotAtOptimum) -> str:
    return "the search did not arrive at an optimum: the answer is where it ended"


@words.register
def _(finding: SamplesRoughlyCounted) -> str:
    return (
        "the probability of the samples is known to "
        f"{finding.known:.2g} in ln between the places where it was computed, wanted "
        f"{finding.wanted:g}: take the intervals as rough, or fit the picks"
    )


@words.register
def _(finding: fitting.LawsUnsettled) -> str:
    return (
        "the automatic choice of law at the answer differs from the one it was "
        "fitted with; name one with --law"
    )


@words.register
def _(finding: fitting.BurstsUnsettled) -> str:
    return (
        "the curve sets that the height leaves at the answer differ from those it "
        'was fitted with; say burst = "surface" or "free-air" of the charge'
    )


@words.register
def _(finding: fitting.NoScene) -> str:
    air = "sea-level air"
    if finding.altitude_m:
        air = f"the standard atmosphere at {finding.altitude_m:.0f} m"
    if not finding.freed:
        place = "at the origin at time 0, in"
        return f"no scene was given: a surface charge of TNT {place} {air}"
    free = joined([parameter_words(name) for name in finding.freed])
    return f"no scene was given: a surface charge of TNT in {air}; free with it: {free}"


@words.register
def _(finding: fitting.SlowerThanSound) -> str:
    shown = finding.sensors[:MOST_NAMED]
    more = len(finding.sensors) - len(shown)
    names = joined([*shown, f"{more} more sensors"] if more else shown)
    return (
        f"slower than sound: the arrivals at {names} imply speeds from the charge down "
        f"to {finding.speed_m_s:.0f} m/s, where sound has {finding.sound_m_s:.0f} m/s, "
        "by more than scatter explains; check clocks, distances, and temperature and "
        "wind of the scene"
    )


@words.register
def _(finding: fitting.NothingLearned) -> str:
    names = ", ".join(finding.parameters)
    return f"the log tells nothing of {names} beyond the prior"


@words.register
def _(finding: fitting.FarFromItsLaw) -> str:
    return (
        f"the whole shot, or a path, departs from its law by {finding.times:.1f} "
        "times the scatter expected of it: the law may not suit this setting"
    )


@words.register
def _(finding: fitting.HeightOfBurst) -> str:
    return finding.note


@words.register
def _(finding: fitting.DeepCharge) -> str:
    which = f"the charge {finding.charge}" if finding.charge else "the charge"
    return (
        f"{which} lay {finding.scaled_depth:.2g} m/kg^(1/3) deep, of which the laws "
        "used know nothing but the longer way"
    )


@words.register
def _(finding: fitting.NoPointSource) -> str:
    return (
        f"{' and '.join(finding.laws)} is the law of a point source, which a charge of "
        f"{finding.explosive} is not: near it the mass can come out many times too "
        'small; a nuclear burst is explosive = "nuclear"'
    )


@words.register
def _(finding: fitting.ClocksTakenToAgree) -> str:
    one = len(finding.clocks) == 1
    which = f"the clock {finding.clocks[0]} and the common clock"
    which = which if one else f"the clocks {', '.join(finding.clocks)}"
    rests = ""
    if finding.resting:
        verb = "is" if len(finding.resting) == 1 else "are"
        rests = f", without which {joined(finding.resting)} {verb} not identified"
    return (
        f"{which} were taken to agree{rests}; "
        f"--free {','.join(finding.parameters)} fits what they differ by"
    )


@words.register
def _(finding: fitting.PathsTakenAsIndependent) -> str:
    taken = (
        f"the scatter of {finding.paths:,} paths was taken as independent, as that of "
        f"more than {finding.limit:,} paths is"
    )
    remedy = f"fit {finding.limit:,} of them or fewer to take it into account"
    if not finding.beyond_array:
        return (
            f"{taken}; neighbouring paths scatter alike, so intervals of position and "
            f"time are too narrow; {remedy}"
        )
    return (
        f"{taken}; the sensors are close together compared with the range, so their "
        "paths scatter alike: the intervals of bearing and range are too narrow, and "
        f"the range may be too small; {remedy}"
    )


@words.register
def _(finding: fitting.FlashesSetAside) -> str:
    names = joined(finding.clocks)
    verb, clock = ("reads", "clock") if len(finding.clocks) == 1 else ("read", "clocks")
    offsets = ",".join(f"{CLOCK_OFFSET}.{name}" for name in finding.clocks)
    return (
        f"the flash times on the {clock} {names} were set aside: {names} {verb} "
        "nothing else, so nothing ties that clock to the others; if it agrees with "
        "them, give it their name in the column clock, or an offset_s in the scene; "
        f"--free {offsets} fits its offset"
    )


@words.register
def _(finding: WindPassesForSoundSpeed) -> str:
    name = finding.parameter
    stands = f"{name}, which is fitted," if finding.is_fitted else f"a prior on {name}"
    return (
        "still air was taken, and a wind along the ranges would pass for another "
        f"sound speed: {stands} stands for it"
    )


@words.register
def _(finding: StillAir) -> str:
    said = (
        "still air was taken: were the wind unknown, "
        f"0 +- {finding.wind_sd:g} m/s (1 sd) towards east and north, "
    )
    if finding.wider is None:
        return f"{said}by how much intervals would widen cannot be told"
    if not finding.wider:
        return f"{said}no 90 % interval would widen by 5 %"
    wide = ", ".join(f"{name} {by:.2g} times" for name, by in finding.wider.items())
    return f"{said}90 % intervals would be wider: {wide}"


@words.register
def _(finding: fitting.SeveralExplanations) -> str:
    others = " or ".join(finding.others)
    return (
        f"the recordings of {finding.suspected} are suspected, but without those of "
        f"{others} the log would fit as well: it cannot say which is wrong"
    )


@words.register
def _(finding: fitting.AsAsked) -> str:
    return "as asked for"


@words.register
def _(finding: fitting.DirectionUnidentified) -> str:
    return "nothing else can be said of a log that leaves a direction untold"


@singledispatch
def posterior_words(finding: Finding) -> str:
    """Say what was found."""
    raise NotImplementedError(f"no words for {type(finding).__name__}")


@posterior_words.register
def _(finding: importance.IntervalsOff) -> str:
    off, k_hat = finding.off, f"(k-hat {finding.k_hat:.2f})"
    said = NORMAL
    if not np.isnan(off):
        said += f", off by up to {off:.1f} of a standard deviation at "
        said += finding.parameter
    if not np.isnan(finding.k_hat):
        said += (
            f"; how far they are off, importance sampling cannot tell {k_hat}"
            if np.isnan(off)
            else f", as far as importance sampling can tell {k_hat}"
        )
    return f"{said}: --posterior emcee walks"


@posterior_words.register
def _(finding: importance.NormalIntervals) -> str:
    return f"{NORMAL}, as {posterior_words(finding.because)}: --posterior emcee walks"


@posterior_words.register
def _(finding: importance.FewEffectiveDraws) -> str:
    return (
        f"importance sampling is left with {finding.effective:.0f} draws' worth, of "
        f"{finding.wanted} that intervals take"
    )


@posterior_words.register
def _(finding: importance.ImportanceCannotTell) -> str:
    return f"importance sampling cannot tell (k-hat {finding.k_hat:.2f})"


@posterior_words.register
def _(finding: importance.DrawsWeighted) -> str:
    return (
        "draws of the normal approximation, weighted by the posterior (importance "
        f"sampling, k-hat {finding.k_hat:.2f}, {finding.effective:.0f} draws' worth)"
    )


@posterior_words.register
def _(finding: importance.RangeFollowed) -> str:
    return (
        f"draws along the range of the charge: at {finding.ranges} ranges the "
        "posterior is integrated over bearing and all other numbers; the prior is flat "
        "in ln of the range"
    )


@posterior_words.register
def _(finding: importance.NormalJudged) -> str:
    said = (
        f"importance sampling k-hat {finding.k_hat:.2f}, largest sd in ln "
        f"{finding.log_sd:.2g}, ends of intervals off by {finding.off:.2f} sd"
    )
    limits = (
        f"the limits are {finding.most_k_hat:g}, {finding.most_log_sd:g} and "
        f"{finding.most_off:g}"
    )
    if finding.holds:
        return f"{said}: {limits}"
    return f"the normal approximation does not do ({said}; {limits})"


@posterior_words.register
def _(finding: mcmc.Interrupted) -> str:
    return f"stopped by Ctrl-C after {finding.steps} steps"


@posterior_words.register
def _(finding: mcmc.QuantilesUncertain) -> str:
    return (
        f"the quantiles of {finding.parameter} are known to {finding.error:.2g} "
        f"of its standard deviation, wanted {finding.wanted:g}"
    )


@posterior_words.register
def _(finding: mcmc.ChainTooShort) -> str:
    return (
        f"{finding.steps} steps are {finding.times:.0f} autocorrelation times of "
        f"{finding.parameter}, wanted {finding.wanted:.0f}"
    )


@posterior_words.register
def _(finding: mcmc.ChainsDisagree) -> str:
    return (
        f"R-hat of {finding.parameter} is {finding.r_hat:.3g}, wanted "
        f"{finding.wanted:g}"
    )


@posterior_words.register
def _(finding: mcmc.SeveralModes) -> str:
    parts = [
        f"{100 * share:.0f} % about {_place(peak)}"
        for share, peak in zip(finding.shares, finding.peaks, strict=True)
    ]
    return f"the posterior has {len(parts)} modes: {'; '.join(parts)}"


@posterior_words.register
def _(finding: mcmc.LongRidge) -> str:
    text = (
        f"the posterior is a ridge {finding.longer:.0f} times as long as its normal "
        f"approximation, from {_place(finding.low)} to {_place(finding.high)}"
    )
    if finding.is_endless:
        text += (
            "; the density does not fall beyond it, so the posterior is improper: "
            "expected a prior for one of these"
        )
    return text


def _place(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in values.items())
