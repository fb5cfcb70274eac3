"""Event files in the format of their suffix: read whole, written block by block.

A file is written completely or not at all. Only npz is assembled in memory.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.errors import read_bytes, reading, require
from jblast.files import replacing
from jblast.registry import Registry
from jblast.sensors.camera.files import aedat4, event_tables, evt3
from jblast.sensors.camera.files.recorded_events import (
    Columns,
    Content,
    NewFile,
    RecordedEvents,
    checked,
    recorded,
)
from jblast.sensors.camera.pixel import Events


class EventFormat(NamedTuple):
    """A format of event files.

    Attributes:
        name: Suffix of its files.
        read: Reader of a file as it is; the checks follow.
        write: Writer of columns, block by block, to an empty file; None for a format
            that is only read.
        largest: Largest number of columns or rows [px].
    """

    name: str
    read: Callable[[Path], Content]
    write: Callable[[NewFile, Iterable[Columns]], None] | None = None
    largest: int = 1 << 16


EVENT_FORMATS = Registry[EventFormat](
    "format of events",
    EventFormat(".h5", event_tables.read_hdf5, event_tables.write_dsec),
    EventFormat(".hdf5", event_tables.read_hdf5, event_tables.write_dsec),
    EventFormat(".npz", event_tables.read_npz, event_tables.write_npz),
    EventFormat(".raw", evt3.read_raw, evt3.write_evt3, evt3.MAX_SIDE),
    EventFormat(".aedat4", aedat4.read_aedat4, aedat4.write_aedat4, aedat4.MAX_SIDE),
    EventFormat(".txt", event_tables.read_lines, event_tables.write_text),
    EventFormat(".csv", partial(event_tables.read_lines, order="xypt")),
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
    expected = f"a complete {suffix} file of events"
    require(read_bytes(path, expected, 1), path, expected, "an empty file")
    with reading(path, expected):
        return recorded(path, EVENT_FORMATS[suffix].read(path), size)


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
    require(
        max(width, height) <= form.largest,
        path,
        f"images of at most {form.largest:,} pixels per side, the limit of this format",
        f"{width} x {height}",
    )
    last_ms = math.ceil(1e3 * duration_s - 1e-6)  # 8 ms, not 8.0000000001
    counts = [0, 0]
    columns = _counted(path, blocks, (width, height), counts)
    with replacing(path) as temporary:
        form.write(NewFile(temporary, width, height, last_ms), columns)
    brighter, darker = counts
    return Written(brighter + darker, brighter, darker)


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
    expected = f"a name ending in {', '.join(known[:-1])} or {known[-1]}"
    require(suffix in known, path, expected, suffix or "no suffix")
    return suffix


def _counted(
    path: str | Path, blocks: Iterable[Events], size: tuple[int, int], counts: list[int]
) -> Iterator[Columns]:
    """Yield the columns of each non-empty block, checked; count brighter and darker."""
    last = 0
    for block in blocks:
        count = int(block.count)
        if not count:
            continue
        fields = {"x": block.x, "y": block.y, "t": block.time, "p": block.polarity}
        columns = {name: np.asarray(field)[:count] for name, field in fields.items()}
        # all formats have whole microseconds
        columns["t"] = np.rint(1e6 * columns["t"]).astype(np.int64)
        columns["p"] = columns["p"] > 0
        columns = checked(path, columns, size, last)
        last = int(columns["t"][-1])
        brighter = int(columns["p"].sum())
        counts[0] += brighter
        counts[1] += count - brighter
        yield columns
