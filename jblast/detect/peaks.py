r"""Blasts in a filter's output: one peak each, to a fraction of a sample.

A maximum over the threshold is a blast if none higher stands within `dead` samples
before it or `wait` samples after it. The filter answers a blast from `reach` samples
before the arrival to its own length after it, so these are what is kept clear.

Between samples the output is that of its band, $y(t) = \sum_k y_k\,\mathrm{sinc}(t-k)$,
windowed to sixteen samples either side; its maximum is the arrival. The error of it is
the bound of Cramér and Rao,

$$\sigma_t = \frac{1}{\beta \sqrt{2E/N_0}}$$

with the rms bandwidth $\beta$ of the template in this noise (Kay, Fundamentals of
Statistical Signal Processing I, eq. 3.14), for blasts that look like the template.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.detect.kernel import MatchedKernel
from jblast.detect.matched_filter import Filtered
from jblast.detect.samples import checked_positive
from jblast.detect.threshold import in_decibels
from jblast.errors import InputError, argument

HALF_WIDTH = 16
"""Samples either side that a value between samples is made of."""
FINE = 32
"""Parts of a sample in which the maximum is looked for before a parabola is laid."""


class Detection(NamedTuple):
    """One blast that was heard.

    Attributes:
        time_s: When the template's first sample lands, from the first sample on [s].
        sigma_s: Standard deviation of that time [s].
        snr_db: 2E/N0 as estimated [dB].
        statistic: The same, in standard deviations of the noise.
    """

    time_s: float
    sigma_s: float
    snr_db: float
    statistic: float


def detections(
    filtered: Filtered,
    threshold: float,
    *,
    dead_s: float | None = None,
    wait_s: float | None = None,
) -> tuple[Detection, ...]:
    """Return the blasts in a filter's output, in order of time.

    Args:
        filtered: The output.
        threshold: In standard deviations, positive.
        dead_s: A blast silences lower peaks so long after it [s]; none for the length
            of the filter.
        wait_s: And so long before it [s]; none for the length of the template.
    """
    picker = PeakPicker(filtered.kernel, threshold, dead_s=dead_s, wait_s=wait_s)
    inside = filtered.statistic[filtered.start : filtered.stop]
    picker.skip(filtered.start)
    return (*picker.push(inside), *picker.finish())


class PeakPicker:
    """Picks blasts from a filter's output as it comes, in constant memory.

    Attributes:
        settles: Outputs after a peak that have to be known before it counts.
        threshold: In standard deviations.
        kernel: The filter.
    """

    def __init__(
        self,
        kernel: MatchedKernel,
        threshold: float,
        *,
        dead_s: float | None = None,
        wait_s: float | None = None,
    ):
        """Get ready; arguments as in `detections`."""
        self.threshold = checked_positive("threshold", threshold, "standard deviations")
        rate = kernel.rate_hz
        self.kernel = kernel
        for name, time in (("dead_s", dead_s), ("wait_s", wait_s)):
            if time is not None and not 0 <= time < np.inf:
                raise InputError(
                    f"{argument(name)}: expected a time from 0 up [s], got {time}"
                )
        self._dead = kernel.taps.size if dead_s is None else round(dead_s * rate)
        self._wait = kernel.reach if wait_s is None else round(wait_s * rate)
        self.settles = max(self._wait, HALF_WIDTH)
        self._back = max(self._dead, HALF_WIDTH) + 1
        self._held = np.zeros(0)
        self._first = 0  # where the held outputs begin
        self._judged = 0  # peaks before this one have been settled

    def skip(self, outputs: int) -> None:
        """Pass over outputs that are not to be searched, before any other."""
        self._first += outputs
        self._judged = self._first

    def push(self, outputs: Float[np.ndarray, " new"]) -> tuple[Detection, ...]:
        """Take in outputs; return the blasts that are now settled."""
        held = np.concatenate([self._held, outputs])
        until = self._first + held.size - self.settles
        found = self._settled(held, until)
        keep = max(until - self._back - self._first, 0)
        self._held, self._first = held[keep:].copy(), self._first + keep
        return found

    def finish(self) -> tuple[Detection, ...]:
        """Return the blasts that the end left unsettled."""
        return self._settled(self._held, self._first + self._held.size)

    def _settled(self, held: np.ndarray, until: int) -> tuple[Detection, ...]:
        """Return blasts whose peak lies from the last one judged to before `until`."""
        judged, self._judged = self._judged, max(until, self._judged)
        over = held > self.threshold
        if not over.any():
            return ()
        inner = held[1:-1]
        rising = (inner > held[:-2]) & (inner >= held[2:]) & over[1:-1]
        peaks = 1 + np.flatnonzero(rising)
        heights = np.append(held[peaks], -np.inf)
        lo = np.searchsorted(peaks, peaks - self._dead)
        hi = np.searchsorted(peaks, peaks + self._wait, side="right")
        bounds = np.stack([lo, hi], axis=1).ravel()
        highest = np.maximum.reduceat(heights, bounds)[::2] if peaks.size else heights
        # of equals the first; none higher, and none as high before
        stands = heights[:-1] >= highest[: peaks.size]
        mine = (peaks + self._first >= judged) & (peaks + self._first < until)
        return tuple(self._detection(held, int(peak)) for peak in peaks[stands & mine])

    def _detection(self, held: np.ndarray, peak: int) -> Detection:
        around = np.arange(peak - HALF_WIDTH, peak + HALF_WIDTH + 1)
        known = (around >= 0) & (around < held.size)
        near = np.where(known, held[np.clip(around, 0, held.size - 1)], 0.0)
        shift, height = between_samples(near)
        kernel = self.kernel
        return Detection(
            time_s=float((self._first + peak + shift) / kernel.rate_hz),
            sigma_s=float(1 / (kernel.timing_rad_s * height)),
            snr_db=in_decibels(height),
            statistic=height,
        )


def between_samples(near: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return where a maximum lies from the middle sample on [samples], and its height.

    Args:
        near: The samples around the highest, `HALF_WIDTH` either side of it.
    """
    fine = _INTERPOLATION @ near
    top = int(np.clip(np.argmax(fine), 1, fine.size - 2))
    low, mid, high = fine[top - 1 : top + 2]
    bend = 2 * mid - low - high
    part = 0.5 * (high - low) / bend if bend > 0 else 0.0
    height = mid + 0.25 * (high - low) * part
    return float(_OFFSETS[top] + part / FINE), float(height)


_OFFSETS = np.arange(-FINE, FINE + 1) / FINE
_AWAY = _OFFSETS[:, None] - np.arange(-HALF_WIDTH, HALF_WIDTH + 1)
_WINDOWED = np.sinc(_AWAY) * np.cos(0.5 * np.pi * _AWAY / (HALF_WIDTH + 1)).clip(0) ** 3
_INTERPOLATION = _WINDOWED / _WINDOWED.sum(axis=1, keepdims=True)
"""From samples to parts of a sample. A window less smooth than the cube of a cosine has
ripples that move the flat maximum of a slow pulse by a tenth of a sample."""
