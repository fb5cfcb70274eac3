"""Columns of events as EVT 3.0."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt16

from jblast.errors import InputError
from jblast.sensors.camera.files.events.evt3.header import header_of
from jblast.sensors.camera.files.events.evt3.words import (
    ADDR_X,
    ADDR_Y,
    PERIOD,
    TIME_HIGH,
    TIME_LOW,
)
from jblast.sensors.camera.files.events.recorded import Columns

LONGEST_US = 24 * 3600 * 10**6
"""Without an event [us]: the time is counted up in steps of 4,096 us, as cameras do."""


@dataclass
class Encoder:
    """What the words written so far have said.

    Attributes:
        high: Steps of `TIME_HIGH`.
        low: Microseconds after that; -1 before the first.
        y: Row.
    """

    high: int = -1
    low: int = -1
    y: int = -1

    def words(self, events: Columns) -> UInt16[np.ndarray, " word"]:
        """Return the words of a block that is not empty: single events, no vectors.

        Each step of the time's upper bits is written, so that a reader who counts
        how often they began again is never wrong, however long nothing happens.
        """
        high, low = np.divmod(events["t"], PERIOD)
        y = events["y"].astype(np.int64)
        steps = np.diff(high, prepend=self.high)
        is_low = (np.diff(low, prepend=self.low) != 0) | (steps > 0)
        is_row = np.diff(y, prepend=self.y) != 0
        ends = np.cumsum(steps + is_low + is_row + 1)
        words = np.empty(ends[-1], np.uint16)
        column = events["p"].astype(np.uint16) << 11 | events["x"].astype(np.uint16)
        words[ends - 1] = ADDR_X << 12 | column
        words[(ends - 2)[is_row]] = ADDR_Y << 12 | y[is_row]
        words[(ends - 2 - is_row)[is_low]] = TIME_LOW << 12 | low[is_low]
        begin = ends - 1 - is_row - is_low - steps
        within = np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)
        counted = np.repeat(high - steps + 1, steps) + within
        words[np.repeat(begin, steps) + within] = TIME_HIGH << 12 | counted % PERIOD
        self.high, self.low, self.y = int(high[-1]), int(low[-1]), int(y[-1])
        return words


def write_evt3(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events block by block.

    Args:
        path: An empty file.
        blocks: Columns of events, none empty.
        size: Width and height.
        last_ms: Of no use here.

    Raises:
        InputError: Longer than `LONGEST_US` nothing happens.
    """
    del last_ms
    encoder, count, last = Encoder(), 0, 0
    with path.open("wb") as file:
        file.write(header_of(*size, count))
        for block in blocks:
            pause = int(np.diff(block["t"], prepend=last).max())
            last = int(block["t"][-1])
            if pause > LONGEST_US:
                raise InputError(
                    f"t: expected at most {LONGEST_US / 3.6e9:g} hours between two "
                    f"events of an EVT3 file, got {pause / 3.6e9:g}"
                )
            words = encoder.words(block)
            file.write(words.astype("<u2").tobytes())
            count += len(words)
        file.seek(0)
        file.write(header_of(*size, count))
