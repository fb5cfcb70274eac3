import numpy as np
import pytest

from jblast.waves.laws.acoustic import acoustic_arrival_time
from jblast.waves.propagation import effective_sound_speed


def _exact_travel_time(way, wind, sound_speed):
    """The root of c t = |d - w t|: (c^2 - w^2) t^2 + 2 d.w t - d^2 = 0."""
    along = np.dot(way, wind)
    square = sound_speed**2 - np.dot(wind, wind)
    return (np.sqrt(along**2 + np.dot(way, way) * square) - along) / square


@pytest.mark.parametrize("wind", [8.0, -8.0])
def test_straight_up_or_down_the_wind_it_is_exact(wind):
    speed = effective_sound_speed(340.0, wind)
    exact = _exact_travel_time(np.array([500.0, 0.0]), np.array([wind, 0.0]), 340.0)
    np.testing.assert_allclose(acoustic_arrival_time(500.0, speed), exact, rtol=1e-13)


def test_across_the_wind_it_leaves_out_the_second_order_term():
    way, bearing = np.array([300.0, 400.0]), np.linspace(0, 2 * np.pi, 13)
    for wind in 10.0 * np.stack([np.cos(bearing), np.sin(bearing)], axis=1):
        along = np.dot(way, wind) / 500.0
        across_squared = 10.0**2 - along**2
        exact = 500.0 / _exact_travel_time(way, wind, 340.0)
        left_out = effective_sound_speed(340.0, along) - exact
        # sqrt(c^2 - w^2) = c - w^2/(2c) - w^4/(8c^3) - ..., the last below 1e-4 m/s
        np.testing.assert_allclose(left_out, across_squared / 680.0, atol=5e-5)
        assert left_out <= 4.4e-4 * 340.0
