"""Events of an ideal pixel, and counts that have slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from jax.test_util import check_grads

from calibration.cases import THRESHOLD, WIDTH, analytic, film
from jblast.sensors.camera.events.ideal import (
    DARKEST,
    Events,
    continued_events,
    count_events,
    darkest_of,
    first_reference,
    grey_table,
    ideal_events,
    log_intensity,
    smooth_counts,
)

convert = jax.jit(ideal_events, static_argnames="capacity")
carry_on = jax.jit(continued_events, static_argnames="capacity")
BOTH = (THRESHOLD, THRESHOLD)


def by_pixel(events: Events, width: int = WIDTH):
    count = int(events.count)
    pixel = np.asarray(events.y * width + events.x)[:count]
    time = np.asarray(events.time)[:count]
    order = np.lexsort((time, pixel))
    return pixel[order], time[order]


def one_pixel(logs, times, thresholds=(0.2, 0.2), capacity=64):
    frames = jnp.asarray(logs, float)[:, None, None]
    return convert(frames, jnp.asarray(times, float), thresholds, capacity=capacity)


@pytest.mark.parametrize(("fps", "microseconds"), [(1000, 12.0), (2000, 3.0)])
def test_events_of_a_disc_are_all_there_and_second_order_in_time(fps, microseconds):
    times, logs = film(fps)
    events = convert(jnp.asarray(logs), jnp.asarray(times), BOTH, capacity=1 << 14)
    pixel, time = by_pixel(events)
    known, _, when = analytic()
    np.testing.assert_array_equal(pixel, known)
    assert np.abs(time - when).mean() * 1e6 < microseconds
    assert (np.asarray(events.polarity)[: int(events.count)] == 1).all()
    assert int(events.lost) == 0


@settings(deadline=None, max_examples=25)
@given(
    count=st.integers(1, 40),
    threshold=st.floats(0.01, 0.8),
    down=st.booleans(),
    begin=st.floats(-6.0, 0.0),
)
def test_a_ramp_of_k_thresholds_gives_k_events_at_the_right_microsecond(
    count, threshold, down, begin
):
    sign = -1.0 if down else 1.0
    times = np.arange(11) / 1000.0
    logs = begin + sign * count * threshold * np.arange(11) / 10.0
    events = one_pixel(logs, times, (threshold, threshold))
    assert int(events.count) == count
    expected = 0.01 * np.arange(1, count + 1) / count
    np.testing.assert_allclose(events.time[:count], expected, atol=1e-9)  # rounding
    assert (np.asarray(events.polarity[:count]) == sign).all()
    assert (np.asarray(events.x[count:]) == -1).all()
    assert np.isinf(np.asarray(events.time[count:])).all()


def test_the_reference_stays_where_the_last_event_put_it():
    # up 0.5: two events, reference 0.4; down to 0.25: within a threshold of 0.4
    events = one_pixel([0.0, 0.5, 0.25, 0.15, 0.65], [0.0, 1.0, 2.0, 3.0, 4.0])
    assert int(events.count) == 5
    np.testing.assert_array_equal(events.polarity[:5], [1, 1, -1, 1, 1])
    # 0.2 again after the fall to 0.15, whose own event was at 0.2: then 0.4 and 0.6
    np.testing.assert_allclose(events.time[:5], [0.4, 0.8, 2.5, 3.5, 3.9], rtol=1e-12)


def test_each_polarity_has_its_threshold():
    events = one_pixel([0.0, 1.0, 0.0], [0.0, 1.0, 2.0], (0.25, 0.5))
    np.testing.assert_array_equal(events.polarity[:6], [1, 1, 1, 1, -1, -1])
    np.testing.assert_allclose(events.time[:6], [0.25, 0.5, 0.75, 1.0, 1.5, 2.0])


def test_what_does_not_fit_is_counted():
    times, logs = film(1000)
    frames = jnp.asarray(logs), jnp.asarray(times)
    full = convert(*frames, BOTH, capacity=1 << 14)
    few = convert(*frames, BOTH, capacity=100)
    assert int(few.count) == 100
    assert int(few.count + few.lost) == int(full.count)


def test_parts_give_the_events_of_the_whole():
    times, logs = (jnp.asarray(array) for array in film(1000))
    whole = convert(logs, times, BOTH, capacity=1 << 14)
    reference, found = first_reference(logs[0]), []
    for a, b in ((0, 10), (10, 41), (41, 80)):
        part, reference = carry_on(
            logs[a : b + 1], times[a : b + 1], BOTH, reference, capacity=1 << 14
        )
        found.append([np.asarray(v)[: int(part.count)] for v in (part.x, part.time)])
    x, time = (np.concatenate(values) for values in zip(*found, strict=True))
    np.testing.assert_array_equal(x, whole.x[: int(whole.count)])
    np.testing.assert_array_equal(time, whole.time[: int(whole.count)])


def test_times_have_gradients_in_frames_thresholds_and_clock():
    def total(logs, threshold, times):
        events = ideal_events(logs[:, None, None], times, (threshold, 0.2), capacity=8)
        return jnp.sum(jnp.where(events.polarity != 0, events.time, 0.0) ** 2)

    logs, times = jnp.array([0.1, 0.2, 0.75, 0.5]), jnp.array([0.0, 1.0, 2.5, 3.0])
    check_grads(
        jax.jit(total), (logs, jnp.asarray(0.19), times), order=1, modes=["rev"]
    )


def test_light_below_the_floor_of_its_source_is_as_dark_as_that():
    np.testing.assert_allclose(
        log_intensity(jnp.array([0.0, DARKEST, 1.0])), np.log([DARKEST, DARKEST, 1.0])
    )
    # 120 dB: a range of 1e6, where 8 bits have 510
    assert pytest.approx(10 ** (-120 / 20)) == DARKEST
    np.testing.assert_allclose(log_intensity(jnp.asarray(1e-5)), np.log(1e-5))
    assert darkest_of(16) == 0.5 / 65535
    assert darkest_of(None) == DARKEST
    assert grey_table()[0] == pytest.approx(np.log(0.5 / 255))
    assert grey_table()[128] == pytest.approx(np.log(128 / 255))
    # IEC 61966-2-1: value 128 is 21.586 % of full light
    assert np.exp(grey_table(srgb=True)[128]) == pytest.approx(0.21586, abs=1e-5)


UNLIKE = (jnp.asarray(0.2), jnp.asarray(0.3))


def frames():
    """Light that goes up and down; no change ends close to a threshold."""
    change = jnp.array([0.0, 0.7, 0.45, -0.75, -0.33, 0.5])[:, None, None]
    return change * jnp.ones((1, 2, 3))


def hard():
    counts, _, _ = count_events(frames(), UNLIKE, first_reference(frames()[0]))
    counts = np.asarray(counts, float)
    return np.maximum(counts, 0.0), np.maximum(-counts, 0.0)


def test_as_the_temperature_falls_the_counts_become_the_hard_ones():
    known, errors = hard(), []
    assert known[0].sum() > 0
    assert known[1].sum() > 0
    for temperature in (0.1, 0.03, 0.01):
        smooth = smooth_counts(frames(), UNLIKE, temperature)
        pairs = zip(smooth, known, strict=True)
        errors.append(max(float(jnp.abs(a - b).max()) for a, b in pairs))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-3


@pytest.mark.parametrize("temperature", [0.05, 0.2])
def test_counts_have_the_gradients_of_finite_differences(temperature):
    def total(frames, thresholds):
        up, down = smooth_counts(frames, thresholds, temperature)
        return jnp.sum(up * jnp.arange(1.0, 6.0)[:, None, None]) + jnp.sum(down**2)

    # the step is short beside the temperature
    check_grads(
        jax.jit(total),
        (frames(), UNLIKE),
        order=1,
        modes=["rev"],
        eps=1e-6,
        atol=1e-4,
        rtol=1e-4,
    )


def test_a_still_pixel_sends_almost_nothing():
    up, down = smooth_counts(jnp.zeros((11, 1, 1)), UNLIKE, 0.1)
    # ten frames of exp(-1/T); meanwhile the reference creeps by as little
    np.testing.assert_allclose(up.sum(), 10 * np.exp(-10.0), rtol=1e-2)
    np.testing.assert_allclose(down.sum(), 10 * np.exp(-10.0), rtol=1e-2)
