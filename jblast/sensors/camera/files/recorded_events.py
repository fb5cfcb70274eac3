"""Columns of recorded events: their types, limits and units, for all file formats.

Times that a file's format does not state in microseconds are in seconds if they are
fractions, else in microseconds, unless that leaves fewer than `SPARSE_HZ` events.
"""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64, UInt8, UInt16

from jblast.errors import argument, require

TYPES = {"x": np.uint16, "y": np.uint16, "t": np.int64, "p": np.uint8}
"""Columns of a file, with their types."""
Columns = Mapping[str, np.ndarray]
MAX_PIXELS = 1 << 24
"""Largest number of pixels of an image: event cameras have up to a few million, and a
search keeps several images in memory."""
LAST_US = 1 << 60
"""Largest time [us], 36,000 years: sums of times stay within 64 bits."""
SPARSE_HZ = 100.0
"""Smallest plausible rate of events over the image [1/s]: the noise of a small camera,
0.05 events per pixel and second, is ten times that. Fewer are a synthetic stream, or
have another unit of time."""
UNITS = {
    "f": (("seconds", 1e6), ("milliseconds", 1e3), ("microseconds", 1.0)),
    "i": (("microseconds", 1.0), ("nanoseconds", 1e-3)),
}
"""Units of time of fractions and of whole numbers [us], the usual first."""


class RecordedEvents(NamedTuple):
    """Events in order of time.

    Attributes:
        x: Column.
        y: Row, downwards.
        t: Whole microseconds on the file's clock.
        p: 1 brighter, 0 darker.
        width: Pixels of a row.
        height: Number of rows.
        t_offset: Offset to be added to the times, as stated in the file [us].
        notes: Warnings of the reader, a sentence each.
    """

    x: UInt16[np.ndarray, " event"]
    y: UInt16[np.ndarray, " event"]
    t: Int64[np.ndarray, " event"]
    p: UInt8[np.ndarray, " event"]
    width: int
    height: int
    t_offset: int = 0
    notes: tuple[str, ...] = ()


class Content(NamedTuple):
    """Content of an event file as it is, before any check.

    Attributes:
        columns: x, y, t and p, numbers of any type; p may also be 1 and -1.
        size: Width and height; None if the file does not state them.
        t_offset: Offset of the times, as stated in the file [us].
        in_us: True if the format's times are microseconds.
        notes: Warnings of the reader, a sentence each.
    """

    columns: Columns
    size: tuple[int, int] | None = None
    t_offset: int = 0
    in_us: bool = True
    notes: tuple[str, ...] = ()


class NewFile(NamedTuple):
    """An empty file to which a format's writer adds events.

    Attributes:
        path: The file.
        width: Pixels of a row.
        height: Number of rows.
        last_ms: Minimum last millisecond of an index by time.
    """

    path: Path
    width: int
    height: int
    last_ms: int


def joined(parts: Iterable[Columns]) -> dict[str, np.ndarray]:
    """Return the columns of several blocks as one; of none, empty columns."""
    # converted block by block: int64 columns of a whole file take four times the memory
    each = [
        {name: part[name].astype(kind) for name, kind in TYPES.items()}
        for part in parts
    ]
    return {
        name: np.concatenate([np.zeros(0, kind), *(part[name] for part in each)])
        for name, kind in TYPES.items()
    }


def recorded(
    path: str | Path, content: Content, size: tuple[int, int] | None
) -> RecordedEvents:
    """Return the events of a file after all checks.

    Args:
        path: The file, for messages.
        content: Its content.
        size: Width and height, for a file that does not state them.

    Raises:
        InputError: The size is unknown or too large, the columns are no numbers or
            differ in length, or as in `checked`.
    """
    size = content.size or size
    expected = (
        "the width and height of the image, which this file does not contain; add "
        f"{argument('size')}, such as 640x480"
    )
    require(size is not None, path, expected)
    assert size is not None
    width, height = size
    require(
        min(size) >= 1 and width * height <= MAX_PIXELS,
        path,
        f"an image of 1 to {MAX_PIXELS:,} pixels",
        f"{width} x {height}",
    )
    columns, notes = _numbers(path, content.columns), content.notes
    if not content.in_us:
        columns["t"], more = _in_microseconds(columns["t"])
        notes += more
    columns["p"] = np.where(columns["p"] == -1, 0, columns["p"])  # darker as -1
    columns = checked(path, columns, size)
    return RecordedEvents(
        **columns, width=width, height=height, t_offset=content.t_offset, notes=notes
    )


def _numbers(path: str | Path, columns: Columns) -> dict[str, np.ndarray]:
    """Return columns of numbers, of equal length."""
    columns = {name: np.asarray(columns[name]) for name in TYPES}
    for name, values in columns.items():
        require(
            values.dtype.kind in "iubf" and values.ndim == 1,
            f"{path}: {name}",
            "a column of numbers",
            f"{values.dtype} of shape {values.shape}",
        )
    lengths = {name: len(values) for name, values in columns.items()}
    counts = ", ".join(f"{number:,} of {name}" for name, number in lengths.items())
    require(len({*lengths.values()}) == 1, path, "as many of each column", counts)
    return columns


def checked(
    path: str | Path, columns: Columns, size: tuple[int, int], since: int | None = None
) -> dict[str, np.ndarray]:
    """Return columns in the types of `TYPES`, after checks.

    Args:
        path: The file, for messages.
        columns: x, y, t in microseconds and p, numbers.
        size: Width and height.
        since: Time before which no event may be [us]; None for none.

    Raises:
        InputError: A pixel is outside the image, a sign is neither 1 nor 0, or times
            fall.
    """
    inside = "as the image has"
    limits = {
        "x": (0, size[0] - 1, inside),
        "y": (0, size[1] - 1, inside),
        "p": (0, 1, "darker or brighter"),
        "t": (-LAST_US, LAST_US, "in microseconds"),
    }
    for name, (least, most, why) in limits.items():
        values = columns[name]
        right = (values >= least) & (values <= most)  # false for NaN
        if values.dtype.kind == "f":
            right &= values == np.rint(values)
        for at in np.flatnonzero(~right)[:1]:
            where = f"{path}: {name} of event {at}"
            require(False, where, f"{least} to {most}, {why}", f"{values[at]}")
    columns = {name: columns[name].astype(kind) for name, kind in TYPES.items()}
    t = columns["t"]
    before = np.append(t[:1] if since is None else np.int64(since), t[:-1])
    for at in np.flatnonzero(t < before)[:1]:
        got = f"{t[at]} us after {before[at]} us"
        require(False, f"{path}: t", "events in order of time", got)
    return columns


def _in_microseconds(t: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return times in the likely unit as microseconds, and a note if it is unusual."""
    units = UNITS["f" if t.dtype.kind == "f" else "i"]
    span = float(t[-1]) - float(t[0]) if len(t) else 0.0
    rates = {
        unit: len(t) / (1e-6 * factor * span) if span > 0.0 else math.inf
        for unit, factor in units
    }
    usual = units[0][0]
    unit, factor = next((u for u in units if rates[u[0]] >= SPARSE_HZ), units[0])
    t = np.rint(factor * t) if t.dtype.kind == "f" else t // round(1.0 / factor)
    sparse = f"{rates[usual]:.3g} events a second over the whole image"
    if unit != usual:
        return t, (f"times were read as {unit}: in {usual} there are {sparse}",)
    if rates[usual] < SPARSE_HZ:
        return t, (f"{sparse} are few for a camera: the unit of its times may differ",)
    return t, ()
