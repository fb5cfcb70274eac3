import numpy as np
import pytest

from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_blast_wind,
    kingery_bulmash_dynamic_pressure,
    kingery_bulmash_pressure,
    kingery_bulmash_reflected_pressure,
    kingery_bulmash_shock_speed,
)

AMBIENT, SOUND = 9e4, 330.0
both_bursts = pytest.mark.parametrize("burst", ["surface", "free-air"])


@both_bursts
def test_wind_times_front_speed_and_density_is_the_overpressure(burst):
    r = np.geomspace(1.0, 40.0, 100)
    wind = kingery_bulmash_blast_wind(r, 1.0, AMBIENT, SOUND, burst)
    speed = kingery_bulmash_shock_speed(r, 1.0, AMBIENT, SOUND, burst)
    density = 1.4 * AMBIENT / SOUND**2
    # momentum; their tabulated speed is within 0.6 % of the jump relation past Z = 1
    np.testing.assert_allclose(
        wind * speed * density,
        kingery_bulmash_pressure(r, 1.0, AMBIENT, burst),
        rtol=0.006,
    )


@both_bursts
def test_the_dynamic_pressure_is_what_reflection_adds(burst):
    r = np.geomspace(1.0, 40.0, 100)
    q = kingery_bulmash_dynamic_pressure(r, 1.0, burst=burst)
    incident = kingery_bulmash_pressure(r, 1.0, burst=burst)
    reflected = kingery_bulmash_reflected_pressure(r, 1.0, burst=burst)
    # p_r = 2 p + 12/5 q, which their tables keep to 1.6 % of p_r past Z = 1
    np.testing.assert_allclose(2 * incident + 2.4 * q, reflected, rtol=0.016)


def test_far_away_the_wind_is_that_of_sound():
    p = float(kingery_bulmash_pressure(1e5, 1.0, AMBIENT))
    wind = float(kingery_bulmash_blast_wind(1e5, 1.0, AMBIENT, SOUND))
    assert wind == pytest.approx(p * SOUND / (1.4 * AMBIENT), rel=1e-5)
