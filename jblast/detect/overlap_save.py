"""A filter over an endless sound, block by block: overlap-save.

A Fourier transform multiplies around a circle; the outputs whose samples lie inside the
block are the same as on a line, and those alone are kept (Oppenheim and Schafer,
Discrete-Time Signal Processing, section 8.7.3). Each block takes the last samples of
the one before along. Recordings go the same way as streams, so both come out the same.
"""

import numpy as np
from jaxtyping import Float


def fast_length(least: int) -> int:
    """Return a length from `least` up whose Fourier transform is quick.

    A power of two times one of `ODD`: mostly at most a tenth longer than asked.
    """
    return min(n << max(-(-least // n) - 1, 0).bit_length() for n in ODD)


ODD = (1, 3, 5, 9, 15, 25, 27, 45, 75, 81, 125, 135)


class OverlapSave:
    """Correlates samples with a row of taps as they come.

    Output k is the sum of `taps[j]` times sample `k - before + j`; samples outside the
    sound count as 0.

    Attributes:
        out: Outputs handed back so far.
    """

    def __init__(
        self, taps: Float[np.ndarray, " tap"], before: int, block: int | None = None
    ):
        """Get ready.

        Args:
            taps: The filter.
            before: So many of its taps stand before the sample that an output is for.
            block: Outputs of one transform; none for a number that is cheap.
        """
        if block is None:
            block = max(3 * taps.size, 2**15)
        self._overlap = taps.size - 1
        self._size = fast_length(self._overlap + block)
        self._block = self._size - self._overlap
        self._gain = np.conj(np.fft.rfft(taps, self._size)) / self._size
        self._held = np.zeros(before)
        self._reach = taps.size - 1 - before
        self.out = 0

    def push(self, samples: Float[np.ndarray, " new"]) -> Float[np.ndarray, " output"]:
        """Take in samples; return the outputs that are now known, in order."""
        held = np.concatenate([self._held, samples])
        ready = max(held.size - self._overlap, 0)
        parts = []
        for start in range(0, ready, self._block):
            stop = min(start + self._block, ready)
            spectrum = np.fft.rfft(held[start : stop + self._overlap], self._size)
            spectrum *= self._gain
            around = np.fft.irfft(spectrum, self._size, norm="forward")
            parts.append(around[: stop - start])
        self._held = held[ready:].copy()
        self.out += ready
        return parts[0] if len(parts) == 1 else np.concatenate([np.zeros(0), *parts])

    def finish(self) -> Float[np.ndarray, " output"]:
        """Return the last outputs: with them there are as many as samples came."""
        return self.push(np.zeros(self._reach))
