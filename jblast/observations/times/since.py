"""A log whose clock times count from another moment."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from jblast.observations.table import CLOCK_TIMES, Observations


def since(observations: Observations, epoch: datetime) -> Observations:
    """Return a log of clock times whose clock times count from an epoch.

    Args:
        observations: The log; its own epoch is known.
        epoch: UTC of clock time zero.
    """
    if observations.epoch is None or observations.epoch == epoch:
        return observations
    # in whole microseconds, as an epoch is one to the second or the microsecond
    later = (observations.epoch - epoch) // timedelta(microseconds=1) / 1e6
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    return replace(
        observations,
        value=np.where(timed, observations.value + later, observations.value),
        time=observations.time + later,
        epoch=epoch,
    )
