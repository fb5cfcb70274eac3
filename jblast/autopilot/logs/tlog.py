"""A log of telemetry as ground stations keep it: a time, and a frame, one by one.

The time is that of MAVLink's tools: microseconds, eight bytes, the highest first.
"""

import struct
from pathlib import Path
from types import TracebackType

from jblast.errors import InputError


def stamped(time_s: float, frame: bytes) -> bytes:
    """Return a frame of a log with its time in front [s]."""
    return struct.pack(">Q", round(1e6 * time_s)) + frame


class TelemetryLog:
    """A log that is written as a flight goes on, so that what ends it leaves the rest.

    Args:
        path: The file; what it held is lost.

    Raises:
        InputError: It cannot be written.
    """

    def __init__(self, path: str | Path):
        self.now_s = 0.0
        try:
            self._file = Path(path).open("wb")  # noqa: SIM115 - closed by the context
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written: {error.strerror or error}"
            ) from None

    def keep(self, frame: bytes) -> None:
        """Write a frame at the time that it is now."""
        self._file.write(stamped(self.now_s, frame))

    def __enter__(self) -> "TelemetryLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()
