"""What sampling shows of a posterior, in words: its normal, modes, a ridge."""

from collections.abc import Mapping
from functools import singledispatch

import numpy as np

from jblast.inference.importance import findings as importance
from jblast.inference.mcmc import findings as mcmc
from jblast.inference.posterior.finding import Finding

NORMAL = "the 90 % intervals are those of a normal approximation"


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
