"""A detector that listens for ever: blasts as they are heard, in constant memory.

What a stream finds is what the same filter finds in the recording of it, output for
output. A blast is told after `latency_s`, counted from the first sample of it that
arrives: the length of the template, which has to be heard; as long again, in which
something louder would show that this was its foot; and the block being filled.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.detect.kernel import MatchedKernel, matched_kernel
from jblast.detect.overlap_save import OverlapSave
from jblast.detect.peaks import Detection, PeakPicker
from jblast.detect.samples import checked_positive, checked_samples, checked_template
from jblast.detect.threshold import FALSE_ALARMS_PER_HOUR, threshold_for
from jblast.detect.whitening import NoiseSpectrum, noise_spectrum as measured_spectrum

BLOCK_S = 0.1
LEARN_S = 10.0


class Stream:
    """A detector that listens for ever; `stream` makes it.

    Attributes:
        rate_hz: Sampling rate [Hz].
        kernel: Its filter; none while it learns what the noise is.
        threshold: In standard deviations; none while it learns.
        statistic: Outputs of the filter that the last push made known.
    """

    kernel: MatchedKernel | None = None
    threshold: float | None = None

    def __init__(
        self,
        rate_hz: float,
        block: int,
        learn: int,
        begin: Callable[[NoiseSpectrum], PeakPicker],
        noise: NoiseSpectrum | None,
    ):
        """Get ready.

        Args:
            rate_hz: Sampling rate [Hz].
            block: Samples that are filtered at a time.
            learn: Samples that the noise is measured in.
            begin: Makes filter and threshold for a noise.
            noise: Spectrum of the noise, or none to measure it.
        """
        self.rate_hz, self._block, self._learn = rate_hz, block, learn
        self._make = begin
        self._waiting: list[np.ndarray] = []
        self._count = 0
        self.statistic: Float[np.ndarray, " output"] = np.zeros(0)
        if noise is not None:
            self._begin(noise)

    @property
    def latency_s(self) -> float | None:
        """From the first sample of a blast to its being told, at most [s]."""
        if self.kernel is None:
            return None
        later = self.kernel.reach + self._picker.settles + self._block
        return later / self.rate_hz

    def push(self, samples: ArrayLike) -> tuple[Detection, ...]:
        """Take in samples, however many; return the blasts that are now settled.

        Raises:
            InputError: Samples are not finite. The stream is as it was before them.
        """
        new = checked_samples("samples", samples, least=0)
        self._waiting.append(new.copy())
        self._count += new.size
        self.statistic = np.zeros(0)
        if self._count < (self._learn if self.kernel is None else self._block):
            return ()
        if self.kernel is None:
            self._begin(measured_spectrum(np.concatenate(self._waiting), self.rate_hz))
        whole = new if len(self._waiting) == 1 else np.concatenate(self._waiting)
        cut = whole.size - whole.size % self._block
        self._waiting, self._count = [whole[cut:]], whole.size - cut
        return self._heard(whole[:cut])

    def finish(self) -> tuple[Detection, ...]:
        """Return the blasts that were still unsettled: the stream is over.

        Raises:
            InputError: It ended before there was enough of it to know the noise.
        """
        rest = np.concatenate([np.zeros(0), *self._waiting])
        self._waiting, self._count = [], 0
        if self.kernel is None:
            self._begin(measured_spectrum(rest, self.rate_hz))
        return (*self._heard(rest), *self._picker.finish())

    def _begin(self, noise: NoiseSpectrum) -> None:
        self._picker = self._make(noise)
        kernel, self.threshold = self._picker.kernel, self._picker.threshold
        self._filter = OverlapSave(kernel.taps, kernel.before, self._block)
        self._picker.skip(kernel.before)
        self.kernel = kernel

    def _heard(self, samples: Float[np.ndarray, " new"]) -> tuple[Detection, ...]:
        assert self.kernel is not None
        known = self._filter.out
        self.statistic = self._filter.push(samples - self.kernel.offset)
        # outputs before the first whole one are not searched
        early = max(self.kernel.before - known, 0)
        return self._picker.push(self.statistic[early:])


def stream(
    template: ArrayLike,
    rate_hz: float,
    *,
    block_s: float = BLOCK_S,
    threshold: float | None = None,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    noise_spectrum: NoiseSpectrum | None = None,
    learn_s: float = LEARN_S,
    dead_s: float | None = None,
    wait_s: float | None = None,
) -> Stream:
    """Return a detector to which samples are pushed as they come.

    Args:
        template: Samples of what is listened for, of any scale.
        rate_hz: Sampling rate of it and of the stream [Hz].
        block_s: So much sound is filtered at a time [s].
        threshold: In standard deviations; none to set it by the next.
        false_alarms_per_hour: How many on average [1/h].
        noise_spectrum: Of the noise, in the stream's unit; none to measure it in the
            first of the stream, in which blasts are found, too, but later.
        learn_s: So much of it [s].
        dead_s: As in `detections` [s].
        wait_s: As in `detections` [s].

    Raises:
        InputError: The template is silent, empty or not finite, or a time or rate is
            not positive.
    """
    shape = checked_template(template)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    block = max(round(checked_positive("block_s", block_s, "s") * rate_hz), 1)
    learn = round(checked_positive("learn_s", learn_s, "s") * rate_hz)
    checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    if threshold is not None:
        checked_positive("threshold", threshold, "standard deviations")

    def begin(noise: NoiseSpectrum) -> PeakPicker:
        kernel = matched_kernel(shape, rate_hz, noise)
        height = threshold
        if height is None:
            height = threshold_for(kernel, false_alarms_per_hour)
        return PeakPicker(kernel, height, dead_s=dead_s, wait_s=wait_s)

    return Stream(rate_hz, block, learn, begin, noise_spectrum)
