"""Files of samples by format: recognised, opened, and found in folders.

The extension of a file selects its reader, and its first bytes must not be those of
another format. A reader is imported when it is used, since most need a library of their
own. A format is added by a module with a function `open_NAME` and an entry in
`FORMATS`. Text, miniSEED, SAC and MATLAB files are read whole and limited to 2 GB; the
other formats are read in segments, at any length.
"""

import os
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from jblast.errors import InputError, closest
from jblast.observations.records.csv import is_stations
from jblast.observations.records.recording import Recording, Scaling

Opener = Callable[[Path, Scaling], tuple[Recording, ...]]
FORMATS = {
    "sound": (".wav", ".flac"),
    "csv": (".csv", ".txt", ".tsv", ".dat", ".asc"),
    "seismic": (".mseed", ".miniseed", ".msd", ".sac"),
    "tdms": (".tdms",),
    "netcdf": (".nc", ".nc4", ".h5", ".hdf5", ".hdf", ".cdf"),
    "matlab": (".mat",),
}
"""Modules of this folder, each with its function `open_NAME`, by extension."""
EXTENSIONS = {ending: kind for kind, endings in FORMATS.items() for ending in endings}
BEGINNINGS = {
    b"RIFF": ("sound", ".wav"),
    b"RF64": ("sound", ".wav"),
    b"fLaC": ("sound", ".flac"),
    b"\x89HDF": ("netcdf", ".h5"),
    b"CDF": ("netcdf", ".nc"),
    b"TDSm": ("tdms", ".tdms"),
    b"MATLAB": ("matlab", ".mat"),
}
"""What files of a format begin with, and what their names should end in."""
LIKE = {("netcdf", "matlab")}
"""Formats that others are written in: .mat of version 7.3 is HDF5."""
MOST_WHOLE = 2 * 10**9
"""Bytes of a file that is read whole; sound, HDF5, NetCDF and TDMS are not."""
WHOLE = ("csv", "seismic", "matlab")


def open_record(
    path: str | os.PathLike[str], scaling: Scaling | None = None
) -> tuple[Recording, ...]:
    """Return what a file of samples holds: a recording for each clock in it.

    Args:
        path: Of a format in `FORMATS`.
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
    module = import_module(f"jblast.observations.records.{kind}")
    opener: Opener = getattr(module, f"open_{kind}")
    recordings = opener(path, scaling or Scaling())
    if not any(recording.length for recording in recordings):
        raise InputError(f"{path}: expected samples, got none")
    return recordings


def is_record(path: Path) -> bool:
    """Return whether a file's name ends as those of samples do."""
    return path.suffix.lower() in EXTENSIONS


def _kind(path: Path) -> str:
    """Return the format that a name asks for."""
    ending = path.suffix.lower()
    if ending in EXTENSIONS:
        return EXTENSIONS[ending]
    known = ", ".join(EXTENSIONS)
    close = closest(ending, EXTENSIONS) if ending else None
    hint = f"; did you mean {close}?" if close else ""
    raise InputError(
        f"{path}: expected a record of samples, its name ending in {known}, got "
        f"{ending or 'no ending'}{hint}"
    )


def _check(path: Path, kind: str) -> None:
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
    for mark, (held, ending) in BEGINNINGS.items():
        if start.startswith(mark) and held != kind and (held, kind) not in LIKE:
            raise InputError(
                f"{path}: expected what a name in {path.suffix} promises, got a file "
                f"that begins as {ending} does; rename it"
            )
    if kind in WHOLE and size > MOST_WHOLE:
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
