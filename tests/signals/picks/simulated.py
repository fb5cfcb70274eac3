"""Records made in NumPy, by the formulas again: what picks are tested with."""

from typing import NamedTuple

import numpy as np

RATE, SAMPLES = 1e5, 1024
TIME = np.arange(SAMPLES) / RATE
FINE = 64
"""Instants that a sample is the mean of."""


class Truth(NamedTuple):
    """A pulse: times in seconds, pressures in pascals."""

    arrival: float = 3.1234e-3
    peak: float = 3e4
    duration: float = 2e-3
    decay: float = 1.2
    rise: float = 4e-5
    suction: float = 6e3
    suction_duration: float = 4.6e-3

    @property
    def impulse(self) -> float:
        """Of the positive phase [Pa s]."""
        b = self.decay
        behind = (b - 1.0 + np.exp(-b)) / b**2
        return self.peak * (0.5 * self.rise + (self.duration - self.rise) * behind)


def pressure_at(truth: Truth, time):
    """Return the overpressure at instants [Pa]."""
    since = time - truth.arrival
    x = np.clip(since / truth.rise, 0.0, 1.0)
    s = np.clip((since - truth.rise) / (truth.duration - truth.rise), 0.0, 1.0)
    q = np.clip((since - truth.duration) / truth.suction_duration, 0.0, 1.0)
    shape = np.where(x < 1.0, 3 * x**2 - 2 * x**3, (1 - s) * np.exp(-truth.decay * s))
    return truth.peak * shape - 6.75 * truth.suction * q * (1 - q) ** 2


def samples_of(truth: Truth, count: int = SAMPLES, rate: float = RATE):
    """Return means over samples whose middles are the times."""
    fine = ((np.arange(count * FINE) + 0.5) / FINE - 0.5) / rate
    return pressure_at(truth, fine).reshape(count, FINE).mean(axis=1)


def noisy(truth: Truth, sigma: float, many: int, seed: int = 0):
    """Return records under white noise."""
    rng = np.random.default_rng(seed)
    return samples_of(truth) + sigma * rng.standard_normal((many, SAMPLES))
