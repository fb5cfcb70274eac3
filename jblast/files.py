"""Files that are written whole or not at all.

What is written goes into a file of its own beside the one it is for, and takes its name
when it is complete: who reads, and who comes after a crash, finds the old content or
the new one, never a part. Everything jblast writes goes through here.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NAMED_AFTER = 40
"""Characters of a file's name that a temporary one begins with: names have limits."""


@contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = True) -> Iterator[Path]:
    """Give the path of an empty file; it takes a file's place if nothing goes wrong.

    A link stays one, and what it points to is replaced. A new file has the permissions
    that the umask grants, one that was there keeps its own. What cannot be replaced is
    written in place: a device, a pipe, a file in a folder that takes no new ones.

    Args:
        path: What to write. Its folder has to be there.
        durable: Whether to wait until the content is on the disk before it takes the
            name, so that a loss of power, too, leaves the old content or the new one.
            It takes milliseconds a file: not for what comes by the hundred and can be
            made again.

    Raises:
        OSError: It cannot be written; what was there before is as it was, unless it
            is written in place.
    """
    target = Path(os.path.realpath(path))
    mode = _mode(Path(path))
    if mode is not None and not _is_replaceable(target, mode):
        yield Path(path)  # as it is called: what a pipe's link names is no path
        return
    temporary = _created(target)
    try:
        if mode is not None:
            temporary.chmod(stat.S_IMODE(mode))
        yield temporary
        if durable:
            _flush(temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(
    path: str | os.PathLike[str], data: bytes, *, durable: bool = True
) -> None:
    """Write a file whole or not at all; arguments and errors of `replacing`."""
    with replacing(path, durable=durable) as temporary:
        temporary.write_bytes(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    r"""Write text as UTF-8, lines ending in `\n`, whole or not at all."""
    write_bytes(path, text.encode())


def _mode(path: Path) -> int | None:
    """Return type and permissions of a file; None if there is none.

    Raises:
        OSError: Links go in a circle, or what should be a folder is none.
    """
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return None


def _is_replaceable(target: Path, mode: int) -> bool:
    """Return whether another file may take the place of one that is there.

    One that must not be written to is opened as it stands, which says why.
    """
    folder = os.access(target.parent, os.W_OK | os.X_OK)
    return stat.S_ISREG(mode) and folder and os.access(target, os.W_OK)


def _created(target: Path) -> Path:
    """Return a new file beside another, hidden and of a name that nobody else has."""
    while True:
        name = f".{target.name[:NAMED_AFTER]}.{os.urandom(4).hex()}.part"
        temporary = target.with_name(name)
        try:
            temporary.touch(exist_ok=False)
        except FileExistsError:
            continue
        return temporary


def _flush(path: Path) -> None:
    """Wait until a file's content is on the disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
