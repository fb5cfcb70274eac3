"""Random lenses, wider than those that are sold."""

import numpy as np
from hypothesis import strategies as st
from scipy.optimize import brentq

from jblast.sensors.camera.geometry import distortion_jacobian

LENS = st.tuples(
    st.floats(-0.5, 0.5),
    st.floats(-0.3, 0.3),
    st.floats(-0.02, 0.02),
    st.floats(-0.02, 0.02),
    st.floats(-0.1, 0.1),
).map(np.array)
"""k1, k2, p1, p2, k3."""


def fold_radius(lens, way) -> float:
    """Return the radius at which a lens first folds over along a unit vector."""

    def least(radius):
        xx, xy, yy = distortion_jacobian(np.asarray(radius)[..., None] * way, lens)
        return (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)

    radii = np.tan(np.arange(1024) * (np.pi / 2 / 1024))
    folded = np.flatnonzero(least(radii) <= 0)
    if not folded.size:
        return np.inf
    return brentq(least, radii[folded[0] - 1], radii[folded[0]], xtol=1e-15)
