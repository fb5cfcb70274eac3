"""The matched filter: how loud a template is in a recording, at each sample.

Parab's thesis, algorithm 6, multiplies the transform of the recording with the
conjugate of the reference's and transforms back. As printed it goes around a circle, so
that a blast at the end of the recording is heard at its beginning; takes the noise as
white; and leaves the level open. Here the reference is padded, the noise is what it is
(`kernel.py`), and the output is counted in standard deviations of the noise, so that it
is the same for every gain of the microphone.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.detect.kernel import MatchedKernel, matched_kernel
from jblast.detect.overlap_save import OverlapSave
from jblast.detect.samples import checked_samples, checked_template
from jblast.detect.whitening import NoiseSpectrum, noise_spectrum as measured_spectrum
from jblast.errors import InputError, argument


class Filtered(NamedTuple):
    """What came out of a matched filter.

    Attributes:
        statistic: One for each sample of the recording: how strongly it speaks for the
            template's first sample landing there, in standard deviations of the noise.
        kernel: The filter.
        start: First sample whose statistic saw the recording alone.
        stop: Sample after the last such one. Outside of these the noise is not known
            to have variance 1, and nothing is searched for.
    """

    statistic: Float[np.ndarray, " sample"]
    kernel: MatchedKernel
    start: int
    stop: int


def matched_filter(
    recording: ArrayLike,
    template: ArrayLike,
    rate_hz: float,
    *,
    noise_spectrum: NoiseSpectrum | None = None,
) -> Filtered:
    r"""Filter a recording for a template.

    The statistic $s$ of a blast is that of a test at a known time: $s^2$ estimates
    $2E/N_0$, which in decibels is $20 \log_{10} s$.

    Args:
        recording: Samples of one channel, in any unit.
        template: Samples of what is looked for, of any scale, at the same rate.
        rate_hz: Sampling rate of both [Hz].
        noise_spectrum: Of the noise, in the recording's unit; none to measure it in the
            recording itself, after which no gain changes the statistic.

    Raises:
        InputError: Template or recording are empty, silent or not finite, or the
            template is longer than the recording.
    """
    shape = checked_template(template)
    samples = checked_samples("recording", recording)
    if samples.size < shape.size:
        raise InputError(
            f"{argument('recording')}: expected at least the {shape.size} samples of "
            f"the template, got {samples.size}"
        )
    if noise_spectrum is None:
        noise_spectrum = measured_spectrum(samples, rate_hz)
    kernel = matched_kernel(shape, rate_hz, noise_spectrum)
    if kernel.taps.size > samples.size:  # no room for all the noise that foretells
        room_s = (samples.size - shape.size) / rate_hz
        kernel = matched_kernel(shape, rate_hz, noise_spectrum, before_s=room_s)
    return filtered_by(samples, kernel)


def unsteadiness(filtered: Filtered, stretch_s: float = 0.1) -> float:
    """Return the deviation of a statistic in its loudest tenth over that of the rest.

    Near 1 for noise that is steady; thresholds hold for such. From 1.4 on gusts, birds
    or loud blasts are in the recording, and false alarms come twice as often as asked
    and more.

    Args:
        filtered: What came out of a filter.
        stretch_s: How long the stretches are that are compared [s].

    Raises:
        InputError: There are fewer than ten.
    """
    inside = filtered.statistic[filtered.start : filtered.stop]
    size = max(round(stretch_s * filtered.kernel.rate_hz), 1)
    count = inside.size // size
    if count < 10:
        raise InputError(
            f"{argument('stretch_s')}: expected ten stretches within "
            f"{inside.size / filtered.kernel.rate_hz:.3g} s, got {stretch_s:g} s"
        )
    rows = inside[: count * size].reshape(count, size)
    power = np.sort(np.mean(rows**2, axis=1))
    loud = max(count // 10, 1)
    return float(np.sqrt(power[-loud:].mean() / power[:-loud].mean()))


def filtered_by(recording: ArrayLike, kernel: MatchedKernel) -> Filtered:
    """Filter a recording with a filter made before.

    Args:
        recording: Samples of one channel, at the filter's rate and in its unit.
        kernel: The filter.

    Raises:
        InputError: The recording is shorter than the filter, or not finite.
    """
    samples = checked_samples("recording", recording, least=kernel.taps.size)
    passed = OverlapSave(kernel.taps, kernel.before)
    first = passed.push(samples - kernel.offset)
    statistic = np.concatenate([first, passed.finish()])
    return Filtered(statistic, kernel, kernel.before, samples.size - kernel.reach)
