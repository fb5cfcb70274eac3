"""What a pick of one record tells: a value and its standard deviation, as numbers."""

from typing import NamedTuple

import numpy as np

from jblast.inference.picks import NAMES, RecordPick

ADDITIVE = ("air_arrival_s", "decay")
"""Their spread is in their own unit; that of the others is of their logarithm."""
IN_PASCALS = ("peak_overpressure_pa", "positive_impulse_pa_s", "negative_pressure_pa")
"""What samples that nobody scaled do not tell."""


class PickEstimate(NamedTuple):
    """A value and its standard deviation, in its unit."""

    value: float
    sd: float


def pick_estimate(one: RecordPick, name: str) -> PickEstimate | None:
    """Return a value of a pick; None where samples are no pascals and it is in them.

    None, too, where only the onset is told.

    Args:
        one: The pick of one record.
        name: One of `NAMES`.
    """
    if name in IN_PASCALS and not one.record.calibrated:
        return None
    value, spread = float(getattr(one.pick, name)), one.pick.spread[NAMES.index(name)]
    if np.isnan(value):
        return None
    return PickEstimate(
        value, float(spread) * (1.0 if name in ADDITIVE else abs(value))
    )
