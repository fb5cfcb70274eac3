import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import (
    detections,
    false_alarms_at,
    filtered_by,
    matched_kernel,
    threshold_for,
    white_noise,
)
from jblast.signals.matched_filter import PeakPicker, between_samples

NOISE, SHAPE = rumble(), pulse(0.02)
KERNEL = matched_kernel(SHAPE, RATE, NOISE)


def heard(*blasts: tuple[float, float]):
    """Filter 0.7 s of noise with blasts at (sample, sigmas)."""
    sound = coloured(np.random.default_rng(8), NOISE, 2**15)[0]
    for at, sigmas in blasts:
        whole = int(at)
        late = pulse(0.02, float(at - whole))
        sound[whole : whole + late.size] += sigmas / KERNEL.response * late
    return filtered_by(sound, KERNEL)


@pytest.mark.parametrize("part", [0.0, 0.25, 0.5, 0.9])
def test_arrivals_between_samples_are_found_there(part):
    kernel = matched_kernel(pulse(0.02, rise_s=5e-3), RATE, NOISE)
    sound = np.zeros(2**15)
    sound[9000:9960] = 300 / kernel.response * pulse(0.02, part, rise_s=5e-3)
    found = detections(filtered_by(sound, kernel), 10.0)
    assert len(found) == 1
    # a twentieth of the bound at 50 dB; a window's ripple and the pulse's own corners
    assert found[0].time_s * RATE == pytest.approx(9000 + part, abs=5e-3)
    assert found[0].sigma_s * RATE > 0.05
    assert found[0].statistic == pytest.approx(300, rel=1e-3)


def test_arrivals_err_by_the_bound_of_cramer_and_rao():
    rng, sigmas, rows = np.random.default_rng(9), 10**1.0, 400
    size = 8192
    sound = coloured(rng, NOISE, size, rows)
    parts = rng.uniform(size=rows)
    errors, statistics = [], []
    for row, part in zip(sound, parts, strict=True):
        row[4000:][: SHAPE.size] += sigmas / KERNEL.response * pulse(0.02, part)
        out = filtered_by(row, KERNEL).statistic
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
    found = detections(heard((9000.3, 31.6)), 6.0)[0]
    assert found.snr_db == pytest.approx(20 * np.log10(found.statistic))
    assert found.sigma_s == pytest.approx(1 / (KERNEL.timing_rad_s * found.statistic))
    assert abs(found.time_s - 9000.3 / RATE) < 4 * found.sigma_s


def test_a_loud_blast_is_one_and_its_foot_is_none():
    found = detections(heard((9000, 1e4)), threshold_for(KERNEL))
    assert [round(one.time_s * RATE) for one in found] == [9000]


def test_two_blasts_apart_are_two_and_close_ones_the_louder():
    apart = detections(heard((9000, 40.0), (15000, 20.0)), 6.0)
    assert [round(one.time_s * RATE) for one in apart] == [9000, 15000]
    close = heard((9000, 20.0), (9500, 40.0))
    assert [round(one.time_s * RATE) for one in detections(close, 6.0)] == [9500]
    both = detections(close, 6.0, dead_s=0.004, wait_s=0.004)
    assert [round(one.time_s * RATE) for one in both] == [9000, 9500]


def test_noise_alone_is_no_blast():
    assert detections(heard(), threshold_for(KERNEL)) == ()


def test_peaks_pushed_one_by_one_are_those_of_the_whole():
    out = np.random.default_rng(10).standard_normal(5000)
    out[2000:2003] = 5.0  # equal neighbours: one peak, the first
    whole = PeakPicker(KERNEL, 1.5, dead_s=1e-3, wait_s=2e-4)
    found = (*whole.push(out), *whole.finish())
    pieces = PeakPicker(KERNEL, 1.5, dead_s=1e-3, wait_s=2e-4)
    parts = [d for i in range(out.size) for d in pieces.push(out[i : i + 1])]
    parts += pieces.finish()
    assert len(found) > 20
    # the last sixteen are interpolated towards what is not there, in both
    assert [d.time_s for d in parts] == pytest.approx([d.time_s for d in found])
    # by hand: higher than all 48 before and none higher in the 10 after
    tops = 1 + np.flatnonzero((out[1:-1] > out[:-2]) & (out[1:-1] >= out[2:]))
    tops = tops[out[tops] > 1.5]
    kept = [
        t
        for t in tops
        if all(out[u] < out[t] for u in tops if t - 48 <= u < t)
        and all(out[u] <= out[t] for u in tops if t < u <= t + 10)
    ]
    assert [round(d.time_s * RATE) for d in found] == pytest.approx(kept, abs=1)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"threshold": 0.0}, "threshold: expected a positive number"),
        ({"threshold": np.nan}, "threshold: expected a positive number"),
        ({"dead_s": -1.0}, "expected a time from 0 up"),
        ({"wait_s": np.nan}, "expected a time from 0 up"),
    ],
)
def test_thresholds_and_times_out_of_range_are_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        detections(heard(), **({"threshold": 6.0} | wrong))


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
