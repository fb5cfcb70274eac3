"""Which files are records: those that are named, and those that a folder holds."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jblast.errors import InputError
from jblast.observations.records.formats.by_extension import is_record
from jblast.observations.records.formats.csv import is_stations


class RecordFiles(NamedTuple):
    """Files to read.

    Attributes:
        files: Records, in the order named; those of a folder by name.
        left_out: Files of folders that are none.
    """

    files: tuple[Path, ...]
    left_out: tuple[Path, ...]


def record_files(
    named: Sequence[str | os.PathLike[str]], stations: str | None = None
) -> RecordFiles:
    """Return the records among files and folders.

    What a folder holds beside records is left out: hidden files, folders, names that
    end in nothing we read, tables of stations and logs. A file that is named is taken
    as a record, whatever it is.

    Args:
        named: Files and folders.
        stations: The table of stations, which may lie in the folder.

    Raises:
        InputError: There is no such file, or a folder holds no record.
    """
    files: list[Path] = []
    left_out: list[Path] = []
    for name in map(Path, named):
        if not name.is_dir():
            files.append(name)
            continue
        held = [path for path in sorted(name.iterdir()) if _is_seen(path, stations)]
        records = [path for path in held if is_record(path) and not _is_table(path)]
        if not records:
            raise InputError(
                f"{name}: expected a folder of records of samples, got "
                f"{f'{len(held)} other files' if held else 'none'}"
            )
        files += records
        left_out += [path for path in held if path not in records]
    return RecordFiles(tuple(files), tuple(left_out))


def _is_seen(path: Path, stations: str | None) -> bool:
    """Return whether a file of a folder is to be taken or named."""
    if path.name.startswith(".") or not path.is_file():
        return False
    return not (stations and Path(stations).exists() and path.samefile(stations))


def _is_table(path: Path) -> bool:
    """Return whether a text is a table of sensors or a log."""
    return path.suffix.lower() in (".csv", ".tsv", ".txt") and is_stations(path)
