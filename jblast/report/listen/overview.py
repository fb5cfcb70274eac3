"""What is kept of samples that go by, to draw them: in constant memory.

Samples come in pieces, of any size, and are seen once: the same pictures result
whether a record came whole or in packets.
"""

import math

import numpy as np
from jaxtyping import Float

COLUMNS = 1600
"""That a waveform is drawn from, about one a pixel."""
INSTANTS = 400
"""That a spectrogram has at most."""
WINDOW_S = 0.04
"""Of one spectrum, about: a blast's low tones and its front are both seen."""
OVERLAPS = (2, 16)
"""Windows that a sample lies in: of a long record, and at most."""
PIECE = 2**16
"""Samples that are looked at in one go."""


class Envelope:
    """Smallest and largest sample of every column of a stretch of a record.

    Attributes:
        low: Smallest sample of each column; NaN where none has come.
        high: Largest one.
    """

    def __init__(self, start: int, stop: int, rate_hz: float, columns: int = COLUMNS):
        self.start, self.stop, self.rate_hz = start, stop, rate_hz
        columns = max(1, min(columns, stop - start))
        self.edges = start + (stop - start) * np.arange(columns + 1) // columns
        self.low = np.full(columns, np.nan)
        self.high = np.full(columns, np.nan)

    def push(self, samples: Float[np.ndarray, " n"], at: int) -> None:
        """Take in samples, of which the first is number `at` of the record."""
        begin, end = max(at, self.start), min(at + samples.size, self.stop)
        if end <= begin:
            return
        inside = samples[begin - at : end - at]
        first = int(np.searchsorted(self.edges, begin, side="right")) - 1
        last = int(np.searchsorted(self.edges, end, side="left"))
        cuts = np.maximum(self.edges[first:last], begin) - begin
        low, high = self.low[first:last], self.high[first:last]
        np.fmin(low, np.minimum.reduceat(inside, cuts), out=low)
        np.fmax(high, np.maximum.reduceat(inside, cuts), out=high)

    @property
    def time_s(self) -> Float[np.ndarray, " column"]:
        """Middle of each column [s]."""
        return (self.edges[:-1] + self.edges[1:] - 1) / (2.0 * self.rate_hz)


class Spectrogram:
    """Power density of a record against time, by Hann windows that overlap.

    Attributes:
        frequency_hz: Of each row, without 0.
        time_s: Edges of the columns.
    """

    def __init__(self, samples: int, rate_hz: float):
        self.rate_hz, self.samples = rate_hz, samples
        size = 2 ** round(math.log2(max(WINDOW_S * rate_hz, 16.0)))
        while size > max(samples, 16):
            size //= 2
        least, most = (size // overlap for overlap in reversed(OVERLAPS))
        self.size, self.step = size, max(1, least, min(most, samples // INSTANTS))
        self.window = np.hanning(size + 1)[:-1]
        frames = max(1, (samples - size) // self.step + 1)
        self.frames, columns = frames, min(frames, INSTANTS)
        self.power = np.zeros((columns, size // 2))
        self.count = np.zeros(columns)
        self.frequency_hz = np.arange(1, size // 2 + 1) * rate_hz / size
        first = np.arange(columns + 1) * frames / columns * self.step
        self.time_s = (first + self.size / 2 - self.step / 2) / rate_hz
        self._left = np.zeros(0)
        self._done = 0

    def push(self, samples: Float[np.ndarray, " n"]) -> None:
        """Take in the next samples."""
        for start in range(0, samples.size, PIECE):
            self._take(samples[start : start + PIECE])

    def _take(self, samples: Float[np.ndarray, " n"]) -> None:
        waiting = np.concatenate([self._left, samples])
        frames = max(0, (waiting.size - self.size) // self.step + 1)
        frames = min(frames, self.frames - self._done)
        if frames > 0:
            windows = np.lib.stride_tricks.sliding_window_view(waiting, self.size)
            spectra = np.fft.rfft(windows[:: self.step][:frames] * self.window)[:, 1:]
            # one-sided; the last row, Nyquist's, has no twin
            power = 2.0 * np.abs(spectra) ** 2
            power[:, -1] /= 2.0
            columns = (self._done + np.arange(frames)) * len(self.count) // self.frames
            np.add.at(self.power, columns, power)
            np.add.at(self.count, columns, 1.0)
            self._done += frames
        self._left = waiting[frames * self.step :]

    def density(self) -> Float[np.ndarray, "instant frequency"]:
        """Return mean power by frequency [unit^2/Hz]; NaN where nothing came."""
        scale = self.rate_hz * np.sum(self.window**2)
        with np.errstate(invalid="ignore"):
            return self.power / (scale * self.count[:, None])
