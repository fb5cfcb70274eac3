"""EVT 3.0, the raw files of Prophesee's event cameras.

A text header, line by line "% keyword value", then words of 16 bits, little-endian:
four bits are the kind of a word, twelve its value. A word changes the state of the
decoder (the time's upper and lower 12 bits, the row, the column that vectors begin at),
or gives events.

Encoder and decoder are our own: expelliarmus 1.1.12 loses the time of events where
4,096 us or more pass without one, and handles neither an empty file nor its size.

References:
    Prophesee, Metavision documentation: EVT 3.0 format; RAW file format.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from jaxtyping import Bool, Int64, UInt16

from jblast.errors import InputError, whole_number
from jblast.sensors.camera.files.recorded_events import (
    TYPES,
    Columns,
    RecordedEvents,
    recorded,
)

BLOCK = 1 << 20
"""Words that are decoded together."""
NOWHERE = -1 << 40
"""Column of vectors before any word sets it: no number of columns leads there."""
LONGEST_US = 24 * 3600 * 10**6
"""Without an event [us]: the time is counted up in steps of 4,096 us, as cameras do."""
MAX_HEADER = 1 << 16
"""Largest size of a header; real ones are far shorter [bytes]."""
ADDR_Y = 0x0
"""Row: 11 bits; the twelfth is the number of one of two cameras."""
ADDR_X = 0x2
"""An event: its column in 11 bits, and its sign in the twelfth."""
VECT_BASE_X = 0x3
"""Column and sign of the vectors that follow, in the same bits."""
VECT_12, VECT_8 = 0x4, 0x5
"""Which of the next 12 or 8 columns have an event; the next vector goes on there."""
# EVT 3.0 sends time in two halves of 12 bits, each in a word of its own.
TIME_LOW = 0x6
TIME_HIGH = 0x8
"""Lower and upper 12 bits of 24 bits of microseconds; beyond, they begin again."""
WITHOUT_EVENTS = (0x7, 0xA, 0xE, 0xF)
"""Triggers of other devices, and what vendors add."""
KNOWN = (ADDR_Y, ADDR_X, VECT_BASE_X, VECT_12, VECT_8, TIME_LOW, TIME_HIGH)
MAX_SIDE = 1 << 11
"""Largest number of columns or rows [px]."""
PERIOD = 1 << 12
"""Microseconds of one step of `TIME_HIGH`, and steps until it begins again."""


class DecoderState(NamedTuple):
    """State set by the words so far; -1 where none has set it.

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
        state: As set by the words so far.
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
        if octets % 2 or (header.words is not None and octets != 2 * header.words):
            amount = (
                "whole words" if header.words is None else f"{2 * header.words:,} bytes"
            )
            raise InputError(
                f"{path}: expected a whole EVT 3.0 file, {amount} after its header, "
                f"got {octets:,} bytes"
            )
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


@dataclass
class Encoder:
    """State set by the words written so far.

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
        last_ms: Not used by this format.

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


class Header(NamedTuple):
    """Content of a header.

    Attributes:
        size: Width and height; None if they are not stated.
        words: How many words follow; None if it is not stated.
    """

    size: tuple[int, int] | None
    words: int | None


def header_of(width: int, height: int, words: int) -> bytes:
    """Return the header of our files, always of one length for an image.

    Prophesee's software finds by it which of its plug-ins reads the file.
    """
    lines = (
        "evt 3.0",
        f"format EVT3;height={height};width={width}",
        f"geometry {width}x{height}",
        "integrator_name jblast",
        "plugin_integrator_name Prophesee",
        "plugin_name hal_plugin_prophesee",
        f"words {words:020d}",
        "end",
    )
    return "".join(f"% {line}\n" for line in lines).encode()


def read_header(path: Path, file: BinaryIO) -> Header:
    """Read a header; the file then stands at its first word.

    Raises:
        InputError: There is none, or it is of another encoding.
    """
    said: dict[str, str] = {}
    start = file.tell()
    while file.tell() < MAX_HEADER:
        line = file.readline(MAX_HEADER)
        if not line.startswith(b"% "):
            break  # "end" may be left out
        start = file.tell()
        key, _, value = line[2:].decode("ascii", "replace").strip().partition(" ")
        if key == "end":
            break
        said[key] = value
    file.seek(start)
    encoding, _, options = said.get("format", "").partition(";")
    encoding = encoding or {"3.0": "EVT3"}.get(said.get("evt", ""), said.get("evt", ""))
    if encoding != "EVT3":
        got = f"one of {encoding}" if encoding else "none"
        raise InputError(f"{path}: expected the header of an EVT 3.0 file, got {got}")
    if said.get("endianness", "little") != "little":
        raise InputError(f"{path}: expected little-endian words, got big-endian ones")
    width, _, height = said.get("geometry", "").partition("x")
    fields = {"width": width, "height": height}
    for option in options.split(";"):
        key, _, value = option.partition("=")
        fields[key] = value
    across, down = whole_number(fields["width"]), whole_number(fields["height"])
    size = None if across is None or down is None else (across, down)
    return Header(size, whole_number(said.get("words", "")))
