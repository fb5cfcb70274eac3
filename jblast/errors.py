"""Errors in input: one message with the place, what was expected and what was found."""

import difflib
import os
import re
import warnings
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

MARK = "\0"
"""Stands on both sides of an argument's name; no text that is read may hold it."""
_CONTROLS = {chr(code) for code in (*range(32), 127)} - {"\t", "\n", "\r"}


class InputError(ValueError):
    """Input cannot be used; the message is one line and complete in itself.

    Arguments appear in it by their names in Python (see `argument`).
    """

    def __init__(self, message: str):
        self._marked = " ".join(message.split())
        super().__init__(self._marked.replace(MARK, ""))

    def worded(self, option: Callable[[str], str]) -> str:
        """Return the message with other names of its arguments, as those of options."""
        parts = self._marked.split(MARK)
        return "".join(option(p) if i % 2 else p for i, p in enumerate(parts))


def argument(name: str) -> str:
    """Mark an argument in a message, as the command line has another name for it."""
    return f"{MARK}{name}{MARK}"


def shown(value: Any, width: int = 60) -> str:
    """Return a value as text, short enough for a message."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # integers of thousands of digits; nesting
        text = f"a very long {type(value).__name__}"
    return text if len(text) <= width else text[: width - 4] + " ..."


def whole_number(text: str) -> int | None:
    """Return the number that 1 to 18 digits state, zeros in front aside; else None.

    `str.isdigit` also accepts digits that `int` refuses ("²") or reads as others ("٣"),
    and `int` refuses thousands of digits. 18 digits fit into 64 bits.
    """
    return int(text) if re.fullmatch("0{0,64}[0-9]{1,18}", text) else None


def nearest(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" for a misspelt name, or "" if none is close."""
    close = closest(name, known)
    return f"; did you mean {close}?" if close else ""


def closest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that a misspelt one is closest to; None if none is."""
    by_lower = {word.lower(): word for word in known}
    close = difflib.get_close_matches(name[:80].lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[close[0]] if close else None


def needed(module: str, extra: str, path: str | Path, what: str) -> ModuleType:
    """Import a package that serves one format, an extra of ours.

    Args:
        module: Its name.
        extra: The extra of jblast that installs it.
        path: The file that is to be read or written.
        what: The format, and what is done with it: "TDMS is read".

    Raises:
        InputError: It is not installed.
    """
    try:
        with warnings.catch_warnings():  # of the package itself, not of our calls
            warnings.simplefilter("ignore", DeprecationWarning)
            return import_module(module)
    except ImportError:
        raise InputError(
            f"{path}: {what} by the package {module.partition('.')[0]}, which "
            f"is not installed; pip install 'jblast[{extra}]'"
        ) from None


def read_text(path: str | os.PathLike[str], expected: str) -> str:
    r"""Return the text of a file, its line ends made `\n`, without byte order mark.

    Args:
        path: The file.
        expected: What the file should be, for the messages: "a CSV file".

    Raises:
        InputError: There is no such file, it cannot be read, or is no UTF-8 text.
    """
    return decoded(read_bytes(path, expected), path, expected)


def read_bytes(path: str | os.PathLike[str], expected: str) -> bytes:
    """Return the content of a file.

    Raises:
        InputError: There is no such file, or it cannot be read.
    """
    try:
        return Path(path).read_bytes()
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
    *,
    utf16: bool = False,
) -> str:
    r"""Return bytes as text, line ends made `\n`, without byte order mark.

    Args:
        data: UTF-8, marked or not.
        path: Where they come from, for the messages.
        expected: What they should be, for the messages.
        utf16: Whether UTF-16 with its mark is accepted, too.

    Raises:
        InputError: They are not such a text.
    """
    if utf16 and data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeError as error:
            raise InputError(f"{path}: expected UTF-16 text, got {error}") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(
            f"{path}: line 1: expected UTF-8 text, got UTF-16; save it as UTF-8"
        )
    if data.startswith(b"PK\x03\x04"):
        raise InputError(
            f"{path}: line 1: expected {expected}, got a zip archive "
            "(a spreadsheet's workbook?); export it as plain text"
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        start = error.start + (len(data) - len(error.object))  # past the mark
        line = data.count(b"\n", 0, start) + 1
        raise InputError(
            f"{path}: line {line}: expected UTF-8 text, got the byte "
            f"0x{data[start]:02x}; save the file as UTF-8"
        ) from None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    controls = sorted(set(text) & _CONTROLS)
    if controls:
        at = min(text.index(control) for control in controls)
        wide = text[at] == "\0" and text.count("\0") * 3 > len(text)
        raise InputError(
            f"{path}: line {text.count(chr(10), 0, at) + 1}: expected {expected}, "
            f"got the control character 0x{ord(text[at]):02x}; is this "
            + (
                "UTF-16 without its mark? Save it as UTF-8"
                if wide
                else "a binary file?"
            )
        )
    return text
