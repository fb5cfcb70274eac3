import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import (
    false_alarms_at,
    filtered_by,
    matched_kernel,
    threshold_for,
    white_noise,
)

KERNEL = matched_kernel(pulse(0.02), RATE, rumble())


@pytest.mark.parametrize("threshold", [0.0, 1.0, 3.0])
def test_the_rate_is_that_of_two_neighbours_on_either_side(threshold):
    rho = np.cos(KERNEL.phase_step_rad)
    pair = multivariate_normal([0.0, 0.0], [[1.0, rho], [rho, 1.0]])  # pyright: ignore[reportArgumentType] (stub: int)
    one, both = norm.cdf(threshold), pair.cdf([threshold, threshold])
    expected = RATE * 3600 * (one - both)  # below, then not below
    # digits of the bivariate distribution
    assert false_alarms_at(KERNEL, threshold) == pytest.approx(expected, rel=1e-4)


def test_noise_rises_through_a_threshold_as_often_as_said():
    sound = coloured(np.random.default_rng(5), rumble(), 2**20)[0]
    heard = filtered_by(sound, KERNEL)
    out = heard.statistic[heard.start : heard.stop]
    seen = int(np.sum((out[:-1] <= 3.0) & (out[1:] > 3.0)))
    said = false_alarms_at(KERNEL, 3.0) / 3600 * out.size / RATE
    assert seen == pytest.approx(said, abs=4 * np.sqrt(said))  # of a Poisson number


def test_slow_outputs_follow_rice_and_fast_ones_stay_below_it():
    slow = matched_kernel(pulse(0.05, rise_s=0.01), RATE, white_noise(1.0, RATE))
    rice = [
        3600 * RATE * k.phase_step_rad / (2 * np.pi) * np.exp(-18)
        for k in (slow, KERNEL)
    ]
    assert false_alarms_at(slow, 6.0) == pytest.approx(rice[0], rel=0.01)
    assert false_alarms_at(KERNEL, 6.0) < 0.8 * rice[1]


@pytest.mark.parametrize("rate", [1e-9, 1.0, 1000.0])
def test_thresholds_are_where_the_rate_is_met(rate):
    assert false_alarms_at(KERNEL, threshold_for(KERNEL, rate)) == pytest.approx(rate)


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        (0.0, "expected a positive number"),
        (-1.0, "expected a positive number"),
        (np.inf, "expected a positive number"),
        (1e9, "expected less than the zero upcrossings of the noise"),
    ],
)
def test_rates_that_no_threshold_has_are_refused(rate, said):
    with pytest.raises(InputError, match=said):
        threshold_for(KERNEL, rate)
