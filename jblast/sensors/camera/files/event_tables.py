"""Recorded events as npz, HDF5 and text.

HDF5 has the layout of DSEC. `events/{x, y, t, p}`: column, row, whole microseconds from
frame 0, 1 for brighter and 0 for darker. `t_offset` is 0. `ms_to_idx[i]` is the first
event at or after millisecond i, to the end of the film: DSEC's slicer looks up the
milliseconds in which a window begins and by which it ends, and returns None where there
is no entry. An npz file has the same columns as NumPy arrays. A text has a line
`t x y p` per event, as the Event Camera Dataset and v2e, or `x,y,p,t`, as Metavision's
CSV; its first line may state the size, or name the columns.

References:
    Gehrig, Aarents, Gehrig and Scaramuzza (2021), DSEC: a stereo event camera dataset
    for driving scenarios; its description of the data format, and its `eventslicer.py`.
    Mueggler, Rebecq, Gallego, Delbruck and Scaramuzza (2017), The Event-Camera Dataset;
    Hu, Liu and Delbruck (2021), v2e. Prophesee, Metavision documentation: CSV format.
"""

import re
import warnings
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from jblast.errors import check_declared, require
from jblast.sensors.camera.files.recorded_events import (
    TYPES,
    Columns,
    Content,
    NewFile,
    joined,
)

FASTEST = 1
"""Level of zlib: a quarter of the time of the default 6, a tenth more bytes."""
SIZE_LINE = re.compile(
    r"(?:# size |% ?geometry[: ]+|#? ?)(\d+)[x, \t]+(\d+)(?:, events (\d+))?"
)
"""Line that states the size of the image, and ours the number of events: of this
package, of Metavision's CSV, and of texts with the size alone in the first line."""
COLUMN_NAMES = {"ts": "t", "time": "t", "timestamp": "t", "pol": "p", "polarity": "p"}
"""Names of columns in the first line of a text, beside x, y, t and p."""
ECF = 0x8ECF
"""Number of the filter of Prophesee's codec in HDF5."""
EXAMPLES = {"t": "0.000123 33 39 1", "x": "33,39,1,123"}
"""Events of a text by its first column."""


def write_npz(file: NewFile, blocks: Iterable[Columns]) -> None:
    """Write columns of events, assembled in memory."""
    numbers = {"width": file.width, "height": file.height, "t_offset": 0}
    with ZipFile(file.path, "w", ZIP_DEFLATED, compresslevel=FASTEST) as archive:
        for name, values in (joined(blocks) | numbers).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(
                    member, np.asarray(values), allow_pickle=False
                )


def read_npz(path: Path) -> Content:
    """Read an npz file of events.

    Raises:
        InputError: It has other columns, or declares more numbers than it can contain.
    """
    # opened here: NumPy leaves a path open if reading fails
    with path.open("rb") as held:
        # the directory of the archive states the sizes before anything is decompressed
        check_declared(path, sum(one.file_size for one in ZipFile(held).infolist()))
        held.seek(0)
        with np.load(held, allow_pickle=False) as file:
            require({*TYPES} <= {*file}, path, "arrays x, y, t and p", ", ".join(file))
            columns = {name: file[name] for name in TYPES}
            in_us = "t_offset" in file
            offset = _whole(file["t_offset"]) if in_us else 0
            return Content(columns, _size(file), offset, in_us)


def _size(stated: Any) -> tuple[int, int] | None:
    """Return width and height, if they are stated."""
    known = "width" in stated and "height" in stated
    return (_whole(stated["width"]), _whole(stated["height"])) if known else None


def _whole(value: Any) -> int:
    return int(np.asarray(value).item())


def write_dsec(file: NewFile, blocks: Iterable[Columns]) -> None:
    """Write columns of events to HDF5 block by block."""
    import h5py

    # `shuffle` groups bytes of equal significance, which compress better
    packed = {"compression": "gzip", "compression_opts": FASTEST, "shuffle": True}
    each_ms = np.zeros(file.last_ms, np.int64)
    with h5py.File(file.path, "w") as target:
        group = target.create_group("events")
        # DSEC's readers ignore these attributes; ours need the size
        group.attrs.update(width=file.width, height=file.height)
        columns = {
            name: group.create_dataset(
                name, (0,), kind, chunks=(1 << 16,), maxshape=(None,), **packed
            )
            for name, kind in TYPES.items()
        }
        for block in blocks:
            for name, column in columns.items():
                count = len(column)
                column.resize((count + len(block[name]),))
                column[count:] = block[name]
            # events per millisecond; their running sum is the index
            here = np.bincount(block["t"] // 1000, minlength=len(each_ms))
            here[: len(each_ms)] += each_ms
            each_ms = here
        target["ms_to_idx"] = np.append(0, np.cumsum(each_ms)).astype(np.uint64)
        target["t_offset"] = np.int64(0)


def read_hdf5(path: Path) -> Content:
    """Read an HDF5 file of events in the layout of DSEC, v2e or Prophesee.

    v2e writes a table `events` of time [us], column, row and sign; Prophesee a table
    `CD/events` with named columns, and the size as the attribute `geometry`. DSEC and
    v2e do not store the size.

    Raises:
        InputError: It has another layout or an unavailable compression, or declares
            more numbers than it can contain.
    """
    import h5py

    with h5py.File(path) as file:
        events, table = file.get("events"), file.get("CD/events")
        if isinstance(events, h5py.Group) and {*TYPES} <= {*events}:
            columns = {name: _values(path, events[name]) for name in TYPES}
            in_us = "t_offset" in file
            offset = _whole(file["t_offset"]) if in_us else 0
            return Content(columns, _size(events.attrs), offset, in_us)
        if isinstance(table, h5py.Dataset) and {*TYPES} <= {*(table.dtype.names or ())}:
            rows = _values(path, table)
            size = re.fullmatch(r"(\d{1,9})x(\d{1,9})", str(file.attrs.get("geometry")))
            size = (int(size[1]), int(size[2])) if size else None
            return Content({name: rows[name] for name in TYPES}, size)
        require(
            isinstance(events, h5py.Dataset) and events.shape[1:] == (4,),
            path,
            "events/x, y, t and p (DSEC), a table CD/events (Prophesee) or a table "
            "events of four columns (v2e)",
            ", ".join(file) or "nothing",
        )
        columns: dict[str, Any] = dict(
            zip("txyp", _values(path, events).T, strict=True)
        )
        return Content(columns, in_us=False)


def _values(path: Path, data: Any) -> np.ndarray:
    """Return the numbers of a dataset.

    Raises:
        InputError: It is no dataset of numbers in this file, is compressed by a filter
            that is not installed, or declares more than the file can contain.
    """
    import h5py

    where = f"{path}: {getattr(data, 'name', None) or 'dataset'}"
    is_plain = (
        isinstance(data, h5py.Dataset) and data.shape and not data.dtype.hasobject
    )
    expected = "numbers in this file, not a link to another"
    require(is_plain and not (data.is_virtual or data.external), where, expected)
    check_declared(path, data.size * data.dtype.itemsize)
    filters = data.id.get_create_plist()
    for number in range(filters.get_nfilters()):
        code = filters.get_filter(number)[0]
        expected = (
            "a compression that is installed (set HDF5_PLUGIN_PATH to its folder)"
        )
        codec = f"the filter {code}" + ", Prophesee's ECF" * (code == ECF)
        require(h5py.h5z.filter_avail(code), where, expected, codec)
    return data[()]


def write_text(file: NewFile, blocks: Iterable[Columns]) -> None:
    """Write a line of text per event."""
    head, count = f"# size {file.width}x{file.height}, events {{:020d}}\n", 0
    with file.path.open("w", encoding="ascii", newline="\n") as text:
        text.write(head.format(count))
        for block in blocks:
            count += len(block["t"])
            rows = zip(*(block[name].tolist() for name in "txyp"), strict=True)
            text.writelines(
                f"{t // 10**6}.{t % 10**6:06d} {x} {y} {p}\n" for t, x, y, p in rows
            )
        text.seek(0)
        text.write(head.format(count))


def read_lines(path: Path, order: str = "txyp") -> Content:
    """Read a text with a line per event, with spaces or commas between the numbers.

    Args:
        path: The file.
        order: Order of the columns, if no line names them.

    Raises:
        InputError: It is no such text, or has fewer events than its first line states.
    """
    size, count, line = None, None, ""
    with path.open(encoding="ascii", errors="replace") as file:
        for line in file:
            words = [str(word) for word in re.findall(r"\w+", line.lower())]
            named = "".join(COLUMN_NAMES.get(word, word) for word in words)
            if found := SIZE_LINE.fullmatch(line.strip()):
                size = int(found[1]), int(found[2])
                count = int(found[3]) if found[3] else None
            elif sorted(named) == sorted(TYPES):
                order = named
            elif line[0] not in "#%\n":
                break
            line = ""
        expected = (
            f"a complete text with {', '.join(order)} in each line, such as "
            f"{EXAMPLES.get(order[0], EXAMPLES['t'])}"
        )
        try:
            with warnings.catch_warnings():  # a text without events
                warnings.simplefilter("ignore", UserWarning)
                separator = "," if "," in line else None
                lines = chain([line], file)
                rows = np.loadtxt(lines, np.float64, ndmin=2, delimiter=separator)
        except ValueError as error:
            require(False, path, expected, f"another text ({error})")
            raise
    rows = rows if rows.size else rows.reshape(-1, 4)
    require(rows.shape[1] == 4, path, expected, f"{rows.shape[1]} numbers")
    got = f"{len(rows):,} of {count or 0:,} events"
    require(count in (None, len(rows)), path, expected, got)
    columns: dict[str, np.ndarray] = dict(zip(order, rows.T, strict=True))
    ours, t = count is not None, columns["t"]
    if ours:
        columns["t"] = np.rint(1e6 * t)
    elif "." not in line and (t == np.rint(t)).all():
        columns["t"] = t.astype(np.int64)
    return Content(columns, size, in_us=ours)
