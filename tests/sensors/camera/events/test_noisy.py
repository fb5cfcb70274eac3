import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.cases import HEIGHT, THRESHOLD, WIDTH, film
from jblast.sensors.camera.events.ideal import Events, ideal_events
from jblast.sensors.camera.events.noise import (
    IDEAL,
    NoiseModel,
    leaks,
    low_passed,
    mismatched,
    noisy_events,
    noisy_stream,
    rested,
    shot_noise,
)

KEY = jax.random.key(0)
BOTH = (THRESHOLD, THRESHOLD)


@functools.partial(jax.jit, static_argnames=("capacity", "noise"))
def convert(logs, times, noise, capacity=1 << 14, key=KEY):
    return noisy_events(key, logs, times, BOTH, noise, capacity=capacity)


def test_with_every_effect_left_out_the_camera_is_ideal():
    times, logs = (jnp.asarray(array) for array in film(1000))
    ideal = jax.jit(ideal_events, static_argnames="capacity")
    ideal = ideal(logs, times, BOTH, capacity=1 << 14)
    for ours, theirs in zip(
        jax.tree.leaves(convert(logs, times, IDEAL)),
        jax.tree.leaves(ideal),
        strict=True,
    ):
        # two programs, which may round a time apart in its last digits
        np.testing.assert_allclose(ours, theirs, rtol=1e-14, atol=0)


def test_thresholds_scatter_as_asked_and_stay_positive():
    positive, negative = mismatched(KEY, (0.2, 0.4), 0.15, (100, 100))
    for threshold, middle in ((positive, 0.2), (negative, 0.4)):
        logs = np.log(np.asarray(threshold) / middle)
        # standard errors of 10,000 draws: 0.0015 and 0.0011; four of them
        assert abs(logs.mean()) < 0.006
        assert abs(logs.std() - 0.15) < 0.0045
    assert abs(np.corrcoef(np.ravel(positive), np.ravel(negative))[0, 1]) < 0.04


def test_the_low_pass_is_exact_for_ramps_and_steps_at_any_frame_rate():
    rate = 2.0 * np.pi * 300.0
    times = jnp.array([0.0, 0.0002, 0.003, 0.0031, 0.01])
    ramp = 50.0 * times
    answer = low_passed(ramp[:, None], times, 300.0, jnp.zeros(1))[:, 0]
    exact = ramp - 50.0 / rate * (1.0 - jnp.exp(-rate * times))
    np.testing.assert_allclose(answer, exact, rtol=1e-12, atol=1e-15)
    # a step just before the first frame
    answer = low_passed(jnp.ones((5, 1)), times, 300.0, jnp.zeros(1))[:, 0]
    np.testing.assert_allclose(answer, 1.0 - jnp.exp(-rate * times), atol=1e-14)


def test_leaking_pixels_have_own_rates_and_phases_from_the_first_second():
    """A still film of 100 s, at the default rate: none of it at one instant."""
    clock = jnp.array([0.0, 37.0, 100.0])
    still = 2.0 * jnp.ones((3, 48, 64))
    leaky = IDEAL._replace(leak_hz=0.01, refractory_s=0.5e-3)
    events = convert(still, clock, leaky)
    pixels, count = 48 * 64, int(events.count)
    time = np.asarray(events.time)[:count]
    assert (np.asarray(events.polarity)[:count] == 1).all()
    # pixels take turns at random: not more scatter than of a Poisson process
    assert abs(count - pixels) < 4.0 * np.sqrt(pixels)
    seconds = np.histogram(time, np.arange(101))[0]
    mean = 0.01 * pixels
    # the most of 100 seconds: Poisson, 4.5 standard deviations
    assert seconds.max() < mean + 4.5 * np.sqrt(mean)
    assert seconds.var() < 1.6 * mean  # 1 is Poisson's, standard error 0.14
    for first in (1, 10):  # from the beginning
        early = seconds[:first].sum()
        assert abs(early - first * mean) < 4.0 * np.sqrt(first * mean)
    assert np.unique(time).size > 0.999 * count


def test_leak_rates_scatter_as_asked_about_their_mean():
    lanes = IDEAL._replace(leak_hz=0.5, hot_fraction=0.1, hot_hz=40.0)
    leak = leaks(KEY, (100, 100), lanes)
    hot = np.asarray(leak.rate) > 5.0
    # binomial: 1000 of 10,000, standard deviation 30; four of them
    assert abs(hot.sum() - 1000) < 120
    for rates, mean in ((leak.rate[~hot], 0.5), (leak.rate[hot], 40.0)):
        logs = np.log(np.asarray(rates) / mean)
        error = lanes.leak_spread / np.sqrt(logs.size)
        assert abs(logs.std() - lanes.leak_spread) < 4.0 * error
        assert abs(np.asarray(rates).mean() / mean - 1.0) < 4.2 * error
    phase = np.asarray(leak.phase)
    # uniform: standard errors of mean and variance of 10,000
    assert abs(phase.mean() - 0.5) < 4.0 * 0.0029
    assert abs(phase.var() - 1 / 12) < 4.0 * 0.00075
    assert abs(np.corrcoef(phase.ravel(), np.ravel(leak.rate))[0, 1]) < 0.04
    # a pixel that does not leak begins with its first light, as an ideal one
    some = leaks(KEY, (100, 100), lanes._replace(leak_hz=None))
    np.testing.assert_array_equal(some.phase[~hot], 0.0)
    np.testing.assert_array_equal(some.rate[~hot], 0.0)


def test_noise_has_no_memory():
    """It comes at its rate, with exponential waits and uncorrelated counts."""
    noise = jax.jit(shot_noise, static_argnums=2, static_argnames="capacity")
    events = noise(KEY, 0.5, (20, 30), 2.0, 22.0, capacity=1 << 13)
    time = np.asarray(events.time)[: int(events.count)]
    waits = np.diff(time)
    # of an exponential: mean and standard deviation alike; 6,000 waits
    assert abs(waits.std() / waits.mean() - 1.0) < 4.0 * np.sqrt(2.0 / 6000)
    counts = np.histogram(time, np.linspace(2.0, 22.0, 401))[0]
    assert abs(counts.var() / counts.mean() - 1.0) < 4.0 * np.sqrt(2.0 / 400)
    assert abs(np.corrcoef(counts[1:], counts[:-1])[0, 1]) < 4.0 / np.sqrt(400)
    # Poisson: 6000, standard deviation 77; four of them
    assert abs(time.size - 6000) < 310
    assert (waits >= 0).all()
    assert 2.0 <= time[0] < time[-1] <= 22.0
    sign = np.asarray(events.polarity)[: time.size]
    assert abs(sign.mean()) < 4.0 / np.sqrt(time.size)
    each = np.bincount(np.asarray(events.y * 30 + events.x)[: time.size])
    assert each.size == 600
    assert abs(each.var() / each.mean() - 1.0) < 4.0 * np.sqrt(2.0 / 600)


def test_a_pixel_rests_after_an_event_it_sent_not_after_one_it_did_not():
    time = jnp.array([0.0, 0.3, 0.4, 1.1, 1.5, 2.2, jnp.inf])
    x = jnp.array([0, 0, 1, 0, 0, 0, -1])
    sign = jnp.array([1, 1, 1, 1, -1, 1, 0])
    events = Events(x, jnp.minimum(x, 0), time, sign, jnp.asarray(6), jnp.asarray(0))
    left, last = rested(events, 1.0, jnp.full((1, 2), -jnp.inf))
    assert int(left.count) == 4
    np.testing.assert_array_equal(left.time[:4], [0.0, 0.4, 1.1, 2.2])
    np.testing.assert_array_equal(last, [[2.2, 0.4]])


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise",
    [
        IDEAL._replace(mismatch=0.15),
        IDEAL._replace(bandwidth_hz=300.0),
        IDEAL._replace(leak_hz=5.0, hot_fraction=0.01, hot_hz=100.0),
        IDEAL._replace(refractory_s=0.002),
        IDEAL._replace(refractory_s=0.002, refractory="esim"),
        NoiseModel(shot_hz=None),
    ],
)
def test_a_stream_gives_the_events_of_the_whole(noise):
    times, logs = film(1000)
    whole = convert(jnp.asarray(logs), jnp.asarray(times), noise)
    assert int(whole.lost) == 0
    light = np.exp(logs)
    blocks = [(times[a : a + 16], light[a : a + 16]) for a in range(0, len(times), 16)]
    parts = list(noisy_stream(KEY, blocks, (HEIGHT, WIDTH), BOTH, noise))
    ours = np.concatenate([np.asarray(p.time)[: int(p.count)] for p in parts])
    assert len(ours) > 1000
    # taking logarithms of exponentials moves the last bits
    np.testing.assert_allclose(ours, whole.time[: int(whole.count)], atol=1e-12)


def test_a_stream_repeats_with_its_key():
    times, light = np.arange(33) / 4.0, np.full((33, 20, 30), 0.5)
    blocks = [(times[a : a + 8], light[a : a + 8]) for a in range(0, 33, 8)]
    noisy = NoiseModel(leak_hz=0.2, shot_hz=0.2)
    one, two, other = (
        np.concatenate(
            [
                np.asarray(part.time)[: int(part.count)]
                for part in noisy_stream(key, blocks, (20, 30), BOTH, noisy)
            ]
        )
        for key in (KEY, KEY, jax.random.key(1))
    )
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, other)
    # leak and noise together: 0.4 Hz of 600 pixels for 8 s; Poisson at most
    assert abs(one.size - 1920) < 4.0 * np.sqrt(1920)
