"""Radius and place of silhouettes that are known."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.signals.flash.fireball import silhouette
from tests.signals.flash.films import SHAPE, disc

SEED = np.ones(SHAPE, bool)


@given(
    st.floats(4.0, 20.0), st.floats(30.0, 45.0), st.floats(28.0, 34.0), st.booleans()
)
@settings(max_examples=25, deadline=None)
def test_disc_and_half_disc_have_their_radius(radius, x, y, half):
    seen = silhouette(0.0, disc(x, y, radius, half=half), SEED)
    assert seen is not None
    # the error that is told: its columns are few, and its lowest row is lit by half
    assert seen.radius_px == pytest.approx(radius, abs=0.3)
    assert seen.x_px == pytest.approx(x, abs=0.15)
    above = 4 * radius / (3 * np.pi) if half else 0.0
    assert seen.y_px == pytest.approx(y - above, abs=0.3)
    assert not seen.cut


def test_only_the_spot_at_the_seed_counts():
    share = np.maximum(disc(20, 30, 6), disc(60, 30, 10))
    seed = np.zeros(SHAPE, bool)
    seed[30, 18:22] = True
    seen = silhouette(0.0, share, seed)
    assert seen is not None
    assert seen.x_px == pytest.approx(20, abs=0.1)
    assert silhouette(0.0, share, np.zeros(SHAPE, bool)) is None
    assert silhouette(0.0, np.zeros(SHAPE), SEED) is None


def test_a_spot_at_the_edge_is_cut():
    seen = silhouette(0.0, disc(3, 30, 10), SEED)
    assert seen is not None
    assert seen.cut
