"""What of sound files we read and write: formats, channels, rates, whole numbers."""

import math
import os
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError, shown

Bits = int | Literal["float"]
"""Of a sample: 8, 16, 24 or 32 as whole numbers, or floats of 32 bits."""

MOST_CHANNELS = 8
SUBTYPES = {
    "WAV": {8: "PCM_U8", 16: "PCM_16", 24: "PCM_24", 32: "PCM_32", "float": "FLOAT"},
    "FLAC": {8: "PCM_S8", 16: "PCM_16", 24: "PCM_24"},
}
"""How a format holds samples of so many bits, as libsndfile calls it."""
READ = {"DOUBLE"}.union(*(kinds.values() for kinds in SUBTYPES.values()))
FORMATS = ("WAV", "WAVEX", "RF64", "FLAC")
EXPECTED = "expected a sound file, WAV or FLAC"
MOST_BYTES = 2**32 - 2**16
"""That a WAV file may hold: its sizes have 32 bits, and its header needs some."""


def check_kind(path: Path, kind: str, subtype: str, channels: int) -> None:
    """Refuse what is compressed with a loss, or has too many channels.

    Raises:
        InputError: It is so.
    """
    if kind not in FORMATS or subtype not in READ:
        raise InputError(
            f"{path}: {EXPECTED} of 8 to 32 bits or float, got {kind} {subtype}"
        )
    if channels > MOST_CHANNELS:
        raise InputError(
            f"{path}: expected at most {MOST_CHANNELS} channels, got {channels}"
        )


def format_of(path: str | os.PathLike[str], bits: Bits) -> str:
    """Return the format that a file's name asks for.

    Raises:
        InputError: There is none, or it holds no samples of so many bits.
    """
    kind = Path(path).suffix.lower().removeprefix(".").upper()
    if kind not in SUBTYPES:
        raise InputError(f"{path}: expected a name in .wav or .flac")
    if bits not in SUBTYPES[kind]:
        expected = ", ".join(map(str, SUBTYPES[kind]))
        raise InputError(
            f"{path}: expected bits as {kind} holds them ({expected}), "
            f"got {shown(bits)}"
        )
    return kind


def whole_rate(rate_hz: float | int, path: str | os.PathLike[str] | None = None) -> int:
    """Return samples a second as a whole number.

    Raises:
        InputError: They are none, or not positive.
    """
    if not (math.isfinite(rate_hz) and rate_hz == int(rate_hz) and 0 < rate_hz < 2**31):
        where = f"{path}: " if path else ""
        raise InputError(
            f"{where}expected a positive, whole number of samples a second, "
            f"got {rate_hz:g} Hz"
        )
    return int(rate_hz)


def encoded(
    path: str | os.PathLike[str], samples: Float[np.ndarray, "channel n"], bits: Bits
) -> Float[np.ndarray, "channel n"] | Int[np.ndarray, "channel n"]:
    """Return samples as libsndfile is given them, so that it rounds nothing by itself.

    It takes the upper bits of 32; given floats, it would make 32767 of 1, and when it
    reads, 1 of 32768.

    Raises:
        InputError: One is no finite number, or of whole numbers beyond full scale.
    """
    if bits == "float":
        with np.errstate(over="ignore"):  # what is too large is refused below
            samples = samples.astype(np.float32)
    if not np.isfinite(samples).all():
        raise InputError(f"{path}: expected finite samples to write, got others")
    if bits == "float":
        return samples
    most = float(np.abs(samples).max(initial=0.0))
    if most > 1.0:
        raise InputError(
            f"{path}: expected samples from -1 to 1 of full scale, got {most:g}"
        )
    scale = 2 ** (bits - 1)
    codes = np.rint(samples.astype(np.float64) * scale).astype(np.int64)
    return (np.minimum(codes, scale - 1) << (32 - bits)).astype(np.int32)
