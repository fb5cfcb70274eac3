"""What the header of a WAV file promises: a decoder reads what is there and is silent.

A recording that was cut short would otherwise pass for a shorter one.
"""

import struct
from pathlib import Path
from typing import BinaryIO

STREAMED = 0xFFFFFFFF
"""Size that says "until the end": written by what could not seek back, and in RF64,
where the chunk `ds64` holds the true one."""


def missing_bytes(path: Path) -> int:
    """Return how many bytes, at least, a WAV file promises and does not hold.

    Args:
        path: A file that begins as RIFF or RF64.

    References:
        Multimedia Programming Interface and Data Specifications 1.0 (IBM, Microsoft,
        1991); EBU Tech 3306 for RF64.
    """
    there = path.stat().st_size
    with path.open("rb") as file:
        file.seek(12)
        long_size = STREAMED
        while len(head := file.read(8)) == 8:
            name, size = struct.unpack("<4sI", head)
            if name == b"ds64":
                long_size = _data_size(file)
                file.seek(size - 16, 1)
                continue
            if name == b"data":
                size = long_size if size == STREAMED else size
                promised = 0 if size == STREAMED else file.tell() + size
                return max(promised - there, 0)
            file.seek(size + size % 2, 1)  # chunks begin at even places
    return 8 - len(head)  # not even the head of the samples


def _data_size(file: BinaryIO) -> int:
    """Return the size of the samples that a chunk `ds64` tells, read up to there."""
    _, size = struct.unpack("<QQ", file.read(16))
    return size
