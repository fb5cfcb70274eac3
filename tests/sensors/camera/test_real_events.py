import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.camera.events import Events, ideal_events
from jblast.sensors.camera.imperfections import (
    IDEAL,
    Imperfections,
    low_passed,
    mismatched,
    rested,
    shot_noise,
)
from jblast.sensors.camera.real_events import real_events, real_stream
from jblast.study.event_disc import HEIGHT, THRESHOLD, WIDTH, film

KEY = jax.random.key(0)
BOTH = (THRESHOLD, THRESHOLD)
STILL = 2.0 * jnp.ones((3, 20, 30))
CLOCK = jnp.array([0.0, 4.0, 10.0])


@functools.partial(jax.jit, static_argnames=("capacity", "imperfections"))
def convert(logs, times, imperfections, capacity=1 << 14, key=KEY):
    return real_events(key, logs, times, BOTH, imperfections, capacity=capacity)


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


def test_leak_and_hot_pixels_send_brighter_events_at_their_rates():
    leaky = IDEAL._replace(leak_hz=0.55)
    events = convert(STILL, CLOCK, leaky)
    assert int(events.count) == 5 * 20 * 30  # 0.55 Hz for 10 s
    assert (np.asarray(events.polarity[:3000]) == 1).all()
    np.testing.assert_allclose(events.time[0], 1.0 / 0.55)
    hot = convert(STILL, CLOCK, IDEAL._replace(hot_fraction=0.1, hot_hz=2.05))
    pixels = np.unique(np.asarray(hot.y * 30 + hot.x)[: int(hot.count)])
    assert int(hot.count) == 20 * len(pixels)
    # binomial: 60 of 600, standard deviation 7.3; four of them
    assert abs(len(pixels) - 60) < 30


def test_noise_comes_at_its_rate_from_everywhere_with_either_sign():
    noise = jax.jit(shot_noise, static_argnums=2, static_argnames="capacity")
    events = noise(KEY, 0.5, (20, 30), 2.0, 12.0, capacity=1 << 13)
    count = int(events.count)
    # Poisson: 3000, standard deviation 55; four of them
    assert abs(count - 3000) < 220
    time, sign = np.asarray(events.time)[:count], np.asarray(events.polarity)[:count]
    assert (np.diff(time) >= 0).all()
    assert time[0] >= 2.0
    assert time[-1] <= 12.0
    assert abs(sign.mean()) < 4.0 / np.sqrt(count)
    assert len(np.unique(np.asarray(events.x)[:count])) == 30


def test_a_pixel_rests_after_an_event_it_sent_not_after_one_it_did_not():
    time = jnp.array([0.0, 0.3, 0.4, 1.1, 1.5, 2.2, jnp.inf])
    x = jnp.array([0, 0, 1, 0, 0, 0, -1])
    sign = jnp.array([1, 1, 1, 1, -1, 1, 0])
    events = Events(x, jnp.minimum(x, 0), time, sign, jnp.asarray(6), jnp.asarray(0))
    left, last = rested(events, 1.0, jnp.full((1, 2), -jnp.inf))
    assert int(left.count) == 4
    np.testing.assert_array_equal(left.time[:4], [0.0, 0.4, 1.1, 2.2])
    np.testing.assert_array_equal(last, [[2.2, 0.4]])


def test_a_key_gives_the_same_events_again_and_another_key_others():
    times, logs = (jnp.asarray(array) for array in film(1000))
    rough = IDEAL._replace(mismatch=0.1)
    one, two, other = (
        convert(logs, times, rough, key=key) for key in (KEY, KEY, jax.random.key(1))
    )
    np.testing.assert_array_equal(one.time, two.time)
    assert not np.array_equal(one.time, other.time)


@pytest.mark.slow
@pytest.mark.parametrize(
    "imperfections",
    [
        IDEAL._replace(mismatch=0.15),
        IDEAL._replace(bandwidth_hz=300.0),
        IDEAL._replace(leak_hz=5.0, hot_fraction=0.01, hot_hz=100.0),
        IDEAL._replace(refractory_s=0.002),
        Imperfections(shot_hz=None),
    ],
)
def test_a_stream_gives_the_events_of_the_whole(imperfections):
    times, logs = film(1000)
    whole = convert(jnp.asarray(logs), jnp.asarray(times), imperfections)
    assert int(whole.lost) == 0
    light = np.exp(logs)
    blocks = [(times[a : a + 16], light[a : a + 16]) for a in range(0, len(times), 16)]
    parts = list(real_stream(KEY, blocks, (HEIGHT, WIDTH), BOTH, imperfections))
    ours = np.concatenate([np.asarray(p.time)[: int(p.count)] for p in parts])
    assert len(ours) > 1000
    # taking logarithms of exponentials moves the last bits
    np.testing.assert_allclose(ours, whole.time[: int(whole.count)], atol=1e-12)


def test_noise_of_a_stream_comes_at_its_rate():
    times, light = np.arange(33) / 4.0, np.full((33, 20, 30), 0.5)
    blocks = [(times[a : a + 8], light[a : a + 8]) for a in range(0, 33, 8)]
    stream = real_stream(KEY, blocks, (20, 30), BOTH, IDEAL._replace(shot_hz=0.5))
    count = sum(int(part.count) for part in stream)
    assert abs(count - 2400) < 196  # Poisson: four standard deviations
