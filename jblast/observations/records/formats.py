"""Formats of files of samples: recognition, opening, and search in folders.

The extension of a file selects its reader, and its first bytes must not be those of
another format. A reader is imported when it is used, since most need a library of their
own. A format is one record of `RECORD_FORMATS`. Text, miniSEED, SAC and MATLAB files
are read whole and limited to 2 GB; the other formats are read in segments, at any
length.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from jblast.errors import InputError, nearest, reading
from jblast.lazy import resolved
from jblast.observations.records.clips import VIDEOS
from jblast.observations.records.recording import (
    Group,
    Recording,
    Scaling,
    channels_of,
    first_bytes,
    recordings_of,
    warned,
)
from jblast.observations.records.text_samples import is_stations
from jblast.registry import Registry

Opener = Callable[[Path], tuple[Group, ...]]
ZEROS = tuple(datetime(year, 1, 1, tzinfo=UTC) for year in (1904, 1970, 1980, 2000))
"""Zero of the clocks of LabVIEW, of POSIX, of GPS (5 days later) or DOS, and of field
recorders: a recorder whose clock was not set begins there."""
UNSET_S = 31 * 86400.0
"""Longest time after one of them at which a clock is not set [s]: a recorder runs for
weeks without a fix, and records of blasts of those months are few."""


@dataclass(frozen=True)
class RecordFormat:
    """A format of files of samples.

    Attributes:
        name: Name of the format.
        suffixes: Suffixes of its files: (".wav", ".flac").
        open: Function of a path that returns its columns, or "module:name".
        beginnings: First bytes of its files: a file of another format's suffix that
            begins with them is refused.
        is_whole: True if a file is read whole, which limits its size.
        head: As `open`, from the beginning of a file, for their names; `open` if None.
    """

    name: str
    suffixes: tuple[str, ...]
    open: Opener | str
    beginnings: tuple[bytes, ...] = ()
    is_whole: bool = False
    head: Opener | str | None = None


_FOLDER = "jblast.observations.records"
_ARRAYS, _TEXT = f"{_FOLDER}.arrays:open_arrays", f"{_FOLDER}.text_samples"
_TEXTS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm")
_SEISMIC = (".mseed", ".miniseed", ".msd", ".sac")
_HDF5 = (".nc", ".nc4", ".h5", ".hdf5", ".hdf", ".cdf")
_SOUND = b"RIFF", b"RF64", b"fLaC"
RECORD_FORMATS = Registry[RecordFormat](
    "format of records",
    RecordFormat("sound", (".wav", ".flac"), f"{_FOLDER}.sound:open_sound", _SOUND),
    RecordFormat(
        "csv", _TEXTS, f"{_TEXT}:open_text", is_whole=True, head=f"{_TEXT}:open_head"
    ),
    RecordFormat("seismic", _SEISMIC, f"{_FOLDER}.seismic:open_seismic", is_whole=True),
    RecordFormat("clip", VIDEOS, f"{_FOLDER}.clips:open_clip", is_whole=True),
    RecordFormat("tdms", (".tdms",), f"{_FOLDER}.tdms:open_tdms", (b"TDSm",)),
    RecordFormat("netcdf", _HDF5, _ARRAYS, (b"\x89HDF", b"CDF")),
    # version 7.3 is HDF5
    RecordFormat("matlab", (".mat",), _ARRAYS, (b"MATLAB", b"\x89HDF"), is_whole=True),
)
"""Formats by name; `register` adds one from any module."""
register = RECORD_FORMATS.register
TABLES = (".csv", ".tsv", ".txt")
"""Suffixes of records that tables of sensors, and logs, may have, too."""
EXPECTED = "a record of samples"
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
    with warned() as warnings, reading(path, f"a complete {path.suffix} file"):
        recordings = recordings_of(path, _groups(path), scaling or Scaling())
    if not any(recording.length for recording in recordings):
        raise InputError(f"{path}: expected samples, got none")
    # each once: a library may repeat one for every channel
    notes = tuple(f"warning of the reader: {one}" for one in dict.fromkeys(warnings))
    return tuple(
        replace(one, notes=(*one.notes, *notes)) for one in map(_dated, recordings)
    )


def open_channels(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], ...]:
    """Return the names of each channel of pressure of a file, before it is read.

    Raises:
        InputError: As for `open_record`.
    """
    path = Path(path)
    with warned(), reading(path, f"a complete {path.suffix} file"):
        found = channels_of(path, _groups(path, head=True))
    return tuple(names for one in found for names in one.names)


def _groups(path: Path, *, head: bool = False) -> tuple[Group, ...]:
    """Return the columns of a file."""
    start = first_bytes(path, EXPECTED)
    ending, formats = path.suffix.lower(), suffixes()
    if ending not in formats:
        raise InputError(
            f"{path}: expected {EXPECTED}, its name ending in {', '.join(formats)}, "
            f"got {ending or 'no ending'}{nearest(ending, formats)}"
        )
    kind = formats[ending]
    for other in RECORD_FORMATS.values():
        # readers of other formats fail with obscure errors, or read noise
        if start.startswith(other.beginnings) and not start.startswith(kind.beginnings):
            raise InputError(
                f"{path}: expected a {ending} file, got one that begins like "
                f"{' or '.join(other.suffixes)}; rename it"
            )
    size = path.stat().st_size
    if kind.is_whole and size > MAX_WHOLE_BYTES:
        raise InputError(
            f"{path}: expected at most {MAX_WHOLE_BYTES / 1e9:g} GB of {ending}, which "
            f"is read whole, got {size / 1e9:.3g} GB; cut it, or write it as WAV or "
            "HDF5, which may have any length"
        )
    return resolved(kind.head if head and kind.head else kind.open)(path)


def _dated(one: Recording) -> Recording:
    """Return a recording without UTC if its clock was not set.

    Its times count from the first sample of the file.
    """
    begin = one.epoch and one.epoch + timedelta(seconds=math.floor(one.start_s))
    for zero in ZEROS:
        if begin and 0 <= (begin - zero).total_seconds() < UNSET_S:
            note = f"its clock was not set: it begins in {zero.year}"
            return replace(
                one,
                epoch=None,
                start_s=one.own_start_s,
                clock_is_set=False,
                notes=(*one.notes, f"no time of day, as {note}"),
            )
    return one


def is_record(path: Path) -> bool:
    """Return True if a file's suffix is that of a format of samples."""
    return path.suffix.lower() in suffixes()


def record_files(
    named: Sequence[str | os.PathLike[str]], stations: str | None = None
) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Return the records among files and folders, and the other files of the folders.

    In a folder, hidden files and folders, files of unknown suffixes, tables of stations
    and logs are left out; folders in it are read if it contains no record itself. Each
    named file must be a record.

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
        records, others, folders = [], [], []
        for path in sorted(name.iterdir()):
            if path.name.startswith(".") or (stations and path.samefile(stations)):
                continue
            may_be_table = path.suffix.lower() in TABLES
            if path.is_dir():
                folders.append(path)
            elif is_record(path) and not (may_be_table and is_stations(path)):
                records.append(path)
            else:
                others.append(path)
        if folders and not records:
            # the shots of a day
            found, more = record_files(folders, stations)
            files += found
            left_out += more
            continue
        if not records:
            raise InputError(
                f"{name}: expected a folder of records of samples, got "
                f"{f'{len(others)} other files' if others else 'none'}"
            )
        files += records
        left_out += others
    return tuple(files), tuple(left_out)
