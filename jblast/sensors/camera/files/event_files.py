"""Event files in the format of their suffix: read whole, written block by block.

A file is written completely or not at all. Only npz is assembled in memory.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.errors import InputError, reading
from jblast.files import replacing
from jblast.registry import Registry
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.files import aedat4, evt3
from jblast.sensors.camera.files.recorded_events import (
    TYPES,
    Columns,
    RecordedEvents,
    check_place,
    check_rising,
    read_arrays,
    read_hdf5,
    read_lines,
    write_arrays,
    write_dsec,
    write_text,
)


class EventFormat(NamedTuple):
    """A format of event files.

    Attributes:
        name: Suffix of its files.
        read: Reader: path, and size for files that do not state it, to events.
        write: Writer: empty file, columns, width and height, last millisecond of an
            index; None for a format that is only read.
        largest: Largest number of columns or rows [px].
    """

    name: str
    read: Callable[[Path, tuple[int, int] | None], RecordedEvents]
    write: Callable[[Path, Iterable[Columns], tuple[int, int], int], None] | None = None
    largest: int = 1 << 16


EVENT_FORMATS = Registry[EventFormat](
    "format of events",
    EventFormat(".h5", read_hdf5, write_dsec),
    EventFormat(".hdf5", read_hdf5, write_dsec),
    EventFormat(".npz", read_arrays, write_arrays),
    EventFormat(".raw", evt3.read_raw, evt3.write_evt3, evt3.MAX_SIDE),
    EventFormat(".aedat4", aedat4.read_aedat4, aedat4.write_aedat4, aedat4.MAX_SIDE),
    EventFormat(".txt", read_lines, write_text),
    EventFormat(".csv", partial(read_lines, order="xypt")),
    EventFormat(".dat", evt3.read_dat),
)
"""Formats by the suffix of their files; `register` adds one from any module."""
register = EVENT_FORMATS.register


def read_events(
    path: str | Path, *, size: tuple[int, int] | None = None
) -> RecordedEvents:
    """Read an event file whole.

    Args:
        path: The file; its suffix is one of `EVENT_FORMATS`.
        size: Width and height, for a file that does not contain them.

    Raises:
        InputError: There is no such file, its suffix is unknown, the reader of its
            format is not installed, it is empty or incomplete, has no size, or contains
            falling times or pixels outside the image.
    """
    path = Path(path)
    suffix = check_suffix(path)
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; expected an event file")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; expected an event file")
    with reading(path, f"a complete {suffix} file of events"):
        return EVENT_FORMATS[suffix].read(path, size)


class Written(NamedTuple):
    """Numbers of events written to a file, by sign.

    Attributes:
        events: Number of all events.
        brighter: Number of events of increasing light.
        darker: Number of events of decreasing light.
    """

    events: int
    brighter: int
    darker: int


def write_events(
    path: str | Path,
    blocks: Iterable[Events],
    width: int,
    height: int,
    *,
    duration_s: float = 0.0,
) -> Written:
    """Write a stream of events completely or not at all, in the format of the suffix.

    All formats are written block by block except npz, which is assembled in memory.

    Args:
        path: Ends in one of `EVENT_FORMATS`; an existing file is replaced.
        blocks: Events in order of time, which begins at frame 0.
        width: Pixels of a row.
        height: Number of rows.
        duration_s: Minimum end of `ms_to_idx`: the time of the last frame.

    Raises:
        InputError: The suffix is unknown, the image is too large for the format, or an
            event is outside it, before the one that precedes it, or before 0.
    """
    form = EVENT_FORMATS[check_suffix(path, writing=True)]
    assert form.write is not None
    if max(width, height) > form.largest:
        raise InputError(
            f"{path}: expected images of at most {form.largest:,} pixels per side, the "
            f"limit of this format; got {width} x {height}"
        )
    last_ms = math.ceil(1e3 * duration_s - 1e-6)  # 8 ms, not 8.0000000001
    counts = {"events": 0, "brighter": 0}
    columns = _counted(path, blocks, (width, height), counts)
    with replacing(path) as temporary:
        form.write(temporary, columns, (width, height), last_ms)
    darker = counts["events"] - counts["brighter"]
    return Written(**counts, darker=darker)


def check_suffix(path: str | Path, *, writing: bool = False) -> str:
    """Return the suffix of an event file.

    Args:
        path: The file.
        writing: True to require a format that can be written.

    Raises:
        InputError: It is not a known one.
    """
    suffix = Path(path).suffix.lower()
    known = [one.name for one in EVENT_FORMATS.values() if one.write or not writing]
    if suffix not in known:
        raise InputError(
            f"{path}: expected a name ending in {', '.join(known[:-1])} or "
            f"{known[-1]}, got {suffix or 'no suffix'}"
        )
    return suffix


def _counted(
    path: str | Path,
    blocks: Iterable[Events],
    size: tuple[int, int],
    counts: dict[str, int],
) -> Iterator[Columns]:
    """Yield the columns of each non-empty block, checked and counted."""
    last = 0
    for block in blocks:
        columns = _columns(block)
        if not len(columns["t"]):
            continue
        for name, limit in zip("xy", size, strict=True):
            check_place(path, name, columns[name], limit)
        check_rising(path, columns["t"], last)
        last = int(columns["t"][-1])
        counts["events"] += len(columns["t"])
        counts["brighter"] += int(columns["p"].sum())
        yield {name: columns[name].astype(dtype) for name, dtype in TYPES.items()}


def _columns(events: Events) -> Columns:
    """Return the events of a block as columns, before conversion to a file's types."""
    count = int(events.count)
    x, y, time, sign = (
        np.asarray(field)[:count]
        for field in (events.x, events.y, events.time, events.polarity)
    )
    # all formats have whole microseconds
    t = np.rint(1e6 * time).astype(np.int64)
    return {"x": x, "y": y, "t": t, "p": sign > 0}
