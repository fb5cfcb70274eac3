"""Pulses and noise over bins, against formulas at instants and drawn noise."""

import numpy as np
import pytest

from jblast.signals.picks.preparation import (
    FIRST,
    KERNELS,
    RHO,
    WIDTH,
    Prepared,
    clipped_samples,
    first_front,
    noise_powers,
)
from jblast.signals.picks.pulse import (
    CONTINUED,
    EXPONENTIAL,
    FAMILY_RISE,
    NEGATIVES,
    PEAK,
    RISES,
    SUCTION,
    moved,
    natural,
    outputs,
    primitive,
)

ARRIVAL, DURATION, DECAY, TAU, FALL, DEPTH = 0.3, 300.0, 1.2, 9.0, 700.0, 0.3
POINTS = 200_001
FORMS = [(r, n) for r in range(len(RISES)) for n in range(len(NEGATIVES))]


def unknowns(rise: int, tau=TAU):
    """Return the unknowns of the pulse, by solving `natural` for them."""
    free = tau / (1 - tau / DURATION)
    shape = [np.log(DURATION), np.log1p(DECAY), np.log(free), np.log(FALL / DURATION)]
    trial = np.array([[0.0, *shape]])
    trial[0, 0] = ARRIVAL - natural(trial, np.array([rise]))[0][0]
    return trial


def pressure(time, rise: int, negative: int):
    """Return the pressure of a form at instants, by its formulas again."""
    u = time - ARRIVAL
    s = u / DURATION if rise == EXPONENTIAL else (u - TAU) / (DURATION - TAU)
    x = np.clip(u / TAU, 0, 1)
    falls = (1 - s) * np.exp(-DECAY * np.maximum(s, 0))
    shape = np.interp(x, np.linspace(0, 1, RISES[rise][2].size), RISES[rise][2])
    positive = np.where(x < 1, shape, falls)
    if rise == FAMILY_RISE:  # half of the decay begins within the rise
        bent = RISES[rise][3][2] * (1 + DECAY) * TAU / (DURATION - TAU)
        nodes = np.linspace(0, 1, bent.size)
        positive = np.where(x < 1, positive + 0.5 * np.interp(x, nodes, bent), falls)
    if rise == EXPONENTIAL:
        positive = falls * -np.expm1(-3 * np.maximum(u, 0) / TAU)
    r = np.clip((u - DURATION) / FALL, 0, 1)
    deep = NEGATIVES[negative][2]
    suction = DEPTH * np.interp(r, np.linspace(0, 1, deep.size), deep)
    tail = positive if negative == CONTINUED else -suction
    return np.where(u < 0, 0, np.where(u < DURATION, positive, tail))


@pytest.mark.parametrize(("rise", "negative"), FORMS)
def test_antiderivatives_are_the_integrals_of_each_form(rise, negative):
    ends = np.array([-5.0, 0.0, 0.5, 3.0, 8.0, 20.0, 150.0, 299.0, 320.0, 900.0])
    at = (np.array([rise]), np.array([negative]), ends)
    made = primitive(unknowns(rise), *at)[0]
    made = made[PEAK] + DEPTH * made[SUCTION]
    time = np.linspace(ends[0], ends[-1], POINTS)
    p = pressure(time, rise, negative)
    # an exponential rise is not divided by its maximum
    area = np.append(0, np.cumsum(0.5 * (p[1:] + p[:-1]) * np.diff(time)))
    # trapezoids of 0.0045 samples and tables of 1024 nodes
    expected = np.interp(ends, time, area)
    np.testing.assert_allclose(made, expected - expected[0], atol=2e-3)


def test_samples_at_instants_are_the_pressure_there_and_wide_bins_are_means():
    rise, negative = np.array([0]), np.array([CONTINUED])
    window = Prepared(np.r_[np.zeros(600), np.ones(900)]).window(DURATION)
    columns = window.means(unknowns(0), rise, negative, instants=True)[0, PEAK]
    means = window.means(unknowns(0), rise, negative)[0, PEAK]
    single = window.widths == 1
    at = pressure(window.middle[single], 0, CONTINUED)
    np.testing.assert_allclose(columns[single], at, atol=2e-3)
    np.testing.assert_array_equal(columns[~single], means[~single])


@pytest.mark.parametrize("rise", range(len(RISES)))
def test_outputs_are_those_of_the_pressure(rise):
    linear = np.zeros((1, 7))
    linear[0, [PEAK, SUCTION]] = 1.0, DEPTH
    trial = unknowns(rise)
    arrival, peak, duration, impulse, decay, tau, depth, long = outputs(
        trial, np.array([rise]), np.array([0]), linear
    )[0]
    time = np.linspace(ARRIVAL, ARRIVAL + DURATION, POINTS)
    p = pressure(time, rise, 0)
    assert arrival == pytest.approx(ARRIVAL)
    # the maximum of a noisy rise is known to a sixteenth of the table
    assert np.exp(peak) == pytest.approx(p.max(), rel=2e-3)
    assert np.exp([duration, tau, long]) == pytest.approx([DURATION, TAU, FALL])
    assert np.exp(impulse) == pytest.approx(np.trapezoid(p, time), rel=1e-4)
    assert (decay, depth) == pytest.approx((DECAY, DEPTH), rel=1e-3)


def test_another_rise_keeps_centre_and_end_of_the_phase():
    for rise in range(len(RISES)):
        trial, same = unknowns(0), np.array([rise])
        new = moved(trial, np.array([0]), same)
        arrival, duration, *_ = natural(new, same)
        assert new[0, 0] == trial[0, 0]
        assert arrival + duration == pytest.approx(ARRIVAL + DURATION)


def test_covariances_over_bins_are_those_of_drawn_noise():
    # a relaxation is an autoregression of first order
    rng, rho, draws = np.random.default_rng(1), RHO[2], 4000
    near = (np.abs(FIRST) < 150) & (FIRST + WIDTH < 150)
    first, width = FIRST[near], WIDTH[near]
    x = np.empty((draws, 400))
    x[:, 0] = rng.standard_normal(draws)
    for k in range(1, 400):
        x[:, k] = rho * x[:, k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(draws)
    sums = np.pad(np.cumsum(x, axis=1), ((0, 0), (1, 0)))
    at = first + 200
    means = (sums[:, at + width] - sums[:, at]) / width
    made = KERNELS[3][np.ix_(near, near)]
    # a covariance of 4000 draws has a standard error of 0.022 at most
    np.testing.assert_allclose(means.T @ means / draws, made, atol=5 * 0.022)


@pytest.mark.parametrize("power", [0.0, 0.5])
def test_powers_have_the_size_of_sums_of_noise_of_any_colour(power):
    # sums over 64 samples, in noise whose amplitude falls with a power of frequency
    rng, ratios = np.random.default_rng(2), []
    for _ in range(30):
        f = np.fft.rfftfreq(1 << 14)
        f[0] = f[1]
        parts = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
        x = np.fft.irfft(parts * f**-power)[:8192]
        v = noise_powers(x[:2048])
        lag = np.abs(np.subtract.outer(np.arange(64), np.arange(64)))
        made = v[0] * 64 + sum(
            p * np.sum(rho**lag) for p, rho in zip(v[1:], RHO, strict=True)
        )
        ratios.append(made / np.var(x.reshape(-1, 64).sum(axis=1)))
    # slow noise of a quarter of a record is known to some tens of percent
    assert 0.6 < np.exp(np.mean(np.log(ratios))) < 1.7


def test_a_front_is_found_in_flicker_noise_and_before_a_larger_reflection():
    rng, off = np.random.default_rng(3), []
    for _ in range(20):
        f = np.fft.rfftfreq(2048)
        f[0] = f[1]
        parts = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
        noise = np.fft.irfft(parts / np.sqrt(f))
        t = np.arange(2048) - 700.0
        pulse = np.where(t >= 0, (1 - t / 60) * np.exp(-t / 50), 0.0)
        off.append(first_front(pulse + noise / noise.std() / 5) - 700)
    # peaks of five times the noise
    assert np.max(np.abs(off)) < 20
    t = np.arange(2048.0)
    clean = np.where(t < 600, 0, np.exp(-(t - 600) / 80)) + 2 * np.where(
        t < 700, 0, np.exp(-(t - 700) / 80)
    )
    assert abs(first_front(clean + 0.01 * rng.standard_normal(2048)) - 600) < 3


def test_the_front_of_a_strong_pulse_is_its_first_sample():
    # chance alone decides which of two wide means has the smaller noise
    t = np.arange(14400) - 9600.0
    pulse = np.where(t >= 0, (1 - t / 500) * np.exp(-t / 500), 0.0)
    for seed in range(8):
        noise = np.random.default_rng(seed).standard_normal(t.size)
        assert first_front(pulse + 2e-6 * noise) == 9600


RAMP = np.linspace(0.0, 1.0, 20)


def clipped(samples, full_scale=None):
    """Return the clipped samples of a record."""
    return np.flatnonzero(clipped_samples(np.asarray(samples), full_scale)).tolist()


def test_equal_samples_in_a_row_at_the_top_are_clipped():
    assert clipped(np.minimum(RAMP, 0.8)) == [16, 17, 18, 19]
    assert clipped(np.r_[np.minimum(RAMP, 0.8), 0.0]) == [16, 17, 18, 19]
    # also a sample at the level that noise leaves between others
    assert clipped([0.0, 0.8, 0.7, 0.8, 0.8, 0.8]) == [1, 3, 4, 5]
    assert clipped(RAMP) == []
    assert clipped(RAMP, 1.0) == [19]


def test_a_flat_top_is_clipped_and_the_top_of_few_codes_is_not():
    time = np.arange(4000)
    pulse = np.where(time < 1000, 0.0, 0.9 * np.exp(-(time - 1000.0) / 800.0))
    pulse += 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    # an amplifier that clips at 0.8, in 16 bits
    flat = np.round(np.minimum(pulse, 0.8) * 2**15) / 2**15
    assert clipped(flat, 1.0) == np.flatnonzero(flat == flat.max()).tolist()
    assert clipped(pulse, 1.0) == []
    # 20 codes in all, each of tens of samples
    assert clipped(np.round(pulse * 20) / 20, 1.0) == []
    assert clipped(np.full(100, 0.5), 1.0) == []
