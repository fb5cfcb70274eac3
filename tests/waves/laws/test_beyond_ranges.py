"""Laws beyond their ranges: marked, and never wild."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.registry import LAWS
from jblast.waves import (
    kingery_bulmash_duration,
    kinney_graham_duration,
    shock_kinematics_pressure,
    wu_hao_air_arrival_time,
)
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve

SOUND = 340.29


@pytest.mark.parametrize("mass", [0.1, 15.0, 1e6])
def test_wu_hao_is_marked_where_it_is_slower_than_sound(mass):
    law, end = LAWS["air_arrival_s", "wu_hao"], 0.34**-2.5 * np.sqrt(mass)
    for distance, slow in ((0.999 * end, False), (1.001 * end, True)):
        time = wu_hao_air_arrival_time(distance, mass, SOUND)
        assert bool(distance / time < SOUND) == slow
        assert bool(law.valid(distance, mass)) != slow


@pytest.mark.parametrize("burst", ["surface", "free-air"])
@pytest.mark.parametrize("name", ["incident_impulse", "positive_phase_duration"])
def test_curves_do_not_jump_at_the_joins_of_the_printed_polynomials(name, burst):
    curve = kingery_bulmash_curve(name, burst)
    for before, after in zip(curve.segments, curve.segments[1:], strict=False):
        at = np.log(after.z_min)
        assert abs(np.expm1(after.log_value(at) - before.log_value(at))) > 5e-4
        low, high = curve.log_value(jnp.asarray([at - 1e-9, at]))
        assert abs(float(high - low)) < 1e-7


def test_the_peak_beyond_its_table_is_marked_and_of_the_right_size():
    law = LAWS["peak_overpressure_pa", "kingery_bulmash"]
    z = np.array([0.067, 0.068, 39.9, 40.1])
    assert law.valid(z, 1.0).tolist() == [False, True, True, False]
    # wrong there as well, which is why it is marked
    far = float(law.function(1e3, 1.0))
    assert 0.3 < far / float(shock_kinematics_pressure(1e3, 1.0)) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "quantity", ["positive_impulse_pa_s", "positive_duration_s", "air_arrival_s"]
)
def test_beyond_the_table_curves_are_power_laws(quantity):
    law = LAWS[quantity, "kingery_bulmash"]
    for z in (jnp.array([50.0, 100.0, 200.0]), jnp.array([0.06, 0.03, 0.015])):
        low, middle, high = np.log(np.asarray(law.function(z, 1.0)))
        assert high - middle == pytest.approx(middle - low, rel=1e-9)


def test_the_duration_of_kinney_graham_is_marked_where_it_is_a_third_short():
    z = np.geomspace(0.15, 40.0, 200)
    reference = kingery_bulmash_duration(z, 1.0, burst="free-air")
    ratio = np.asarray(kinney_graham_duration(z, 1.0) / reference)
    law = LAWS["positive_duration_s", "kinney_graham"]
    assert np.all(ratio[np.asarray(law.valid(z, 1.0))] > 0.69)
    assert ratio.min() < 0.25
    assert law.valid(np.array([1.0, 10.0, 40.0]), 1.0).tolist() == [False, True, False]
