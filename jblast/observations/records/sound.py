"""Sound files: WAV and FLAC of 8 to 32 bits or float, one to eight channels.

Whole numbers are read as a share of full scale, floating-point numbers as they stand.
Lossy compression, samples that are not finite and files that are cut short are refused;
nothing is clipped or filled in. libsndfile reads the samples that are present and
ignores the size in the header, so the header of a WAV file (RIFF, or RF64 by EBU Tech
3306) is compared with the size of the file. Whole numbers are passed to libsndfile in
the upper bits of 32, because its own conversion from floats is not the inverse of its
reading. WAV files are written up to 4 GiB.
"""

import math
import os
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError, shown
from jblast.files import replacing
from jblast.observations.records.recording import Recording, Scaling, channel_names

if TYPE_CHECKING:
    import soundfile

Bits = int | Literal["float"]
"""Of a sample: 8, 16, 24 or 32 as whole numbers, or floats of 32 bits."""
MOST_CHANNELS = 8
"""Largest number of channels; declared."""
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
STREAMED = 0xFFFFFFFF
"""Size that says "until the end": written by what could not seek back, and in RF64,
where the chunk `ds64` holds the true one."""


class SoundRecord(NamedTuple):
    """What a sound file holds.

    Attributes:
        samples: Whole numbers as a share of full scale, -1 to 1; floats as they stand.
        rate_hz: Samples a second of each channel.
        subtype: How they were written, as libsndfile calls it: "PCM_24", "FLOAT".
        dead_channels: Channels, counted from 0, that hold zeros alone.
    """

    samples: Float[np.ndarray, "channel sample"]
    rate_hz: int
    subtype: str
    dead_channels: tuple[int, ...]

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return self.samples.shape[1] / self.rate_hz


def read_sound(path: str | os.PathLike[str]) -> SoundRecord:
    """Return what a sound file holds, in double precision.

    Raises:
        InputError: There is no such file; it is empty, cut short or no sound file; it
            holds no samples, some that are no finite number, or more than eight
            channels; or it is compressed with a loss.
    """
    path = Path(path)
    with opened_sound(path) as file:
        rate_hz, subtype, promised = file.samplerate, file.subtype, file.frames
        samples = file.read(dtype="float64", always_2d=True).T
    if samples.shape[1] < promised:
        raise InputError(
            f"{path}: is cut short: {samples.shape[1]:,} samples of the {promised:,} "
            "that its header promises can be read"
        )
    _check_finite(path, samples, rate_hz)
    dead = tuple(int(i) for i in np.flatnonzero(~samples.any(axis=1)))
    return SoundRecord(np.ascontiguousarray(samples), rate_hz, subtype, dead)


def write_sound(
    path: str | os.PathLike[str],
    samples: Float[np.ndarray, "..."],
    rate_hz: float | int,
    bits: Bits = "float",
) -> None:
    """Write a sound file whole or not at all.

    Args:
        path: Ends in .wav or .flac; what is there is replaced.
        samples: By channel and sample, or of one channel alone. Written as floats of 32
            bits they stand as they are; as whole numbers they are a share of full
            scale, -1 to 1, and rounded to the nearest. 1 itself is one step too much
            and becomes the largest number there is.
        rate_hz: Samples a second, a whole number.
        bits: Of a sample; FLAC holds up to 24, and no floats.

    Raises:
        InputError: It cannot be written so, or the samples are none.
    """
    samples = np.atleast_2d(np.asarray(samples))
    if samples.ndim != 2 or samples.shape[1] == 0:
        raise InputError(
            f"{path}: expected samples [channel, sample], got the shape {samples.shape}"
        )
    write_sound_stream(path, [samples], rate_hz, bits)


def write_sound_stream(
    path: str | os.PathLike[str],
    packets: Iterable[Float[np.ndarray, "..."]],
    rate_hz: float | int,
    bits: Bits = "float",
) -> int:
    """Write a sound file packet by packet, in constant memory.

    If the packets break off by an error, or are interrupted, those that came are kept
    as a whole file and the error goes on.

    Args:
        path: As `write_sound` takes it.
        packets: Samples as `write_sound` takes them, all of as many channels.
        rate_hz: Samples a second, a whole number.
        bits: Of a sample.

    Returns:
        How many samples each channel has.

    Raises:
        InputError: It cannot be written so, no packet came, or more than the format
            holds.
    """
    import soundfile

    kind = format_of(path, bits)
    whole_rate_hz = whole_rate(rate_hz, path)
    packets = iter(packets)
    first = next(packets, None)
    if first is None:
        raise InputError(f"{path}: expected samples to write, got none")
    first = np.atleast_2d(np.asarray(first))
    channels, written = len(first), 0
    if channels > MOST_CHANNELS:
        raise InputError(
            f"{path}: expected at most {MOST_CHANNELS} channels, got {channels}"
        )
    step = channels * (4 if bits == "float" else bits // 8)
    broken: BaseException | None = None
    with (
        replacing(path) as temporary,
        soundfile.SoundFile(
            temporary,
            mode="w",
            samplerate=whole_rate_hz,
            channels=channels,
            format=kind,
            subtype=SUBTYPES[kind][bits],
        ) as file,
    ):
        try:
            for packet in chain([first], packets):
                codes = encoded(path, np.atleast_2d(np.asarray(packet)), bits)
                if (written + codes.shape[1]) * step > MOST_BYTES:
                    raise InputError(
                        f"{path}: expected at most {MOST_BYTES // step:,} samples, "
                        "which is what a WAV file holds; write a shorter one"
                    )
                file.write(codes.T)
                written += codes.shape[1]
        except BaseException as error:
            if not written:
                raise  # nothing to keep: what was there before stays
            broken = error
    if broken is not None:
        raise broken
    return written


def resampled(
    samples: Float[np.ndarray, "*channel sample"],
    from_hz: float | int,
    to_hz: float | int,
) -> Float[np.ndarray, "*channel resampled"]:
    """Return samples at another rate, free of aliases, each at the same time as before.

    By `scipy.signal.resample_poly`: a linear-phase low-pass that is half down at the
    lower of the two Nyquist frequencies; before and after the samples there is silence.

    Args:
        samples: Along the last axis.
        from_hz: Samples a second, a whole number.
        to_hz: Samples a second to come, a whole number.

    Raises:
        InputError: A rate is not positive, or no whole number.
    """
    ratio = Fraction(whole_rate(to_hz), whole_rate(from_hz))
    if ratio == 1:
        return np.asarray(samples)
    from scipy.signal import resample_poly

    return resample_poly(samples, ratio.numerator, ratio.denominator, axis=-1)


def _check_finite(
    path: Path, samples: Float[np.ndarray, "channel sample"], rate_hz: int
) -> None:
    """Refuse samples that are no number, and say where the first one is."""
    if np.isfinite(samples).all():
        return
    bad = np.argwhere(~np.isfinite(samples.T))  # in the order of time
    sample, channel = (int(i) for i in bad[0])
    raise InputError(
        f"{path}: expected finite samples, got {samples[channel, sample]} in channel "
        f"{channel + 1} at {sample / rate_hz:.6g} s (sample {sample + 1}; "
        f"{len(bad):,} of {samples.size:,} are so)"
    )


def open_sound(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return what a sound file holds, none of its samples read yet.

    Whole numbers clip at their largest; floats clip nowhere that a file could tell.

    Raises:
        InputError: It is no sound file, or one that cannot be used (`read_sound`).
    """
    with opened_sound(path) as file:
        channels, rate_hz, length = file.channels, file.samplerate, file.frames
        bits = {"PCM_U8": 8, "PCM_S8": 8, "PCM_16": 16, "PCM_24": 24, "PCM_32": 32}.get(
            file.subtype
        )
    factor = 1.0 if scaling.full_scale_pa is None else scaling.full_scale_pa

    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        with opened_sound(path) as file:
            file.seek(start)
            samples = file.read(stop - start, dtype="float64", always_2d=True)
        return factor * samples.T

    recording = Recording(
        source=str(path),
        names=channel_names(path.stem, channels),
        labels=tuple(f"channel {number + 1}" for number in range(channels)),
        rate_hz=float(rate_hz),
        length=length,
        read=read,
        calibrated=scaling.full_scale_pa is not None,
        full_scale=None if bits is None else factor * (1.0 - 2.0 ** (1 - bits)),
    )
    return (recording,)


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


def missing_bytes(path: Path) -> int:
    """Return how many bytes, at least, a WAV file promises and does not hold.

    Args:
        path: A file that begins as RIFF or RF64.

    References:
        Multimedia Programming Interface and Data Specifications 1.0 (IBM, Microsoft,
        1991); EBU Tech 3306 for RF64.
    """
    there = path.stat().st_size
    with path.open("rb") as file:
        file.seek(12)
        long_size = STREAMED
        while len(head := file.read(8)) == 8:
            name, size = struct.unpack("<4sI", head)
            if name == b"ds64":
                _, long_size = struct.unpack("<QQ", file.read(16))
                file.seek(size - 16, 1)
                continue
            if name == b"data":
                size = long_size if size == STREAMED else size
                promised = 0 if size == STREAMED else file.tell() + size
                return max(promised - there, 0)
            file.seek(size + size % 2, 1)  # chunks begin at even places
    return 8 - len(head)  # not even the head of the samples
