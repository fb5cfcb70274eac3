"""A log about another origin."""

from dataclasses import replace

import numpy as np

from jblast.observations.places.frame import Frame
from jblast.observations.table import Observations


def framed(observations: Observations, frame: Frame) -> Observations:
    """Return a log whose positions count from a frame's origin.

    Of a log in metres they do already, as nobody said from where else.

    Args:
        observations: The log.
        frame: Where east, north, up are zero.
    """
    if observations.frame is None or observations.frame == frame:
        return replace(observations, frame=frame)
    position = observations.position.copy()
    known = ~np.isnan(position).any(axis=1)
    there = observations.frame.to_geodetic(position[known])
    position[known] = frame.to_enu(*there.T)
    return replace(observations, position=position, frame=frame)
