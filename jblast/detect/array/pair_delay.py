r"""How much later a sound comes to one microphone than to another.

The generalised cross-correlation of two records, whose cross spectrum
$G_k = X_{1k}^* X_{2k}$ is weighed by $\psi_k$,

$$C(\tau) = \sum_k \psi_k \,\mathrm{Re}\,(G_k e^{i\omega_k\tau}),$$

is greatest at the delay. With sound of power $S_k$ in both and noise of powers
$N_{1k}$, $N_{2k}$ (all of a bin of the window's transform), the weights are

$$\psi^{\rm PHAT}_k = 1/|G_k|\ \ (S_k > 0), \qquad
\psi^{\rm ML}_k = \frac{S_k}{S_k(N_{1k}+N_{2k}) + N_{1k}N_{2k}}
               = \frac{1}{S_k}\frac{\gamma_k^2}{1-\gamma_k^2},$$

the second with the coherence $\gamma^2 = S^2/((S+N_1)(S+N_2))$. The error of any
weighting is, while the right peak is found,

$$\sigma^2 = \frac{\sum \psi^2\omega^2 (S(N_1+N_2) + N_1N_2)}
                 {2\,(\sum \psi\,\omega^2 S)^2},$$

and that of the second is the Cramer-Rao bound,
$\sigma^{-2} = 2\sum \omega^2\gamma^2/(1-\gamma^2)$. Sums run over the bins above
zero and below half the rate.

What is recorded is data: NumPy, in double precision, one pair a call.

References:
    Knapp and Carter (1976), IEEE Trans. ASSP 24(4), 320-327: the weights in their table
    I; the bound with a sum over bins for their integral.
"""

from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Complex, Float

Weighting = Literal["ml", "phat"]
SIGNIFICANT = 10.0
"""A peak of fewer standard deviations of the correlation of noise alone is none."""
FINER = 8
"""Lags a sample among which the greatest is looked for, before it is refined."""


class PairDelay(NamedTuple):
    """How much later the second microphone hears it.

    Attributes:
        delay: Of the second record [s]; NaN if none is told.
        sigma: Its standard deviation [s]; infinite if none is told.
        share: Of its variance: what the first record's noise brings, what the second's
            brings, and what only their product does.
        significance: Height of the peak in standard deviations of noise alone. Below
            `SIGNIFICANT` no delay is told.
    """

    delay: float
    sigma: float
    share: tuple[float, float, float]
    significance: float


def pair_delay(
    spectra: Complex[np.ndarray, "2 bin"],
    sound: Float[np.ndarray, " bin"],
    noise: Float[np.ndarray, "2 bin"],
    rate_hz: float,
    largest_s: float,
    *,
    weighting: Weighting = "ml",
) -> PairDelay:
    """Return the delay between two records of one window.

    Args:
        spectra: Their transforms (`rfft`), of an even number of samples.
        sound: Power of the sound that both hold, in each bin.
        noise: Power of the noise in each.
        rate_hz: Samples a second.
        largest_s: Greatest delay that the place of the microphones allows [s]; the
            record has to hold the sound with as much to spare at either end.
        weighting: `ml` is the most precise; `phat` weighs all bins that hold sound
            alike, so that a tone, or an echo, weighs no more than its bandwidth.
    """
    cross = np.conj(spectra[0]) * spectra[1]
    bins = np.arange(len(cross))
    omega = 2 * np.pi * bins * rate_hz / (2 * (len(cross) - 1))
    both = sound * noise.sum(axis=0) + noise[0] * noise[1]
    if weighting == "ml":
        psi = np.divide(sound, both, out=np.zeros_like(both), where=both > 0)
        expected = psi
    else:
        size = np.abs(cross)
        holds = (size > 0) & (sound > 0)
        psi = np.divide(1.0, size, out=np.zeros_like(size), where=holds)
        power = np.sqrt((sound + noise[0]) * (sound + noise[1]))
        expected = np.divide(1.0, power, out=np.zeros_like(power), where=power > 0)
    psi[[0, -1]] = 0.0  # no phase is told there
    expected = np.where(psi > 0, expected, 0.0)
    lag = _greatest_lag(psi * cross, rate_hz, largest_s)
    spectrum = psi * cross * np.exp(1j * omega * lag)
    by_chance = np.sqrt(0.5 * np.sum(expected**2 * noise[0] * noise[1]))
    height = float(np.sum(spectrum.real))
    significance = height / by_chance if by_chance > 0 else 0.0
    curvature = np.sum(expected * omega**2 * sound)
    if not significance > SIGNIFICANT or not curvature > 0 or abs(lag) > largest_s:
        return PairDelay(np.nan, np.inf, (0.0, 0.0, 0.0), float(significance))
    parts = [
        float(np.sum(expected**2 * omega**2 * part) / 2 / curvature**2)
        for part in (sound * noise[0], sound * noise[1], noise[0] * noise[1])
    ]
    whole = sum(parts)
    first, second, product = (part / whole if whole else 0.0 for part in parts)
    sigma = float(np.sqrt(whole))
    return PairDelay(lag, sigma, (first, second, product), float(significance))


def _greatest_lag(
    weighed: Complex[np.ndarray, " bin"], rate_hz: float, largest_s: float
) -> float:
    """Return where the correlation of a weighed cross spectrum is greatest [s].

    Looked for among `FINER` lags a sample, then refined by Newton's steps on the sum of
    cosines that it is, so that its place is no matter of the samples'.
    """
    samples = 2 * (len(weighed) - 1)
    fine = np.fft.irfft(weighed, samples * FINER)
    reach = min(int(np.ceil(largest_s * rate_hz * FINER)), len(fine) // 2 - 1)
    lags = np.arange(-reach, reach + 1)
    step = 1.0 / (rate_hz * FINER)
    start = float(lags[np.argmax(fine[lags])]) * step
    omega = 2 * np.pi * np.arange(len(weighed)) * rate_hz / samples
    lag = start
    for _ in range(6):
        turned = weighed * np.exp(1j * omega * lag)
        slope = -np.sum(omega * np.imag(turned))
        bend = -np.sum(omega**2 * np.real(turned))
        if not bend < 0:
            return start
        lag = float(np.clip(lag - slope / bend, start - step, start + step))
    return lag
