"""HDF5 in the layout of DSEC.

`events/{x, y, t, p}`: column, row, whole microseconds from frame 0, 1 for brighter
and 0 for darker. `t_offset` is 0. `ms_to_idx[i]` is the first event at or after
millisecond i, to the end of the film: DSEC's slicer looks up the millisecond in which a
window begins and the one by which it ends, and gives None where there is no entry.

References:
    Gehrig, Aarents, Gehrig and Scaramuzza (2021), DSEC: a stereo event camera dataset
    for driving scenarios; its description of the data format, and its `eventslicer.py`.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.sensors.camera.files.events.recorded import (
    TYPES,
    Columns,
    RecordedEvents,
    recorded,
)

_PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


def write_dsec(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events block by block.

    Args:
        path: An empty file.
        blocks: Columns of events.
        size: Width and height.
        last_ms: Until when `ms_to_idx` goes at least.
    """
    import h5py

    count = 0
    each_ms = np.zeros(last_ms, np.int64)
    with h5py.File(path, "w") as file:
        group = file.create_group("events")
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
            here = np.bincount(block["t"] // 1000, minlength=len(each_ms))
            here[: len(each_ms)] += each_ms
            each_ms = here
        file["ms_to_idx"] = np.append(0, np.cumsum(each_ms)).astype(np.uint64)
        file["t_offset"] = np.int64(0)


def read_dsec(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read such a file; DSEC's own do not tell their size.

    Raises:
        InputError: It is no HDF5, or not of this layout.
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
            f"{path}: expected a whole HDF5 file of events, which cannot be read "
            f"({error})"
        ) from None
    return recorded(path, columns, size, offset)


def _whole(value: Any) -> int:
    return int(np.asarray(value).item())
