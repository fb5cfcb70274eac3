"""A log about another origin: that of its scene, or of another log."""

from dataclasses import replace

import numpy as np

from jblast.errors import InputError
from jblast.observations.places.frame import FARTHEST, Frame
from jblast.observations.table import Observations
from jblast.scene import UncertainScene


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


def located(observations: Observations, uncertain: UncertainScene) -> Observations:
    """Return a log whose positions count from the place of its scene, if that has one.

    Raises:
        InputError: The log is on another continent.
    """
    if uncertain.place is None:
        return observations
    there = framed(observations, Frame(*uncertain.place))
    away = np.linalg.norm(there.position, axis=1)
    for row in np.flatnonzero(away > FARTHEST):
        raise InputError(
            f"{observations.where(int(row))}: the sensor stands {away[row] / 1e3:.4g} "
            f"km from [place] of {uncertain.source or 'the scene'}; expected both at "
            f"one site, within {FARTHEST / 1e3:g} km"
        )
    return there
