"""A sound file opened to be read, and why one cannot be."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.errors import InputError
from jblast.observations.records.sound_formats import EXPECTED, check_kind
from jblast.observations.records.wav_header import missing_bytes

if TYPE_CHECKING:
    import soundfile


@contextmanager
def opened_sound(path: Path) -> Iterator["soundfile.SoundFile"]:
    """Open a sound file to be read, in part or whole.

    Raises:
        InputError: There is no such file; it is empty, cut short or no sound file; it
            holds no samples or more than eight channels; or it is compressed with a
            loss.
    """
    import soundfile  # libsndfile: nobody else need wait for it

    _check_is_file(path)
    try:
        with soundfile.SoundFile(path) as file:
            check_kind(path, file.format, file.subtype, file.channels)
            if file.format != "FLAC" and (missing := missing_bytes(path)):
                raise InputError(
                    f"{path}: is cut short: at least {missing:,} bytes are missing at "
                    "its end"
                )
            if file.frames == 0:
                raise InputError(
                    f"{path}: expected a sound file with samples, got none"
                )
            yield file
    except soundfile.LibsndfileError as error:
        raise InputError(_unreadable(path, error.error_string)) from None


def _check_is_file(path: Path) -> None:
    if not path.exists():
        raise InputError(f"{path}: no such file; {EXPECTED}")
    if path.is_dir():
        raise InputError(f"{path}: is a directory; {EXPECTED}")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path}: is empty; {EXPECTED}")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path}: may not be read; {EXPECTED}")


def _unreadable(path: Path, reason: str) -> str:
    """Say why libsndfile makes nothing of a file."""
    with path.open("rb") as file:
        start = file.read(4)
    if any(mark.startswith(start) for mark in (b"RIFF", b"RF64", b"fLaC")):
        return f"{path}: is cut short or damaged ({reason.strip().rstrip('.')})"
    return f"{path}: is no sound file; {EXPECTED}"
