r"""What is lost by taking the ground as flat, at each reading of a log in degrees.

The frame's axes are straight. A wave along the ground goes by the arc, longer than the
chord $d$ by $d^3 / 24 R^2$ (8 mm at 20 km), and a charge that is fixed at up = 0 at a
distance $s$ from the origin stands $s^2 / 2R$ above the ground (31 m at 20 km).
"""

import numpy as np
from jaxtyping import Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.fitting.findings import FlatGround
from jblast.observations import Observations
from jblast.quantities import TIMES

EARTH_RADIUS = 6_371_008.8
"""Mean radius [m]. Moritz (2000), Geodetic Reference System 1980, J. Geodesy 74."""
NOTICED = 0.1
"""An error of so many sigmas is told."""
FALL = 1.4
"""Pressures and impulses fall no faster than by this power of the distance, far off."""


def flat_ground(
    observations: Observations,
    charge: Float[np.ndarray, "row 3"],
    slant_range: Float[np.ndarray, " row"],
) -> FlatGround | None:
    """Return the reading that the flat ground is furthest off for, if it is noticed.

    Args:
        observations: The log; None is returned of one without a place on the Earth.
        charge: East, north, up of each row's charge [m].
        slant_range: Distance of each row from it [m].
    """
    if observations.frame is None or not len(observations):
        return None
    arc = slant_range**3 / (24.0 * EARTH_RADIUS**2)
    drop = np.sum(charge[:, :2] ** 2, axis=1) / (2.0 * EARTH_RADIUS)
    level = observations.position - charge
    lower = level + drop[:, None] * np.array([0.0, 0.0, 1.0])
    tilt = np.abs(np.linalg.norm(lower, axis=1) - np.linalg.norm(level, axis=1))
    error = arc + tilt
    timed = np.isin(observations.quantity, TIMES)
    share = FALL * error / np.maximum(slant_range, 1.0)
    shift = np.where(timed, error / STANDARD_SOUND_SPEED, share)
    sigmas = np.nan_to_num(shift / observations.error_scale())
    worst = int(np.argmax(sigmas))
    if not sigmas[worst] > NOTICED:
        return None
    return FlatGround(
        observations.sensor[worst],
        observations.quantity[worst],
        float(slant_range[worst]),
        float(error[worst]),
        float(sigmas[worst]),
    )
