"""Does the law agree with the recordings, within their errors?"""

from collections.abc import Mapping
from typing import Any

from jblast.inference.fitting.goodness_of_fit import POOR, chance
from jblast.report.numbers import finite

MARGINAL = 0.01


def goodness_p(answer: Mapping[str, Any]) -> float | None:
    """Return the chance of a worse chi2 than this by luck; None without freedom."""
    chi2, dof = finite(answer.get("chi2")), finite(answer.get("dof"))
    return None if chi2 is None or dof is None else chance(chi2, int(dof))


def goodness_sentence(answer: Mapping[str, Any]) -> str:
    """Say what chi2 says of the fit."""
    p = goodness_p(answer)
    if p is None and (answer.get("dof") or 0) > 0:
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


def goodness_numbers(answer: Mapping[str, Any]) -> str:
    """Return chi2, degrees of freedom and p in one line."""
    chi2, dof, p = finite(answer.get("chi2")), answer.get("dof"), goodness_p(answer)
    shown = "unknown" if chi2 is None else f"{chi2:.1f}"
    line = f"chi2 = {shown} on {dof} degrees of freedom"
    return line if p is None else f"{line}, p {printed_p(p)}"


def printed_p(p: float) -> str:
    """Print a probability with its sign of comparison: "= 0.27", "< 0.001"."""
    if p < POOR:
        return f"< {POOR}"
    return f"> {1 - POOR}" if p > 1 - POOR else f"= {p:.2g}"
