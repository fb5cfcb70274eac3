"""The same columns as NumPy arrays in an npz."""

import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from jblast.errors import InputError
from jblast.sensors.camera.files.events.recorded import (
    TYPES,
    Columns,
    RecordedEvents,
    recorded,
)


def write_arrays(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events, put together in memory.

    Args:
        path: An empty file.
        blocks: Columns of events.
        size: Width and height.
        last_ms: Of no use here.
    """
    del last_ms
    parts = [*blocks]
    values = {
        name: np.concatenate([np.zeros(0, dtype), *(part[name] for part in parts)])
        for name, dtype in TYPES.items()
    }
    width, height = size
    values |= {"width": np.asarray(width), "height": np.asarray(height)}
    with path.open("wb") as file:  # a name would be made to end in .npz
        values["t_offset"] = np.asarray(0)
        np.savez_compressed(file, allow_pickle=False, **values)


def read_arrays(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read such a file.

    Raises:
        InputError: It is no npz, or not of these columns.
    """
    try:
        # a path that breaks off would be left open
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
        f"{path}: expected a whole npz of events, which cannot be read ({why})"
    )
