"""Sound of a bang at several microphones, made without anything of jblast."""

import numpy as np

RATE = 48_000.0
WINDOW = 4096


def pulse_spectrum(delay, length=WINDOW, rate=RATE):
    """Spectrum of a smooth pulse of some 2 ms that begins at 30 ms, later by a delay.

    A difference of two Gaussians, shifted by phase, so that no sample is special.
    """
    f = np.fft.rfftfreq(length, 1 / rate)
    width = 1.5e-4
    shape = (2j * np.pi * f * width) * np.exp(-0.5 * (2 * np.pi * f * width) ** 2)
    return shape * np.exp(-2j * np.pi * f * (0.03 + delay)) * rate * width


def heard(rng, delays, *, noise, gain=None, length=WINDOW):
    """Records of a pulse that comes to each microphone with a delay, in white noise."""
    gain = np.ones(len(delays)) if gain is None else np.asarray(gain)
    spectra = [pulse_spectrum(delay, length) for delay in delays]
    clean = gain[:, None] * np.fft.irfft(np.array(spectra), length)
    noise = np.broadcast_to(noise, (len(delays),))
    return clean + noise[:, None] * rng.standard_normal(clean.shape)


def variance(noise, count, length=WINDOW):
    """Of white noise of an rms, in each bin of a unitary transform."""
    rms = np.broadcast_to(noise, (count,))
    return np.repeat((rms**2)[:, None], length // 2 + 1, axis=1)


def bound(noise, length=WINDOW, rate=RATE):
    """Cramer-Rao bound of a delay between two such records, the pulse unknown [s].

    1/var = sum over all bins, of both signs, of w^2 |S|^2 / (N1 + N2).
    """
    f = np.fft.rfftfreq(length, 1 / rate)
    power = np.abs(pulse_spectrum(0.0, length)) ** 2
    return (2 * np.sum((2 * np.pi * f) ** 2 * power / (2 * noise**2 * length))) ** -0.5
