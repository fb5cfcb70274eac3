import numpy as np

from calibration.far_pressure import records, slope_of
from jblast.waves import shock_kinematics_pressure, swisdak_pressure


def test_a_slope_is_found_through_shots_of_different_level():
    rng = np.random.default_rng(1)
    shot = np.repeat(["a", "b", "c"], 40)
    z = np.exp(rng.uniform(3.0, 6.0, 120))
    level = np.repeat([0.0, 1.0, -2.0], 40)
    y = level + 0.3 * np.log(z) + rng.normal(0.0, 0.2, 120)
    slope, sd, scatter = slope_of(shot, z, y)
    # sd of the slope: 0.2/sqrt(120)/0.87
    assert abs(sd - 0.021) < 0.003
    assert abs(slope - 0.3) < 3 * sd
    assert abs(scatter - 0.2) < 0.04


def test_recorded_peaks_fall_as_a_weak_shock_and_not_as_the_printed_power():
    found = records()
    shot, z, peak = found["shot"], found["z"], found["peak"]
    assert len(z) == 59
    for law, slope in ((swisdak_pressure, 0.26), (shock_kinematics_pressure, 0.02)):
        got, sd, _ = slope_of(shot, z, np.log(peak / np.asarray(law(z, 1.0))))
        assert abs(got - slope) < 5e-3  # the kept table's digits
        assert 0.02 < sd < 0.04
