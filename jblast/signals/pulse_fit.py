r"""Goodness of fit of a blast pulse to an arrival, against other impulsive sounds.

A matched filter responds to any loud sound. The test here compares an arrival with a
blast pulse sample by sample. The ambient sound is noise with the spectrum of the second
before the window, be it a gust, a bird or a voice, and a causal whitening filter leaves
it independent with variance 1. In the window $w$ of $n$ samples around the arrival the
model is a pulse of the bank through a low-pass, its positive phase $h^+$, and one
reflection,

$$m(t) = a\,h_{T,b}(t - t_0) + p\,h^+_{T,b}(t - t_0) + r\,h_{T,b}(t - t_0 - \tau)$$

with seven free numbers: arrival, duration $T$, bandwidth $b$ (absorption and rise
time), size of the suction, $a$, and of the positive phase, $a + p$, and size and delay
of the reflection (ground, facade). What may be a blast is picked as a record is
(`picks`), and rejected if it cannot be. Where the pulse of the pick fits its samples it
is a further pulse of the model: that of a loud blast is far nearer than any of a bank.
With $E = |m|^2$ and $\chi^2 = |w - m|^2$:

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
  frequency $f$ and quality $Q \ge 3$. A second and a third one from the same onset
  explain more with four further numbers each. In Gaussian noise
  $\ln(L/L_\mathrm{ring}) = (E - E_\mathrm{ring})/2$. Two and three oscillations have
  two and six numbers more than the pulse, for each of which $\tfrac12 \ln n$ is added
  (Schwarz 1978). The smallest counts. Doors, drums, hammers, hail, clicks through a
  resonance and voiced sounds belong to this class.

The window begins `BEFORE_S` before the arrival and ends `AFTER_S` after the pulse of
the bank that found it: noise bursts, gusts, and peals in a roll of thunder do not rise
from a quiet background, or continue. A single N-wave of thunder or a burst balloon in
quiet surroundings has the form of a blast and is accepted.
"""

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError
from jblast.observations.records.recording import PressureRecord
from jblast.signals.detection import PulseFit
from jblast.signals.noise import (
    NoiseSpectrum,
    bin_variances,
    fast_length,
    noise_spectrum,
    whitening_taps,
)
from jblast.signals.picks.pick import LEAST_SAMPLES, FittedPulse
from jblast.signals.picks.record_picks import NO_PULSE, RecordPick, pick_records

BEFORE_S, AFTER_S = 0.05, 0.1
"""Window before the arrival and after the pulse [s]: a cycle of 20 Hz, and the next
peal, drop or syllable. A longer end counts the reverberation of blasts as misfit."""
NOISE_S = 1.0
"""Time before the window in which the noise is measured [s]: that of a gust, a bird or
a voice, which may be far above the mean of the recording."""
LEAST_NOISE_S = 0.3
"""Smallest part of it, at the beginning of a recording [s]; with less the noise is that
of the recording."""
LEAST_SHARE = 0.1
"""Smallest density of that noise, over that of the recording: 10 dB below is the quiet
after a gust, less is an encoder's silence."""
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
"""Frequencies per octave from which a fit starts: a third apart, the width of a
resonance of the lowest quality."""
QUALITIES = (3.0, 6.0, 15.0)
"""Qualities from which a fit starts, and the least. At a quality of 3 the second cycle
has a third of the first one's amplitude; one of lower quality is nearly a blast's pulse
and suction."""
STEADY = 1e4
"""Largest quality: the oscillation does not decay within a window."""
LEAD_S = 0.002
"""Time before the front at which a Gaussian low-pass of 600 Hz begins [s]: 7 sd."""
FITTED_NUMBERS = 7
"""Number of fitted parameters: template, band, arrival and two sizes of the pulse,
delay and size of the second one."""
OSCILLATIONS = 3
"""Largest number of oscillations of one onset, with five free numbers and four more for
each further one: a struck plate or drum has several modes."""
MAX_MISFIT = 1.25
"""Largest misfit of a blast. It accepts 98 of 104 simulated blasts after absorption,
reflection, reverberation, high-pass and clipping, and 8 of 585 other arrivals; 1.0
accepts 94 and 8, 0.8 accepts 87 and 6, 1.5 accepts 100 and 8 (sounds of
`calibration/everyday_sounds.py`)."""
LEAST_LOG_LIKELIHOOD_RATIO = float(np.log(100.0))
"""Smallest log likelihood ratio of a blast. Everyday impulsive sounds are assumed to be
a hundred times as frequent as blasts; the posterior odds are then even."""

PICKED_BEFORE_S, PICKED_AFTER_S, PICKED_LENGTHS = 0.25, 0.1, 3.0
"""Interval before an arrival that is picked [s], and after it [s] or in lengths of its
template: quiet enough to measure the noise, and the whole pulse if it is longer than
the template, but few of the sounds that follow."""


def has_form(fit: PulseFit) -> bool:
    """Return True if an arrival has the form of a blast, with a pick or without."""
    likely = fit.log_likelihood_ratio >= LEAST_LOG_LIKELIHOOD_RATIO
    return likely and fit.misfit <= MAX_MISFIT


class PulseTest:
    """Test of a channel's arrivals against the pulses of a bank, and their picks.

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
        self._lead = max(round(LEAD_S * rate_hz), 1)
        self._shift = max(round(SHIFT_S * rate_hz), 1)
        self._before = max(round(BEFORE_S * rate_hz), self._shift + self._lead)

    def __call__(
        self,
        samples: Float[np.ndarray, " sample"],
        time_s: float,
        nth: int,
        threshold: float = 0.0,
    ) -> tuple[PulseFit, RecordPick | None]:
        """Fit an arrival; return the test, and the pick of what may be a blast.

        Args:
            samples: Samples of the channel.
            time_s: Arrival [s].
            nth: Number of the template that found it.
            threshold: Smallest statistic of a blast [standard deviations].
        """
        rate, long = self._rate_hz, self._templates[nth].size
        begin = round(time_s * rate) - self._before
        noise = self._noise_before(samples[: max(begin, 0)])
        room = long + max(round(AFTER_S * rate), 1)
        window = _Window(samples, begin, self._before + room, noise, rate)
        near = slice(max(nth - NEIGHBOUR_TEMPLATES, 0), nth + NEIGHBOUR_TEMPLATES + 1)
        lead, length = np.zeros(self._lead), self._lead + room
        shapes = [np.append(lead, one)[:length] for one in self._templates[near]]
        lags = np.arange(-self._shift, self._shift + 1) + self._before - self._lead
        model, statistic = window.pulse(shapes, lags)
        likely = window.misfit(model) <= MAX_MISFIT and statistic > threshold
        picked = pick_near(time_s, long / rate, samples, rate) if likely else None
        if picked is not None and (own := fitted_pulse(picked)) is not None:
            at = round(picked.pick.air_arrival_s * rate) - self._lead
            shape = own.means((at - 0.5 + np.arange(length + 1)) / rate)
            # it is where it was picked, but for the parts of a sample
            places = np.arange(at - begin - 2, at - begin + 3).clip(0, self._before)
            refit, _ = window.pulse([shape], places)
            model = max(model, refit, key=lambda one: float(one @ one))
        energy, dof, misfit = float(model @ model), window.dof, window.misfit(model)
        log_ratio = min(
            0.5 * (energy - other) + max(2 * nth - 1, 0) * math.log(dof)
            for nth, other in enumerate(window.ringing(lags + self._lead))
        )
        accepted = MAX_MISFIT * energy
        # normal limit of the noncentral chi-squared, at hundreds of degrees of freedom
        z = (misfit * energy - accepted) / np.sqrt(2 * (dof + 2 * accepted))
        return PulseFit(
            picked is not None and log_ratio >= LEAST_LOG_LIKELIHOOD_RATIO,
            misfit,
            log_ratio,
            fit_p=0.5 * math.erfc(z / math.sqrt(2)),
            fit_dof=dof,
            noise_level=self._level(nth, noise),
        ), picked

    def _noise_before(self, samples: np.ndarray) -> NoiseSpectrum:
        """Return the spectrum of the sound before a window, or of the recording."""
        earlier = samples[-round(NOISE_S * self._rate_hz) :]
        if earlier.size < LEAST_NOISE_S * self._rate_hz:
            return self._noise
        try:
            noise = noise_spectrum(earlier, self._rate_hz)
        except InputError:  # digital silence
            return self._noise
        # mean of inverse densities over n windows (Reed, Mallett and Brennan 1974)
        windows = 2 * earlier.size / self._rate_hz * float(noise.frequency_hz[1])
        density = noise.density / (1.0 - 1.0 / windows)
        known = np.interp(noise.frequency_hz, *self._noise[:2])
        return noise._replace(density=np.maximum(density, LEAST_SHARE * known))

    def _level(self, nth: int, noise: NoiseSpectrum) -> float:
        """Return the rms of a noise in the band of a pulse over the channel's."""
        size = fast_length(self._templates[nth].size)
        power = np.abs(np.fft.rfft(self._templates[nth], size)) ** 2
        here, mean = (
            np.sum(power / bin_variances(one, size, self._rate_hz))
            for one in (noise, self._noise)
        )
        return float(np.sqrt(mean / here))


def pick_near(
    time_s: float,
    template_s: float,
    samples: Float[np.ndarray, " sample"],
    rate_hz: float,
    spread_s: float = 0.0,
) -> RecordPick | None:
    """Return the pick of the sound at an arrival; None for a poor one or another sound.

    Args:
        time_s: Arrival, from the first sample on [s].
        template_s: Length of its template [s].
        samples: The samples about it, in any unit.
        rate_hz: Sampling rate [Hz].
        spread_s: Range of the times by all templates [s].
    """
    last_s = time_s + max(PICKED_AFTER_S, PICKED_LENGTHS * template_s)
    whole = np.array([time_s - PICKED_BEFORE_S, last_s]) * rate_hz
    begin, end = np.clip(whole, 0, samples.size).astype(int).tolist()
    if end - begin < LEAST_SAMPLES or not np.ptp(samples[begin:end]) > 0:
        return None
    record = PressureRecord(
        name="",
        samples=samples[begin:end],
        rate_hz=rate_hz,
        start_s=begin / rate_hz,
        calibrated=False,
    )
    (picked,) = pick_records([record])
    # a short pulse can be loudest within a longer sound, at which others begin
    near = abs(picked.pick.air_arrival_s - time_s) <= max(template_s, spread_s)
    return picked if picked.quality != "poor" and near else None


def fitted_pulse(picked: RecordPick) -> FittedPulse | None:
    """Return the pulse of a pick that fits its samples; None without one."""
    others = NO_PULSE | {"reversed_polarity"}
    return None if others & set(picked.notes) else picked.pick.pulse


class _Window:
    """Whitened samples about an arrival, and models of them.

    Attributes:
        dof: Degrees of freedom of its samples within the recording.
    """

    def __init__(
        self,
        samples: np.ndarray,
        begin: int,
        length: int,
        noise: NoiseSpectrum,
        rate_hz: float,
    ):
        self._rate_hz, self._taps = rate_hz, whitening_taps(noise, rate_hz)
        memory = self._taps.size - 1
        first, last = max(begin - memory, 0), min(begin + length, samples.size)
        start = max(begin, 0)
        white = self._whitened(samples[first:last] - noise.offset)
        # zero outside: the response to the end of the recording is no sound
        self._white = np.zeros(length)
        self._white[start - begin : last - begin] = white[start - first :]
        self._size = fast_length(length + 2 * max(round(SHIFT_S * rate_hz), 1))
        self._spectrum = np.fft.rfft(self._white, self._size)
        self.dof = last - start - FITTED_NUMBERS

    def misfit(self, model: Float[np.ndarray, " sample"]) -> float:
        """Return the energy that a model leaves over that of the model."""
        left = float(np.sum((self._white - model) ** 2))
        return (left - self.dof) / float(model @ model)

    def pulse(
        self, shapes: Sequence[np.ndarray], starts: Int[np.ndarray, " start"]
    ) -> tuple[Float[np.ndarray, " sample"], float]:
        """Return the best pulse and its reflection, and the statistic of the pulse.

        Args:
            shapes: Pulses of equal length.
            starts: Possible numbers of their first sample in the window.
        """
        length = self._white.size
        rows = np.zeros((2, len(shapes), max(one.size for one in shapes)))
        for nth, one in enumerate(shapes):
            rows[0, nth, : one.size] = one / np.abs(one).max()
            end = np.argmax(one) + np.argmax(np.append(one[np.argmax(one) :], -1.0) < 0)
            rows[1, nth, :end] = rows[0, nth, :end]
        wide = fast_length(rows.shape[-1] + self._taps.size)
        f = np.fft.rfftfreq(wide, 1 / self._rate_hz)
        bands = np.array([np.exp(-0.5 * (f / band) ** 2) for band in BANDS_HZ])
        gain = np.fft.rfft(self._taps, wide) * bands
        spectra = np.fft.rfft(rows, wide)[:, :, None] * gain
        white = np.fft.irfft(spectra, wide)[..., : rows.shape[-1]]
        white = white.reshape(2, -1, rows.shape[-1])
        pulses, positive = white / np.linalg.norm(white, axis=-1, keepdims=True)
        transforms = np.fft.rfft(pulses, self._size)
        around = np.fft.irfft(self._spectrum * np.conj(transforms), self._size)
        nth, lag = np.unravel_index(
            np.argmax(around[:, starts]), (len(around), starts.size)
        )
        start = int(starts[lag])
        pulse = pulses[nth]
        later = np.arange(3, max(round(REFLECTION_S * self._rate_hz), 4))
        # autocorrelation of the pulse by its power spectrum
        likeness = np.fft.irfft(np.abs(transforms[nth]) ** 2, self._size)[later]
        one, two = around[nth, start], around[nth, start + later]
        # least squares for two pulses of unit energy at every delay, in closed form
        first = (one - likeness * two) / (1 - likeness**2)
        second = (two - likeness * one) / (1 - likeness**2)
        # a reflection has the sign of the pulse and is no stronger
        allowed = (second > 0) & (second <= first)
        gain = np.where(allowed, one * first + two * second, 0.0)
        best = int(np.argmax(gain))
        columns = [_placed(pulse, start, length), _placed(positive[nth], start, length)]
        if gain[best] > one**2:
            columns.append(_placed(pulse, start + int(later[best]), length))
        basis = np.stack(columns, axis=1)
        sizes, *_ = np.linalg.lstsq(basis, self._white, rcond=None)
        return basis @ sizes, float(one)

    def ringing(self, starts: Int[np.ndarray, " start"]) -> list[float]:
        """Return the energies explained by the best oscillation, and by more of them.

        Args:
            starts: Possible numbers of their first sample in the window.
        """
        from scipy.optimize import least_squares

        length, size = self._white.size, self._size
        low, high = FREQUENCIES_HZ
        # below half the rate, where an oscillation is still sampled
        high = min(high, 0.45 * self._rate_hz)
        many = max(round(PER_OCTAVE * np.log2(high / low)), 2)
        grid = np.array(list(product(np.geomspace(low, high, many), QUALITIES)))
        pairs = self._rings(grid, length - int(starts[0])).swapaxes(1, 2)
        # orthonormal: explained energies then add up for any phase
        rings = np.fft.rfft(np.linalg.qr(pairs)[0].swapaxes(1, 2), size)
        around = np.fft.irfft(self._spectrum * np.conj(rings), size)[..., starts]
        at = np.unravel_index(np.argmax(np.sum(around**2, axis=1)), around[:, 0].shape)
        start = int(starts[at[1]])
        rings *= np.exp(-2j * np.pi / size * start * np.arange(self._spectrum.size))

        def explained(ln_rings: np.ndarray) -> Float[np.ndarray, " sample"]:
            made = self._rings(np.exp(ln_rings).reshape(-1, 2), length - start)
            basis, _ = np.linalg.qr(np.concatenate(made).T)
            return np.append(np.zeros(start), basis @ (self._white[start:] @ basis))

        found, model, energies = np.zeros(0), np.zeros(length), []
        for nth in range(1, OSCILLATIONS + 1):
            # the next is the one that explains most of what is left
            products = np.conj(rings) @ np.fft.rfft(self._white - model, size)
            best = grid[np.argmax(np.sum(products.real**2, axis=1))]
            bounds = np.tile(np.log([[low, QUALITIES[0]], [high, STEADY]]), nth)
            found = least_squares(
                lambda ln_rings: self._white - explained(ln_rings),
                np.append(found, np.log(best)).clip(*bounds),
                bounds=bounds,
                ftol=1e-4,
            ).x
            model = explained(found)
            energies.append(float(model @ model))
        return energies

    def _rings(
        self, rings: Float[np.ndarray, "ring 2"], count: int
    ) -> Float[np.ndarray, "ring 2 tap"]:
        """Return whitened sines and cosines of given frequency [Hz] and quality."""
        t = np.arange(count) / self._rate_hz
        frequency, quality = rings.T[..., None]
        fall, turn = np.exp(-np.pi * frequency / quality * t), 2 * np.pi * frequency * t
        return self._whitened(np.stack([fall * np.sin(turn), fall * np.cos(turn)], 1))

    def _whitened(
        self, rows: Float[np.ndarray, "*row sample"]
    ) -> Float[np.ndarray, "*row sample"]:
        wide = fast_length(rows.shape[-1] + self._taps.size)
        spectrum = np.fft.rfft(rows, wide) * np.fft.rfft(self._taps, wide)
        return np.fft.irfft(spectrum, wide)[..., : rows.shape[-1]]


def _placed(pulse: np.ndarray, start: int, count: int) -> Float[np.ndarray, " sample"]:
    """Return a window of zeros with a pulse from a sample on."""
    return np.pad(pulse, (start, count))[:count]
