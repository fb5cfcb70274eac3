"""A pulse that every format's test writes and reads back."""

import numpy as np

RATE_HZ = 2000.0
START_S = 0.25


def pulse(samples: int = 400) -> np.ndarray:
    """A pulse of 1.2 kPa after 50 ms, in pascals."""
    t = np.arange(samples) / RATE_HZ - 0.05
    return np.where(t >= 0, 1200.0 * (1 - t / 0.02) * np.exp(-t / 0.02), 0.0)


def times(samples: int = 400) -> np.ndarray:
    """When its samples are taken [s]."""
    return START_S + np.arange(samples) / RATE_HZ
