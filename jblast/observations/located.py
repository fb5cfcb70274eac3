"""A log where its scene has its origin."""

import numpy as np

from jblast.errors import InputError
from jblast.observations.framed import framed
from jblast.observations.places.frame import FARTHEST, Frame
from jblast.observations.table import Observations
from jblast.scene import UncertainScene


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
