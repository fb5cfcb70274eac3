"""What a pick reads, as rows of a log hold it: values, sigmas and their covariance."""

from collections.abc import Sequence

import numpy as np

from jblast.inference.picks import RecordPick
from jblast.observations.table import OF_SAMPLES, RecordCovariance
from jblast.quantities import ADDITIVE

TOLD = OF_SAMPLES
"""Quantities in the order of a pick's covariance."""


def log_value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return value and sigma; of a clipped peak where it clips, at least."""
    if quantity == "peak_overpressure_pa" and bool(one.pick.lower_bound):
        level = float(one.pick.clipped_at_pa - one.pick.baseline_pa)
        return level, float(one.pick.noise_pa)
    at = TOLD.index(quantity)
    value = float(getattr(one.pick, quantity))
    sd = float(np.sqrt(one.pick.covariance[at, at]))
    return value, sd if quantity in ADDITIVE else sd * value


def covariance_of(
    one: RecordPick, record: str, quantities: Sequence[str]
) -> RecordCovariance:
    """Return how the errors of a pick's rows go together.

    A peak that is a lower bound has an error of its own, that of a reading.

    Args:
        one: The pick.
        record: What the log calls it.
        quantities: Of its rows.

    Raises:
        ValueError: They go together as no errors can.
    """
    bound = bool(one.pick.lower_bound)
    names = tuple(
        name
        for name in TOLD
        if name in quantities and not (bound and name == "peak_overpressure_pa")
    )
    at = [TOLD.index(name) for name in names]
    matrix = np.asarray(one.pick.covariance, float)[np.ix_(at, at)]
    return RecordCovariance(record, names, 0.5 * (matrix + matrix.T))
