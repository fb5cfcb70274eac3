"""Formats of files of samples: recognition, opening, and search in folders.

The extension of a file selects its reader, and its first bytes must not be those of
another format. A reader is imported when it is used, since most need a library of their
own. A format is one record of `RECORD_FORMATS`. Text, miniSEED, SAC and MATLAB files
are read whole and limited to 2 GB; the other formats are read in segments, at any
length.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from jblast.errors import InputError, check_declared, closest, reading
from jblast.lazy import resolved
from jblast.observations.records.clips import VIDEOS
from jblast.observations.records.csv import is_stations
from jblast.observations.records.recording import (
    Recording,
    Scaling,
    warned,
    without_unset_clocks,
)
from jblast.registry import Registry

Opener = Callable[[Path, Scaling], tuple[Recording, ...]]


@dataclass(frozen=True, kw_only=True)
class RecordFormat:
    """A format of files of samples.

    Attributes:
        name: Name of the format.
        suffixes: Suffixes of its files: (".wav", ".flac").
        open: Function of path and scaling that returns recordings, or "module:name".
        beginnings: First bytes of its files, and the suffix for messages: a file of
            another format's suffix that begins with them is refused.
        inside: Names of formats in which its files may be written.
        is_whole: True if a file is read whole, which limits its size.
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
        suffixes=(".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm"),
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
        name="clip",
        suffixes=VIDEOS,
        open=f"{_FOLDER}.clips:open_clip",
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
        # version 7.3 is HDF5
        inside=("netcdf",),
        is_whole=True,
    ),
)
"""Formats by name; `register` adds one from any module."""
register = RECORD_FORMATS.register
MAX_WHOLE_BYTES = 2 * 10**9
"""Largest size of a file that is read whole: as double precision it takes several times
its size in memory. Sound, HDF5, NetCDF and TDMS are read in segments."""


def suffixes() -> dict[str, RecordFormat]:
    """Return the format of each suffix."""
    return {end: one for one in RECORD_FORMATS.values() for end in one.suffixes}


def open_record(
    path: str | os.PathLike[str], scaling: Scaling | None = None
) -> tuple[Recording, ...]:
    """Return the recordings of a file of samples, one for each clock in it.

    Args:
        path: File of a format in `RECORD_FORMATS`.
        scaling: Scale of the recorder.

    Raises:
        InputError: There is no such file, it is empty, of an unknown format, of another
            format than its suffix, or too large for a format that is read whole; or an
            error of the format's reader.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file; expected a record of samples")
    kind = _kind(path)
    _check(path, kind)
    with warned() as warnings, reading(path, f"a complete {path.suffix} file"):
        recordings = resolved(kind.open)(path, scaling or Scaling())
    # samples of a record are at least a byte each, compressed ones less
    check_declared(path, sum(one.length * len(one.names) for one in recordings))
    recordings = without_unset_clocks(recordings)
    if not any(recording.length for recording in recordings):
        raise InputError(f"{path}: expected samples, got none")
    if not warnings:
        return recordings
    # each once: a library may repeat one for every channel
    notes = tuple(f"warning of the reader: {one}" for one in dict.fromkeys(warnings))
    return tuple(replace(one, notes=(*one.notes, *notes)) for one in recordings)


def is_record(path: Path) -> bool:
    """Return True if a file's suffix is that of a format of samples."""
    return path.suffix.lower() in suffixes()


def _kind(path: Path) -> RecordFormat:
    """Return the format by the suffix of a file."""
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
    """Raise an error for a folder and for an empty, too large or mislabelled file."""
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
            # readers of other formats fail with obscure errors, or read noise
            if start.startswith(mark):
                raise InputError(
                    f"{path}: expected a {path.suffix} file, got one that begins "
                    f"like {ending}; rename it"
                )
    if kind.is_whole and size > MAX_WHOLE_BYTES:
        raise InputError(
            f"{path}: expected at most {MAX_WHOLE_BYTES / 1e9:g} GB of {path.suffix}, "
            f"which is read whole, got {size / 1e9:.3g} GB; cut it, or write it as WAV "
            "or HDF5, which may have any length"
        )


class RecordFiles(NamedTuple):
    """Files to read.

    Attributes:
        files: Records, in the given order; those of a folder by name.
        left_out: Other files of the folders.
    """

    files: tuple[Path, ...]
    left_out: tuple[Path, ...]


def record_files(
    named: Sequence[str | os.PathLike[str]], stations: str | None = None
) -> RecordFiles:
    """Return the records among files and folders.

    In a folder, hidden files, folders, files of unknown suffixes, tables of stations
    and logs are left out. Each named file must be a record.

    Args:
        named: Files and folders.
        stations: The table of stations, which may be in the folder.

    Raises:
        InputError: There is no such file, or a folder contains no record.
    """
    files: list[Path] = []
    left_out: list[Path] = []
    for name in map(Path, named):
        if not name.is_dir():
            files.append(name)
            continue
        held = [
            path
            for path in sorted(name.iterdir())
            if path.is_file()
            and not path.name.startswith(".")
            and not (stations and Path(stations).exists() and path.samefile(stations))
        ]
        # of sensors, or a log
        tables = (".csv", ".tsv", ".txt")
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
