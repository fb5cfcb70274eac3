"""Arrivals at several microphones: bangs, delays and directions, with honest errors.

Times without the scatter of paths (`path_scatter=0`) have the errors of instruments
alone."""

import numpy as np
import pytest
from scipy.special import gamma, kv

from jblast.errors import InputError
from jblast.signals import RelativeTimes, direction, relative_times
from jblast.signals.arrays import bangs
from jblast.signals.detection import Detection

RATE = 48_000.0
WINDOW = 4096


def pulse_spectrum(delay, length=WINDOW, rate=RATE):
    """Spectrum of a smooth pulse of some 2 ms that begins at 30 ms, later by a delay.

    A difference of two Gaussians, shifted by phase, so that no sample is special.
    """
    f = np.fft.rfftfreq(length, 1 / rate)
    width = 1.5e-4
    shape = (2j * np.pi * f * width) * np.exp(-0.5 * (2 * np.pi * f * width) ** 2)
    return shape * np.exp(-2j * np.pi * f * (0.03 + delay)) * rate * width


def heard(rng, delays, *, noise, gain=None, length=WINDOW):
    """Records of a pulse that comes to each microphone with a delay, in white noise."""
    gain = np.ones(len(delays)) if gain is None else np.asarray(gain)
    spectra = [pulse_spectrum(delay, length) for delay in delays]
    clean = gain[:, None] * np.fft.irfft(np.array(spectra), length)
    noise = np.broadcast_to(noise, (len(delays),))
    return clean + noise[:, None] * rng.standard_normal(clean.shape)


def variance(noise, count, length=WINDOW):
    """Of white noise of an rms, in each bin of a unitary transform."""
    rms = np.broadcast_to(noise, (count,))
    return np.repeat((rms**2)[:, None], length // 2 + 1, axis=1)


def bound(noise, length=WINDOW, rate=RATE):
    """Cramer-Rao bound of a delay between two such records, the pulse unknown [s].

    1/var = sum over all bins, of both signs, of w^2 |S|^2 / (N1 + N2).
    """
    f = np.fft.rfftfreq(length, 1 / rate)
    power = np.abs(pulse_spectrum(0.0, length)) ** 2
    return (2 * np.sum((2 * np.pi * f) ** 2 * power / (2 * noise**2 * length))) ** -0.5


PLACES = {"a": (0.0, 0.0, 0.0), "b": (30.0, 0.0, 0.0)}  # 0.1 s apart


def arrivals(*times, statistic=10.0):
    return [Detection(time, 1e-3, 20.0, statistic) for time in times]


def test_what_is_nearer_than_sound_can_be_is_one_bang():
    found = bangs({"a": arrivals(1.0, 2.0), "b": arrivals(1.1, 2.3)}, PLACES)
    assert [{n: d.time_s for n, d in of.items()} for of in found.heard] == [
        {"a": 1.0, "b": 1.1},
        {"a": 2.0},
        {"b": 2.3},
    ]
    assert found.left_out == ()


def test_of_several_at_a_sensor_the_loudest_is_kept_and_the_other_told():
    loud, (quiet,) = arrivals(1.05, statistic=20.0), arrivals(1.0)
    found = bangs({"a": [quiet, *loud], "b": arrivals(1.02)}, PLACES)
    assert found.heard[0]["a"].time_s == 1.05
    assert found.left_out == (("a", quiet),)


def test_recorders_whose_clocks_differ_heard_one_bang():
    found = bangs({"a": arrivals(1.0), "b": arrivals(500.0)}, PLACES, one=True)
    assert len(found.heard) == 1


def test_nothing_heard_is_no_bang():
    assert bangs({"a": [], "b": []}, PLACES).heard == ()


C = 340.0
SIGMA = 2e-5
TRIES = 200
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.87, 0], [0.5, 0.3, 0.8]])
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
MAST = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 2.0]])


def toward(b, e):
    """Unit vector of a bearing and an elevation."""
    return np.array([np.sin(b) * np.cos(e), np.cos(b) * np.cos(e), np.sin(e)])


def passed(positions, source, rng, speed=C, sigma=SIGMA):
    """Times at which a plane wave passes, with errors."""
    times = -(positions @ source) / speed + sigma * rng.standard_normal(len(positions))
    apart = np.eye(len(positions)) - 1 / len(positions)
    return RelativeTimes(apart @ times, apart * sigma**2)


def scaled_errors(positions, angle, *, speed_sd=0.0):
    """Errors of bearing and elevation over their sigmas, and chi-squared."""
    rng, rows, chi2 = np.random.default_rng(1), [], []
    for _ in range(TRIES):
        b = rng.uniform(0, 2 * np.pi)
        speed = C + speed_sd * rng.standard_normal()
        times = passed(positions, toward(b, angle), rng, speed)
        found = direction(positions, times, C, speed_sd, path_scatter=0.0)
        sd = np.sqrt(np.diag(found.covariance))
        off = (found.bearing - b + np.pi) % (2 * np.pi) - np.pi
        rows.append([off / sd[0], (found.elevation - angle) / sd[1]])
        chi2.append(found.chi2 / max(found.dof, 1))
    return np.array(rows), np.mean(chi2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "speed_sd"), [(-0.4, 10.0), (0.02, 0.0), (1.2, 10.0)]
)
def test_normalised_errors_of_a_direction_are_one(angle, speed_sd):
    errors, chi2 = scaled_errors(TETRAHEDRON, angle, speed_sd=speed_sd)
    # Monte Carlo: sd of 200 is known to 5 %, the mean to 0.07
    assert ((errors.std(axis=0) > 0.8) & (errors.std(axis=0) < 1.2)).all()
    assert (np.abs(errors.mean(axis=0)) < 0.3).all()
    assert 0.7 < chi2 < 1.4


def test_a_level_square_tells_the_bearing_and_not_which_side_it_came_from():
    errors, _ = scaled_errors(SQUARE, 0.3)
    assert 0.8 < errors[:, 0].std() < 1.2
    assert np.isnan(errors[:, 1]).all()
    times = passed(SQUARE, toward(1.0, 0.3), np.random.default_rng(0))
    found = direction(SQUARE, times, C, path_scatter=0.0)
    assert found.layout == "coplanar"
    assert found.undetermined == ("elevation_rad",)
    assert found.mirror is not None
    assert abs(found.mirror[1]) == pytest.approx(0.3, abs=0.05)  # 2 sigma or so


def test_an_upright_mast_tells_the_elevation_alone():
    errors, _ = scaled_errors(MAST, 0.3)
    assert 0.8 < errors[:, 1].std() < 1.2
    assert np.isnan(errors[:, 0]).all()
    times = passed(MAST, toward(1.0, 0.3), np.random.default_rng(0))
    assert direction(MAST, times, C, path_scatter=0.0).undetermined == ("bearing_rad",)


@pytest.mark.parametrize(
    ("positions", "layout"),
    [
        (np.array([[0, 0, 0], [1, 0, 0.0]]), "two"),
        (np.array([[0, 0, 0], [1, 1, 0], [3, 3, 0.0]]), "collinear"),
        (np.array([[0, 0, 0], [1, 0, 1], [2, 0, 2.0]]), "collinear"),
    ],
)
def test_two_microphones_and_those_in_a_line_tell_neither(positions, layout):
    rng = np.random.default_rng(0)
    found = direction(positions, passed(positions, toward(0.7, 0.1), rng), C)
    assert found.layout == layout
    assert found.undetermined == ("bearing_rad", "elevation_rad")
    assert np.isnan([found.bearing, found.elevation]).all()
    assert np.isnan(found.covariance).all()


def test_a_wall_of_microphones_cannot_tell_front_from_back():
    wall = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1.0]])
    times = passed(wall, toward(0.6, 0.2), np.random.default_rng(0), sigma=1e-7)
    found = direction(wall, times, C, path_scatter=0.0)
    assert found.undetermined == ("bearing_rad",)
    assert found.elevation == pytest.approx(0.2, abs=1e-3)
    assert found.mirror is not None
    sides = np.array([found.mirror[0], np.pi - found.mirror[0]]) % (2 * np.pi)
    assert np.isclose(sides, 0.6, atol=1e-3).any()


def test_one_late_microphone_is_seen_in_chi_squared():
    times = passed(SQUARE, toward(1.0, 0.3), np.random.default_rng(0))
    late = times.time + np.array([0, 0, 0, 20 * SIGMA]) - 5 * SIGMA
    still = {"path_scatter": 0.0}
    assert direction(SQUARE, times, C, **still).chi2 < 10
    assert direction(SQUARE, times._replace(time=late), C, **still).chi2 > 50


def von_karman(apart, length):
    """Return a correlation that is not the fit's: Matern of order 5/6."""
    x, order = np.maximum(apart / (0.6 * length), 1e-12), 5 / 6
    return 2 ** (1 - order) / gamma(order) * x**order * kv(order, x)


@pytest.mark.slow
def test_intervals_contain_directions_of_fronts_that_air_has_turned():
    rng, inside, widths = np.random.default_rng(3), [], []
    for _ in range(120):
        count = int(rng.integers(3, 9))
        places = np.zeros((count, 3))
        places[:, :2] = rng.uniform(-0.5, 0.5, (count, 2)) * 10 ** rng.uniform(
            -0.3, 0.7
        )
        reach = 10 ** rng.uniform(np.log10(20.0), np.log10(5000.0))
        length = 10 ** rng.uniform(np.log10(0.2), np.log10(0.8))
        b = rng.uniform(0, 2 * np.pi)
        source = reach * toward(b, 0.0)
        distance = np.linalg.norm(places - source, axis=1)
        apart = np.linalg.norm(places[:, None] - places[None], axis=-1) / reach
        root = np.linalg.cholesky(von_karman(apart, length) + 1e-12 * np.eye(count))
        times = distance / C * (1 + 0.01 * root @ rng.standard_normal(count))
        times += SIGMA * rng.standard_normal(count)
        center = np.eye(count) - 1 / count
        relative = RelativeTimes(center @ times, center * SIGMA**2)
        found = direction(places, relative, C, 10.0)
        if "bearing_rad" in found.undetermined:
            continue
        sd = np.sqrt(found.covariance[0, 0])
        off = (found.bearing - b + np.pi) % (2 * np.pi) - np.pi
        inside.append(abs(off) < 1.645 * sd)
        widths.append(sd)
    # ranges from 20 m to 5 km are taken as one; Monte Carlo: 0.03. Without the air: 0.1
    assert len(inside) > 90
    assert np.mean(inside) > 0.8
    assert np.median(widths) < 0.25


def test_precise_times_leave_the_scatter_of_the_air():
    precise = passed(SQUARE, toward(1.0, 0.0), np.random.default_rng(0), sigma=1e-9)
    sd = np.sqrt(direction(SQUARE, precise, C).covariance[0, 0])
    # a plane front of precise times: as of the smoothest air, a tenth of it turbulent
    # (0.1^(1/2) 0.014 (R/D) (D/0.2 R)^(5/6)), the rest turning the front by 0.07 rad
    turbulent = 0.1**0.5 * 0.01 * 2**0.5 * 2000.0 * (1 / 400.0) ** (5 / 6)
    assert sd > np.hypot(0.7 * turbulent, 0.9 * 0.01 * (2 * 0.9) ** 0.5 / 0.2)
    assert sd < 0.15


def test_from_sound_to_direction():
    rng, errors = np.random.default_rng(2), []
    for _ in range(60):
        b, e = rng.uniform(0, 2 * np.pi), rng.uniform(-0.5, 1.0)
        later = -(TETRAHEDRON @ toward(b, e)) / C
        sound = heard(rng, later, noise=0.02)
        times = relative_times(sound, RATE, variance(0.02, 4), 1.5 / C)
        found = direction(TETRAHEDRON, times, C, path_scatter=0.0)
        error = [(found.bearing - b + np.pi) % (2 * np.pi) - np.pi, found.elevation - e]
        errors.append(np.array(error) / np.sqrt(np.diag(found.covariance)))
    # Monte Carlo: sd of 60 is known to 9 %
    assert ((np.std(errors, axis=0) > 0.75) & (np.std(errors, axis=0) < 1.35)).all()


@pytest.mark.parametrize(
    ("positions", "time", "words"),
    [
        (SQUARE[:3], np.zeros(4), "4 rows of east, north, up"),
        (np.zeros((4, 3)), np.zeros(4), "one for all"),
        (SQUARE, np.full(4, np.nan), "a time for each microphone"),
    ],
)
def test_what_has_no_direction_is_refused(positions, time, words):
    with pytest.raises(InputError, match=words):
        direction(positions, RelativeTimes(time, SIGMA**2 * np.eye(4)), C)


FAR = 3e-3


def delays_of(noise, tries=TRIES, seed=0):
    """Errors of delays, and their sigmas."""
    rng = np.random.default_rng(seed)
    errors, sigmas = [], []
    for _ in range(tries):
        later = rng.uniform(-1e-3, 1e-3, 2)
        times = relative_times(
            heard(rng, later, noise=noise),
            RATE,
            variance(noise, 2),
            FAR,
        )
        errors.append(np.diff(times.time) - np.diff(later))
        # relative to their mean, two times have half the variance of their difference
        sigmas.append(2 * times.covariance[0, 0] ** 0.5)
    return np.array(errors), np.array(sigmas)


def test_the_best_weights_reach_the_bound_of_cramer_and_rao():
    errors, sigmas = delays_of(0.01)
    assert errors.std() == pytest.approx(bound(0.01), rel=0.15)  # 3 sd of 200 tries
    # weights that are measured leave out bins in which the sound is not told from noise
    np.testing.assert_allclose(sigmas, bound(0.01), rtol=0.05)


def test_a_delay_is_no_matter_of_the_samples():
    rng = np.random.default_rng(4)
    for part in (0.0, 0.25, 0.5, 0.77):
        quiet = heard(rng, [0.0, (3 + part) / RATE], noise=1e-7)
        (delay,) = np.diff(relative_times(quiet, RATE, variance(1e-7, 2), FAR).time)
        assert delay * RATE == pytest.approx(3 + part, abs=1e-5)


def test_gains_of_the_microphones_change_nothing():
    rng, later = np.random.default_rng(5), np.array([0.0, 3e-4, -2e-4])
    even = heard(rng, later, noise=0.01)
    noise = np.array([1.0, 20.0, 0.05])
    plain = relative_times(even, RATE, variance(0.01, 3), FAR)
    scaled = relative_times(even * noise[:, None], RATE, variance(0.01 * noise, 3), FAR)
    np.testing.assert_allclose(scaled.time, plain.time, atol=2e-9)
    np.testing.assert_allclose(scaled.covariance, plain.covariance, rtol=1e-3)


def test_a_noisy_microphone_has_a_larger_error_and_the_covariance_knows():
    rng, noise = np.random.default_rng(6), np.array([0.01, 0.01, 0.04, 0.01])
    errors, told = [], []
    for _ in range(TRIES):
        later = rng.uniform(-1e-3, 1e-3, 4)
        times = relative_times(
            heard(rng, later, noise=noise), RATE, variance(noise, 4), FAR
        )
        errors.append(times.time - (later - later.mean()))
        told.append(times.covariance)
        assert abs(times.time.sum()) < 1e-12
    measured, expected = np.cov(np.array(errors).T), np.mean(told, axis=0)
    # Monte Carlo: a variance of 200 is known to 10 %
    np.testing.assert_allclose(np.diag(measured), np.diag(expected), rtol=0.35)
    assert expected[2, 2] > 4 * expected[0, 0]


def test_where_nothing_is_heard_no_delay_is_told():
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((3, WINDOW))
    times = relative_times(noise, RATE, variance(1.0, 3), FAR)
    assert not times.complete
    assert np.isnan(times.time).all()


def test_with_a_dead_microphone_no_time_is_complete():
    rng = np.random.default_rng(8)
    records = heard(rng, [0.0, 1e-4, 2e-4], noise=0.01)
    records[2] = 0.0
    times = relative_times(records, RATE, variance([0.01, 0.01, 0.0], 3), FAR)
    assert not times.complete


@pytest.mark.parametrize(
    ("samples", "said"),
    [
        (np.zeros((1, 64)), "2 to 8 microphones, got 1"),
        (np.zeros((9, 64)), "2 to 8 microphones, got 9"),
        (np.zeros((2, 101)), "even number"),
        (np.full((2, 64), np.nan), "finite samples"),
    ],
)
def test_what_cannot_be_used_is_refused(samples, said):
    count, length = samples.shape
    with pytest.raises(InputError, match=said):
        relative_times(samples, RATE, variance(1.0, count, length), FAR)
