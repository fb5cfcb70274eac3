"""Noise of a known spectrum, and a pulse of one band, for the tests of this room."""

import numpy as np

from jblast.detect import NoiseSpectrum

RATE = 48000.0


def rumble(lines: bool = False) -> NoiseSpectrum:
    """Wind and traffic over a recorder's floor: 90 dB between the ends of the band."""
    f = np.linspace(0.0, RATE / 2, 2049)
    density = 1 / (1 + (f / 30) ** 2) ** 1.2 + 1e-5 / (1 + (f / 500) ** 2) + 1e-9
    if lines:
        density[[12, 24, 36]] *= 100.0  # a rotor
    return NoiseSpectrum(f, density)


def coloured(
    rng: np.random.Generator, noise: NoiseSpectrum, size: int, rows: int = 1
) -> np.ndarray:
    """Draw noise around a circle of `size` samples, by its spectrum alone."""
    f = np.fft.rfftfreq(size, 1 / RATE)
    spread = np.sqrt(np.interp(f, *noise[:2]) * RATE / 2)
    white = np.fft.rfft(rng.standard_normal((rows, size)))
    return np.fft.irfft(white * spread, size).reshape(rows, size)


def pulse(duration_s: float, delay: float = 0.0, rise_s: float = 2e-4) -> np.ndarray:
    """A blast with a smooth front, `delay` samples late."""
    count = round(duration_s * RATE)
    t = (np.arange(count) - delay) / RATE
    after = np.maximum(t, 0.0)
    front = 1 - (1 + after / rise_s * 4) * np.exp(-after / rise_s * 4)
    late = after / duration_s * 6
    end = np.cos(0.5 * np.pi * np.clip((t / duration_s - 0.7) / 0.25, 0, 1)) ** 2
    return np.where(t > 0, front * (1 - late) * np.exp(-late) * end, 0.0)
