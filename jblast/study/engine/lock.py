"""One process writes a store; who comes second is told so."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from jblast.errors import InputError

NAME = ".lock"


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a store; the lock goes with the process, however that ends.

    Raises:
        InputError: Another process holds it.
        OSError: The folder cannot be written to.
    """
    try:
        import fcntl
    except ImportError:  # a system without such locks: two write the same numbers
        yield
        return
    path.mkdir(parents=True, exist_ok=True)
    file = os.open(path / NAME, os.O_CREAT | os.O_RDWR)  # goes when the process does
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{path}: another process writes this study; expected one alone"
            ) from None
        except OSError as error:  # a file system without locks
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP):
                raise
        yield
    finally:
        os.close(file)
