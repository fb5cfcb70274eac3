import numpy as np
import pytest

from jblast.registry import law_for
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_blast_wind,
    kingery_bulmash_dynamic_pressure,
    kingery_bulmash_pressure,
    kingery_bulmash_reflected_pressure,
    kingery_bulmash_shock_speed,
)
from jblast.waves.laws.shock_kinematics import shock_kinematics_shock_speed

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


def test_sachs_scaling_brings_every_charge_to_one_kilogram():
    # S_p = 1/2, S_d = (8/0.5)^(1/3), twice the sound speed
    r, one = 3.0 * 16.0 ** (1 / 3), (3.0, 1.0)
    assert float(kingery_bulmash_blast_wind(r, 8.0, 50_662.5, 680.58)) == pytest.approx(
        2.0 * float(kingery_bulmash_blast_wind(*one)), rel=1e-12
    )
    assert float(kingery_bulmash_dynamic_pressure(r, 8.0, 50_662.5)) == pytest.approx(
        0.5 * float(kingery_bulmash_dynamic_pressure(*one)), rel=1e-12
    )


def test_an_unknown_burst_is_refused():
    with pytest.raises(ValueError, match="burst must be 'surface' or 'free-air'"):
        kingery_bulmash_blast_wind(1.0, 1.0, burst="buried")


@pytest.mark.parametrize(
    ("quantity", "function", "sd"),
    [
        ("blast_wind_m_s", kingery_bulmash_blast_wind, 0.10),
        ("dynamic_pressure_pa", kingery_bulmash_dynamic_pressure, 0.10),
        ("shock_speed_m_s", kingery_bulmash_shock_speed, 0.01),
    ],
)
def test_the_registry_knows_them_with_their_declared_scatter(quantity, function, sd):
    law = law_for(quantity, "kingery_bulmash")
    assert law.function is function
    assert law.scatter() == (sd, 0.0, sd)


def test_the_registry_knows_the_shock_speed_of_shock_kinematics():
    law = law_for("shock_speed_m_s", "shock_kinematics")
    assert law.function is shock_kinematics_shock_speed
    assert law.scatter() == (0.01, 0.0, 0.01)
