import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.cases import THRESHOLD, film
from jblast.sensors.camera.events.ideal import ideal_events, reset_events
from jblast.sensors.camera.events.noise import IDEAL, noisy_events
from jblast.sensors.camera.events.stream import stream_events
from tests.tools.slopes import check_slopes

BOTH = (0.2, 0.3)
TAU = 0.013
SHAPE = (3, 5)
TIMES = np.cumsum(np.r_[0.0, np.tile([0.01, 0.004, 0.02, 0.002], 20)])


def pixel(times, logs, thresholds, refractory, first):
    """Simulate one pixel event by event; light is linear between frames."""
    sent, now, level, last = [], times[0], first, times[-1]
    while True:
        event = _next(times, logs, now, level, thresholds)
        if event is None:
            return sent
        sent.append(event)
        now = event[0] + refractory
        if now >= last:
            return sent
        level = np.interp(now, times, logs)


def _next(times, logs, now, level, thresholds):
    """Return when light next leaves the band about the level, and how."""
    knots = [now, *times[times > now]]
    values = [np.interp(now, times, logs), *logs[times > now]]
    for (a, va), (b, vb) in zip(
        zip(knots[:-1], values[:-1], strict=True),
        zip(knots[1:], values[1:], strict=True),
        strict=True,
    ):
        for sign, size in zip((1, -1), thresholds, strict=True):
            goal = level + sign * size
            if sign * (vb - goal) >= 0.0 > sign * (va - goal) - 1e-15:
                return a + (b - a) * (goal - va) / (vb - va), sign
    return None


def simulated(times, logs, thresholds, refractory, first):
    """Every pixel's events: number, time and sign, by time and then number."""
    rows = [
        (time, number, sign)
        for number in range(logs[0].size)
        for time, sign in pixel(
            times,
            logs.reshape(len(logs), -1)[:, number],
            thresholds,
            refractory,
            first.ravel()[number],
        )
    ]
    return np.array(sorted(rows)).T


def walks(seed=2):
    """Light that goes up and down by several thresholds, as fast as a period."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0.0, 0.4, (len(TIMES), *SHAPE)), axis=0)


def fields(events):
    count = int(events.count)
    x, y, time, sign = (
        np.asarray(f)[:count]
        for f in (events.x, events.y, events.time, events.polarity)
    )
    return np.stack([time, y * SHAPE[1] + x, sign])


convert = jax.jit(reset_events, static_argnames="capacity")


@pytest.mark.parametrize("refractory", [TAU, 0.0007, 0.1])
def test_events_are_those_of_a_pixel_followed_one_by_one(refractory):
    logs = walks()
    first = logs[0] - 0.05
    known = simulated(TIMES, logs, BOTH, refractory, first)
    args = [jnp.asarray(v) for v in (logs, TIMES)]
    found = convert(*args, BOTH, refractory, jnp.asarray(first), capacity=4096)
    assert known.shape[1] > 60
    np.testing.assert_allclose(fields(found), known, rtol=0, atol=1e-12)


@pytest.mark.parametrize("size", [1, 7, 81])
def test_a_stream_sends_the_same_however_it_is_cut(size):
    logs = walks()
    known = simulated(TIMES, logs, BOTH, TAU, logs[0] - 0.05)
    blocks = [
        (TIMES[a : a + size], logs[a : a + size]) for a in range(0, len(TIMES), size)
    ]
    options = {"in_logarithms": True, "begun": np.full(SHAPE, 0.05)}
    parts = stream_events(blocks, BOTH, refractory_s=TAU, workers=1, **options)
    found = np.concatenate([fields(part) for part in parts], axis=1)
    np.testing.assert_allclose(found, known, rtol=0, atol=1e-12)


def test_without_a_period_it_is_the_ideal_pixel():
    logs, times = jnp.asarray(walks()), jnp.asarray(TIMES)
    ours = fields(convert(logs, times, BOTH, 0.0, logs[0], capacity=4096))
    ideal = jax.jit(ideal_events, static_argnames="capacity")
    theirs = fields(ideal(logs, times, BOTH, capacity=4096))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10)


def test_it_loses_what_happens_in_the_period_where_esim_counts_on():
    times, logs = film(1000)
    logs = logs[:, 20:24]
    args = jnp.asarray(logs), jnp.asarray(times), (THRESHOLD, THRESHOLD)
    rest = IDEAL._replace(refractory_s=2e-3)
    run = functools.partial(noisy_events, jax.random.key(0), *args, capacity=1 << 14)
    counts = {}
    for name in ("reset", "esim"):
        events = jax.jit(functools.partial(run, rest._replace(refractory=name)))()
        counts[name] = int(events.count)
    first = logs[0]
    both = (THRESHOLD, THRESHOLD)
    known = simulated(times, logs, both, 2e-3, first)
    assert counts["reset"] == known.shape[1] < 0.9 * counts["esim"]


def test_times_have_gradients_in_light_thresholds_and_period():
    times = jnp.asarray(TIMES[:9])
    logs = jnp.asarray(walks()[:9])

    def total(logs, rise, period):
        events = reset_events(
            logs, times, (rise, 0.3), period, logs[0] - 0.05, capacity=256
        )
        return jnp.sum(jnp.where(jnp.isfinite(events.time), events.time, 0.0) ** 2)

    # straight lines and a sum: differences are off by rounding, 1e-16 over the step
    check_slopes(total, (logs, jnp.asarray(0.2), jnp.asarray(TAU)), eps=1e-7)
