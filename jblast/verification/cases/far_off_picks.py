"""Simulated records whose picks are far off, and how many of them say so."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.picks import RecordPick, pick_records
from jblast.verification.cases.pressure_records import Recorder, readings, recorded

LOGS, SEED = 5, 3
FAR = 4.0
"""Standard deviations; a normal error is beyond once in 16,000."""


class Shares(NamedTuple):
    """How many picks fail, by level.

    Attributes:
        failed: Share that is far off or not found.
        unmarked: Share that is far off and called good.
        marked: Share that is not called good, far off or not.
    """

    failed: Float[np.ndarray, " level"]
    unmarked: Float[np.ndarray, " level"]
    marked: Float[np.ndarray, " level"]


def shares_of(recorders: Sequence[Recorder]) -> Shares:
    """Return how many picks fail of records that are taken in each way."""
    rng = np.random.default_rng(SEED)
    truths = [readings(rng, scatter=True) for _ in range(LOGS)]
    records = []
    for recorder in recorders:
        # the same noise for each
        drawn = np.random.default_rng(SEED + 1)
        records += [r for one in truths for r in recorded(drawn, one, recorder)]
    picks = pick_records(records)
    truth = np.tile(np.concatenate(truths), (len(recorders), 1))
    far = np.array(
        [is_far_off(one, true) for one, true in zip(picks, truth, strict=True)]
    )
    good = np.array([one.quality == "good" for one in picks])
    found = np.array([bool(one.pick.found) for one in picks])
    shape = len(recorders), -1

    def share(which: Bool[np.ndarray, " record"]) -> Float[np.ndarray, " level"]:
        return which.reshape(shape).mean(axis=1)

    return Shares(share(far | ~found), share(far & good), share(~good))


def is_far_off(one: RecordPick, truth: Float[np.ndarray, "4"]) -> bool:
    """Return whether a value of a pick is off by more than it may be.

    Args:
        one: The pick.
        truth: Arrival, peak, duration and impulse.
    """
    found = one.pick
    arrival = float(found.air_arrival_s) - truth[0]
    others = np.array(
        [
            found.peak_overpressure_pa,
            found.positive_duration_s,
            found.positive_impulse_pa_s,
        ]
    )
    error = np.append(arrival, np.log(others / truth[1:]))
    return bool(np.any(np.abs(error) > FAR * np.asarray(found.spread)[:4]))
