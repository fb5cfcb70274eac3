"""Which files hold a log, by their endings, and what a row of one is called."""

from pathlib import PurePath

TEXTS = ("", ".csv", ".tsv", ".tab", ".txt", ".dat", ".log")
"""Endings of files that are read as text."""
WORKBOOKS = {".xlsx": "openpyxl", ".xlsm": "openpyxl", ".ods": "odf"}
"""Endings of spreadsheets, and what pandas reads them by."""
PARQUET = (".parquet", ".pq")
FRAME = "data frame"
"""Source of a log that came as one."""


def row_word(source: str) -> str:
    """Return what a row of a source is called: text has lines."""
    suffix = PurePath(source).suffix.lower()
    sheets = suffix in WORKBOOKS or suffix in PARQUET or source == FRAME
    return "row" if sheets else "line"
