"""Which law read each quantity, why, and whether it holds there."""

from dataclasses import dataclass

import numpy as np

from jblast.inference.fitting.result import Fit
from jblast.registry import LAWS, Law
from jblast.report.choice.reason import law_reasons
from jblast.report.words import joined, law_words, quantity_words


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
