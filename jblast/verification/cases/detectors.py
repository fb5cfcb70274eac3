"""Sound in which detectors are compared: noise of a known spectrum, and one pulse."""

import numpy as np
from jaxtyping import Float

from jblast.detect import NoiseSpectrum

RATE = 48000.0
"""Samples a second [Hz]."""


def rumble(lines: bool = False) -> NoiseSpectrum:
    """Return wind and traffic over a recorder's floor: 90 dB from end to end.

    Args:
        lines: Whether a rotor's first three harmonics, 141 Hz apart, are in it.
    """
    f = np.linspace(0.0, RATE / 2, 2049)
    density = 1 / (1 + (f / 30) ** 2) ** 1.2 + 1e-5 / (1 + (f / 500) ** 2) + 1e-9
    if lines:
        density[[12, 24, 36]] *= 100.0
    return NoiseSpectrum(f, density)


def coloured(
    rng: np.random.Generator, noise: NoiseSpectrum, size: int, rows: int = 1
) -> Float[np.ndarray, "row sample"]:
    """Draw noise around a circle of so many samples, by its spectrum alone.

    Args:
        rng: Where chance comes from.
        noise: Its spectrum.
        size: Samples of a row.
        rows: How many.
    """
    frequency = np.fft.rfftfreq(size, 1 / RATE)
    spread = np.sqrt(np.interp(frequency, *noise[:2]) * RATE / 2)
    white = np.fft.rfft(rng.standard_normal((rows, size)))
    return np.fft.irfft(white * spread, size)


def pulse(
    duration_s: float, delay: float = 0.0, rise_s: float = 2e-4
) -> Float[np.ndarray, " sample"]:
    """Return a blast of peak about 0.8 with a smooth front and a smooth end.

    Args:
        duration_s: Of all of it [s].
        delay: By so many samples it comes later, a fraction or more.
        rise_s: Of the front [s].
    """
    count = round(duration_s * RATE)
    t = (np.arange(count) - delay) / RATE
    after = np.maximum(t, 0.0)
    front = 1 - (1 + after / rise_s * 4) * np.exp(-after / rise_s * 4)
    late = after / duration_s * 6
    end = np.cos(0.5 * np.pi * np.clip((t / duration_s - 0.7) / 0.25, 0, 1)) ** 2
    return np.where(t > 0, front * (1 - late) * np.exp(-late) * end, 0.0)


def plain_normalised(
    recording: Float[np.ndarray, " sample"], template: Float[np.ndarray, " tap"]
) -> Float[np.ndarray, " output"]:
    """Return the correlation coefficient of a template at each place it fits.

    The usual detector: algorithm 6 of Parab's thesis, padded, over the energy of the
    stretch. It knows no colour.

    Args:
        recording: Samples.
        template: Samples, fewer.
    """
    size = 2 ** int(np.ceil(np.log2(recording.size)))
    product = np.fft.rfft(recording, size) * np.conj(np.fft.rfft(template, size))
    along = np.fft.irfft(product, size)[: recording.size - template.size + 1]
    sums = np.concatenate([[0.0], np.cumsum(recording**2)])
    energy = sums[template.size :] - sums[: -template.size]
    length = np.sqrt(np.maximum(energy, 1e-12 * sums[-1])) * np.linalg.norm(template)
    return along / length
