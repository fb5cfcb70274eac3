"""Sentences on the agreement of the recordings with their law."""

from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.summary import Summary
from jblast.report.messages import printed_p
from jblast.report.words import finite

MARGINAL = 0.01
"""p below which a fit is called marginal; below `POOR`, 0.001, it is called poor. One
good fit in a hundred falls below it by chance."""


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
