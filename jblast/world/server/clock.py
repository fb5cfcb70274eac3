"""When packets are: on the clock of the world, and for who waits for them.

Packet k covers the time from k/rate to (k + 1)/rate of the world's clock. Rates are
taken as they are written (`1/Fraction("0.1")` is ten), so no time drifts, and a sample
belongs to one packet whatever the two rates.
"""

import functools
import math
import time
from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

from jblast.errors import InputError, argument

RATES_HZ = (1.0, 1000.0)
"""Least and most packets a second."""


class PacketTimes(NamedTuple):
    """How many packets a second, exactly.

    Attributes:
        rate: Packets a second.
    """

    rate: Fraction

    def start_s(self, number: int) -> float:
        """Return when a packet begins [s]."""
        # of whole numbers Python's quotient is the float nearest to it
        return number * self.rate.denominator / self.rate.numerator

    def samples(self, number: int, rate_hz: float) -> tuple[int, int]:
        """Return the first sample that begins within a packet, and that of the next.

        Args:
            number: Of the packet.
            rate_hz: Samples a second.
        """
        part, whole = _samples_each(rate_hz, self.rate)
        return -(-number * part // whole), -(-(number + 1) * part // whole)

    def at(self, time_s: float) -> int:
        """Return the number of the first packet that begins at a time or after [-]."""
        return math.ceil(Fraction(time_s) * self.rate)


@functools.cache
def _samples_each(rate_hz: float, rate: Fraction) -> tuple[int, int]:
    """Return the samples of a packet as a fraction of whole numbers."""
    each = exact(rate_hz) / rate
    return each.numerator, each.denominator


def exact(rate_hz: float) -> Fraction:
    """Return a rate as it is written: 0.1 is a tenth, not the float nearest to it."""
    return Fraction(repr(float(rate_hz)))


def packet_times(packets_hz: float) -> PacketTimes:
    """Return the packets of a rate.

    Raises:
        InputError: It is out of range.
    """
    if not RATES_HZ[0] <= packets_hz <= RATES_HZ[1]:
        raise InputError(
            f"{argument('packets_hz')}: expected {RATES_HZ[0]:g} to {RATES_HZ[1]:g} "
            f"packets a second, got {packets_hz:g}"
        )
    return PacketTimes(exact(packets_hz))


class Lockstep(NamedTuple):
    """Time goes on for each entity as it asks for packets, as fast as that may be.

    What a packet holds depends on its number, and not on how long anything took.
    """


class ScaledRealTime:
    """Time goes on by the wall clock, the same for all, once somebody has come.

    Attributes:
        speed: Seconds of the world a second.
    """

    def __init__(self, speed: float, now: Callable[[], float] = time.monotonic):
        """Stand at 0.

        Args:
            speed: Seconds of the world a second.
            now: A clock that does not jump.
        """
        self.speed = speed
        self._now = now
        self._began: float | None = None

    def begin(self) -> None:
        """Go, unless it goes already."""
        if self._began is None:
            self._began = self._now()

    def world_s(self) -> float:
        """Return what the world's clock says [s]."""
        return 0.0 if self._began is None else (self._now() - self._began) * self.speed

    def wait_s(self, world_s: float) -> float:
        """Return how long until the world's clock says so; not below 0 [s]."""
        return max((world_s - self.world_s()) / self.speed, 0.0)


Clock = Lockstep | ScaledRealTime
