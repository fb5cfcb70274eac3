"""Atomic writing of files.

The content is written to a temporary file in the same folder, which is renamed when it
is complete. A reader, also after a crash, finds the old or the new content, never a
part. This module writes all files of jblast.
"""

import csv
import io
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jblast.errors import InputError, argument

Content = str | bytes | Callable[[Path], object]
"""Content of a file: text, bytes, or a function that writes to a path."""
PAGE = "report.html"
"""Page of an answer, in each output folder that has one."""
NAMED_AFTER = 40
"""Characters of a file's name in that of its temporary file: names have limits, often
255 bytes."""


@contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = True) -> Iterator[Path]:
    """Yield the path of an empty file that replaces a file unless an error occurs.

    A link remains, and its target is replaced. A new file has the permissions of the
    umask; an existing file retains its own. Devices, pipes and files in a folder
    without write permission cannot be replaced and are written in place.

    Args:
        path: The file. Its folder must exist.
        durable: Wait until the content is on the disk before renaming the file, so that
            it is atomic also in a power failure. This takes milliseconds per file:
            unsuitable for hundreds of files that can be recomputed.

    Raises:
        OSError: The file cannot be written; its old content is unchanged, unless it is
            written in place.
    """
    # The target of a link: renaming onto the link would replace the link.
    target = Path(os.path.realpath(path))
    try:  # of the link's target; a circle of links is an error here
        mode = Path(path).stat().st_mode
    except FileNotFoundError:
        mode = None
    if mode is not None and not (
        stat.S_ISREG(mode)
        and os.access(target.parent, os.W_OK | os.X_OK)
        # without write permission it is opened directly, for the system's message
        and os.access(target, os.W_OK)
    ):
        yield Path(path)  # not the target: the link of a pipe does not name a path
        return
    temporary = _created(target)
    try:
        if mode is not None:
            temporary.chmod(stat.S_IMODE(mode))
        yield temporary
        if durable:
            # Without `fsync` a power failure may leave an empty file under the new
            # name.
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(
    path: str | os.PathLike[str], data: bytes, *, durable: bool = True
) -> None:
    """Write a file atomically; arguments and errors as in `replacing`."""
    with replacing(path, durable=durable) as temporary:
        temporary.write_bytes(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    r"""Write text as UTF-8 with line ends `\n`, atomically."""
    write_bytes(path, text.encode())


def table_text(rows: Iterable[Iterable[Any]], comments: Iterable[str] = ()) -> str:
    """Return rows as CSV, after comments as lines that begin with "#".

    Args:
        rows: Cells; the first row has the names of the columns.
        comments: Comments, such as the provenance.
    """
    text = io.StringIO()
    # a line break in a comment would begin a row of the table
    text.writelines(f"# {' '.join(line.split())}\n" for line in comments)
    # the default of csv is CR LF on all systems
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _created(target: Path) -> Path:
    """Create and return a hidden file with a unique name next to another."""
    while True:
        # Hidden, and without the suffix of the file: no reader of a folder takes it.
        name = f".{target.name[:NAMED_AFTER]}.{os.urandom(4).hex()}.part"
        temporary = target.with_name(name)
        try:
            # Exclusive creation, so that two processes never share a temporary file.
            temporary.touch(exist_ok=False)
        except FileExistsError:
            continue
        return temporary


def refuse_existing(path: str | os.PathLike[str], *, force: bool) -> None:
    """Raise InputError if a file exists and may not be overwritten."""
    if Path(path).exists() and not force:
        raise InputError(
            f"{path}: exists already; expected a new file, or {argument('force')} to "
            "overwrite it"
        )


def check_out(
    directory: str | os.PathLike[str], names: Iterable[str], *, force: bool
) -> None:
    """Check before a computation that files can be written to a folder, and make it.

    Args:
        directory: Output folder.
        names: Names of the files to write, besides the page.
        force: Whether existing files may be overwritten.

    Raises:
        InputError: The folder is not writable, or has the page or one of the files.
    """
    with writing(directory):
        # made before the work: a missing permission would otherwise appear after it
        Path(directory).mkdir(parents=True, exist_ok=True)
    for name in (*names, PAGE):
        refuse_existing(Path(directory) / name, force=force)


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Convert an OSError in writing a file or directory to a message.

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


def save(path: str | os.PathLike[str], content: Content) -> None:
    """Write a file completely or not at all, and make its folder.

    Raises:
        InputError: The file cannot be written.
    """
    with writing(path):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, str | bytes):
            data = content.encode() if isinstance(content, str) else content
            write_bytes(path, data)
        else:
            with replacing(path) as temporary:
                content(temporary)


def check_log_paths(paths: Iterable[str | os.PathLike[str]]) -> None:
    """Reject scenes in place of logs, and folders, which need a table of stations.

    Raises:
        InputError: A path is one of these.
    """
    for path in paths:
        if Path(path).suffix.lower() == ".toml":
            raise InputError(
                f"{path}: expected a log, got a scene; pass it by {argument('scene')}"
            )
        if Path(path).is_dir():
            raise InputError(
                f"{path}: is a folder; for a folder of records also pass "
                f"{argument('positions')} STATIONS.csv with the sensor positions"
            )
