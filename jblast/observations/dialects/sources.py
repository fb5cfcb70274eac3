"""What a log may come as: a path, an open file, a buffer, a data frame."""

import os
from pathlib import PurePath
from typing import Any

from jblast.errors import InputError, decoded, read_bytes
from jblast.observations.dialects.table import Table
from jblast.observations.dialects.text import WITHIN, text_table
from jblast.observations.faults import Faults
from jblast.observations.formats import FRAME, PARQUET, TEXTS, WORKBOOKS

EXPECTED = "a CSV file of observations"
MOST_BYTES = 1_000_000_000
"""A log of this size has some twenty million rows, takes ten times that in memory."""
MARKS = {b"\xff\xfe": "UTF-16 (little-endian)", b"\xfe\xff": "UTF-16 (big-endian)"}
RECORDINGS = (
    *(".wav", ".flac", ".mseed", ".miniseed", ".sac", ".tdms"),
    *(".h5", ".hdf5", ".nc", ".mat"),
)
"""Endings of files that hold samples."""


def source_name(source: Any) -> str:
    """Return what a source is called in messages."""
    if isinstance(source, (str, os.PathLike)):
        return str(source)
    if _is_frame(source):
        return FRAME
    name = getattr(source, "name", None)
    return name if isinstance(name, str) and name else "buffer"


def table_of(
    source: Any,
    faults: Faults,
    *,
    strict: bool,
    expected: str = EXPECTED,
    within: str = WITHIN,
) -> Table:
    """Return what a source holds as a table.

    Args:
        source: A path, what has `read`, or a `pandas.DataFrame`.
        faults: Takes what the rest can be read without.
        strict: Whether to take UTF-8 text with commas alone.
        expected: What the file should be.
        within: What it should hold.

    Raises:
        InputError: It cannot be read, is no table, or too large.
    """
    name = source_name(source)
    if _is_frame(source):
        from jblast.observations.dialects.workbook import frame_table

        return frame_table(source)
    data = _data(source, name, expected)
    suffix = PurePath(name).suffix.lower()
    if isinstance(source, (str, os.PathLike)) and not strict:
        _refuse_ending(name, suffix)
    elif isinstance(data, bytes) and not strict:  # a buffer need not have a name
        suffix = suffix if suffix in (*WORKBOOKS, *PARQUET) else _looks_like(data)
        name = name if PurePath(name).suffix.lower() == suffix else f"{name}{suffix}"
    if isinstance(data, bytes) and not strict:
        if suffix in WORKBOOKS:
            from jblast.observations.dialects.workbook import workbook_table

            return workbook_table(data, name)
        if suffix in PARQUET:
            from jblast.observations.dialects.workbook import parquet_table

            return parquet_table(data, name)
    encoding = ""
    if isinstance(data, bytes):
        encoding = "" if strict else MARKS.get(data[:2], "")
        data = decoded(data, name, expected, utf16=not strict)
    return text_table(
        data, name, faults, strict=strict, encoding=encoding, within=within
    )


def _data(source: Any, name: str, expected: str) -> bytes | str:
    """Return what a path or a buffer holds."""
    if isinstance(source, (str, os.PathLike)):
        try:
            size = os.path.getsize(source)
        except (OSError, ValueError):
            size = 0  # what is wrong is told where it is opened
        if size > MOST_BYTES:
            raise InputError(
                f"{name}: expected a log of {MOST_BYTES / 1e9:g} GB at most, some "
                f"twenty million rows, got {size / 1e9:.3g} GB; take it apart, or are "
                "these samples of a recording? Pick their arrivals (jblast pick)"
            )
        return read_bytes(source, expected)
    if not callable(getattr(source, "read", None)):
        wrap = "; io.BytesIO makes a buffer of it" if isinstance(source, bytes) else ""
        raise InputError(
            f"expected a path, an open file or buffer, or a data frame, got "
            f"{type(source).__name__}{wrap}"
        )
    data = source.read()
    if isinstance(data, str):  # as a text file opened with newline="" still holds them
        return data.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return bytes(data)


def _refuse_ending(name: str, suffix: str) -> None:
    """Refuse files whose names say that they are no table of ours."""
    if suffix in (*TEXTS, *WORKBOOKS, *PARQUET):
        return
    if suffix in RECORDINGS:
        raise InputError(
            f"{name}: is a recording, not a log; pick its arrival and peak first "
            "(jblast pick)"
        )
    known = ", ".join((*TEXTS[1:], *WORKBOOKS, *PARQUET))
    raise InputError(f"{name}: expected a log in one of {known}, got {suffix}")


def _looks_like(data: bytes) -> str:
    """Return the ending of the format that bytes begin like; "" of text."""
    if data.startswith(b"PAR1"):
        return ".parquet"
    if data.startswith(b"PK\x03\x04"):
        return ".ods" if b"opendocument.spreadsheet" in data[:200] else ".xlsx"
    return ""


def _is_frame(source: Any) -> bool:
    """Return whether a source is a data frame, without importing pandas to ask."""
    kind = type(source)
    return kind.__module__.partition(".")[0] == "pandas" and hasattr(source, "columns")
