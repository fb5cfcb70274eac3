r"""The filter that hears a template best in coloured noise, and what it hears.

Of all linear filters that see the samples from `before` the template to `after` it,
$x = a\,h + n$ with $\langle n n^T\rangle = R$, the one with the greatest ratio of
signal to noise is

$$g = \frac{R^{-1} h}{\sqrt{h^T R^{-1} h}}, \qquad
  \frac{2E}{N_0} = a^2\,h^T R^{-1} h$$

(Kay, Fundamentals of Statistical Signal Processing II, eq. 4.16): by the lemma of
Neyman and Pearson no other test finds more blasts of known form at a known time. For
noise $R = \sigma^2 I$ it is the template itself; for coloured noise the samples before
it foretell the rumble under the template, and so count although no blast is in them.

Division by a spectrum, as usual, is the same for an endless recording only, and its
filter has no end. Here $R$ is the Toeplitz matrix of the noise, and $R^{-1} h$ comes
from conjugate gradients: products by Fourier transforms, preconditioned by the
circulant of the same spectrum (Chan and Ng, SIAM Review 38 (1996) 427). So the filter
has an end, streams and recordings go through the same one, and it is the best of its
length.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.detect.overlap_save import fast_length
from jblast.detect.samples import checked_positive, checked_template
from jblast.detect.whitening import NoiseSpectrum, bin_variances
from jblast.errors import InputError, argument

RESIDUAL = 1e-8
"""Of a solution, relative: a share of 1e-16 of the signal-to-noise ratio."""
MOST_ROUNDS = 2000


class MatchedKernel(NamedTuple):
    r"""A filter whose output is the statistic, in standard deviations of the noise.

    The output at sample k is the sum of `taps[j]` times sample `k - before + j`.

    Attributes:
        taps: Scaled so that noise alone comes out with variance 1.
        before: So many taps stand before the template's first sample.
        offset: Mean of the noise, taken from the samples first.
        rate_hz: Sampling rate [Hz].
        response: Output for the template as given: $\sqrt{2E/N_0}$.
        phase_step_rad: Angle whose cosine is the correlation of two neighbouring
            outputs for noise: 2 pi times the upcrossings of zero a sample.
        timing_rad_s: $\beta$: an arrival heard at s sigmas is known to $1/(\beta s)$.
        template_samples: Length of the template.
    """

    taps: Float[np.ndarray, " tap"]
    before: int
    offset: float
    rate_hz: float
    response: float
    phase_step_rad: float
    timing_rad_s: float
    template_samples: int

    @property
    def reach(self) -> int:
        """Samples after the arrival that the statistic needs."""
        return self.taps.size - 1 - self.before


def matched_kernel(
    template: ArrayLike,
    rate_hz: float,
    noise: NoiseSpectrum,
    *,
    before_s: float | None = None,
    after_s: float = 0.0,
) -> MatchedKernel:
    """Return the best filter for a template in noise.

    Args:
        template: Its samples, in the recording's unit or any other.
        rate_hz: Sampling rate [Hz].
        noise: Its spectrum, in the recording's unit.
        before_s: So much of the noise before the template is made use of [s]; none for
            as long as the noise remembers: a quarter of a period of its finest step in
            frequency, mostly 0.02 s; twice as much gains 0.01 dB.
        after_s: And after it [s], which a stream waits for.

    Raises:
        InputError: The template is empty, silent or not finite, or the spectrum is not
            one.
    """
    shape = checked_template(template)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    white = np.ptp(noise.density) <= 1e-12 * np.max(noise.density)
    memory_s = 0.0 if white else 0.25 / float(noise.frequency_hz[1])
    before = round((memory_s if before_s is None else before_s) * rate_hz)
    after = round(after_s * rate_hz)
    if before < 0 or after < 0:
        raise InputError(
            f"{argument('before_s')}, {argument('after_s')}: expected times from 0 up "
            f"[s], got {before_s} and {after_s}"
        )
    signal = np.pad(shape / np.abs(shape).max(), (before, after))
    # long enough for the matrix, and fine enough for the lines of the spectrum
    lines = int(np.ceil(4 * rate_hz / float(noise.frequency_hz[1])))
    least = 2 * signal.size if white else max(2 * signal.size, lines)
    size = fast_length(least)
    variances = bin_variances(noise, size, rate_hz)
    if white:
        taps = signal / variances[0]
    else:
        near = bin_variances(noise, signal.size, rate_hz)
        taps = solve_toeplitz(variances, near, signal, size)
    return scaled_kernel(
        taps, signal, np.abs(shape).max(), variances, size, rate_hz
    )._replace(before=before, offset=noise.offset, template_samples=shape.size)


def solve_toeplitz(
    variances: Float[np.ndarray, " bin"],
    near: Float[np.ndarray, " near_bin"],
    right: Float[np.ndarray, " tap"],
    size: int,
) -> Float[np.ndarray, " tap"]:
    """Return the solution of R x = right by conjugate gradients.

    Args:
        variances: Eigenvalues of the circulant that R is a corner of.
        near: Of the circulant of R's own size, the preconditioner.
        right: The right-hand side.
        size: Samples of the larger circulant, at least twice those of R.

    Raises:
        RuntimeError: It does not converge.
    """
    n = right.size

    def covariance(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x, size) * variances, size)[:n]

    def precondition(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x) / near, n)

    x = np.zeros(n)
    left = right.copy()
    step = z = precondition(left)
    product = left @ z
    target = RESIDUAL**2 * product
    for _ in range(MOST_ROUNDS):
        if product <= target:
            return x
        image = covariance(step)
        length = product / (step @ image)
        x = x + length * step
        left = left - length * image
        z = precondition(left)
        product, before = left @ z, product
        step = z + product / before * step
    raise RuntimeError(
        f"the filter for {n} samples has not converged in {MOST_ROUNDS} rounds: "
        f"{np.sqrt(product / target) * RESIDUAL:.1g} left, {RESIDUAL:g} wanted"
    )


def scaled_kernel(
    taps: Float[np.ndarray, " tap"],
    signal: Float[np.ndarray, " tap"],
    scale: float,
    variances: Float[np.ndarray, " bin"],
    size: int,
    rate_hz: float,
) -> MatchedKernel:
    r"""Return a filter scaled to unit variance, with the rates of its output.

    The arrival's error is that of the maximum of signal and noise: the slope of the
    noise over the curvature of the signal, which for the best filter is the bound of
    Cramér and Rao.

    Args:
        taps: The filter, of any scale.
        signal: The template in the filter's window, of any scale.
        scale: What the signal is to be multiplied by for the template as given.
        variances: Of the noise's bins.
        size: Samples of their transform.
        rate_hz: Sampling rate [Hz].
    """
    omega = 2 * np.pi * np.fft.rfftfreq(size, 1 / rate_hz)
    twice = np.full(omega.size, 2.0 / size)
    twice[0] /= 2
    if size % 2 == 0:
        twice[-1] /= 2
    gain, shape = np.fft.rfft(taps, size), np.fft.rfft(signal, size)
    power = twice * np.abs(gain) ** 2 * variances
    cross = twice * (np.conj(gain) * shape).real
    sigma = np.sqrt(power.sum())
    away = np.sum(power * np.sin(omega / (2 * rate_hz)) ** 2)  # (1 - correlation) / 2
    slope = np.sqrt(np.sum(omega**2 * power)) / sigma
    curvature = np.sum(omega**2 * cross) / cross.sum()
    return MatchedKernel(
        taps=taps / sigma,
        before=0,
        offset=0.0,
        rate_hz=rate_hz,
        response=float(scale * (taps @ signal) / sigma),
        phase_step_rad=float(2 * np.arcsin(np.sqrt(away / power.sum()))),
        timing_rad_s=float(curvature / slope),
        template_samples=signal.size,
    )
