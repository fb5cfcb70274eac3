"""Files that are written whole or not at all.

The content is written to a temporary file in the same folder, which is renamed when it
is complete. A reader, also after a crash, finds the old content or the new one, never a
part. All files of jblast are written by this module.
"""

import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from jblast.errors import InputError, argument

NAMED_AFTER = 40
"""Characters of a file's name at the start of a temporary one: names have limits."""


@contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = True) -> Iterator[Path]:
    """Give the path of an empty file, which replaces a file unless an error occurs.

    A link remains, and its target is replaced. A new file has the permissions that the
    umask grants; an existing file keeps its own. Devices, pipes and files in a folder
    without write permission cannot be replaced and are written in place.

    Args:
        path: The file. Its folder must exist.
        durable: Whether to wait until the content is on the disk before the file is
            renamed, so that a power failure, too, leaves the old content or the new
            one. It takes milliseconds a file: unsuitable for hundreds of files that
            can be computed again.

    Raises:
        OSError: The file cannot be written; its old content is unchanged, unless it is
            written in place.
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
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
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
        OSError: Links form a circle, or a part of the path is not a folder.
    """
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return None


def _is_replaceable(target: Path, mode: int) -> bool:
    """Return whether another file may take the place of one that is there.

    A file without write permission is opened itself, for the system's error message.
    """
    folder = os.access(target.parent, os.W_OK | os.X_OK)
    return stat.S_ISREG(mode) and folder and os.access(target, os.W_OK)


def _created(target: Path) -> Path:
    """Return a new hidden file next to another, with a unique name."""
    while True:
        name = f".{target.name[:NAMED_AFTER]}.{os.urandom(4).hex()}.part"
        temporary = target.with_name(name)
        try:
            temporary.touch(exist_ok=False)
        except FileExistsError:
            continue
        return temporary


def refuse_existing(path: str | os.PathLike[str], *, force: bool) -> None:
    """Raise InputError if a file is there already and may not be overwritten."""
    if Path(path).exists() and not force:
        raise InputError(
            f"{path}: exists already; expected a new file, or {argument('force')} to "
            "overwrite it"
        )


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Report in one line that a file or directory cannot be written, if it cannot.

    Raises:
        InputError: The enclosed code raises an OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"{path}: cannot be written ({reason}); expected a place to write to"
        ) from None


def save_text(text: str, path: str | os.PathLike[str]) -> None:
    """Write text.

    Raises:
        InputError: It cannot be written.
    """
    with writing(path):
        write_text(path, text)


def check_log_paths(paths: Iterable[str | os.PathLike[str]]) -> None:
    """Refuse scenes given as logs, and folders, which need a table of stations.

    Raises:
        InputError: A path is one of these.
    """
    for path in paths:
        if Path(path).suffix.lower() == ".toml":
            raise InputError(
                f"{path}: expected a log; a scene stands after {argument('scene')}"
            )
        if Path(path).is_dir():
            raise InputError(
                f"{path}: is a folder; of records it takes {argument('positions')} "
                "STATIONS.csv beside it, where they stood"
            )
