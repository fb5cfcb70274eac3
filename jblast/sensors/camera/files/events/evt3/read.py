"""EVT 3.0 as columns of events."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int64, UInt16

from jblast.errors import InputError
from jblast.sensors.camera.files.events.evt3.header import read_header
from jblast.sensors.camera.files.events.evt3.words import (
    ADDR_X,
    ADDR_Y,
    KNOWN,
    PERIOD,
    TIME_HIGH,
    TIME_LOW,
    VECT_8,
    VECT_12,
    VECT_BASE_X,
    WITHOUT_EVENTS,
)
from jblast.sensors.camera.files.events.recorded import (
    TYPES,
    Columns,
    RecordedEvents,
    recorded,
)

BLOCK = 1 << 20
"""Words that are decoded together."""

NOWHERE = -1 << 40
"""Where vectors begin if no word has said it: no number of columns leads there."""


class DecoderState(NamedTuple):
    """What the words so far have said; -1 where none has.

    Attributes:
        high: Steps of 4,096 us, counted on where 12 bits began again.
        low: Microseconds after that.
        y: Row.
        base: Column and sign of the next vector, as in its word.
    """

    high: int = -1
    low: int = 0
    y: int = -1
    base: int = -1


class Decoder:
    """Decodes words, block by block.

    Attributes:
        state: What the words so far have said.
    """

    def __init__(self):
        self.state = DecoderState()

    def columns(self, words: UInt16[np.ndarray, " word"]) -> Columns:
        """Return the events of a block of words.

        What comes before the first time and row is left out, as by the maker's own
        reader: when or where it happened is not known.
        """
        kind, value = words >> 12, (words & 0xFFF).astype(np.int64)
        high, low = self._times(kind, value)
        y = _last(kind == ADDR_Y, value & 0x7FF, self.state.y)
        base = self._bases(kind, value)
        self.state = DecoderState(*(int(v[-1]) for v in (high, low, y, base)))
        # where a word's events begin, and which of the next columns have one
        mask = np.zeros(len(words), np.int64)
        mask[kind == ADDR_X] = 1
        for vector, bits in ((VECT_12, 0xFFF), (VECT_8, 0xFF)):
            mask[kind == vector] = value[kind == vector] & bits
        before = np.where(kind == ADDR_X, value, base - _lengths(kind))
        mask[(high < 0) | (y < 0) | (before < 0)] = 0
        at = np.flatnonzero(mask)
        bits = (mask[at, None] >> np.arange(12)) & 1
        row, column = np.nonzero(bits)
        word = at[row]
        return {
            "x": (before[word] & 0x7FF) + column,
            "y": y[word],
            "t": high[word] * PERIOD + low[word],
            "p": before[word] >> 11,
        }

    def _times(self, kind, value) -> tuple[Int64[np.ndarray, " word"], ...]:
        """Return upper and lower bits of the time at each word."""
        at = np.flatnonzero(kind == TIME_HIGH)
        before = self.state.high
        steps = np.diff(value[at], prepend=max(before, 0) % PERIOD)
        # they began again where they fall by more than half of their range
        wraps = np.cumsum(steps < -PERIOD // 2) + max(before, 0) // PERIOD
        counted = value[at] + PERIOD * wraps
        high = _last_at(at, counted, before, len(kind))
        is_low = kind == TIME_LOW
        # a new step begins at 0; the same one, sent again, changes nothing
        anew = np.diff(high, prepend=before) != 0
        low = _last(is_low | anew, np.where(is_low, value, 0), self.state.low)
        return high, low

    def _bases(self, kind, value) -> Int64[np.ndarray, " word"]:
        """Return column and sign where the next vector begins, after each word."""
        lengths = np.cumsum(_lengths(kind))
        at = np.flatnonzero(kind == VECT_BASE_X)
        before = self.state.base if self.state.base >= 0 else NOWHERE
        start = _last_at(at, value[at] - lengths[at], before, len(kind))
        return np.where(start == NOWHERE, -1, start + lengths)


def _lengths(kind: UInt16[np.ndarray, " word"]) -> Int64[np.ndarray, " word"]:
    """Return how many columns each word goes on by."""
    return np.where(kind == VECT_12, 12, np.where(kind == VECT_8, 8, 0))


def _last(
    where: Bool[np.ndarray, " word"], value: Int64[np.ndarray, " word"], before: int
) -> Int64[np.ndarray, " word"]:
    """Return the value of the last word of a kind, up to each word."""
    at = np.flatnonzero(where)
    return _last_at(at, value[at], before, len(value))


def _last_at(at, values, before: int, count: int) -> Int64[np.ndarray, " word"]:
    """Return the last of values that stand at some words, up to each word."""
    found = np.append(np.int64(before), values)
    return np.repeat(found, np.diff(at, prepend=0, append=count))


def read_evt3(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read such a file.

    Raises:
        InputError: It has no header of EVT 3.0, breaks off, or holds words that are
            none.
    """
    with path.open("rb") as file:
        header = read_header(path, file)
        octets = os.fstat(file.fileno()).st_size - file.tell()
        _check_length(path, octets, header.words)
        decoder = Decoder()
        parts = [
            {name: part[name].astype(kind) for name, kind in TYPES.items()}
            for part in map(decoder.columns, _blocks(path, file))
        ]
    columns = {
        name: np.concatenate([np.zeros(0, kind), *(part[name] for part in parts)])
        for name, kind in TYPES.items()
    }
    return recorded(path, columns, header.size or size)


def _blocks(path: Path, file) -> Iterator[UInt16[np.ndarray, " word"]]:
    """Return words, block by block."""
    while data := file.read(2 * BLOCK):
        words = np.frombuffer(data, "<u2").astype(np.uint16)
        kinds = np.bincount(words >> 12, minlength=16)
        kinds[[*KNOWN, *WITHOUT_EVENTS]] = 0
        if kinds.any():
            raise InputError(
                f"{path}: expected words of EVT 3.0, got some of the unknown type "
                f"0x{int(np.argmax(kinds)):x}"
            )
        yield words


def _check_length(path: Path, octets: int, words: int | None) -> None:
    if octets % 2 or (words is not None and octets != 2 * words):
        amount = "whole words" if words is None else f"{2 * words:,} bytes"
        raise InputError(
            f"{path}: expected a whole EVT 3.0 file, {amount} after its header, got "
            f"{octets:,} bytes"
        )
