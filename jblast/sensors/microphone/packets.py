"""The thesis's packets of a loop, as a ring buffer of fixed size.

Its section 3.3.2: a packet at the head of the background's loop is sent, clipped, and
appended at the end, as long as the whole stays below three loops. A blast is added to
what waits (case 1); one that ends after the last loop first extends it, to a loop past
the blast's end (case 2).

What is appended is the background of the packet alone: recycled as printed, a blast
would sound again in every loop.
"""

import numpy as np
from jaxtyping import Float

from jblast.sensors.signal.ring import Ring

MOST_LOOPS = 3


class LoopPackets:
    """A background in a loop, sent in packets, with blasts in it."""

    def __init__(self, loop: Float[np.ndarray, " sample"]):
        """Start with one loop, waiting.

        Args:
            loop: The background.

        Raises:
            ValueError: It has no sample.
        """
        if not loop.size:
            raise ValueError("loop must have a sample or more, got none")
        self._loop = np.array(loop)
        self._ring = Ring(MOST_LOOPS * loop.size, loop.dtype)
        self._ring.write(self._loop)
        self._appended = 0  # samples of the loop that follow the last one waiting

    @property
    def waiting(self) -> int:
        """How many samples are there to be sent; never more than three loops."""
        return self._ring.waiting

    @property
    def reach(self) -> int:
        """How many samples from the head a blast may end."""
        return self._ring.capacity - self._loop.size

    def send(self, size: int) -> Float[np.ndarray, " sample"]:
        """Take a packet from the head, and append as much background if it fits.

        Args:
            size: Samples of the packet, at most a loop.

        Raises:
            ValueError: The packet is longer than the loop.
        """
        if not 0 <= size <= self._loop.size:
            raise ValueError(
                f"expected a packet of 0 to {self._loop.size} samples, a loop, "
                f"got {size}"
            )
        packet = self._ring.read(size)
        if self._ring.waiting + size < self._ring.capacity:
            self._append(size)
        return packet

    def add_blast(self, at: int, samples: Float[np.ndarray, " sample"]) -> None:
        """Add a blast to the background.

        Args:
            at: Its first sample, counted from the head.
            samples: Its sound.

        Raises:
            ValueError: It begins in the past, or ends beyond `reach`.
        """
        end = at + samples.size
        if at < 0 or end > self.reach:
            raise ValueError(
                f"expected a blast within the {self.reach} samples from the head, two "
                f"loops, got {samples.size} samples at {at}"
            )
        if end > self._ring.waiting:
            self._append(end + self._loop.size - self._ring.waiting)
        self._ring.add(at, samples)

    def _append(self, size: int) -> None:
        """Append samples of the loop, from where it was left."""
        if size <= 0:
            return
        places = (self._appended + np.arange(size)) % self._loop.size
        self._ring.write(self._loop[places])
        self._appended = (self._appended + size) % self._loop.size
