"""Events of pixels: ideal ones, with a reset, and with noise."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from jax.test_util import check_grads

from calibration.cases import THRESHOLD, WIDTH, analytic, film
from jblast.errors import InputError
from jblast.sensors.camera.pixel import (
    DARKEST,
    NoiseModel,
    Pixel,
    darkest_of,
    grey_light,
    log_intensity,
    noisy_pixel,
    pixel_events,
    shot_events,
    smooth_counts,
)
from tests.sensors.camera.pixel_cases import (
    BOTH,
    SHAPE,
    TAU,
    TIMES,
    fields,
    simulated,
    walks,
)
from tests.tools.slopes import check_slopes

KEY = jax.random.key(0)
convert = jax.jit(pixel_events, static_argnames="capacity")


def one_pixel(logs, times, pixel=Pixel(0.2, 0.2)):  # noqa: B008
    frames = jnp.asarray(logs, float)[:, None, None]
    return convert(frames, jnp.asarray(times, float), pixel, capacity=64)[0]


@pytest.mark.parametrize(
    ("fps", "microseconds"),
    [(1000, 12.0), pytest.param(2000, 3.0, marks=pytest.mark.slow)],
)
def test_events_of_a_disc_are_complete_and_second_order_in_time(fps, microseconds):
    times, logs = map(jnp.asarray, film(fps))
    events, _ = convert(logs, times, Pixel(THRESHOLD, THRESHOLD), capacity=1 << 14)
    time, pixel, sign = fields(events, WIDTH)
    order = np.lexsort((time, pixel))
    known, _, when = analytic()
    np.testing.assert_array_equal(pixel[order], known)
    assert np.abs(time[order] - when).mean() * 1e6 < microseconds
    assert (sign == 1).all()
    assert int(events.lost) == 0
    few, _ = convert(logs, times, Pixel(THRESHOLD, THRESHOLD), capacity=100)
    assert (int(few.count), int(few.lost)) == (100, time.size - 100)


@settings(deadline=None, max_examples=10)
@given(
    count=st.integers(1, 40),
    threshold=st.floats(0.01, 0.8),
    sign=st.sampled_from([-1.0, 1.0]),
    begin=st.floats(-6.0, 0.0),
)
def test_a_ramp_of_k_thresholds_gives_k_events_at_their_times(
    count, threshold, sign, begin
):
    times = np.arange(11) / 1000.0
    logs = begin + sign * count * threshold * np.arange(11) / 10.0
    events = one_pixel(logs, times, Pixel(jnp.asarray(threshold), threshold))
    assert int(events.count) == count
    expected = 0.01 * np.arange(1, count + 1) / count
    np.testing.assert_allclose(events.time[:count], expected, atol=1e-9)  # rounding
    assert (np.asarray(events.polarity[:count]) == sign).all()
    assert (np.asarray(events.x[count:]) == -1).all()
    assert np.isinf(np.asarray(events.time[count:])).all()


def test_the_reference_remains_where_the_last_event_put_it():
    # up 0.5: two events, reference 0.4; down to 0.25: within a threshold of 0.4
    events = one_pixel([0.0, 0.5, 0.25, 0.15, 0.65], [0.0, 1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(events.polarity[:6], [1, 1, -1, 1, 1, 0])
    # 0.2 again after the fall to 0.15, whose own event was at 0.2: then 0.4 and 0.6
    np.testing.assert_allclose(events.time[:5], [0.4, 0.8, 2.5, 3.5, 3.9], rtol=1e-12)
    # each polarity has its threshold
    events = one_pixel([0.0, 1.0, 0.0], [0.0, 1.0, 2.0], Pixel(0.25, 0.5))
    np.testing.assert_array_equal(events.polarity[:7], [1, 1, 1, 1, -1, -1, 0])
    np.testing.assert_allclose(events.time[:6], [0.25, 0.5, 0.75, 1.0, 1.5, 2.0])


@pytest.mark.parametrize("period", [0.0, TAU, 0.0007, 0.1])
def test_events_are_those_of_pixels_followed_one_by_one(period):
    logs, times = walks(), TIMES
    known = simulated(times, logs, BOTH, period, logs[0] - 0.05)
    assert known.shape[1] > 60
    pixel = Pixel(*BOTH, period_s=period, begun=0.05)
    logs, times, held, parts = jnp.asarray(logs), jnp.asarray(times), None, []
    for a, b in ((0, 20), (20, 41), (41, 81)):  # parts give the events of the whole
        part = slice(a, b + 1)
        events, held = convert(logs[part], times[part], pixel, held, capacity=4096)
        parts.append(fields(events, SHAPE[1]))
    found = np.concatenate(parts, axis=1)
    np.testing.assert_allclose(found, known, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_single_precision_of_a_late_clock_has_the_right_counts():
    logs = walks()
    known = simulated(TIMES, logs, BOTH, TAU, logs[0])
    times = jnp.asarray(TIMES, jnp.float32)
    frames = jnp.asarray(logs, jnp.float32)
    found = fields(pixel_events(frames, times, Pixel(*BOTH, TAU), capacity=999)[0], 5)
    np.testing.assert_allclose(found[0], known[0], rtol=0, atol=1e-6)


@pytest.mark.slow
def test_times_have_gradients_in_light_thresholds_period_and_clock():
    def total(logs, rise, period, clock):
        pixel = Pixel(rise, 0.3, period_s=period, begun=0.05)
        events, _ = pixel_events(logs, clock, pixel, capacity=256)
        return jnp.sum(jnp.where(events.polarity != 0, events.time, 0.0) ** 2)

    logs, clock = jnp.asarray(walks()[:9]), jnp.asarray(TIMES[:9])
    for period in (0.0, TAU):
        given = logs, jnp.asarray(0.2), jnp.asarray(period + 1e-5), clock
        # straight lines and a sum: differences are off by rounding, 1e-16 over the step
        check_slopes(total, given, eps=1e-7)


def test_light_below_the_floor_of_its_source_is_as_dark_as_the_floor():
    logs = log_intensity(jnp.array([0.0, DARKEST, 1e-5, 1.0]))
    np.testing.assert_allclose(logs, np.log([DARKEST, DARKEST, 1e-5, 1.0]))
    # 120 dB: a range of 1e6, where 8 bits have 510
    assert pytest.approx(10 ** (-120 / 20)) == DARKEST
    assert darkest_of(16) == 0.5 / 65535
    assert darkest_of(None) == DARKEST
    # IEC 61966-2-1: value 128 is 21.586 % of full light
    assert grey_light(srgb=True)[128] == pytest.approx(0.21586, abs=1e-5)
    assert grey_light()[128] == pytest.approx(128 / 255)


@pytest.mark.parametrize("bad", [-0.2, 0.0, np.nan, np.inf])
def test_thresholds_that_are_not_positive_are_refused(bad):
    for name, both in (("negative", (0.2, bad)), ("positive", (np.full(3, bad), 0.2))):
        with pytest.raises(InputError, match=f"^{name} threshold: expected positive"):
            Pixel(*both)


def test_frames_without_use_are_refused():
    frames, pixel = jnp.zeros((2, 1, 1)), Pixel(0.2, 0.2)
    for times in ([1.0, 0.0], [1.0, 1.0], [0.0, np.nan]):
        with pytest.raises(InputError, match="times that rise from frame to frame"):
            pixel_events(frames, jnp.array(times), pixel, capacity=4)
    with pytest.raises(InputError, match="expected two or more, got 1"):
        pixel_events(frames[:1], jnp.zeros(1), pixel, capacity=4)


def test_light_that_is_no_number_is_refused_and_has_no_times_inside_jit():
    frames = jnp.full((3, 2, 4), 0.5).at[2, 1, 1].set(1.0)
    broken, clock = frames.at[1:, 0, 3].set(jnp.nan), jnp.arange(3.0)
    with pytest.raises(InputError, match="got nan in frame 1, row 0, column 3"):
        pixel_events(broken, clock, Pixel(*BOTH), capacity=9)
    assert jnp.isnan(convert(broken, clock, Pixel(*BOTH), capacity=9)[0].time).all()
    known = convert(frames, clock, Pixel(*BOTH), capacity=9)[0].time
    assert known[0] > 1.0
    assert not jnp.isnan(known).any()


# Noise

IDEAL = NoiseModel(
    mismatch=None,
    bandwidth_hz=None,
    leak_hz=None,
    hot_fraction=None,
    shot_hz=None,
    refractory_s=None,
)


def noisy(shape=(100, 100), thresholds=(0.2, 0.4), key=KEY, **effects):
    return noisy_pixel(key, thresholds, IDEAL._replace(**effects), shape)


def test_thresholds_scatter_by_the_mismatch():
    pixel = noisy(mismatch=0.15)
    for threshold, middle in ((pixel.up, 0.2), (pixel.down, 0.4)):
        logs = np.log(np.asarray(threshold) / middle)
        # standard errors of 10,000 draws: 0.0015 and 0.0011; four of them
        assert abs(logs.mean()) < 0.006
        assert abs(logs.std() - 0.15) < 0.0045
    assert abs(np.corrcoef(np.ravel(pixel.up), np.ravel(pixel.down))[0, 1]) < 0.04


def test_the_low_pass_is_exact_for_ramps_and_steps_at_any_frame_rate():
    rate = 2.0 * np.pi * 300.0
    times = jnp.array([0.0, 0.0002, 0.003, 0.0031, 0.01])
    pixel = Pixel(9.0, 9.0, bandwidth_hz=300.0)

    def signal(logs, begin):
        found, held = [], None
        for n in range(1, len(times)):
            part = slice(n - 1, n + 1)
            frames = jnp.asarray(logs)[part, None, None]
            if held is None:
                _, held = convert(0 * frames, times[part] - 1.0, pixel, capacity=1)
                held = held._replace(lag=begin - frames[0])
            _, held = convert(frames, times[part], pixel, held, capacity=1)
            found.append(logs[n] + held.lag[0, 0])
        return np.array(found)

    ramp = 50.0 * times
    exact = ramp - 50.0 / rate * (1.0 - jnp.exp(-rate * times))
    np.testing.assert_allclose(signal(ramp, 0.0), exact[1:], rtol=1e-12, atol=1e-15)
    # a step just before the first frame
    exact = 1.0 - jnp.exp(-rate * times)
    np.testing.assert_allclose(signal(jnp.ones(5), 0.0), exact[1:], atol=1e-14)


@pytest.mark.slow
def test_leaking_pixels_have_their_own_rates_and_phases_from_the_first_second():
    """A still film of 100 s, at the default rate: not all at one instant."""
    clock, shape = jnp.array([0.0, 37.0, 100.0]), (48, 64)
    pixel = noisy(shape, BOTH, leak_hz=0.01)
    events, _ = convert(2.0 * jnp.ones((3, *shape)), clock, pixel, capacity=1 << 14)
    time, place, sign = fields(events, shape[1])
    assert (sign == 1).all()
    # mean rate 0.01 Hz: 3,072 events, and the spread of their pixels' rates
    assert abs(time.size - 3072) < 150
    # even over the record: a share of 0.25, standard error 0.008
    assert abs(np.mean(time < 25.0) - 0.25) < 0.03
    rates = np.asarray(pixel.drift / pixel.up)
    assert rates.mean() == pytest.approx(0.01, rel=0.02)
    assert np.log(rates).std() == pytest.approx(0.1 * np.log(10.0), rel=0.05)
    each = np.bincount(place.astype(int), minlength=rates.size)
    assert np.corrcoef(each, rates.ravel())[0, 1] > 0.3


def test_shot_noise_has_no_memory():
    """It comes at its rate, at even shares of the time, in any pixel and sign."""
    noise = jax.jit(shot_events, static_argnames=("pixels", "capacity"))
    place, share, sign, count = noise(KEY, 6000.0, pixels=600, capacity=1 << 13)
    count = int(count)
    # Poisson: 6,000, standard deviation 77; four of them
    assert abs(count - 6000) < 310
    assert (np.asarray(sign)[count:] == 0).all()
    place, share, sign = (np.asarray(v)[:count] for v in (place, share, sign))
    each = np.histogram(share, np.linspace(0.0, 1.0, 401))[0]
    assert abs(each.var() / each.mean() - 1.0) < 4.0 * np.sqrt(2.0 / 400)
    assert abs(sign.mean()) < 4.0 / np.sqrt(count)
    each = np.bincount(place, minlength=600)
    assert abs(each.var() / each.mean() - 1.0) < 4.0 * np.sqrt(2.0 / 600)


@pytest.mark.slow
def test_shot_noise_of_parts_does_not_repeat_and_resets_nothing():
    logs, clock = jnp.asarray(walks()), jnp.asarray(TIMES)
    quiet, _ = convert(logs, clock, Pixel(*BOTH), capacity=4096)
    pixel = noisy(SHAPE, BOTH, shot_hz=50.0)
    one, held = convert(logs, clock, pixel, capacity=4096)
    two, _ = convert(logs, clock, pixel, held, capacity=4096)
    known = set(map(tuple, fields(quiet, SHAPE[1]).T))
    extra = set(map(tuple, fields(one, SHAPE[1]).T)) - known
    assert len(known) + len(extra) == int(one.count)
    # 15 pixels, 50 Hz, 0.72 s; Poisson
    assert abs(len(extra) - 540) < 4.0 * np.sqrt(540)
    assert not extra & set(map(tuple, fields(two, SHAPE[1]).T))


# Smooth counts

CHANGES = jnp.array([0.0, 0.7, 0.45, -0.75, -0.33, 0.5])
"""Light that goes up and down; no change ends close to a threshold."""


def test_as_the_temperature_falls_the_counts_become_those_of_events():
    frames = CHANGES[:, None, None]
    events = one_pixel(CHANGES, np.arange(6.0), Pixel(*BOTH))
    time, sign = np.asarray(events.time), np.asarray(events.polarity)
    edges = np.arange(6.0) + 1e-9
    known = [1.0 * np.histogram(time[sign == s], edges)[0] for s in (1, -1)]
    assert min(map(sum, known)) > 2
    errors = []
    for temperature in (0.1, 0.03, 0.01):
        smooth = smooth_counts(frames, BOTH, temperature)
        off = [np.abs(s[:, 0, 0] - k).max() for s, k in zip(smooth, known, strict=True)]
        errors.append(max(off))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-3


def test_smooth_counts_have_the_gradients_of_finite_differences():
    def total(frames, thresholds):
        up, down = smooth_counts(frames, thresholds, 0.1)
        return jnp.sum(up * jnp.arange(1.0, 6.0)[:, None, None]) + jnp.sum(down**2)

    given = CHANGES[:, None, None], tuple(map(jnp.asarray, BOTH))
    # the step is short beside the temperature
    check_grads(jax.jit(total), given, 1, ["rev"], eps=1e-6, atol=1e-4, rtol=1e-4)
