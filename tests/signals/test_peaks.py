import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import (
    SoundWatch,
    false_alarms_at,
    filtered,
    matched_kernel,
    threshold_for,
    white_noise,
)
from jblast.signals.matched_filter import between_samples
from jblast.signals.sound_watch import peaks_of

NOISE, SHAPE = rumble(), pulse(0.02)
KERNEL = matched_kernel(SHAPE, RATE, NOISE)


def heard(*blasts: tuple[float, float], shape=SHAPE, rise_s=2e-4):
    """Sounds in 0.7 s of noise with blasts at (sample, sigmas)."""
    sound = coloured(np.random.default_rng(8), NOISE, 2**15)[0]
    response = matched_kernel(shape, RATE, NOISE).response
    for at, sigmas in blasts:
        whole = int(at)
        late = pulse(0.02, float(at - whole), rise_s=rise_s)
        sound[whole : whole + late.size] += sigmas / response * late
    watch = SoundWatch([shape], RATE, noise=NOISE, forms=False)
    return [*watch.push(sound), *watch.finish()]


@pytest.mark.parametrize("part", [0.0, 0.5, 0.9])
def test_arrivals_between_samples_are_found_there(part):
    soft = pulse(0.02, rise_s=5e-3)
    (found,) = heard((9000 + part, 1e4), shape=soft, rise_s=5e-3)
    # a window's ripple and the pulse's own corners
    assert found.time_s * RATE == pytest.approx(9000 + part, abs=5e-3)
    assert found.statistic == pytest.approx(1e4, rel=1e-3)


def test_arrivals_err_by_the_bound_of_cramer_and_rao():
    rng, sigmas, rows = np.random.default_rng(9), 10**1.0, 400
    size = 8192
    sound = coloured(rng, NOISE, size, rows)
    parts = rng.uniform(size=rows)
    errors, statistics = [], []
    for row, part in zip(sound, parts, strict=True):
        row[4000:][: SHAPE.size] += sigmas / KERNEL.response * pulse(0.02, part)
        out = filtered(row, KERNEL)
        top = 3990 + int(np.argmax(out[3990:4012]))
        shift, height = between_samples(out[top - 16 : top + 17])
        errors.append(top + shift - 4000 - part)
        statistics.append(height)
    bound = RATE / (KERNEL.timing_rad_s * sigmas)
    # 400 draws: 3.5 % of a standard deviation, 5 % of sigma of a mean; three of each
    assert np.std(errors) == pytest.approx(bound, rel=0.11)
    assert abs(np.mean(errors)) < 0.15 * bound
    assert np.mean(statistics) == pytest.approx(sigmas, abs=0.2)


def test_sigma_and_decibels_are_those_of_the_statistic():
    (found,) = heard((9000.3, 31.6))
    assert found.snr_db == pytest.approx(20 * np.log10(found.statistic))
    bound = 1 / (KERNEL.timing_rad_s * found.statistic)
    assert found.sigma_s == pytest.approx(np.hypot(bound, 0.1 / RATE))
    assert abs(found.time_s - 9000.3 / RATE) < 4 * found.sigma_s


@pytest.mark.parametrize(
    ("blasts", "found"),
    [
        ([], []),
        ([(9000, 1e4)], [9000]),
        ([(9000, 40.0), (15000, 20.0)], [9000, 15000]),
        ([(9000, 20.0), (9500, 40.0)], [9500]),
    ],
    ids=["noise", "loud", "apart", "close"],
)
def test_of_blasts_within_their_length_the_loudest_is_found(blasts, found):
    assert [round(one.time_s * RATE) for one in heard(*blasts)] == found


def test_peaks_are_those_that_none_nearby_exceeds():
    out = np.random.default_rng(10).standard_normal(5000) / 1.5
    out[2000:2003] = 5.0  # equal neighbours: one peak, the first
    found = peaks_of(out, 48, 10)
    assert found.size > 20
    # by hand: higher than all 48 before and none higher in the 10 after
    tops = 1 + np.flatnonzero((out[1:-1] > out[:-2]) & (out[1:-1] >= out[2:]))
    tops = tops[out[tops] > 1]
    kept = [
        t for t in tops if all(out[u] <= out[t] for u in tops if t - 48 <= u <= t + 10)
    ]
    np.testing.assert_array_equal(found, kept)


@pytest.mark.parametrize("threshold", [0.0, 3.0])
def test_the_rate_is_that_of_two_neighbours_on_either_side(threshold):
    rho = np.cos(KERNEL.phase_step_rad)
    pair = multivariate_normal([0.0, 0.0], [[1.0, rho], [rho, 1.0]])  # type: ignore (stub: int)
    one, both = norm.cdf(threshold), pair.cdf([threshold, threshold])
    expected = RATE * 3600 * (one - both)  # below, then not below
    # digits of the bivariate distribution
    assert false_alarms_at(KERNEL, threshold) == pytest.approx(expected, rel=1e-4)


def test_noise_rises_through_a_threshold_as_often_as_said():
    sound = coloured(np.random.default_rng(5), rumble(), 2**20)[0]
    out = filtered(sound, KERNEL)[KERNEL.before : -KERNEL.reach]
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


@pytest.mark.parametrize("rate", [1e-9, 1000.0])
def test_thresholds_are_where_the_rate_is_met(rate):
    assert false_alarms_at(KERNEL, threshold_for(KERNEL, rate)) == pytest.approx(rate)


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        (0.0, "expected a positive number"),
        (np.inf, "expected a positive number"),
        (1e9, "expected less than the zero upcrossings of the noise"),
    ],
)
def test_rates_that_no_threshold_has_are_refused(rate, said):
    with pytest.raises(InputError, match=said):
        threshold_for(KERNEL, rate)
