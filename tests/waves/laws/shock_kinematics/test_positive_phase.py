import numpy as np
import pytest

from jblast.waves.laws import kingery_bulmash as kb
from jblast.waves.laws.shock_kinematics import (
    END_OF_TABLE,
    front_tail,
    shock_kinematics_duration,
    shock_kinematics_impulse,
    shock_kinematics_pressure,
)

MASS, AMBIENT, SPEED = 15.0, 9e4, 332.0
SCALE = (MASS * 101325.0 / AMBIENT) ** (1 / 3)
BLENDED = END_OF_TABLE * 1.05
both_bursts = pytest.mark.parametrize("burst", ["surface", "free-air"])


def air(z):
    return np.asarray(z) * SCALE, MASS, AMBIENT, SPEED


@both_bursts
def test_to_the_end_of_the_table_they_are_kingerys_and_bulmashs(burst):
    inside = air(np.geomspace(0.2, END_OF_TABLE * (1 - 1e-12), 300))
    for law, table in (
        (shock_kinematics_duration, kb.kingery_bulmash_duration),
        (shock_kinematics_impulse, kb.kingery_bulmash_impulse),
    ):
        np.testing.assert_array_equal(
            law(*inside, burst=burst), table(*inside, burst=burst)
        )


@both_bursts
def test_far_away_the_pulse_is_a_weak_shocks(burst):
    """Its duration by the length of the pressure's tail, so k = i/(P t_d) stays."""
    z = np.geomspace(BLENDED, 1e4, 50)
    length = front_tail(burst).length
    duration = shock_kinematics_duration(*air(z), burst=burst)
    at_end = kb.kingery_bulmash_duration(*air(END_OF_TABLE), burst=burst)
    growth = np.log(z / length) / np.log(END_OF_TABLE / length)
    np.testing.assert_allclose(duration, at_end * np.sqrt(growth), rtol=1e-12)
    impulse = shock_kinematics_impulse(*air(z), burst=burst)
    peak = shock_kinematics_pressure(*air(z)[:3], burst)
    share = impulse / (peak * duration)
    np.testing.assert_allclose(share, share[0] * np.ones(50), rtol=1e-12)
    assert 0.42 < share[0] < 0.48


@both_bursts
@pytest.mark.parametrize("law", [shock_kinematics_duration, shock_kinematics_impulse])
def test_value_and_slope_are_continuous_where_the_table_ends(burst, law):
    ends = np.array([END_OF_TABLE, BLENDED])
    step = 1e-7
    z = ends[:, None] * np.exp(step * np.arange(-2, 3))
    value = np.log(law(*air(z), burst=burst))
    left, right = value[:, 2] - value[:, 1], value[:, 3] - value[:, 2]
    # slopes in ln are below 1.2, so values move by less than 2e-7
    assert np.abs(np.diff(value, axis=1)).max() < 1.2 * step
    # the blend is twice smooth: slopes differ by curvature times step, and rounding
    np.testing.assert_allclose(left / step, right / step, atol=1e-5)
