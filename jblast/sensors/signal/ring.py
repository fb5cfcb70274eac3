"""A buffer of fixed size that is written at one end and read at the other."""

import numpy as np
from jaxtyping import Float


class Ring:
    """Samples that wait between who makes them and who takes them.

    Attributes:
        waiting: How many samples were written and not yet read.
    """

    def __init__(self, capacity: int, dtype: np.dtype | type = float):
        """Make an empty buffer for a number of samples."""
        if capacity < 1:
            raise ValueError(f"capacity must be one sample or more, got {capacity}")
        self._samples = np.zeros(capacity, dtype)
        self._first = 0
        self.waiting = 0

    @property
    def capacity(self) -> int:
        """How many samples fit in."""
        return self._samples.size

    def write(self, samples: Float[np.ndarray, " sample"]) -> None:
        """Append samples.

        Raises:
            ValueError: They do not fit; nothing is written then.
        """
        if self.waiting + samples.size > self.capacity:
            raise ValueError(
                f"expected at most {self.capacity - self.waiting} samples, which is "
                f"what fits, got {samples.size}"
            )
        at = (self._first + self.waiting + np.arange(samples.size)) % self.capacity
        self._samples[at] = samples
        self.waiting += samples.size

    def add(self, at: int, samples: Float[np.ndarray, " sample"]) -> None:
        """Add to samples that wait.

        Args:
            at: How many samples from the oldest the first one is.
            samples: What to add.

        Raises:
            ValueError: Some of them would not be among those that wait.
        """
        if at < 0 or at + samples.size > self.waiting:
            raise ValueError(
                f"expected samples within the {self.waiting} that wait, got "
                f"{samples.size} at {at}"
            )
        places = (self._first + at + np.arange(samples.size)) % self.capacity
        self._samples[places] += samples

    def read(self, count: int) -> Float[np.ndarray, " sample"]:
        """Take the oldest samples out.

        Raises:
            ValueError: There are fewer; nothing is taken then.
        """
        samples = self.peek(count)
        self._first = (self._first + count) % self.capacity
        self.waiting -= count
        return samples

    def peek(self, count: int) -> Float[np.ndarray, " sample"]:
        """Copy the oldest samples and leave them in.

        Raises:
            ValueError: There are fewer.
        """
        if not 0 <= count <= self.waiting:
            raise ValueError(
                f"expected 0 to {self.waiting} samples, which is what waits, "
                f"got {count}"
            )
        return self._samples[(self._first + np.arange(count)) % self.capacity]
