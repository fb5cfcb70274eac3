from pathlib import Path

import numpy as np
import pytest

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.discovery.noise_sweep import noise_sweep, shock_case
from jblast.discovery.shock import shock_slowing
from jblast.errors import InputError
from jblast.observations import read
from jblast.waves import shock_kinematics_arrival_time

TRINITY = Path(__file__).parents[2] / "calibration" / "data" / "trinity.csv"


def with_noise(radius: np.ndarray, noise: float, seed: int = 0) -> np.ndarray:
    drawn = np.random.default_rng(seed).standard_normal(radius.shape)
    return radius * np.exp(noise * drawn)


def test_a_strong_shock_slows_down_as_sedov_says():
    case = shock_case()
    slowing = shock_slowing(case.time_s, case.states[:, 0])
    assert slowing.discovery.terms(0) == ("R^-1.5",)
    # exact data; what is left is the interpolation between 60 radii
    assert slowing.exponent == pytest.approx(-1.5, abs=1e-3)
    factor = slowing.discovery.coefficients[0, 3]
    assert factor == pytest.approx(case.truth["R"]["R^-1.5"], rel=1e-3)


@pytest.mark.slow
def test_noise_of_one_percent_leaves_the_exponent_within_its_interval_mostly():
    case, held = shock_case(), 0
    for seed in range(8):
        noisy = with_noise(case.states[:, 0], 0.01, seed)
        slowing = shock_slowing(case.time_s, noisy, members=20)
        assert slowing.discovery.terms(0) == ("R^-1.5",)
        assert 0.0 < slowing.high - slowing.low < 0.15
        held += slowing.low < -1.5 < slowing.high
    assert held >= 5  # of eight with 0.9 each: fewer once in two hundred times


def test_trinity_slows_down_as_a_point_source():
    photographs = read(TRINITY)
    slowing = shock_slowing(photographs.time, photographs.value)
    assert slowing.discovery.terms(0) == ("R^-1.5",)
    # a straight line in ln R of ln t is the other way to the same number: n = 1 - 1/s
    slope = np.polyfit(np.log(photographs.time), np.log(photographs.value), 1)[0]
    assert slowing.exponent == pytest.approx(1.0 - 1.0 / slope, abs=0.1)


def test_far_off_a_shock_travels_at_the_speed_of_sound():
    radius = np.geomspace(5.0, 300.0, 60)
    time = np.asarray(shock_kinematics_arrival_time(radius, 1.0))
    found = shock_slowing(time, radius).discovery
    assert "1" in found.terms(0)
    # one power of R stands for the whole approach to sound, and shares it
    assert found.coefficients[0, 0] == pytest.approx(STANDARD_SOUND_SPEED, rel=0.03)


def test_a_radius_that_shrinks_is_refused():
    time = np.linspace(1.0, 2.0, 40)
    with pytest.raises(InputError, match="grows with time"):
        shock_slowing(time, 3.0 - time)


def test_the_sweep_tells_where_it_breaks():
    fine, coarse = noise_sweep(shock_case(), noises=(0.003, 0.5), seeds=3)
    assert (fine.exact, fine.missing, fine.false) == (1.0, 0.0, 0.0)
    assert fine.error < 0.05
    assert fine.reproduced == 1.0
    assert coarse.exact < 1.0
