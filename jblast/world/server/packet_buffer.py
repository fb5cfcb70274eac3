"""What waits between the clock of a world and one who takes packets."""

from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")

CAPACITY = 256
"""Packets that wait for one entity, at most: 2.56 s at 100 Hz."""


class BufferFull(Exception):
    """There is no room for another packet: who takes them is too slow."""


class PacketBuffer(Generic[T]):
    """A ring of fixed size; when it is full nothing is lost, the writer is told.

    Nothing is overwritten: one who misses a packet would not know. So `write` raises,
    and what is done with who is too slow is the caller's to decide.
    """

    def __init__(self, capacity: int = CAPACITY):
        """Make an empty ring.

        Raises:
            ValueError: It would hold nothing.
        """
        if capacity < 1:
            raise ValueError(f"capacity must be one packet or more, got {capacity}")
        self._places: list[T | None] = [None] * capacity
        self._first = 0
        self.waiting = 0

    @property
    def capacity(self) -> int:
        """How many packets fit in."""
        return len(self._places)

    def write(self, packet: T) -> None:
        """Append a packet.

        Raises:
            BufferFull: There is no room; nothing changes.
        """
        if self.waiting == self.capacity:
            raise BufferFull
        self._places[(self._first + self.waiting) % self.capacity] = packet
        self.waiting += 1

    def read(self) -> Iterator[T]:
        """Take what waits, the oldest first."""
        while self.waiting:
            packet = self._places[self._first]
            self._places[self._first] = None  # let go of
            self._first = (self._first + 1) % self.capacity
            self.waiting -= 1
            assert packet is not None
            yield packet
