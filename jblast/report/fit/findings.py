"""What a fit, or a bound, has to tell beside its numbers, in words."""

from collections.abc import Iterable
from functools import singledispatch

from jblast.inference.fitting import findings as fitting
from jblast.inference.fitting.samples.findings import SamplesRoughlyCounted
from jblast.inference.fitting.still_air import StillAir, WindPassesForSoundSpeed
from jblast.inference.posterior.finding import Finding
from jblast.parameter_table import CLOCK_OFFSET
from jblast.report.fit.posterior_findings import posterior_words
from jblast.report.numbers import printed_number
from jblast.report.words import joined, parameter_words


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
