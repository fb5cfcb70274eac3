"""Files of events in the format of their suffix: read whole, written block by block.

A file is written whole or not at all. Only npz is assembled in memory.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.errors import InputError
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
    read_dsec,
    write_arrays,
    write_dsec,
)


class EventFormat(NamedTuple):
    """A format of files of camera events.

    Attributes:
        name: Suffix of its files.
        read: From a path and a size, which files without one need, to events.
        write: From an empty file, columns, width and height, and the last millisecond
            of an index.
        largest: Columns or rows that have a number in it [px].
    """

    name: str
    read: Callable[[Path, tuple[int, int] | None], RecordedEvents]
    write: Callable[[Path, Iterable[Columns], tuple[int, int], int], None]
    largest: int = 1 << 16


EVENT_FORMATS = Registry[EventFormat](
    "format of events",
    EventFormat(".h5", read_dsec, write_dsec),
    EventFormat(".hdf5", read_dsec, write_dsec),
    EventFormat(".npz", read_arrays, write_arrays),
    EventFormat(".raw", evt3.read_evt3, evt3.write_evt3, evt3.MAX_SIDE),
    EventFormat(".aedat4", aedat4.read_aedat4, aedat4.write_aedat4, aedat4.MAX_SIDE),
)
"""By the suffix of its files; `register` adds one from any module."""
register = EVENT_FORMATS.register


def read_events(
    path: str | Path, *, size: tuple[int, int] | None = None
) -> RecordedEvents:
    """Read a file of events whole.

    Args:
        path: Its suffix is one that `write_events` writes.
        size: Width and height, for a file that does not contain them.

    Raises:
        InputError: There is no such file, its suffix is another one, what reads its
            format is not installed, it is empty or not whole, has no size, or holds
            what cannot be: times that fall, places outside the image.
    """
    path = Path(path)
    suffix = check_suffix(path)
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; expected a file of events")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; expected a file of events")
    return EVENT_FORMATS[suffix].read(path, size)


class Written(NamedTuple):
    """Numbers of events written to a file, by sign.

    Attributes:
        events: How many there are.
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
    """Write a stream of events whole or not at all, in the format of the suffix.

    All take them block by block but npz, which is put together in memory.

    Args:
        path: Ends in one of `EVENT_FORMATS`; an existing file is replaced.
        blocks: In order of time, which begins at frame 0.
        width: Pixels of a row.
        height: Rows.
        duration_s: Until when `ms_to_idx` goes at least: the time of the last frame.

    Raises:
        InputError: The suffix is another one, the image is too large for the format,
            or an event is outside it, before the one that precedes it, or before 0.
    """
    suffix = check_suffix(path)
    form = EVENT_FORMATS[suffix]
    if max(width, height) > form.largest:
        raise InputError(
            f"{path}: expected images of at most {form.largest:,} pixels a side, "
            f"which this format can hold; got {width} x {height}"
        )
    last_ms = math.ceil(1e3 * duration_s - 1e-6)  # 8 ms, not 8.0000000001
    counts = {"events": 0, "brighter": 0}
    columns = _counted(path, blocks, (width, height), counts)
    with replacing(path) as temporary:
        form.write(temporary, columns, (width, height), last_ms)
    darker = counts["events"] - counts["brighter"]
    return Written(**counts, darker=darker)


def check_suffix(path: str | Path) -> str:
    """Return the suffix of a file of events.

    Raises:
        InputError: It is none that we write.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in EVENT_FORMATS:
        *some, last = EVENT_FORMATS
        raise InputError(
            f"{path}: expected a name that ends in {', '.join(some)} or {last}"
        )
    return suffix


def _counted(
    path: str | Path,
    blocks: Iterable[Events],
    size: tuple[int, int],
    counts: dict[str, int],
) -> Iterator[Columns]:
    """Return the columns of each block that holds some, looked at and counted."""
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
    """Return the events of a block as columns, not yet of a file's types."""
    count = int(events.count)
    x, y, time, sign = (
        np.asarray(field)[:count]
        for field in (events.x, events.y, events.time, events.polarity)
    )
    t = np.rint(1e6 * time).astype(np.int64)
    return {"x": x, "y": y, "t": t, "p": sign > 0}
