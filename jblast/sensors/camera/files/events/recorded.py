"""What a file of events holds, and whether it can be so."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64, UInt8, UInt16

from jblast.errors import InputError, argument

TYPES = {"x": np.uint16, "y": np.uint16, "t": np.int64, "p": np.uint8}
"""Columns of a file."""

Columns = dict[str, np.ndarray]


class RecordedEvents(NamedTuple):
    """Events in order of time.

    Attributes:
        x: Column.
        y: Row, downwards.
        t: Whole microseconds, on the file's clock.
        p: 1 brighter, 0 darker.
        width: Pixels of a row.
        height: Rows.
        t_offset: What the file says is to be added to its times [us].
    """

    x: UInt16[np.ndarray, " event"]
    y: UInt16[np.ndarray, " event"]
    t: Int64[np.ndarray, " event"]
    p: UInt8[np.ndarray, " event"]
    width: int
    height: int
    t_offset: int = 0


def recorded(
    path: str | Path,
    columns: Columns,
    size: tuple[int, int] | None,
    t_offset: int = 0,
) -> RecordedEvents:
    """Return the events of a file's columns, if they can be events.

    Args:
        path: The file, for messages.
        columns: x, y, t and p, of whole numbers; p may be 1 and -1, too.
        size: Width and height; None if the file tells neither.
        t_offset: As in the answer.

    Raises:
        InputError: The columns differ in length, a place is outside the image, times
            fall, or the size is unknown.
    """
    if size is None:
        raise InputError(
            f"{path}: expected the width and height of the image, which this file does "
            f"not tell; say them ({argument('size')})"
        )
    lengths = {name: len(columns[name]) for name in TYPES}
    if len({*lengths.values()}) > 1:
        counts = ", ".join(f"{number:,} of {name}" for name, number in lengths.items())
        raise InputError(f"{path}: expected as many of each column, got {counts}")
    for name in TYPES:
        if columns[name].dtype.kind not in "iub":
            raise InputError(
                f"{path}: {name}: expected whole numbers, got {columns[name].dtype}"
            )
    for name, limit in zip("xy", size, strict=True):
        check_place(path, name, columns[name], limit)
    check_rising(path, columns["t"])
    p = columns["p"]
    if p.dtype.kind == "i":
        p = np.where(p == -1, 0, p)
    if len(p) and not ((p == 0) | (p == 1)).all():
        other = p[(p != 0) & (p != 1)][0]
        raise InputError(f"{path}: p: expected 1 for brighter and 0, got {other}")
    values = {**columns, "p": p}
    arrays = {name: values[name].astype(kind) for name, kind in TYPES.items()}
    return RecordedEvents(**arrays, width=size[0], height=size[1], t_offset=t_offset)


def check_place(path: str | Path, name: str, values: np.ndarray, limit: int) -> None:
    """Refuse columns or rows outside the image.

    Raises:
        InputError: There is one.
    """
    if len(values) and not 0 <= values.min() <= values.max() < limit:
        wrong = int(np.flatnonzero((values < 0) | (values >= limit))[0])
        raise InputError(
            f"{path}: {name} of event {wrong}: expected 0 to {limit - 1}, as the image "
            f"has, got {values[wrong]}"
        )


def check_rising(path: str | Path, t: np.ndarray, before: int | None = None) -> None:
    """Refuse times that fall; those of several events may be the same.

    Args:
        path: The file, for the message.
        t: Times [us].
        before: That of the event before these.

    Raises:
        InputError: One is before the one that precedes it.
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
