"""A file of samples opened by what its name ends in, and what it begins with."""

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from jblast.errors import InputError, closest
from jblast.observations.records.formats.scale import Scaling
from jblast.observations.records.recording import Recording

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
    module = import_module(f"jblast.observations.records.formats.{kind}")
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
