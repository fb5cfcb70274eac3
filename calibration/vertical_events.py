"""Algorithm 5 of Parab's thesis: a jump in the count of vertical events is a blast.

It is the reference with which `watch` is compared. The algorithm calls
"count_vertical_events" without a definition; by the text a blast throws smoke and
debris up. Two readings are implemented:

- "edges": an event is vertical if the image changes more along y than along x there.
  Motion up or down past a pixel makes such events, motion aside does not.
- "rows": events are counted by row in a histogram of 24 bins, and the fullest bin is
  the count. The program of the thesis does this, but it indexes the bins by the raw
  row, out of range from row 24 on.

References:
    Parab (2024), algorithm 5 and section 5.1.1.
"""

from collections.abc import Iterable
from typing import Literal

import numpy as np
from jaxtyping import UInt8

Reading = Literal["edges", "rows"]
STEP = 15
"""Change of the grey value that makes an event: 6 % of 255, above the noise of common
cameras."""
BINS = 24
"""Number of bins of the histogram of rows, as in the thesis."""
Grey = UInt8[np.ndarray, "height width"]


def vertical_events(before: Grey, after: Grey, reading: Reading = "edges") -> int:
    """Return the number of vertical events between two frames.

    Args:
        before: Grey values of 8 bits.
        after: The same a frame later.
        reading: Definition of a vertical event.
    """
    # differences of unsigned bytes would wrap around
    light = after.astype(np.int16)
    events = np.abs(light - before) > STEP
    if reading == "rows":
        rows = events.sum(axis=1)
        first = np.arange(BINS) * len(rows) // BINS
        return int(np.add.reduceat(rows, np.unique(first)).max())
    down, across = np.zeros_like(light), np.zeros_like(light)
    down[1:-1] = np.abs(light[2:] - light[:-2])
    across[:, 1:-1] = np.abs(light[:, 2:] - light[:, :-2])
    return int((events & (down > across)).sum())


class VerticalEvents:
    """The algorithm as a stream of frames.

    Attributes:
        threshold: Increase of the count from one pair of frames to the next that is a
            blast.
        reading: Definition of a vertical event.
    """

    def __init__(self, threshold: float | int, reading: Reading = "edges"):
        """Create the stream; the count before the first frame is 0."""
        self.threshold = threshold
        self.reading: Reading = reading
        self._before: np.ndarray | None = None
        self._count = 0

    def increase(self, frame: Grey) -> int:
        """Process a frame; return the increase of the count of events."""
        before, self._before = self._before, frame
        if before is None:
            return 0
        count, last = vertical_events(before, frame, self.reading), self._count
        self._count = count
        return count - last

    def blast(self, frames: Iterable[Grey]) -> int | None:
        """Return the number of the first frame with a blast; None without one."""
        for number, frame in enumerate(frames):
            if self.increase(frame) > self.threshold:
                return number
        return None
