"""Columns of recorded events, and their files in npz, HDF5 and text.

HDF5 has the layout of DSEC. `events/{x, y, t, p}`: column, row, whole microseconds from
frame 0, 1 for brighter and 0 for darker. `t_offset` is 0. `ms_to_idx[i]` is the first
event at or after millisecond i, to the end of the film: DSEC's slicer looks up the
milliseconds in which a window begins and by which it ends, and returns None where there
is no entry. An npz file has the same columns as NumPy arrays. A text
has a line `t x y p` per event, with the time in seconds, as the Event Camera Dataset
and v2e.

References:
    Gehrig, Aarents, Gehrig and Scaramuzza (2021), DSEC: a stereo event camera dataset
    for driving scenarios; its description of the data format, and its `eventslicer.py`.
    Mueggler, Rebecq, Gallego, Delbruck and Scaramuzza (2017), The Event-Camera Dataset;
    Hu, Liu and Delbruck (2021), v2e.
"""

import os
import re
import warnings
from collections.abc import Iterable
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
) -> RecordedEvents:
    """Return the events of a file's columns after checks.

    Args:
        path: The file, for messages.
        columns: x, y, t and p, whole numbers; p may also be 1 and -1.
        size: Width and height; None if the file does not state them.
        t_offset: Offset of the result [us].

    Raises:
        InputError: The columns differ in length, a pixel is outside the image, times
            fall, or the size is unknown.
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
        if column.dtype.kind not in "iub" or column.ndim != 1:
            raise InputError(
                f"{path}: {name}: expected whole numbers, got {column.dtype}"
                + f" of the shape {column.shape}" * (column.ndim != 1)
            )
    lengths = {name: len(columns[name]) for name in TYPES}
    if len({*lengths.values()}) > 1:
        counts = ", ".join(f"{number:,} of {name}" for name, number in lengths.items())
        raise InputError(f"{path}: expected as many of each column, got {counts}")
    for name, limit in zip("xy", size, strict=True):
        check_place(path, name, columns[name], limit)
    check_rising(path, columns["t"])
    if len(columns["t"]) and int(columns["t"][-1]) > LAST_US:
        raise InputError(
            f"{path}: t: expected microseconds up to {LAST_US}, got {columns['t'][-1]}"
        )
    p = columns["p"]
    # some writers code darker as -1
    if p.dtype.kind == "i":
        p = np.where(p == -1, 0, p)
    if len(p) and not ((p == 0) | (p == 1)).all():
        other = p[(p != 0) & (p != 1)][0]
        raise InputError(
            f"{path}: p: expected 1 for brighter, 0 for darker, got {other}"
        )
    values = {**columns, "p": p}
    x, y, t, p = (values[name].astype(kind) for name, kind in TYPES.items())
    return RecordedEvents(x, y, t, p, *size, t_offset)


def check_place(path: str | Path, name: str, values: np.ndarray, limit: int) -> None:
    """Reject columns or rows outside the image.

    Raises:
        InputError: The first such event, with its value.
    """
    if len(values) and not 0 <= values.min() <= values.max() < limit:
        wrong = int(np.flatnonzero((values < 0) | (values >= limit))[0])
        raise InputError(
            f"{path}: {name} of event {wrong}: expected 0 to {limit - 1}, as the image "
            f"has, got {values[wrong]}"
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
            offset = _whole(file["t_offset"]) if "t_offset" in file else 0
            if {"width", "height"} <= {*file}:
                size = _whole(file["width"]), _whole(file["height"])
    return recorded(path, columns, size, offset)


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
        offset = _whole(file["t_offset"]) if "t_offset" in file else 0
    return recorded(path, columns, size, offset)


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


def read_lines(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read a text of time [s], column, row and sign.

    Raises:
        InputError: It is no such text, or has fewer events than its first line states.
    """
    with path.open("rb") as file:
        head = re.match(rb"# size (\d+)x(\d+), events (\d+)\n", file.read(100))
    if head and not _ends_line(path):
        raise InputError(f"{path}: expected a complete text, got half of a last line")
    try:
        with warnings.catch_warnings():  # a text without events
            warnings.simplefilter("ignore", UserWarning)
            rows = np.loadtxt(path, np.float64, ndmin=2, encoding="ascii")
    except ValueError as error:
        raise InputError(
            f"{path}: expected lines of time [s], column, row and sign, such as "
            f"0.000123 33 39 1; got another text ({' '.join(str(error).split())})"
        ) from None
    rows = rows.reshape(-1, 4) if not rows.size else rows
    if rows.shape[1] != 4 or not np.isfinite(rows).all():
        raise InputError(
            f"{path}: expected four finite numbers a line, time [s], column, row and "
            f"sign, got {rows.shape[1]} columns"
        )
    if head and int(head[3]) != len(rows):
        raise InputError(
            f"{path}: expected a complete text of {int(head[3]):,} events, got "
            f"{len(rows):,}"
        )
    times, others = rows[:, 0], rows[:, 1:]
    if (
        not head
        and len(times) > 1
        and times[-1] > 0
        and (times == np.rint(times)).all()
    ):
        raise InputError(
            f"{path}: expected times in seconds, as 0.000123, got whole numbers up to "
            f"{times[-1]:.12g} (microseconds?); divide them by 1,000,000"
        )
    wrong = np.flatnonzero((others != np.rint(others)).any(axis=1))
    if len(wrong):
        raise InputError(
            f"{path}: event {wrong[0]}: expected whole numbers of column, row and "
            f"sign, got {others[wrong[0]].tolist()}"
        )
    if head:
        size = int(head[1]), int(head[2])
    if (np.abs(rows) > LAST_US / 1e6).any():
        raise InputError(
            f"{path}: expected numbers up to {LAST_US / 1e6:.3g}, got "
            f"{np.abs(rows).max():.3g}"
        )
    whole = np.rint(others).astype(np.int64).T
    columns = {"t": np.rint(1e6 * times).astype(np.int64)}
    return recorded(path, columns | dict(zip("xyp", whole, strict=True)), size)
