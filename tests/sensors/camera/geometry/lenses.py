"""Random lenses, wider than those that are sold."""

import numpy as np
from hypothesis import strategies as st

LENS = st.tuples(
    st.floats(-0.5, 0.5),
    st.floats(-0.3, 0.3),
    st.floats(-0.02, 0.02),
    st.floats(-0.02, 0.02),
    st.floats(-0.1, 0.1),
).map(np.array)
"""k1, k2, p1, p2, k3."""
