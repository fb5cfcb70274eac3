"""A bright disc whose edge is a logistic of the logarithm of light, and moves out.

Its events are known: the radius at which a threshold is crossed moves with the edge.
"""

import numpy as np

HEIGHT, WIDTH = 48, 64
# the last of the six thresholds lies at 87 % of the rise: in the flat end of the edge
# 8 bits tell little of the time (90 us if it lies at 99 %)
DARK, BRIGHT = np.log(50 / 255), np.log(200 / 255)
EDGE, SPEED, START, DURATION = 1.0, 260.0, 3.0, 0.08
THRESHOLD = 0.2


def radius():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.hypot(x - (WIDTH - 1) / 2 - 0.3, y - (HEIGHT - 1) / 2 + 0.2)


def log_light(time):
    edge = START + SPEED * time
    return DARK + (BRIGHT - DARK) / (1.0 + np.exp((radius() - edge) / EDGE))


def film(fps):
    """Times [s] and logarithm of the light."""
    times = np.arange(round(DURATION * fps) + 1) / fps
    return times, np.stack([log_light(time) for time in times])


def analytic():
    """Pixel, number and time of each event, by pixel and then time."""
    r, begin, end = radius().ravel(), log_light(0.0).ravel(), log_light(DURATION)
    number = np.floor((end.ravel() - begin) / THRESHOLD).astype(int)
    pixel = np.repeat(np.arange(r.size), number)
    nth = np.concatenate([np.arange(1, n + 1) for n in number])
    share = (begin[pixel] + nth * THRESHOLD - DARK) / (BRIGHT - DARK)
    edge = r[pixel] - EDGE * np.log(1.0 / share - 1.0)
    return pixel, nth, (edge - START) / SPEED
