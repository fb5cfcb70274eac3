import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.cases import (
    BRIGHT,
    DARK,
    DURATION,
    EDGE,
    HEIGHT,
    SPEED,
    START,
    THRESHOLD,
    WIDTH,
    analytic,
    disc_light,
    radius,
)
from jblast.sensors.camera.events.exact import frameless_events, implicit_times

BOTH = (THRESHOLD, THRESHOLD)
CLOSE = 2e-9
"""Twice the tolerance of a crossing [s]."""


def moving_disc(start, speed):
    return lambda time, x, y: disc_light(time, x, y, start, speed)


def samples(fps, duration=DURATION):
    return np.linspace(0.0, duration, max(2, round(duration * fps) + 1))


def one_pixel(curve, times, thresholds=BOTH):
    events = frameless_events(
        lambda time, x, y: curve(time), (1, 1), np.asarray(times), thresholds
    )
    return events.time, events.polarity


@pytest.mark.parametrize("fps", [1000, 100, 30])
def test_events_of_a_disc_stand_at_their_instants_whatever_the_frame_rate(fps):
    disc = moving_disc(START, SPEED)
    events = frameless_events(disc, (HEIGHT, WIDTH), samples(fps), BOTH)
    known, _, when = analytic()
    order = np.lexsort((events.time, events.x, events.y))
    np.testing.assert_array_equal((events.y * WIDTH + events.x)[order], known)
    np.testing.assert_allclose(events.time[order], when, rtol=0, atol=CLOSE)
    assert (events.polarity == 1).all()
    assert (np.diff(events.time) >= 0.0).all()
    assert int(events.count) == len(known)
    assert int(events.lost) == 0


def test_a_pixel_that_rises_and_falls_within_one_frame_is_seen():
    peak, middle, width = 0.9, 0.041, 4e-3

    def curve(time):
        return peak * jnp.exp(-0.5 * ((time - middle) / width) ** 2)

    def where(value, side):
        return middle + side * width * np.sqrt(2.0 * np.log(peak / value))

    # frames at 0, 1/30, 2/30: both ends of the frame of the pulse are dark
    time, sign = one_pixel(curve, np.arange(4) / 30.0, (0.2, 0.25))
    up = [where(0.2 * n, -1.0) for n in (1, 2, 3, 4)]
    down = [where(0.8 - 0.25 * n, 1.0) for n in (1, 2, 3)]
    np.testing.assert_array_equal(sign, [1] * 4 + [-1] * 3)
    np.testing.assert_allclose(time, up + down, rtol=0, atol=CLOSE)


def test_a_flash_has_all_its_events_at_its_instant():
    time, sign = one_pixel(lambda t: jnp.where(t < 0.0123, -2.0, -1.0), [0.0, 0.04])
    np.testing.assert_array_equal(sign, [1] * 5)
    np.testing.assert_allclose(time, 0.0123, rtol=0, atol=CLOSE)


@pytest.mark.parametrize(("peak", "count"), [(0.2, 2), (0.2 - 1e-9, 0)])
def test_a_peak_that_touches_a_threshold_reaches_it(peak, count):
    # up at the peak; the fall from there to -0.1 is another, at 0
    def curve(time):
        return peak - 0.3 * ((time - 0.5) / 0.5) ** 2

    time, sign = one_pixel(curve, [0.5 - 0.5 * np.sqrt(peak / 0.3), 0.4, 1.0])
    assert len(time) == count
    if count:
        np.testing.assert_array_equal(sign, [1, -1])
        # where light turns a rounding error is felt by its root
        assert time[0] == pytest.approx(0.5, abs=1e-6)


def test_times_have_the_gradients_of_the_scene():
    def weighted(time):
        return jnp.sum(time * jnp.sin(jnp.arange(time.size, dtype=time.dtype)))

    def by_newton(scene):
        events = frameless_events(
            moving_disc(START, SPEED), (HEIGHT, WIDTH), samples(100), BOTH
        )
        return weighted(implicit_times(moving_disc(*scene), events, 0.0, BOTH))

    # the same events, each found anew
    def in_closed_form(scene):
        start, speed = scene
        pixel, nth, _ = analytic()
        x, y = pixel % WIDTH, pixel // WIDTH
        disc = moving_disc(start, speed)
        begin = disc(
            jnp.zeros(pixel.size), jnp.asarray(x, float), jnp.asarray(y, float)
        )
        share = (begin + nth * THRESHOLD - DARK) / (BRIGHT - DARK)
        away = radius(jnp.asarray(x, float), jnp.asarray(y, float))
        time = (away - EDGE * jnp.log(1.0 / share - 1.0) - start) / speed
        _, _, when = analytic()
        return weighted(time[np.lexsort((pixel, when))])

    at = (jnp.asarray(START), jnp.asarray(SPEED))
    ours, known = jax.grad(by_newton)(at), jax.grad(in_closed_form)(at)
    # an order of two events that are simultaneous to the tolerance may differ
    np.testing.assert_allclose(ours, known, rtol=1e-6)
