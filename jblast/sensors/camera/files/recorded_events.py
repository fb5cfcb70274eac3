"""Columns of recorded events, and their files in npz and HDF5.

HDF5 has the layout of DSEC. `events/{x, y, t, p}`: column, row, whole microseconds from
frame 0, 1 for brighter and 0 for darker. `t_offset` is 0. `ms_to_idx[i]` is the first
event at or after millisecond i, to the end of the film: DSEC's slicer looks up the
milliseconds in which a window begins and by which it ends, and returns None where there
is no entry. An npz file has the same columns as NumPy arrays.

References:
    Gehrig, Aarents, Gehrig and Scaramuzza (2021), DSEC: a stereo event camera dataset
    for driving scenarios; its description of the data format, and its `eventslicer.py`.
"""

import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Int64, UInt8, UInt16

from jblast.errors import InputError, argument

TYPES = {"x": np.uint16, "y": np.uint16, "t": np.int64, "p": np.uint8}
"""Columns of a file, with their types."""
Columns = dict[str, np.ndarray]
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
            f"not contain; add {argument('size')}"
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
    # some writers code darker as -1
    if p.dtype.kind == "i":
        p = np.where(p == -1, 0, p)
    if len(p) and not ((p == 0) | (p == 1)).all():
        other = p[(p != 0) & (p != 1)][0]
        raise InputError(
            f"{path}: p: expected 1 for brighter, 0 for darker, got {other}"
        )
    values = {**columns, "p": p}
    arrays = {name: values[name].astype(kind) for name, kind in TYPES.items()}
    return RecordedEvents(**arrays, width=size[0], height=size[1], t_offset=t_offset)


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
        InputError: It is no npz file, or has other columns.
    """
    try:
        # opened here: NumPy leaves a path open if reading fails
        with path.open("rb") as held, np.load(held, allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile) or not {*TYPES} <= {*file}:
                got = ", ".join(file) if hasattr(file, "files") else "one array"
                raise InputError(f"{path}: expected arrays x, y, t and p, got {got}")
            columns = {name: np.atleast_1d(file[name]) for name in TYPES}
            offset = int(file["t_offset"]) if "t_offset" in file else 0
            if {"width", "height"} <= {*file}:
                size = int(file["width"]), int(file["height"])
    except (OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise _broken(path, str(error)) from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise _broken(path, str(error)) from None
    return recorded(path, columns, size, offset)


def _broken(path: Path, why: str) -> InputError:
    return InputError(
        f"{path}: expected a complete npz file of events, which cannot be read ({why})"
    )


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


def read_dsec(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read an HDF5 file of events; DSEC's own do not contain their size.

    Raises:
        InputError: It is no HDF5 file, or has another layout.
    """
    import h5py

    try:
        with h5py.File(path) as file:
            held = file.get("events")
            if not isinstance(held, h5py.Group) or not {*TYPES} <= {*held}:
                raise InputError(
                    f"{path}: expected events/x, y, t and p, as in DSEC, got "
                    f"{', '.join(file) or 'nothing'}"
                )
            columns = {name: np.asarray(held[name]) for name in TYPES}
            offset = _whole(file["t_offset"]) if "t_offset" in file else 0
            if {"width", "height"} <= {*held.attrs}:
                size = _whole(held.attrs["width"]), _whole(held.attrs["height"])
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"{path}: expected a complete HDF5 file of events, which cannot be read "
            f"({error})"
        ) from None
    return recorded(path, columns, size, offset)


def _whole(value: Any) -> int:
    return int(np.asarray(value).item())
