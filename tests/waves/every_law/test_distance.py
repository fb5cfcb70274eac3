"""With distance every wave comes later and weaker; what is no distance is refused."""

import numpy as np
import pytest

from tests.waves.every_law.laws import (
    every_law,
    in_blocks,
    points,
)

FALLING = ("peak_overpressure_pa", "reflected_pressure_pa", "reflected_impulse_pa_s")
FALLING += ("shock_speed_m_s", "blast_wind_m_s", "dynamic_pressure_pa")
FALLING += ("ground_displacement_m", "ground_peak_velocity_m_s")
RISING = ("air_arrival_s", "ground_arrival_s", "flash_time_s")
DIPS = {
    # as printed: the first leaves the speed of sound past its table, the second turns
    # up at its end
    ("shock_speed_m_s", "kingery_bulmash", "surface"): (0.0, 40.0),
    ("shock_speed_m_s", "swisdak", None): (0.0, 38.0),
}
"""Where a law is not monotone though physics says so, and where it is."""


@every_law
def test_with_distance_waves_come_later_and_grow_weaker(law, word):
    if law.quantity not in (*FALLING, *RISING):
        pytest.skip("physics does not say: impulse and duration rise and fall")
    z = np.geomspace(0.01, 1e5, 4000)
    low, high = DIPS.get((law.quantity, law.name, word), (0.0, np.inf))
    z = z[(z > low) & (z < high)]
    one = points(z[:1], np.ones(1))
    along = {name: np.full(z.shape, value) for name, value in one.items()}
    along |= dict.fromkeys(("slant_range", "ground_range"), z)
    sign = 1.0 if law.quantity in RISING else -1.0
    steps = sign * np.diff(np.log(in_blocks(law, word, along)))
    assert np.all(steps > -1e-12), z[:-1][steps <= -1e-12]
