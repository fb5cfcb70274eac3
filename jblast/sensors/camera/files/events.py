"""Events as files: HDF5 in the layout of DSEC, or npz.

`events/{x, y, t, p}`: column, row, whole microseconds from frame 0, 1 for brighter
and 0 for darker. `t_offset` is 0. `ms_to_idx[i]` is the first event at or after
millisecond i, to the end of the film: DSEC's slicer looks up the millisecond in which a
window begins and the one by which it ends, and gives None where there is no entry.

References:
    Gehrig, Aarents, Gehrig and Scaramuzza (2021), DSEC: a stereo event camera dataset
    for driving scenarios; its description of the data format, and its `eventslicer.py`.
"""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.errors import InputError
from jblast.files import replacing
from jblast.sensors.camera.events.ideal import Events

TYPES = {"x": np.uint16, "y": np.uint16, "t": np.int64, "p": np.uint8}
LARGEST = 1 << 16
"""Columns or rows that have a number of 16 bits [px]."""

SUFFIXES = (".h5", ".hdf5", ".npz")


class Written(NamedTuple):
    """How many events went into a file, and their signs."""

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
    """Write a stream of events whole or not at all; the suffix says which format.

    HDF5 takes them block by block; an npz is put together in memory.

    Args:
        path: Ends in .h5, .hdf5 or .npz; an existing file is replaced.
        blocks: In order of time, which begins at frame 0.
        width: Pixels of a row.
        height: Rows.
        duration_s: Until when `ms_to_idx` goes at least: the time of the last frame.

    Raises:
        InputError: The suffix is another one, or the image is too large for the format.
    """
    suffix = check_suffix(path)
    if max(width, height) > LARGEST:
        raise InputError(
            f"{path}: expected images of at most {LARGEST:,} pixels a side, which this "
            f"format can hold; got {width} x {height}"
        )
    with replacing(path) as temporary:
        if suffix == ".npz":
            brighter, darker = _write_npz(temporary, blocks, width, height)
        else:
            last_ms = math.ceil(1e3 * duration_s - 1e-6)  # 8 ms, not 8.0000000001
            brighter, darker = _write_hdf5(temporary, blocks, width, height, last_ms)
    return Written(brighter + darker, brighter, darker)


def check_suffix(path: str | Path) -> str:
    """Return the suffix of a file of events.

    Raises:
        InputError: It is none that we write.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a name that ends in .h5, .hdf5 or .npz")
    return suffix


def _columns(events: Events) -> dict[str, np.ndarray]:
    """Return the events of a block as the columns of a file."""
    count = int(events.count)
    x, y, time, sign = (
        np.asarray(field)[:count]
        for field in (events.x, events.y, events.time, events.polarity)
    )
    values = {"x": x, "y": y, "t": np.rint(1e6 * time), "p": sign > 0}
    return {name: values[name].astype(dtype) for name, dtype in TYPES.items()}


def _write_hdf5(
    path: Path, blocks, width: int, height: int, last_ms: int
) -> tuple[int, int]:
    import h5py

    count = brighter = 0
    each_ms = np.zeros(last_ms, np.int64)
    with h5py.File(path, "w") as file:
        group = file.create_group("events")
        group.attrs.update({"width": width, "height": height})
        columns = {
            name: group.create_dataset(
                name, (0,), dtype, chunks=(1 << 16,), maxshape=(None,), **_PACKED
            )
            for name, dtype in TYPES.items()
        }
        for block in blocks:
            values = _columns(block)
            new = len(values["t"])
            if not new:
                continue
            for name, column in columns.items():
                column.resize((count + new,))
                column[count:] = values[name]
            count, brighter = count + new, brighter + int(values["p"].sum())
            here = np.bincount(values["t"] // 1000, minlength=len(each_ms))
            here[: len(each_ms)] += each_ms
            each_ms = here
        file["ms_to_idx"] = np.append(0, np.cumsum(each_ms)).astype(np.uint64)
        file["t_offset"] = np.int64(0)
    return brighter, count - brighter


_PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


def _write_npz(path: Path, blocks, width: int, height: int) -> tuple[int, int]:
    parts = [_columns(block) for block in blocks]
    values = {
        name: np.concatenate([np.zeros(0, dtype), *(part[name] for part in parts)])
        for name, dtype in TYPES.items()
    }
    size = {"width": np.asarray(width), "height": np.asarray(height)}
    values |= size | {"t_offset": np.asarray(0)}
    with path.open("wb") as file:  # a name would be made to end in .npz
        np.savez_compressed(file, allow_pickle=False, **values)
    brighter = int(values["p"].sum())
    return brighter, len(values["p"]) - brighter
