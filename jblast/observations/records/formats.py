"""Files of samples by format: recognised, opened, and found in folders.

The extension of a file selects its reader, and its first bytes must not be those of
another format. A reader is imported when it is used, since most need a library of their
own. A format is one record of `RECORD_FORMATS`. Text, miniSEED, SAC and MATLAB files
are read whole and limited to 2 GB; the other formats are read in segments, at any
length.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from jblast.errors import InputError, closest
from jblast.lazy import resolved
from jblast.observations.records.csv import is_stations
from jblast.observations.records.recording import Recording, Scaling
from jblast.registry import Registry

Opener = Callable[[Path, Scaling], tuple[Recording, ...]]


@dataclass(frozen=True, kw_only=True)
class RecordFormat:
    """A format of files of samples.

    Attributes:
        name: Of the format.
        suffixes: Of its files: (".wav", ".flac").
        open: From a path and a scaling to recordings, or the place of that function.
        beginnings: First bytes of its files, and the suffix that they stand for: a file
            of another suffix that begins so is refused.
        inside: Formats that its files may be written in.
        is_whole: Whether a file is read whole, which limits its size.
    """

    name: str
    suffixes: tuple[str, ...]
    open: Opener | str
    beginnings: Mapping[bytes, str] = field(default_factory=dict)
    inside: tuple[str, ...] = ()
    is_whole: bool = False


_FOLDER = "jblast.observations.records"
RECORD_FORMATS = Registry[RecordFormat](
    "format of records",
    RecordFormat(
        name="sound",
        suffixes=(".wav", ".flac"),
        open=f"{_FOLDER}.sound:open_sound",
        beginnings={b"RIFF": ".wav", b"RF64": ".wav", b"fLaC": ".flac"},
    ),
    RecordFormat(
        name="csv",
        suffixes=(".csv", ".txt", ".tsv", ".dat", ".asc"),
        open=f"{_FOLDER}.csv:open_csv",
        is_whole=True,
    ),
    RecordFormat(
        name="seismic",
        suffixes=(".mseed", ".miniseed", ".msd", ".sac"),
        open=f"{_FOLDER}.seismic:open_seismic",
        is_whole=True,
    ),
    RecordFormat(
        name="tdms",
        suffixes=(".tdms",),
        open=f"{_FOLDER}.tdms:open_tdms",
        beginnings={b"TDSm": ".tdms"},
    ),
    RecordFormat(
        name="netcdf",
        suffixes=(".nc", ".nc4", ".h5", ".hdf5", ".hdf", ".cdf"),
        open=f"{_FOLDER}.netcdf:open_netcdf",
        beginnings={b"\x89HDF": ".h5", b"CDF": ".nc"},
    ),
    RecordFormat(
        name="matlab",
        suffixes=(".mat",),
        open=f"{_FOLDER}.matlab:open_matlab",
        beginnings={b"MATLAB": ".mat"},
        inside=("netcdf",),  # version 7.3 is HDF5
        is_whole=True,
    ),
)
"""By name; `register` adds one from any module."""
register = RECORD_FORMATS.register
MOST_WHOLE = 2 * 10**9
"""Bytes of a file that is read whole; sound, HDF5, NetCDF and TDMS are not."""


def suffixes() -> dict[str, RecordFormat]:
    """Return the format of each suffix."""
    return {end: one for one in RECORD_FORMATS.values() for end in one.suffixes}


def open_record(
    path: str | os.PathLike[str], scaling: Scaling | None = None
) -> tuple[Recording, ...]:
    """Return what a file of samples holds: a recording for each clock in it.

    Args:
        path: Of a format in `RECORD_FORMATS`.
        scaling: What the user says of the recorder's scale.

    Raises:
        InputError: There is no such file, it is empty, of no format that is read, of
            another than its name says, or too large for one that is read whole; or
            what its format's reader refuses.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file; expected a record of samples")
    kind = _kind(path)
    _check(path, kind)
    recordings = resolved(kind.open)(path, scaling or Scaling())
    if not any(recording.length for recording in recordings):
        raise InputError(f"{path}: expected samples, got none")
    return recordings


def is_record(path: Path) -> bool:
    """Return whether a file's name ends as those of samples do."""
    return path.suffix.lower() in suffixes()


def _kind(path: Path) -> RecordFormat:
    """Return the format that a name asks for."""
    ending, formats = path.suffix.lower(), suffixes()
    if ending in formats:
        return formats[ending]
    known = ", ".join(formats)
    close = closest(ending, formats) if ending else None
    hint = f"; did you mean {close}?" if close else ""
    raise InputError(
        f"{path}: expected a record of samples, its name ending in {known}, got "
        f"{ending or 'no ending'}{hint}"
    )


def _check(path: Path, kind: RecordFormat) -> None:
    """Refuse what is a folder, empty, too large, or of another format."""
    if path.is_dir():
        raise InputError(f"{path}: is a directory; expected a record of samples")
    try:
        with path.open("rb") as file:
            start = file.read(8)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); expected a record of samples"
        ) from None
    size = path.stat().st_size
    if not start:
        raise InputError(f"{path}: is empty; expected a record of samples")
    for other in RECORD_FORMATS.values():
        if other.name in (kind.name, *kind.inside):
            continue
        for mark, ending in other.beginnings.items():
            if start.startswith(mark):
                raise InputError(
                    f"{path}: expected what a name in {path.suffix} promises, got a "
                    f"file that begins as {ending} does; rename it"
                )
    if kind.is_whole and size > MOST_WHOLE:
        raise InputError(
            f"{path}: expected at most {MOST_WHOLE / 1e9:g} GB of {path.suffix}, which "
            f"is read whole, got {size / 1e9:.3g} GB; cut it, or write it as WAV or "
            "HDF5, of which any length is read"
        )


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
        tables = (".csv", ".tsv", ".txt")  # of sensors, or a log
        records = [
            path
            for path in held
            if is_record(path)
            and not (path.suffix.lower() in tables and is_stations(path))
        ]
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
