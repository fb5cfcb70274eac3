"""Columns of recorded events, and their files in npz, HDF5 and text.

HDF5 has the layout of DSEC. `events/{x, y, t, p}`: column, row, whole microseconds from
frame 0, 1 for brighter and 0 for darker. `t_offset` is 0. `ms_to_idx[i]` is the first
event at or after millisecond i, to the end of the film: DSEC's slicer looks up the
milliseconds in which a window begins and by which it ends, and returns None where there
is no entry. An npz file has the same columns as NumPy arrays. A text has a line
`t x y p` per event, as the Event Camera Dataset and v2e, or `x,y,p,t`, as Metavision's
CSV; its first line may state the size, or name the columns.

Times that a file's format does not state in microseconds are in seconds if they are
fractions, else in microseconds, unless that leaves fewer than `SPARSE_HZ` events.

References:
    Gehrig, Aarents, Gehrig and Scaramuzza (2021), DSEC: a stereo event camera dataset
    for driving scenarios; its description of the data format, and its `eventslicer.py`.
    Mueggler, Rebecq, Gallego, Delbruck and Scaramuzza (2017), The Event-Camera Dataset;
    Hu, Liu and Delbruck (2021), v2e. Prophesee, Metavision documentation: CSV format.
"""

import math
import os
import re
import warnings
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZipFile

import numpy as np
from jaxtyping import Int64, UInt8, UInt16

from jblast.errors import InputError, argument, check_declared, whole_number

TYPES = {"x": np.uint16, "y": np.uint16, "t": np.int64, "p": np.uint8}
"""Columns of a file, with their types."""
Columns = dict[str, np.ndarray]
ECF = 0x8ECF
"""Number of the filter of Prophesee's codec in HDF5."""
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
SIZE_LINES = (
    r"# size (\d+)x(\d+), events (\d+)",
    r"% ?geometry[: ]+(\d+)[x,](\d+)",
    r"#? ?(\d+)[ ,\t]+(\d+)",
)
"""Lines that state the size of the image, and ours the number of events: of this
package, of Metavision's CSV, and of texts with the size alone in the first line."""
COLUMN_NAMES = {"ts": "t", "time": "t", "timestamp": "t", "pol": "p", "polarity": "p"}
"""Names of columns in the first line of a text, beside x, y, t and p."""
COLUMN_WORDS = {"t": "time", "x": "column", "y": "row", "p": "sign"}
EXAMPLES = {"t": "0.000123 33 39 1", "x": "33,39,1,123"}
"""Events of a text by its first column."""
_PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
"""Fastest level of gzip, after `shuffle` has grouped bytes of equal significance."""


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


def recorded(
    path: str | Path,
    columns: Columns,
    size: tuple[int, int] | None,
    t_offset: int = 0,
    *,
    in_us: bool = True,
) -> RecordedEvents:
    """Return the events of a file's columns after checks.

    Args:
        path: The file, for messages.
        columns: x, y, t and p, numbers; p may also be 1 and -1.
        size: Width and height; None if the file does not state them.
        t_offset: Offset of the result [us].
        in_us: True if the format's times are microseconds. Otherwise the unit is the
            first of `UNITS` that gives `SPARSE_HZ`, with a note if that is unusual.

    Raises:
        InputError: The columns differ in length or are no numbers, a pixel is outside
            the image, times fall, or the size is unknown.
    """
    if size is None:
        raise InputError(
            f"{path}: expected the width and height of the image, which this file does "
            f"not contain; add {argument('size')}, such as 640x480"
        )
    if min(size) < 1 or size[0] * size[1] > MAX_PIXELS:
        raise InputError(
            f"{path}: expected an image of 1 to {MAX_PIXELS:,} pixels, got "
            f"{size[0]} x {size[1]}"
        )
    for name in TYPES:
        column = columns[name]
        if column.dtype.kind not in "iubf" or column.ndim != 1:
            raise InputError(
                f"{path}: {name}: expected numbers, got {column.dtype}"
                + f" of the shape {column.shape}" * (column.ndim != 1)
            )
    lengths = {name: len(columns[name]) for name in TYPES}
    if len({*lengths.values()}) > 1:
        counts = ", ".join(f"{number:,} of {name}" for name, number in lengths.items())
        raise InputError(f"{path}: expected as many of each column, got {counts}")
    t, notes = columns["t"], ()
    if not np.isfinite(t).all() or (abs(t[-1:]) > LAST_US).any():
        raise InputError(
            f"{path}: t: expected microseconds up to {LAST_US}, got {t[-1]}"
        )
    if not in_us:
        t, notes = _in_microseconds(t)
    values = {**columns, "t": t}
    if columns["p"].dtype.kind in "if":  # some writers code darker as -1
        values["p"] = np.where(columns["p"] == -1, 0, columns["p"])
    for name, limit in zip("xyp", (*size, 2), strict=True):
        check_place(path, name, values[name], limit)
    check_rising(path, t)
    x, y, t, p = (values[name].astype(kind) for name, kind in TYPES.items())
    return RecordedEvents(x, y, t, p, *size, t_offset, notes)


def _in_microseconds(t: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return times in whole microseconds, and a note on an unlikely unit."""
    units = UNITS["f" if t.dtype.kind == "f" else "i"]
    span = float(t[-1]) - float(t[0]) if len(t) else 0.0
    rates = {
        unit: len(t) / (1e-6 * factor * span) if span > 0.0 else math.inf
        for unit, factor in units
    }
    usual, factor = units[0]
    unit, factor = next((u for u in units if rates[u[0]] >= SPARSE_HZ), units[0])
    if factor < 1.0:
        t = t // round(1.0 / factor)
    elif factor > 1.0 or t.dtype.kind == "f":
        t = np.rint(factor * t).astype(np.int64)
    sparse = f"{rates[usual]:.3g} events a second over the whole image"
    if unit != usual:
        return t, (f"times were read as {unit}: in {usual} there are {sparse}",)
    if rates[usual] < SPARSE_HZ:
        return t, (f"{sparse} are few for a camera: the unit of its times may differ",)
    return t, ()


def check_place(path: str | Path, name: str, values: np.ndarray, limit: int) -> None:
    """Reject columns, rows or signs that are not whole numbers below a limit.

    Raises:
        InputError: The first such event, with its value.
    """
    wrong = (values < 0) | (values >= limit)
    if values.dtype.kind == "f":
        wrong |= ~np.isfinite(values) | (values != np.rint(values))
    if wrong.any():
        at = int(np.argmax(wrong))
        allowed = f"0 to {limit - 1}, as the image has"
        if name == "p":
            allowed = "1 for brighter, 0 for darker"
        raise InputError(
            f"{path}: {name} of event {at}: expected {allowed}, got {values[at]}"
        )


def check_rising(path: str | Path, t: np.ndarray, before: int | None = None) -> None:
    """Reject times that fall; several events may have the same time.

    Args:
        path: The file, for the message.
        t: Times [us].
        before: Time of the event before these [us].

    Raises:
        InputError: A time is before the one that precedes it.
    """
    if before is not None and len(t):
        t = np.append(np.int64(before), t)
    falls = t[1:] < t[:-1]
    if falls.any():
        at = int(np.argmax(falls))
        raise InputError(
            f"{path}: t: expected events in order of time, got {t[at + 1]} us after "
            f"{t[at]} us"
        )


def write_arrays(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events, assembled in memory.

    Args:
        path: An empty file.
        blocks: Columns of events.
        size: Width and height.
        last_ms: Not used by this format.
    """
    del last_ms
    parts = [*blocks]
    values = {
        name: np.concatenate([np.zeros(0, dtype), *(part[name] for part in parts)])
        for name, dtype in TYPES.items()
    }
    width, height = size
    values |= {"width": np.asarray(width), "height": np.asarray(height)}
    with path.open("wb") as file:  # NumPy would append .npz to a name
        values["t_offset"] = np.asarray(0)
        np.savez_compressed(file, allow_pickle=False, **values)


def read_arrays(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read an npz file of events.

    Raises:
        InputError: It is no npz file, has other columns, or declares more numbers than
            it can contain.
    """
    # opened here: NumPy leaves a path open if reading fails
    with path.open("rb") as held:
        # the directory of the archive states the sizes before anything is decompressed
        check_declared(path, sum(one.file_size for one in ZipFile(held).infolist()))
        held.seek(0)
        with np.load(held, allow_pickle=False) as file:
            if not {*TYPES} <= {*file}:
                got = ", ".join(file)
                raise InputError(f"{path}: expected arrays x, y, t and p, got {got}")
            columns = {name: file[name] for name in TYPES}
            in_us = "t_offset" in file
            offset = _whole(file["t_offset"]) if in_us else 0
            if {"width", "height"} <= {*file}:
                size = _whole(file["width"]), _whole(file["height"])
    return recorded(path, columns, size, offset, in_us=in_us)


def write_dsec(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events block by block.

    Args:
        path: An empty file.
        blocks: Columns of events.
        size: Width and height.
        last_ms: Minimum last millisecond of `ms_to_idx`.
    """
    import h5py

    count = 0
    each_ms = np.zeros(last_ms, np.int64)
    with h5py.File(path, "w") as file:
        group = file.create_group("events")
        # DSEC's readers ignore these attributes; ours need the size
        group.attrs.update(dict(zip(("width", "height"), size, strict=True)))
        columns = {
            name: group.create_dataset(
                name, (0,), dtype, chunks=(1 << 16,), maxshape=(None,), **_PACKED
            )
            for name, dtype in TYPES.items()
        }
        for block in blocks:
            new = len(block["t"])
            for name, column in columns.items():
                column.resize((count + new,))
                column[count:] = block[name]
            count += new
            # events per millisecond; their running sum is the index
            here = np.bincount(block["t"] // 1000, minlength=len(each_ms))
            here[: len(each_ms)] += each_ms
            each_ms = here
        file["ms_to_idx"] = np.append(0, np.cumsum(each_ms)).astype(np.uint64)
        file["t_offset"] = np.int64(0)


def read_hdf5(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read an HDF5 file of events in the layout of DSEC, v2e or Prophesee.

    v2e writes a table `events` of time [us], column, row and sign; Prophesee a table
    `CD/events` with named columns, and the size as the attribute `geometry`. DSEC and
    v2e do not store the size.

    Raises:
        InputError: It is no HDF5 file, has another layout or an unavailable
            compression, or declares more numbers than it can contain.
    """
    import h5py

    with h5py.File(path) as file:
        group, table = file.get("events"), file.get("CD/events")
        if isinstance(group, h5py.Group) and {*TYPES} <= {*group}:
            columns = {name: _dataset(path, group[name]) for name in TYPES}
            if {"width", "height"} <= {*group.attrs}:
                size = _whole(group.attrs["width"]), _whole(group.attrs["height"])
        elif isinstance(table, h5py.Dataset) and {*TYPES} <= {
            *(table.dtype.names or ())
        }:
            rows = _dataset(path, table)
            columns = {name: rows[name] for name in TYPES}
            across, _, down = str(file.attrs.get("geometry", "")).partition("x")
            stated = whole_number(across), whole_number(down)
            if stated[0] is not None and stated[1] is not None:
                size = stated[0], stated[1]
        elif isinstance(group, h5py.Dataset) and group.shape[1:] == (4,):
            rows = _dataset(path, group)
            columns = {name: rows[:, at] for at, name in enumerate("txyp")}
        else:
            raise InputError(
                f"{path}: expected events/x, y, t and p (DSEC), a table CD/events "
                "(Prophesee) or a table events of four columns (v2e), got "
                f"{', '.join(file) or 'nothing'}"
            )
        in_us = "t_offset" in file or table is not None
        offset = _whole(file["t_offset"]) if "t_offset" in file else 0
    return recorded(path, columns, size, offset, in_us=in_us)


def _dataset(path: Path, held: Any) -> np.ndarray:
    """Return the numbers of a dataset.

    Raises:
        InputError: It is no dataset of numbers, is in another file, is compressed by a
            codec that is not installed, or declares more than the file can contain.
    """
    import h5py

    name = getattr(held, "name", None) or "dataset"
    if not isinstance(held, h5py.Dataset) or held.dtype.hasobject or held.shape is None:
        raise InputError(f"{path}: {name}: expected a dataset of numbers")
    if held.is_virtual or held.external:
        raise InputError(
            f"{path}: {name}: expected its numbers in this file, got a link to another "
            "file; copy the data into one file"
        )
    check_declared(path, held.size * held.dtype.itemsize)
    filters = held.id.get_create_plist()
    for number in range(filters.get_nfilters()):
        code, *_, words = filters.get_filter(number)
        if not h5py.h5z.filter_avail(code):
            codec = "Prophesee's ECF" if code == ECF else words.decode(errors="replace")
            raise InputError(
                f"{path}: {name}: expected a compression that HDF5 can read, got the "
                f"codec {codec or 'without a name'} (filter {code}), which is not "
                "installed; install it and set HDF5_PLUGIN_PATH to its folder, or "
                "convert the file to .raw"
            )
    return held[()]


def _whole(value: Any) -> int:
    return int(np.asarray(value).item())


def write_text(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write a line of text per event.

    Args:
        path: An empty file.
        blocks: Columns of events.
        size: Width and height.
        last_ms: Not used by this format.
    """
    del last_ms
    head, count = "# size {}x{}, events {:020d}\n", 0
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(head.format(*size, count))
        for block in blocks:
            count += len(block["t"])
            for t, x, y, p in zip(
                *(block[name].tolist() for name in "txyp"), strict=True
            ):
                file.write(f"{t // 10**6}.{t % 10**6:06d} {x} {y} {p}\n")
        file.seek(0)
        file.write(head.format(*size, count))


def _ends_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read() == b"\n"


def read_lines(
    path: Path, size: tuple[int, int] | None, *, order: str = "txyp"
) -> RecordedEvents:
    """Read a text with a line per event, with spaces or commas between the numbers.

    Args:
        path: The file.
        size: Width and height, if no line states them.
        order: Order of the columns, if no line names them.

    Raises:
        InputError: It is no such text, or has fewer events than its first line states.
    """
    count, line, names = None, "", ""
    with path.open(encoding="ascii", errors="replace") as file:
        for line in file:
            words = [str(word) for word in re.findall(r"\w+", line.lower())]
            named = "".join(COLUMN_NAMES.get(word, word) for word in words)
            stated = (re.fullmatch(form, line.strip()) for form in SIZE_LINES)
            found = next(filter(None, stated), None)
            if found:
                size = int(found[1]), int(found[2])
                count = int(found[3]) if found.re.groups > 2 else None
            elif sorted(named) == sorted(TYPES):
                order = named
            elif line[0] not in "#%\n":
                break
            line = ""
        if count is not None and not _ends_line(path):
            raise InputError(f"{path}: expected a complete text, got half of a line")
        names = ", ".join(COLUMN_WORDS[name] for name in order)
        try:
            with warnings.catch_warnings():  # a text without events
                warnings.simplefilter("ignore", UserWarning)
                separator = "," if "," in line else None
                lines = chain([line], file)
                rows = np.loadtxt(lines, np.float64, ndmin=2, delimiter=separator)
        except ValueError as error:
            raise InputError(
                f"{path}: expected lines of {names}, such as {EXAMPLES[order[0]]}; got "
                f"another text ({' '.join(str(error).split())})"
            ) from None
    if count not in (None, len(rows)):
        raise InputError(
            f"{path}: expected a complete text of {count:,} events, got {len(rows):,}"
        )
    rows = rows.reshape(-1, 4) if not rows.size else rows
    if rows.shape[1] != 4:
        raise InputError(
            f"{path}: expected four numbers a line, {names}, got {rows.shape[1]}"
        )
    columns: Columns = dict(zip(order, rows.T, strict=True))
    t = columns["t"]
    ours = count is not None
    if ours or ("." not in line and (t == np.rint(t)).all()):
        columns["t"] = np.rint(1e6 * t if ours else t).astype(np.int64)
    return recorded(path, columns, size, in_us=ours)
