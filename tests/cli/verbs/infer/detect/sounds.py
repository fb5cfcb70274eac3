"""Sound files that the tests of `jblast detect` are asked about."""

import numpy as np
import soundfile

RATE = 8000
WIDTH = 1e-3
BEFORE = 0.01
"""The template's first sample is so long before the middle of its pulse [s]."""


def pulse(time, middle):
    """A bang of some milliseconds, up, then down."""
    x = (time - middle) / WIDTH
    return x * np.exp(-0.5 * x**2)


def recording(times, seconds=4.0, noise=0.02, seed=0, rate=RATE):
    """Channels, each with bangs in white noise; `times` are arrivals by channel."""
    rng = np.random.default_rng(seed)
    clock = np.arange(round(seconds * rate)) / rate
    channels = [
        sum((pulse(clock, t + BEFORE) for t in of), np.zeros(clock.size))
        for of in times
    ]
    return np.array(channels) + noise * rng.standard_normal((len(times), clock.size))


def write(jblast, name, samples, rate=RATE, subtype="FLOAT"):
    """Write a file with nothing of jblast; return its path."""
    path = jblast.path(name)
    soundfile.write(path, np.atleast_2d(samples).T, rate, subtype=subtype)
    return path


def template(jblast, rate=RATE, name="template.wav"):
    """Write the pulse alone."""
    clock = np.arange(round(2 * BEFORE * rate)) / rate
    return write(jblast, name, pulse(clock, BEFORE), rate)
