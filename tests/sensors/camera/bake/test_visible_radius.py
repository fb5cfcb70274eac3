import numpy as np
import pytest
from hypothesis import given, settings, strategies

from jblast.sensors.camera.bake.coding import visible_radius


def disc(size: int, radius: float, x: float, y: float) -> np.ndarray:
    down, across = np.mgrid[:size, :size]
    return (np.hypot(across - x, down - y) < radius).astype(float)


@settings(deadline=None, max_examples=30)
@given(
    radius=strategies.floats(8.0, 40.0),
    x=strategies.floats(55.0, 72.0),
    y=strategies.floats(55.0, 72.0),
)
def test_the_radius_of_a_disc_is_its_radius_wherever_it_is(radius, x, y):
    # pixels on the edge are in or out: a fraction of a pixel, less of large discs
    assert visible_radius(disc(128, radius, x, y)) == pytest.approx(radius, abs=0.25)


@pytest.mark.parametrize("radius", [10.0, 25.0, 45.0])
def test_the_radius_of_half_a_disc_on_the_ground_is_the_same(radius):
    half = disc(128, radius, 63.5, 99.5)
    half[100:] = 0.0
    assert visible_radius(half) == pytest.approx(radius, abs=0.25)


def test_the_radius_of_a_bar_is_its_width_over_the_root_of_three():
    """A bar's variance is w^2/12."""
    bar = np.zeros((20, 60))
    bar[:, 10:40] = 1.0
    assert visible_radius(bar) == pytest.approx(30 / np.sqrt(3.0), rel=1e-12)


def test_thin_dust_does_not_count_and_nothing_has_no_radius():
    cloud = disc(128, 20.0, 63.5, 63.5)
    dust = np.where(cloud > 0, cloud, 0.45)
    assert visible_radius(dust) == visible_radius(cloud)
    assert visible_radius(np.zeros((16, 16))) == 0.0
