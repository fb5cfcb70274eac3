"""Does the law agree with the recordings, within their errors?"""

from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.summary import Summary
from jblast.report.numbers import finite

MARGINAL = 0.01


def goodness_p(found: Summary) -> float | None:
    """Return the chance of a worse chi2 than this by luck; None without freedom."""
    chi2 = finite(found.chi2)
    return None if chi2 is None else p_value(chi2, found.dof)


def goodness_sentence(found: Summary) -> str:
    """Say what chi2 says of the fit."""
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
