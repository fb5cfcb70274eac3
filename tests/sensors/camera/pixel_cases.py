"""Pixels followed event by event, as a reference."""

import numpy as np

BOTH = (0.2, 0.3)
TAU = 0.013
SHAPE = (3, 5)
TIMES = np.cumsum(np.r_[0.0, np.tile([0.01, 0.004, 0.02, 0.002], 20)])


def walks(seed=2):
    """Light that goes up and down by several thresholds, as fast as a period."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0.0, 0.4, (len(TIMES), *SHAPE)), axis=0)


def fields(events, width):
    """Return time, pixel and sign."""
    count = int(events.count)
    x, y, time, sign = (
        np.asarray(f)[:count]
        for f in (events.x, events.y, events.time, events.polarity)
    )
    return np.array([time, y * width + x, sign]) if time.size else np.empty((3, 0))


def simulated(times, logs, thresholds, period, first):
    """Return every pixel's events: time, number and sign, in order."""
    rows = []
    for number in range(logs[0].size):
        light = logs.reshape(len(logs), -1)[:, number]
        for time, sign in _pixel(times, light, thresholds, period, first.flat[number]):
            rows.append((time, number, sign))
    return np.array(sorted(rows)).T


def _pixel(times, logs, thresholds, period, level):
    """Yield the events of a pixel; light is linear between frames."""
    now = times[0]
    while (event := _next(times, logs, now, level, thresholds)) is not None:
        yield event
        now = event[0] + period
        if now >= times[-1]:
            return
        level = np.interp(now, times, logs)


def _next(times, logs, now, level, thresholds):
    """Return time and sign at which light next leaves the band about the level."""
    knots = [now, *times[times > now]]
    values = [np.interp(now, times, logs), *logs[times > now]]
    for n in range(len(knots) - 1):
        (a, b), (va, vb) = knots[n : n + 2], values[n : n + 2]
        for sign, size in zip((1, -1), thresholds, strict=True):
            goal = level + sign * size
            if sign * (vb - goal) >= 0.0 > sign * (va - goal) - 1e-15:
                return a + (b - a) * (goal - va) / (vb - va), sign
    return None
