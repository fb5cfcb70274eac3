"""EVT 3.0, EVT 2.0 and DAT, the raw files of Prophesee's event cameras.

A text header with lines "% keyword value" is followed by little-endian words, of which
the upper four bits are the kind. Those of EVT 3.0 have 16 bits: a word changes the
state of the decoder (the time's upper and lower 12 bits, the row, the column at which
vectors begin), or contains events. Those of EVT 2.0 have 32 bits: an event with the
lower 6 bits of its time, or the upper 28 bits of the time.

A DAT file has, after its header, the type and the size of an event, and 8 bytes per
event: microseconds, then 14 bits of the column, 14 of the row, and the sign.

Files of EVT 2.0 and DAT are only read.

Encoder and decoder are our own: faery 0.7 loses time in a gap of 40 s between events
(it reads 12.6 s), unless the file has all steps of the time, as ours.

References:
    Prophesee, Metavision documentation: EVT 3.0 format; EVT 2.0 format; RAW file
    format; DAT file format.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Bool, Int64, UInt16

from jblast.errors import require, shown, whole_number
from jblast.sensors.camera.files.recorded_events import (
    Columns,
    Content,
    NewFile,
    joined,
)

BLOCK = 1 << 18
"""Words that are decoded together: some 100 MB with the decoder's temporary arrays if
all are full vectors."""
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
TIME_LOW, TIME_HIGH = 0x6, 0x8
"""Lower and upper 12 bits of 24 bits of microseconds, which then begin again at 0."""
STATE = TIME_HIGH, TIME_LOW, ADDR_Y, VECT_BASE_X
"""Words that hold until the next of their kind."""
EVT3_KINDS = *STATE, ADDR_X, VECT_12, VECT_8, 0x7, 0xA, 0xE, 0xF
"""Kinds of words of EVT 3.0. The last four have no events: triggers of other devices,
and extensions of vendors."""
MAX_SIDE = 1 << 11
"""Largest number of columns or rows [px]: they have 11 bits."""
PERIOD = 1 << 12
"""Microseconds per step of `TIME_HIGH`, and number of steps until it begins again."""
EVT2_TIME, EVT2_EVENTS = 0x8, (0x0, 0x1)
"""Words of EVT 2.0: upper bits of the time; an event, darker or brighter."""
EVT2_KINDS = *EVT2_EVENTS, EVT2_TIME, 0xA, 0xE, 0xF
EVT2_STEP, EVT2_STEPS = 1 << 6, 1 << 28
"""Microseconds per step of the upper bits, and number of steps until they begin again,
after 4.8 hours."""
DAT_EVENTS = b"\x0c\x08"
"""Type of events, those of change detection, and their size, in a DAT file."""


def evt3_columns(blocks: Iterable[np.ndarray]) -> Iterator[Columns]:
    """Yield the events of blocks of EVT 3.0 words.

    Events before the first time and row are omitted, as by the manufacturer's own
    reader, because their time or row is unknown.
    """
    # the words that still hold at the end of a block are put before the next
    state, loops = np.zeros(0, np.uint16), 0
    for block in blocks:
        words = np.append(state, block)
        kind, value = words >> 12, (words & 0xFFF).astype(np.int64)
        low_at, row_at, base_at = (_last(kind == one) for one in STATE[1:])
        high = _counted(kind == TIME_HIGH, value, PERIOD, loops)
        # a new step begins at 0; the same step, sent again, changes nothing
        step_at = _last(np.diff(high, prepend=-1) != 0)
        low = np.where(low_at > step_at, value[low_at], 0)
        # a vector advances the column of the next
        length = 12 * (kind == VECT_12) + 8 * (kind == VECT_8)
        advance = np.cumsum(length)
        base = (value[base_at] & 0x7FF) + advance - advance[base_at]
        # column and sign of a word's first event, and mask of the columns that have one
        is_one = kind == ADDR_X
        column = np.where(is_one, value & 0x7FF, base - length)
        sign = np.where(is_one, value, value[base_at]) >> 11
        mask = np.where(is_one, 1, value & ((1 << length) - 1))
        mask *= (high >= 0) & (row_at >= 0) & (is_one | (base_at >= 0))
        at = np.flatnonzero(mask)
        # one row of flags per word with events
        octets = mask[at].astype("<u2").view(np.uint8)
        row, right = np.nonzero(
            np.unpackbits(octets, bitorder="little").reshape(-1, 16)
        )
        word = at[row]
        yield {
            "x": column[word] + right,
            "y": value[row_at[word]] & 0x7FF,
            "t": high[word] * PERIOD + low[word],
            "p": sign[word],
        }
        # a column outside any image remains one
        next_base = value[base_at[-1]] & 0x800 | min(base[-1], 0x7FF)
        values = high[-1] % PERIOD, low[-1], value[row_at[-1]], next_base
        known = high[-1] >= 0, high[-1] >= 0, row_at[-1] >= 0, base_at[-1] >= 0
        held = zip(STATE, values, known, strict=True)
        state = np.array([k << 12 | v for k, v, some in held if some], np.uint16)
        loops = max(high[-1], 0) // PERIOD


def evt2_columns(blocks: Iterable[np.ndarray]) -> Iterator[Columns]:
    """Yield the events of blocks of EVT 2.0 words, those before any time omitted."""
    state, loops = np.zeros(0, np.uint32), 0
    for block in blocks:
        words = np.append(state, block)
        kind, value = words >> 28, words.astype(np.int64)
        high = _counted(kind == EVT2_TIME, value % EVT2_STEPS, EVT2_STEPS, loops)
        at = np.flatnonzero((kind <= EVT2_EVENTS[-1]) & (high >= 0))
        word = value[at]
        yield {
            "x": word >> 11 & 0x7FF,
            "y": word & 0x7FF,
            "t": high[at] * EVT2_STEP + (word >> 22 & 0x3F),
            "p": word >> 28,
        }
        state = words[kind == EVT2_TIME][-1:]
        loops = max(high[-1], 0) // EVT2_STEPS


def _last(where: Bool[np.ndarray, " word"]) -> Int64[np.ndarray, " word"]:
    """Return the position of the last true value up to each; -1 for none."""
    at = np.flatnonzero(where)
    return np.repeat(np.append(-1, at), np.diff(at, prepend=0, append=len(where)))


def _counted(
    is_step: Bool[np.ndarray, " word"],
    value: Int64[np.ndarray, " word"],
    period: int,
    loops: int = 0,
) -> Int64[np.ndarray, " word"]:
    """Return a counter at each word, continued where its bits begin again.

    Args:
        is_step: Words that state the counter.
        value: Its bits in these words.
        period: Number of values of the bits.
        loops: Number of times that they began again before the first of these.

    Returns:
        The counter; -1 before the first statement.
    """
    steps = value[is_step]
    # a fall by more than half of the range: the bits began again
    begins = np.diff(steps, prepend=steps[:1]) < -period // 2
    counter = np.zeros(len(is_step), np.int64)
    counter[is_step] = steps + period * (loops + np.cumsum(begins))
    at = _last(is_step)
    return np.where(at >= 0, counter[at], -1)


ENCODINGS = {
    "EVT3": (np.dtype("<u2"), EVT3_KINDS, evt3_columns),
    "EVT2": (np.dtype("<u4"), EVT2_KINDS, evt2_columns),
}
"""Type of the words, their kinds and their decoder, by name in headers."""


def read_raw(path: Path) -> Content:
    """Read a file of EVT 3.0 or 2.0.

    The bytes of an incomplete last word are omitted, with a note, where the header does
    not state the number of words.

    Raises:
        InputError: It has no header of these, is incomplete, or contains words of an
            unknown kind.
    """
    with path.open("rb") as file:
        stated = _stated(file)
        name, _, options = stated.get("format", "").partition(";")
        version = stated.get("evt", "none")
        name = name or {"3.0": "EVT3", "2.0": "EVT2"}.get(version, version)
        expected = "the header of an EVT 3.0 or EVT 2.0 file"
        require(name in ENCODINGS, path, expected, shown(name))
        order = stated.get("endianness", "little")
        require(order == "little", path, "little-endian words", shown(order))
        word, kinds, decoded = ENCODINGS[name]
        octets, width = os.fstat(file.fileno()).st_size - file.tell(), word.itemsize
        # a truncated file would otherwise lose its last events without a message
        words = whole_number(stated.get("words", ""))
        expected = f"a complete {name} file of {words} words of {width} bytes"
        require(words in (None, octets / width), path, expected, f"{octets:,} bytes")
        columns = joined(decoded(_word_blocks(path, file, word, kinds)))
    parts = (option.partition("=") for option in options.split(";"))
    fields = {key: value for key, _, value in parts}
    across, _, down = stated.get("geometry", "").partition("x")
    size = _size(fields.get("width", across), fields.get("height", down))
    over = octets % width
    note = f"{path}: an incomplete word at the end ({over} of {width} bytes) is ignored"
    return Content(columns, size, notes=(note,) * (over > 0))


def read_dat(path: Path) -> Content:
    """Read a DAT file of change-detection events.

    Raises:
        InputError: It has no header of version 2, other events, or is incomplete.
    """
    with path.open("rb") as file:
        stated = _stated(file)
        kind, data = file.read(2), file.read()
    is_known = stated.get("Version") == "2" and kind == DAT_EVENTS
    expected = "a complete DAT file, version 2, of CD events of 8 bytes"
    require(is_known, path, expected, "another file")
    require(not len(data) % 8, path, expected, f"{len(data) % 8} bytes of the last")
    times, words = np.frombuffer(data, "<u4").reshape(-1, 2).T.astype(np.int64)
    t = _counted(np.ones(len(times), bool), times, 1 << 32)
    columns = {"x": words & 0x3FFF, "y": words >> 14 & 0x3FFF, "p": words >> 28, "t": t}
    return Content(columns, _size(stated.get("Width", ""), stated.get("Height", "")))


def _size(width: str, height: str) -> tuple[int, int] | None:
    """Return the size that a header states, or None."""
    across, down = whole_number(width), whole_number(height)
    return None if across is None or down is None else (across, down)


def _word_blocks(
    path: Path, file: BinaryIO, word: np.dtype, kinds: tuple[int, ...]
) -> Iterator[np.ndarray]:
    """Yield words, block by block."""
    while data := file.read(word.itemsize * BLOCK):
        words = np.frombuffer(data, word, len(data) // word.itemsize)
        words = words.astype(word.newbyteorder("="))
        found = np.unique(words >> (8 * word.itemsize - 4))
        for kind in np.setdiff1d(found, kinds):
            require(False, path, "words of a known type", f"some of type 0x{kind:x}")
        if len(words):
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


def write_evt3(file: NewFile, blocks: Iterable[Columns]) -> None:
    """Write columns of events block by block.

    Raises:
        InputError: There is no event for longer than `LONGEST_US`.
    """
    encoder, count, last = Encoder(), 0, 0
    with file.path.open("wb") as out:
        out.write(header_of(file.width, file.height, count))
        for block in blocks:
            pause = int(np.diff(block["t"], prepend=last).max())
            last = int(block["t"][-1])
            expected = (
                f"at most {LONGEST_US / 3.6e9:g} hours between two events of EVT3"
            )
            require(pause <= LONGEST_US, "t", expected, f"{pause / 3.6e9:g}")
            words = encoder.words(block)
            out.write(words.astype("<u2").tobytes())
            count += len(words)
        out.seek(0)
        out.write(header_of(file.width, file.height, count))


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
