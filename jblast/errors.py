"""Input errors: messages with the location, the expected and the actual input."""

import difflib
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

MARK = "\0"
"""Delimiter of argument names in messages; `decoded` rejects it in input text."""
CONTROLS = r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]"
"""Characters that no text has: all controls but tabs and line ends."""
MARKS = {
    b"\xff\xfe": "UTF-16; save it as UTF-8",
    b"\xfe\xff": "UTF-16; save it as UTF-8",
    b"PK\x03\x04": "a zip archive (a spreadsheet's workbook?); export it as plain text",
}
"""First bytes of files that are no text, and what they are."""


class InputError(ValueError):
    """Invalid input; the message is one self-contained line.

    Arguments appear under their Python names (see `argument`).

    Attributes:
        row: Row of the table that it concerns, from zero; None for all of it.
        line: Line of that row in its file.
    """

    def __init__(
        self, message: str, *, row: int | None = None, line: int | None = None
    ):
        self.row, self.line = row, line
        # One line, as scripts and logs expect; file names may have line breaks.
        self._marked = " ".join(message.split())
        super().__init__(self._marked.replace(MARK, ""))

    def worded(self, option: Callable[[str], str]) -> str:
        """Return the message with arguments renamed, for example to options."""
        parts = self._marked.split(MARK)
        return "".join(option(p) if i % 2 else p for i, p in enumerate(parts))


def require(
    condition: Any, where: str | os.PathLike[str], expected: str, got: Any = ""
) -> None:
    """Reject input unless a condition is satisfied.

    Args:
        condition: Condition of valid input.
        where: File, table, key or argument, as in "scene.toml: [camera] hfov_deg".
        expected: Expected input, in words.
        got: Actual input; text is printed as it is, other values as `shown`.

    Raises:
        InputError: "WHERE: expected EXPECTED, got GOT".
    """
    if condition:
        return
    actual = got if isinstance(got, str) else shown(got)
    raise InputError(f"{where}: expected {expected}{actual and f', got {actual}'}")


def argument(name: str) -> str:
    """Mark an argument in a message, so that the command line can rename it."""
    return f"{MARK}{name}{MARK}"


def shown(value: Any, width: int = 60) -> str:
    """Return a value as text, short enough for a message."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # integers of thousands of digits; nesting
        text = f"a very long {type(value).__name__}"
    return text if len(text) <= width else text[: width - 4] + " ..."


def foreign_digits(text: str) -> bool:
    """Return whether a text has digits other than 0 to 9, which `float` reads too."""
    return not text.isascii() and re.search("(?![0-9])\\d", text) is not None


def whole_number(text: str) -> int | None:
    """Return the number of 1 to 18 digits after leading zeros; else None.

    18 digits fit into 64 bits.
    """
    # `str.isdigit` also accepts "²", which `int` rejects, and "٣", which it converts,
    # and `int` rejects thousands of digits with an error of its own.
    return int(text) if re.fullmatch("0{0,64}[0-9]{1,18}", text) else None


def nearest(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" for a misspelt name, or "" if none is close."""
    close = closest(name, known)
    return f"; did you mean {close}?" if close else ""


def closest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name closest to a misspelt one; None if none is close."""
    by_lower = {word.lower(): word for word in known}
    # 80 characters bound the quadratic cost; 0.6 is the default similarity of difflib.
    close = difflib.get_close_matches(name[:80].lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[close[0]] if close else None


def needed(module: str, extra: str, path: str | Path, what: str) -> ModuleType:
    """Import an optional package for one format.

    Args:
        module: Name of the module.
        extra: The extra of jblast that installs it.
        path: The file to read or write.
        what: Format and operation: "TDMS is read".

    Raises:
        InputError: It is not installed.
    """
    try:
        with warnings.catch_warnings():  # warnings of the package itself at import
            warnings.simplefilter("ignore", DeprecationWarning)
            return import_module(module)
    except ImportError:
        raise InputError(
            f"{path}: {what} by the package {module.partition('.')[0]}, which "
            f"is not installed; pip install 'jblast[{extra}]'"
        ) from None


FREE_BYTES, MAX_RATIO = 1 << 25, 100
"""A file may declare 32 MiB of numbers, and as many times its size. Events and samples
compress to a third or a tenth; a constant compresses to a thousandth, and a damaged or
forged header declares any number."""


def check_declared(path: str | os.PathLike[str], octets: int) -> None:
    """Reject a file that declares far more numbers than it can contain.

    Args:
        path: The file.
        octets: Declared size of its numbers in memory [bytes].

    Raises:
        InputError: It exceeds `FREE_BYTES` and `MAX_RATIO` times the size of the file.
    """
    size = os.stat(path).st_size
    if not 0 <= octets <= FREE_BYTES + MAX_RATIO * size:
        raise InputError(
            f"{path}: expected a complete file, got one of {size:,} bytes that "
            f"declares {octets:,} bytes of numbers; write it again"
        )


@contextmanager
def reading(path: str | os.PathLike[str], expected: str) -> Iterator[None]:
    """Convert the exceptions of a format's library to an `InputError`.

    Libraries raise exceptions of many types for damaged files, also `KeyError`,
    `struct.error` and `MemoryError`.

    Args:
        path: The file.
        expected: Expected kind of file: "a complete HDF5 file of events".

    Raises:
        InputError: The file cannot be read.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        why = " ".join(str(error).split()) or "no reason given"
        why = why if len(why) <= 200 else f"{why[:196]} ..."
        raise InputError(
            f"{path}: expected {expected}, which cannot be read "
            f"({type(error).__name__}: {why})"
        ) from error


CHILD_S, CHILD_BYTES = 8, 1 << 29
"""Processor time and memory of a process that reads a file, beside those by the file's
size. The import of SciPy's reader takes 0.7 s."""
LIMITS = """
import sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)
except (ImportError, ValueError, OSError):
    pass
"""


def child_output(
    path: str | os.PathLike[str], program: str, library: str, expected: str
) -> bytes:
    """Return the output of a program that reads a file by a library.

    For damaged files some libraries end the process or never return. The program is
    therefore a process of its own, with limits of time and memory.

    Args:
        path: The file.
        program: Python source; the file is `sys.argv[1]`.
        library: Name of the library, for the message.
        expected: Expected kind of file: "a complete .mat file".

    Raises:
        InputError: The program fails, or exceeds a limit.
    """
    # imported here: it would delay every command
    import subprocess

    octets = os.stat(path).st_size
    # a reader of less than 10 MB/s is taken for one that never ends
    limit_s = CHILD_S + octets // 10**7
    limits = str(CHILD_BYTES + MAX_RATIO * octets), str(limit_s)
    # each thread of OpenBLAS reserves memory, on large machines more than the limit
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            [sys.executable, "-c", LIMITS + program, os.fspath(path), *limits],
            capture_output=True,
            timeout=4 * limit_s,  # it may wait for other processes
            check=False,
            env=one_thread,
        )
    except subprocess.TimeoutExpired:
        why = f"no end after {4 * limit_s} s"
    else:
        if not done.returncode:
            return done.stdout
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        why = lines[-1] if lines else f"exit code {done.returncode}"
    raise InputError(
        f"{path}: expected {expected}, which {library} cannot read ({why[:200]})"
    )


def read_text(path: str | os.PathLike[str], expected: str) -> str:
    r"""Return the text of a file with line ends `\n`, without byte order mark.

    Args:
        path: The file.
        expected: Expected kind of file, for messages: "a CSV file".

    Raises:
        InputError: The file is missing, cannot be read, or is not UTF-8 text.
    """
    return decoded(read_bytes(path, expected), path, expected)


def read_bytes(path: str | os.PathLike[str], expected: str, octets: int = -1) -> bytes:
    """Return the content of a file, or its first bytes.

    Raises:
        InputError: The file is missing or cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(octets)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected {expected}") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; expected {expected}") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"{os.fspath(path)!r}: cannot be read ({reason}); expected {expected}"
        ) from None


def decoded(
    data: bytes,
    path: str | os.PathLike[str],
    expected: str,
) -> str:
    r"""Return bytes as text with line ends `\n`, without byte order mark.

    Args:
        data: UTF-8 with or without a byte order mark.
        path: File of the bytes, for messages.
        expected: Expected kind of file, for messages.

    Raises:
        InputError: The bytes are not text in this encoding.
    """
    for mark, found in MARKS.items():
        if data.startswith(mark):
            raise InputError(f"{path}: line 1: expected {expected}, got {found}")
    try:
        # With or without the mark, which spreadsheets write.
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        start = error.start + (len(data) - len(error.object))  # after the mark
        line = data.count(b"\n", 0, start) + 1
        raise InputError(
            f"{path}: line {line}: expected UTF-8 text, got the byte "
            f"0x{data[start]:02x}; save the file as UTF-8"
        ) from None
    # Line numbers of messages must be those of an editor.
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if at := re.search(CONTROLS, text):
        raise InputError(
            f"{path}: line {text.count(chr(10), 0, at.start()) + 1}: expected "
            f"{expected}, got the control character 0x{ord(at[0]):02x}; is it a binary "
            "file, or UTF-16? Save it as UTF-8"
        )
    return text
