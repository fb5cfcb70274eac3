r"""Goodness of fit of a blast pulse to an arrival, against other impulsive sounds.

A matched filter responds to any loud sound. The test here compares an arrival with a
blast pulse sample by sample, after a causal whitening filter that leaves the noise
independent with variance 1. In the window $w$ of $n$ samples around the arrival the
model is a pulse of the bank through a low-pass, its positive phase $h^+$, and one
reflection,

$$m(t) = a\,h_{T,b}(t - t_0) + p\,h^+_{T,b}(t - t_0) + r\,h_{T,b}(t - t_0 - \tau)$$

with seven free numbers: arrival, duration $T$, bandwidth $b$ (absorption and rise
time), size of the suction, $a$, and of the positive phase, $a + p$, and size and delay
of the reflection (ground, facade). With $E = |m|^2$ and $\chi^2 = |w - m|^2$:

- *Misfit* $(\chi^2 - \nu)/E$ with $\nu = n - 7$ degrees of freedom: energy that the
  pulse leaves unexplained, per energy that it explains. In Gaussian noise a perfect
  pulse has $\chi^2 \sim \chi^2_\nu$ and a misfit of 0. Real pulses are not exactly of
  any family, so $\chi^2$ grows with loudness; a misfit up to `MAX_MISFIT` is
  accepted, as the noncentral distribution $\chi^2_\nu(\lambda)$ with
  $\lambda =$ `MAX_MISFIT` $E$ (as Allen 2005, Phys. Rev. D 71, 062001).
  `fit_p` is the probability of a larger $\chi^2$ under it.
- *Likelihood ratio* against ringing: the best decaying oscillation
  $e^{-\pi f t / Q}\,(c \cos 2\pi f t + s \sin 2\pi f t)$ explains an energy
  $E_\mathrm{ring}$ of the same window with five free numbers: $c$, $s$, arrival,
  frequency $f$ and quality $Q \ge 3$. A second one from the same onset explains more
  with four further numbers. In Gaussian noise
  $\ln(L/L_\mathrm{ring}) = (E - E_\mathrm{ring})/2$, and for two oscillations, which
  have two numbers more than the pulse, $\ln n$ is added (Schwarz 1978). The smaller one
  counts. Doors, drums, hammers, hail, clicks through a resonance and voiced
  sounds belong to this class.

The window begins `BEFORE_S` before the arrival and ends `AFTER_S` after the pulse of
the bank that found it: noise bursts, gusts, and peals in a roll of thunder do not rise
from a quiet background, or continue. A single N-wave of thunder or a burst balloon in
quiet surroundings has the form of a blast and is accepted.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.signals.noise import NoiseSpectrum, correlated, fast_length, whitening_taps

BEFORE_S, AFTER_S = 0.05, 0.1
"""Window before the arrival and after the pulse [s]: a cycle of 20 Hz, and the next
peal, drop or syllable. A longer end counts the reverberation of blasts as misfit."""
LEVEL_S = 1.0
"""Time before the window in which the noise level is measured [s]: the level of a gust,
a bird or a voice, which may be far above the mean of the recording."""
LEAST_LEVEL_S = 0.1
"""Smallest part of it, at the beginning of a recording [s]; with less the level is the
mean of the recording."""
NEIGHBOUR_TEMPLATES = 1
"""Durations of the bank that are fitted on either side of the one that found the
arrival. With three, 2 of 104 struck plates and drums in white noise are accepted as
longer pulses, with one none."""
BANDS_HZ = (np.inf, 3000.0, 1200.0, 600.0)
"""Gaussian low-pass of the pulses, 4.3 dB down at these frequencies [Hz]: no absorption
to some kilometres of air. About an octave apart: a band between two loses under 0.1
dB."""
REFLECTION_S = 0.05
"""Longest delay of the second pulse [s]: from the ground below the microphone, walls up
to 8 m behind it, or the recompression at the end of the suction."""
SHIFT_S = 0.005
"""Largest shift of a pulse or an oscillation from the arrival, to either side [s]. A
template of a neighbouring duration and a low-pass move the arrival by less."""
FREQUENCIES_HZ = (30.0, 6000.0)
"""Lowest and highest frequency of the oscillations that compete with a pulse [Hz], a
convention: from large doors to small metal parts."""
PER_OCTAVE = 2.5
"""Oscillations per octave: a third of the frequency apart, the width of a resonance of
the lowest quality."""
QUALITIES = (3.0, 6.0, 15.0)
"""Qualities of the oscillations. At a quality of 3 the second cycle has a third of the
first one's amplitude; one of lower quality is nearly a blast's pulse and suction."""
MAX_WINDOWS = 4
"""Largest number of pulses whose models are stored, up to 20 MB each at 48 kHz."""
LEAD_S = 0.002
"""Time before the front at which a Gaussian low-pass of 600 Hz begins [s]: 7 sd."""
FITTED_NUMBERS = 7
"""Number of fitted parameters: template, band, arrival and two sizes of the pulse,
delay and size of the second one."""
MAX_MISFIT = 1.25
"""Largest misfit of a blast. It accepts 98 of 104 simulated blasts after absorption,
reflection, reverberation, high-pass and clipping, and 8 of 585 other arrivals; 1.0
accepts 94 and 8, 0.8 accepts 87 and 6, 1.5 accepts 100 and 8 (sounds of
`calibration/everyday_sounds.py`)."""
LEAST_LOG_LIKELIHOOD_RATIO = float(np.log(100.0))
"""Smallest log likelihood ratio of a blast. Everyday impulsive sounds are assumed to be
a hundred times as frequent as blasts; the posterior odds are then even."""


class PulseFit(NamedTuple):
    """Fit of an arrival by a blast pulse.

    Attributes:
        blast_form: Whether the arrival has the form of a blast pulse, and exceeds the
            threshold in the noise just before it.
        misfit: Unexplained energy over that of the pulse.
        log_likelihood_ratio: Natural logarithm of the likelihood of the pulse over that
            of the best decaying oscillation, or two.
        fit_p: Probability of a larger chi-squared for the largest accepted misfit.
        fit_dof: Degrees of freedom of chi-squared.
        noise_level: Rms noise in the pulse's band before the arrival over that of the
            whole recording.
    """

    blast_form: bool
    misfit: float
    log_likelihood_ratio: float
    fit_p: float
    fit_dof: int
    noise_level: float


class _Window(NamedTuple):
    """Models for the arrivals of one pulse of the bank.

    Attributes:
        length: Number of samples of the window.
        before: Number of samples before the arrival.
        size: Length of the Fourier transforms.
        pulses: Whitened pulses of unit energy, each from `lead` samples before its
            front.
        positive: Their positive phases.
        transforms: Transforms of the pulses.
        rings: Transforms of orthonormal pairs of whitened oscillations.
    """

    length: int
    before: int
    size: int
    pulses: Float[np.ndarray, "pulse tap"]
    positive: Float[np.ndarray, "pulse tap"]
    transforms: np.ndarray
    rings: np.ndarray


class PulseTest:
    """Test of a channel's arrivals against the pulses of a bank.

    Args:
        templates: Pulses of the bank in order of duration, at the channel's rate.
        rate_hz: Sampling rate [Hz].
        noise: Spectrum of the channel's noise.
    """

    def __init__(
        self,
        templates: Sequence[Float[np.ndarray, " tap"]],
        rate_hz: float,
        noise: NoiseSpectrum,
    ):
        self._templates, self._rate_hz, self._noise = templates, rate_hz, noise
        self._taps = whitening_taps(noise, rate_hz)
        self._lead = max(round(LEAD_S * rate_hz), 1)
        self._shift = max(round(SHIFT_S * rate_hz), 1)
        # models of a window are computed once for all arrivals of one template
        self._window = lru_cache(MAX_WINDOWS)(self._models)

    def __call__(
        self,
        samples: Float[np.ndarray, " sample"],
        time_s: float,
        nth: int,
        over: float = math.inf,
    ) -> PulseFit:
        """Fit an arrival.

        Args:
            samples: Samples of the channel.
            time_s: Arrival [s].
            nth: Number of the template that found it.
            over: Its statistic over the threshold in the noise of the whole recording.
        """
        window = self._window(nth)
        at = round(time_s * self._rate_hz)
        earlier, w = self._whitened(samples, at, window)
        spectrum = np.fft.rfft(w, window.size)
        lags = window.before + np.arange(-self._shift, self._shift + 1)
        pulse, model = self._pulse(w, spectrum, window, lags)
        level, power = 1.0, 1.0
        if earlier.size >= pulse.size + LEAST_LEVEL_S * self._rate_hz:
            power = float(np.mean(earlier**2))
            level = float(np.sqrt(np.mean(correlated(earlier, pulse) ** 2)))
        energy = float(model @ model)
        chi2 = float(np.sum((w - model) ** 2))
        one, two = self._ringing(w, spectrum, window, lags)
        begin = at - window.before
        dof = min(begin + window.length, samples.size) - max(begin, 0) - FITTED_NUMBERS
        # louder noise before the window does not excuse a misfit: it may have ended, or
        # belong to the same sound
        least = min(power, 1.0)
        accepted = MAX_MISFIT * energy
        # normal limit of the noncentral chi-squared, at hundreds of degrees of freedom
        spread = np.sqrt(2 * least * (dof * least + 2 * accepted))
        z = (chi2 - dof * least - accepted) / spread
        misfit = (chi2 - dof * least) / energy
        log_ratio = min(
            (energy - one) / (2 * max(level, 1.0) ** 2),
            (energy - two) / (2 * max(level, 1.0) ** 2) + math.log(dof),
        )
        is_pulse = misfit <= MAX_MISFIT and log_ratio >= LEAST_LOG_LIKELIHOOD_RATIO
        p = 0.5 * math.erfc(z / math.sqrt(2))
        return PulseFit(is_pulse and over > level, misfit, log_ratio, p, dof, level)

    def _whitened(
        self, samples: np.ndarray, at: int, window: _Window
    ) -> tuple[Float[np.ndarray, " earlier"], Float[np.ndarray, " sample"]]:
        """Return the whitened samples before an arrival's window, and the window.

        The first result has only samples of the recording; the window is zero outside.
        """
        begin = at - window.before
        memory = self._taps.size - 1
        start = begin - round(LEVEL_S * self._rate_hz) - memory
        stop = begin + window.length
        first, last = max(start, 0), min(stop, samples.size)
        size = fast_length(last - first + memory)
        inside = np.fft.rfft(samples[first:last] - self._noise.offset, size)
        product = np.fft.irfft(inside * np.fft.rfft(self._taps, size), size)
        # zero outside: the response to the end of the recording is no sound
        white = np.zeros(stop - start)
        white[first - start : last - start] = product[: last - first]
        return white[first - start + memory : begin - start], white[begin - start :]

    def _pulse(
        self, w: np.ndarray, spectrum: np.ndarray, window: _Window, lags: np.ndarray
    ) -> tuple[Float[np.ndarray, " tap"], Float[np.ndarray, " sample"]]:
        """Return the best pulse, and the window of it and its reflection."""
        starts = lags - self._lead
        around = np.fft.irfft(spectrum * np.conj(window.transforms), window.size)
        nth, lag = np.unravel_index(
            np.argmax(around[:, starts]), (len(around), lags.size)
        )
        start = int(starts[lag])
        pulse = window.pulses[nth]
        direct = _placed(pulse, start, w.size)
        later = np.arange(3, max(round(REFLECTION_S * self._rate_hz), 4))
        # autocorrelation of the pulse by its power spectrum
        power = np.abs(window.transforms[nth]) ** 2
        likeness = np.fft.irfft(power, window.size)[later]
        one, two = around[nth, start], around[nth, start + later]
        # least squares for two pulses of unit energy at every delay, in closed form
        first = (one - likeness * two) / (1 - likeness**2)
        second = (two - likeness * one) / (1 - likeness**2)
        # a reflection has the sign of the pulse and is no stronger
        allowed = (second > 0) & (second <= first)
        gain = np.where(allowed, one * first + two * second, 0.0)
        best = int(np.argmax(gain))
        columns = [direct, _placed(window.positive[nth], start, w.size)]
        if gain[best] > one**2:
            columns.append(_placed(pulse, start + int(later[best]), w.size))
        basis = np.stack(columns, axis=1)
        sizes, *_ = np.linalg.lstsq(basis, w, rcond=None)
        return pulse, basis @ sizes

    def _ringing(
        self, w: np.ndarray, spectrum: np.ndarray, window: _Window, lags: np.ndarray
    ) -> tuple[float, float]:
        """Return the energies explained by the best oscillation, and by two."""
        around = np.fft.irfft(spectrum * np.conj(window.rings), window.size)[..., lags]
        energies = np.sum(around**2, axis=1)
        nth, at = np.unravel_index(np.argmax(energies), energies.shape)
        turn = np.exp(2j * np.pi / window.size * lags[at] * np.arange(spectrum.size))
        first = np.fft.irfft(window.rings[nth] / turn, window.size)[:, : w.size]
        rest = np.fft.rfft(w - first.T @ (first @ w), window.size)
        products = (np.conj(window.rings) @ (rest * turn)).real
        other = window.rings[np.argmax(np.sum(products**2, axis=1))]
        second = np.fft.irfft(other / turn, window.size)[:, : w.size]
        basis = np.concatenate([first, second]).T
        sizes, *_ = np.linalg.lstsq(basis, w, rcond=None)
        return float(energies[nth, at]), float(np.sum((basis @ sizes) ** 2))

    def _models(self, nth: int) -> _Window:
        rate = self._rate_hz
        before = max(round(BEFORE_S * rate), self._shift + self._lead)
        room = self._templates[nth].size + max(round(AFTER_S * rate), 1)
        taps = room + self._lead
        size = fast_length(before + room + 2 * self._shift)
        wide = fast_length(taps + self._taps.size)
        gain = np.fft.rfft(self._taps, wide)
        f = np.fft.rfftfreq(wide, 1 / rate)
        near = self._templates[
            max(nth - NEIGHBOUR_TEMPLATES, 0) : nth + NEIGHBOUR_TEMPLATES + 1
        ]
        shapes = np.zeros((2, len(near), wide))
        for nth_near, template in enumerate(near):
            part = template[:room] / np.abs(template).max()
            positive = np.argmax(np.append(part, -1.0) < 0)
            shapes[0, nth_near, self._lead : self._lead + part.size] = part
            shapes[1, nth_near, self._lead : self._lead + positive] = part[:positive]
        bands = np.array([np.exp(-0.5 * (f / band) ** 2) for band in BANDS_HZ])
        spectra = np.fft.rfft(shapes)[:, :, None] * (gain * bands)
        rows = np.fft.irfft(spectra, wide)[..., :taps].reshape(2, -1, taps)
        pulses, positive = rows / np.linalg.norm(rows, axis=-1, keepdims=True)
        return _Window(
            length=before + room,
            before=before,
            size=size,
            pulses=pulses,
            positive=positive,
            transforms=np.fft.rfft(pulses, size),
            rings=np.fft.rfft(self._rings(room, wide, gain), size),
        )

    def _rings(
        self, room: int, wide: int, gain: np.ndarray
    ) -> Float[np.ndarray, "ring 2 tap"]:
        """Return whitened decaying oscillations, orthonormal pairs."""
        low, high = FREQUENCIES_HZ
        # below half the rate, where an oscillation is still sampled
        high = min(high, 0.45 * self._rate_hz)
        count = max(round(PER_OCTAVE * np.log2(high / low)), 2)
        t = np.arange(room) / self._rate_hz
        frequency = np.repeat(np.geomspace(low, high, count), len(QUALITIES))
        quality = np.tile(QUALITIES, count)
        decay = -np.pi * frequency / quality
        fall, turn = np.exp(decay[:, None] * t), 2 * np.pi * frequency[:, None] * t
        pairs = np.stack([fall * np.sin(turn), fall * np.cos(turn)], axis=1)
        whitened = np.fft.irfft(np.fft.rfft(pairs, wide) * gain, wide)[..., :room]
        # orthonormal: explained energies then add up for any phase
        return np.linalg.qr(whitened.swapaxes(1, 2))[0].swapaxes(1, 2)


def _placed(pulse: np.ndarray, start: int, count: int) -> Float[np.ndarray, " sample"]:
    """Return a window of zeros with a pulse from a sample on."""
    return np.pad(pulse, (start, count))[:count]
