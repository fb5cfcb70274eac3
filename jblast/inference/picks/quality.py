"""How far a pick may be trusted, and why: findings, worded where they are printed."""

from typing import Literal

import numpy as np

from jblast.inference.picks.fit.lanes import AGAIN, HOPELESS_MISFIT, SLIGHT
from jblast.inference.picks.result import Pick

Quality = Literal["good", "doubtful", "poor"]

NoteKind = Literal[
    "nothing_found",
    "onset_alone",
    "not_converged",
    "clipped",
    "misfit",
    "few_quiet_samples",
    "under_sampled",
    "sharp_front",
    "cut_short",
    "drifting",
    "curved_baseline",
    "resonating",
    "high_passed",
    "later_arrival",
    "zero_shift",
    "front_alone",
    "reversed_polarity",
    "duration_unsure",
    "faint",
]
"""What may be said of a pick."""

POOR = frozenset({"nothing_found", "not_converged"})
HARMLESS = frozenset({"sharp_front", "drifting", "later_arrival"})
"""These were seen and are within the errors; any other makes a pick doubtful."""

UNSURE_DURATION = 0.2
"""Standard deviation of ln duration from which on it is hardly known."""

FAINT = 0.1
"""Standard deviation of ln peak from which on a pulse is faint."""


def notes_of(pick: Pick) -> tuple[NoteKind, ...]:
    """Return what is to be said of the pick of one record."""
    if not bool(pick.found):
        return ("nothing_found",)
    if np.isnan(pick.peak_overpressure_pa):
        return ("onset_alone",)
    spread = np.asarray(pick.spread)
    said: dict[NoteKind, bool] = {
        "not_converged": not bool(pick.converged),
        "clipped": bool(np.isfinite(pick.clipped_at_pa)),
        "misfit": float(pick.misfit) > AGAIN,
        "few_quiet_samples": not bool(pick.noise_known),
        "under_sampled": bool(pick.under_sampled),
        "sharp_front": bool(pick.sharp),
        "cut_short": bool(pick.cut_short),
        "drifting": bool(pick.drifting),
        "curved_baseline": bool(pick.curving),
        "resonating": bool(pick.resonating),
        "high_passed": bool(pick.high_passed),
        "later_arrival": bool(np.any(np.isfinite(pick.later_arrivals_s))),
        "zero_shift": bool(pick.shifted),
        "front_alone": bool(pick.front_alone),
        "duration_unsure": not spread[2] < UNSURE_DURATION,
        "faint": not spread[1] < FAINT,
    }
    return tuple(kind for kind, holds in said.items() if holds)


def quality_of(pick: Pick) -> Quality:
    """Return how far the pick of one record may be trusted."""
    notes = set(notes_of(pick))
    if "onset_alone" in notes:
        return "doubtful"
    if notes & POOR or hopeless(pick):
        return "poor"
    return "doubtful" if notes - HARMLESS else "good"


def hopeless(pick: Pick) -> bool:
    """Return whether the model explains next to nothing of the record."""
    left = np.sqrt(float(pick.misfit)) * float(pick.noise_pa)
    slight = left < SLIGHT * abs(float(pick.peak_overpressure_pa))
    return float(pick.misfit) > HOPELESS_MISFIT and not slight
