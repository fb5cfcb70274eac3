"""EVT 3.0, EVT 2.0 and DAT, the raw files of Prophesee's event cameras.

A text header with lines "% keyword value" is followed by little-endian words, of which
the upper four bits are the kind. Those of EVT 3.0 have 16 bits: a word changes the
state of the decoder (the time's upper and lower 12 bits, the row, the column at which
vectors begin), or contains events. Those of EVT 2.0 have 32 bits: an event with the
lower 6 bits of its time, or the upper 28 bits of the time.

A DAT file has, after its header, the type and the size of an event, and 8 bytes per
event: microseconds, then 14 bits of the column, 14 of the row, and the sign.

Files of EVT 2.0 and DAT are only read.

Encoder and decoder are our own: expelliarmus 1.1.12 loses the time of events after
4,096 us or more without one, and handles neither an empty file nor its size.

References:
    Prophesee, Metavision documentation: EVT 3.0 format; EVT 2.0 format; RAW file
    format; DAT file format.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from jaxtyping import Bool, Int64, UInt16, UInt32

from jblast.errors import InputError, shown, whole_number
from jblast.sensors.camera.files.recorded_events import (
    TYPES,
    Columns,
    RecordedEvents,
    recorded,
)

BLOCK = 1 << 18
"""Words that are decoded together: some 100 MB with the decoder's temporary arrays if
all are full vectors."""
NOWHERE = -1 << 40
"""Column of vectors before any word sets it: adding columns never makes it valid."""
LONGEST_US = 24 * 3600 * 10**6
"""Longest time without an event [us]. The time is counted up in steps of 4,096 us, as
cameras do: a day is 21 million words."""
MAX_HEADER = 1 << 16
"""Largest size of a header; real ones are far shorter [bytes]."""
ADDR_Y = 0x0
"""Row: 11 bits; the twelfth is the number of one of two cameras."""
ADDR_X = 0x2
"""An event: its column in 11 bits, and its sign in the twelfth."""
VECT_BASE_X = 0x3
"""Column and sign of the vectors that follow, in the same bits."""
VECT_12, VECT_8 = 0x4, 0x5
"""Mask of the events in the next 12 or 8 columns; the next vector continues there."""
# EVT 3.0 sends time in two halves of 12 bits, each in a word of its own.
TIME_LOW = 0x6
TIME_HIGH = 0x8
"""Lower and upper 12 bits of 24 bits of microseconds, which then begin again at 0."""
WITHOUT_EVENTS = (0x7, 0xA, 0xE, 0xF)
"""Triggers of other devices, and extensions of vendors."""
KNOWN = (ADDR_Y, ADDR_X, VECT_BASE_X, VECT_12, VECT_8, TIME_LOW, TIME_HIGH)
MAX_SIDE = 1 << 11
"""Largest number of columns or rows [px]: they have 11 bits."""
PERIOD = 1 << 12
"""Microseconds per step of `TIME_HIGH`, and number of steps until it begins again."""
EVT2_TIME, EVT2_EVENTS, EVT2_OTHERS = 0x8, (0x0, 0x1), (0xA, 0xE, 0xF)
"""Kinds of words of EVT 2.0: upper bits of the time; an event, darker or brighter;
triggers and extensions of vendors."""
DAT_EVENTS = b"\x0c\x08"
"""Type of events, those of change detection, and their size, in a DAT file."""
EVT2_STEP, EVT2_STEPS = 1 << 6, 1 << 28
"""Microseconds per step of the upper bits, and number of steps until they begin again,
after 4.8 hours."""


class DecoderState(NamedTuple):
    """State set by the words so far; -1 for values that no word has set.

    Attributes:
        high: Steps of 4,096 us, continued where their 12 bits begin again.
        low: Microseconds after that.
        y: Row.
        base: Column and sign of the next vector, as in its word.
    """

    high: int = -1
    low: int = 0
    y: int = -1
    base: int = -1


class Decoder:
    """Decoder of words, block by block.

    Attributes:
        state: State set by the words so far.
    """

    def __init__(self):
        self.state = DecoderState()

    def columns(self, words: UInt16[np.ndarray, " word"]) -> Columns:
        """Return the events of a block of words.

        Events before the first time and row are omitted, as by the manufacturer's own
        reader, because their time or row is unknown.
        """
        kind, value = words >> 12, (words & 0xFFF).astype(np.int64)
        high, low = self._times(kind, value)
        y = _last(kind == ADDR_Y, value & 0x7FF, self.state.y)
        base = self._bases(kind, value)
        self.state = DecoderState(*(int(v[-1]) for v in (high, low, y, base)))
        # first column of a word's events, and mask of the columns that have one
        mask = np.zeros(len(words), np.int64)
        mask[kind == ADDR_X] = 1
        for vector, bits in ((VECT_12, 0xFFF), (VECT_8, 0xFF)):
            mask[kind == vector] = value[kind == vector] & bits
        before = np.where(kind == ADDR_X, value, base - _lengths(kind))
        mask[(high < 0) | (y < 0) | (before < 0)] = 0
        at = np.flatnonzero(mask)
        # one row of twelve flags per word with events
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
        high = _last_at(at, _counted(value[at], before, PERIOD), before, len(kind))
        is_low = kind == TIME_LOW
        # a new step begins at 0; the same step, sent again, changes nothing
        is_new = np.diff(high, prepend=before) != 0
        low = _last(is_low | is_new, np.where(is_low, value, 0), self.state.low)
        return high, low

    def _bases(self, kind, value) -> Int64[np.ndarray, " word"]:
        """Return column and sign at which the next vector begins, after each word."""
        lengths = np.cumsum(_lengths(kind))
        at = np.flatnonzero(kind == VECT_BASE_X)
        before = self.state.base if self.state.base >= 0 else NOWHERE
        start = _last_at(at, value[at] - lengths[at], before, len(kind))
        return np.where(start == NOWHERE, -1, start + lengths)


class Evt2Decoder:
    """Decoder of words of EVT 2.0, block by block.

    Attributes:
        high: Steps of 64 us, continued where their 28 bits begin again; -1 before the
            first.
    """

    def __init__(self):
        self.high = -1

    def columns(self, words: UInt32[np.ndarray, " word"]) -> Columns:
        """Return the events of a block of words.

        Events before the first time are omitted, because their time is unknown.
        """
        kind = words >> 28
        at = np.flatnonzero(kind == EVT2_TIME)
        steps = (words[at] & (EVT2_STEPS - 1)).astype(np.int64)
        high = _last_at(
            at, _counted(steps, self.high, EVT2_STEPS), self.high, len(kind)
        )
        self.high = int(high[-1])
        some = np.flatnonzero((kind <= EVT2_EVENTS[-1]) & (high >= 0))
        word = words[some].astype(np.int64)
        return {
            "x": word >> 11 & 0x7FF,
            "y": word & 0x7FF,
            "t": high[some] * EVT2_STEP + (word >> 22 & 0x3F),
            "p": word >> 28,
        }


def _counted(
    steps: Int64[np.ndarray, " word"], before: int, period: int
) -> Int64[np.ndarray, " word"]:
    """Return steps of a counter, continued where its bits begin again."""
    falls = np.diff(steps, prepend=max(before, 0) % period)
    # a fall by more than half of the range: the bits began again
    wraps = np.cumsum(falls < -period // 2) + max(before, 0) // period
    return steps + period * wraps


def _lengths(kind: UInt16[np.ndarray, " word"]) -> Int64[np.ndarray, " word"]:
    """Return the number of columns that each word advances."""
    return np.where(kind == VECT_12, 12, np.where(kind == VECT_8, 8, 0))


def _last(
    where: Bool[np.ndarray, " word"], value: Int64[np.ndarray, " word"], before: int
) -> Int64[np.ndarray, " word"]:
    """Return the value of the last word of a kind, up to each word."""
    at = np.flatnonzero(where)
    return _last_at(at, value[at], before, len(value))


def _last_at(at, values, before: int, count: int) -> Int64[np.ndarray, " word"]:
    """Return, for each word, the value at the last of some words up to it."""
    found = np.append(np.int64(before), values)
    return np.repeat(found, np.diff(at, prepend=0, append=count))


class Encoding(NamedTuple):
    """Encoding of a file.

    Attributes:
        name: Its name in messages.
        word: Type of its words.
        kinds: Kinds of words that can be in a file.
        decoder: Type of its decoder.
    """

    name: str
    word: str
    kinds: tuple[int, ...]
    decoder: type[Decoder] | type[Evt2Decoder]


ENCODINGS = {
    "EVT3": Encoding("EVT 3.0", "<u2", (*KNOWN, *WITHOUT_EVENTS), Decoder),
    "EVT2": Encoding(
        "EVT 2.0", "<u4", (*EVT2_EVENTS, EVT2_TIME, *EVT2_OTHERS), Evt2Decoder
    ),
}
"""Encodings by their names in headers."""


def read_raw(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read a file of EVT 3.0 or 2.0.

    The bytes of an incomplete last word are omitted, with a note, where the header does
    not state the number of words.

    Raises:
        InputError: It has no header of these, is incomplete, or contains words of an
            unknown kind.
    """
    with path.open("rb") as file:
        header = read_header(path, file)
        encoding = ENCODINGS[header.encoding]
        width = np.dtype(encoding.word).itemsize
        octets = os.fstat(file.fileno()).st_size - file.tell()
        # a truncated file would otherwise lose its last events without a message
        if header.words is not None and octets != width * header.words:
            raise InputError(
                f"{path}: expected a complete {encoding.name} file, "
                f"{width * header.words:,} bytes after its header, got {octets:,} bytes"
            )
        over = octets % width
        notes = (
            f"{path}: an incomplete word at the end of the file ({over} of {width} "
            "bytes) is ignored",
        )
        decoder = encoding.decoder()
        # converted block by block: int64 columns of a whole file would take four times
        # the memory
        parts = [
            {name: part[name].astype(kind) for name, kind in TYPES.items()}
            for part in map(decoder.columns, _word_blocks(path, file, encoding))
        ]
    columns = {
        name: np.concatenate([np.zeros(0, kind), *(part[name] for part in parts)])
        for name, kind in TYPES.items()
    }
    found = recorded(path, columns, header.size or size)
    return found._replace(notes=notes if over else ())


def read_dat(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read a DAT file of change-detection events.

    Raises:
        InputError: It has no header of version 2, other events, or is incomplete.
    """
    with path.open("rb") as file:
        stated = _stated(file)
        kind, data = file.read(2), file.read()
    if stated.get("Version") != "2" or kind != DAT_EVENTS:
        raise InputError(
            f"{path}: expected a complete DAT file, version 2, of CD events of 8 bytes"
        )
    if over := len(data) % 8:
        raise InputError(
            f"{path}: expected a complete DAT file, got {over} of the 8 bytes of the "
            "last event"
        )
    times, words = np.frombuffer(data, "<u4").reshape(-1, 2).T.astype(np.int64)
    across, down = (whole_number(stated.get(name, "")) for name in ("Width", "Height"))
    if across is not None and down is not None:
        size = across, down
    columns = {"x": words & 0x3FFF, "y": words >> 14 & 0x3FFF, "p": words >> 28}
    return recorded(path, columns | {"t": _counted(times, -1, 1 << 32)}, size)


def _word_blocks(path: Path, file, encoding: Encoding) -> Iterator[np.ndarray]:
    """Yield words, block by block."""
    word = np.dtype(encoding.word)
    while data := file.read(word.itemsize * BLOCK):
        count = len(data) // word.itemsize
        words = np.frombuffer(data, word, count).astype(word.newbyteorder("="))
        if not count:
            return
        kinds = np.bincount(words >> (8 * word.itemsize - 4), minlength=16)
        kinds[[*encoding.kinds]] = 0
        if kinds.any():
            raise InputError(
                f"{path}: expected words of {encoding.name}, got some of the unknown "
                f"type 0x{int(np.argmax(kinds)):x}"
            )
        yield words


@dataclass
class Encoder:
    """State set by the words written so far.

    Attributes:
        high: Steps of `TIME_HIGH`.
        low: Microseconds after that; -1 before the first event.
        y: Row.
    """

    high: int = -1
    low: int = -1
    y: int = -1

    def words(self, events: Columns) -> UInt16[np.ndarray, " word"]:
        """Return the words of a non-empty block: single events, no vectors.

        Each step of the time's upper bits is written. A reader that counts how often
        they begin again is then right, however long there is no event.
        """
        high, low = np.divmod(events["t"], PERIOD)
        # Words of an event in order: time steps, low time, row, column. `ends` is the
        # position after the last; the others are counted back from it.
        y = events["y"].astype(np.int64)
        steps = np.diff(high, prepend=self.high)
        # unchanged parts of the state are not repeated
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
        InputError: There is no event for longer than `LONGEST_US`.
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
    """Header of a file.

    Attributes:
        size: Width and height, or None.
        words: Number of words that follow, or None.
        encoding: Key of `ENCODINGS`.
    """

    size: tuple[int, int] | None
    words: int | None
    encoding: str


def header_of(width: int, height: int, words: int) -> bytes:
    """Return the header of our files; its length does not depend on `words`.

    Prophesee's software finds the plug-in for the file by it.
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


def _stated(file: BinaryIO) -> dict[str, str]:
    """Return the keywords of a header; the file is then at the first byte after it."""
    stated: dict[str, str] = {}
    start = file.tell()
    while file.tell() < MAX_HEADER:
        line = file.readline(MAX_HEADER)
        if not line.startswith(b"% "):
            break  # "end" may be left out
        start = file.tell()
        key, _, value = line[2:].decode("ascii", "replace").strip().partition(" ")
        if key == "end":
            break
        stated[key] = value
    file.seek(start)
    return stated


def read_header(path: Path, file: BinaryIO) -> Header:
    """Read a header; the file is then at its first word.

    Raises:
        InputError: There is none, or it is of another encoding.
    """
    stated = _stated(file)
    encoding, _, options = stated.get("format", "").partition(";")
    version = stated.get("evt", "")
    by_version = {"3.0": "EVT3", "2.0": "EVT2"}
    encoding = encoding or by_version.get(version, version)
    if encoding not in ENCODINGS:
        got = f"one of {shown(encoding)}" if encoding else "none"
        raise InputError(
            f"{path}: expected the header of an EVT 3.0 or EVT 2.0 file, got {got}"
        )
    if stated.get("endianness", "little") != "little":
        raise InputError(f"{path}: expected little-endian words, got big-endian ones")
    width, _, height = stated.get("geometry", "").partition("x")
    fields = {"width": width, "height": height}
    for option in options.split(";"):
        key, _, value = option.partition("=")
        fields[key] = value
    across, down = whole_number(fields["width"]), whole_number(fields["height"])
    size = None if across is None or down is None else (across, down)
    return Header(size, whole_number(stated.get("words", "")), encoding)
