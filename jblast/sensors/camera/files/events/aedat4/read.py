"""AEDAT4 as columns of events, by dv-processing."""

from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, needed
from jblast.sensors.camera.files.events.recorded import (
    TYPES,
    RecordedEvents,
    recorded,
)

NAMES = {"x": "x", "y": "y", "t": "timestamp", "p": "polarity"}
"""What dv-processing calls the columns."""


def read_aedat4(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read the stream of events of such a file.

    Raises:
        InputError: dv-processing is not installed, or makes nothing of the file; it
            holds no events, or those of several cameras.
    """
    dv = needed("dv_processing", "aedat4", path, "AEDAT4 is read")
    _check_begin(path)
    try:
        file = dv.io.MonoCameraRecording(str(path))
        stream = _stream(path, file)
        size = file.getEventResolution(stream) or size
        parts = []
        while file.isRunning(stream):
            batch = file.getNextEventBatch(stream)
            if batch is not None:
                parts.append(batch.numpy())
    except IndexError:  # from dv-processing's own empty files, too
        raise InputError(
            f"{path}: expected an AEDAT4 file with packets of events, got none"
        ) from None
    except RuntimeError as error:
        raise InputError(
            f"{path}: expected a whole AEDAT4 file, which dv-processing cannot make "
            f"of it ({_reason(error)})"
        ) from None
    columns = {
        name: np.concatenate(
            [np.zeros(0, kind), *(part[NAMES[name]] for part in parts)]
        )
        for name, kind in TYPES.items()
    }
    return recorded(path, columns, size)


def _check_begin(path: Path) -> None:
    with path.open("rb") as file:
        begin = file.read(12)
    if begin != b"#!AER-DAT4.0":
        raise InputError(f"{path}: expected an AEDAT4 file, got none of that format")


def _stream(path: Path, file: Any) -> str:
    """Return the name of the one stream of events."""
    names = [name for name in file.getStreamNames() if file.isStreamOfEventType(name)]
    if len(names) != 1:
        raise InputError(
            f"{path}: expected one stream of events, got {len(names)} of "
            f"{', '.join(file.getStreamNames()) or 'nothing'}"
        )
    return names[0]


def _reason(error: RuntimeError) -> str:
    """Return what went wrong, without where in its source."""
    lines = str(error).splitlines()
    message = lines[1] if len(lines) > 1 else lines[0]
    return message.partition(" - Error info")[0]
