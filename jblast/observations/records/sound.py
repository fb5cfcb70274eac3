"""Sound files: WAV and FLAC of 8 to 32 bits, float, mu-law or A-law; 1 to 8 channels.

Whole numbers are read as a share of full scale, floating-point numbers as they stand.
Other compression with loss and samples that are not finite are refused; nothing is
clipped or filled in. Of a truncated file the samples that are present are read, with a
note: the header of a WAV file (RIFF, or RF64 by EBU Tech 3306) is compared with the
size of the file, and the end of a FLAC file is decoded. A recorder that stopped without
closing its file left the size 0 in the header, which is replaced by that of the file.
Whole numbers are passed to libsndfile in the upper bits of 32, because its own
conversion from floats is not the inverse of its reading. WAV files are written up to
4 GiB.
"""

import math
import mmap
import os
import struct
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError, check_declared, shown
from jblast.files import replacing
from jblast.observations.records.recording import Recording, Scaling, channel_names

if TYPE_CHECKING:
    import soundfile

Bits = int | Literal["float"]
"""Bits of a sample: 8, 16, 24 or 32 for whole numbers, or floats of 32 bits."""
MAX_CHANNELS = 8
"""Largest number of channels, that of FLAC and of common field recorders."""
SUBTYPES = {
    "WAV": {8: "PCM_U8", 16: "PCM_16", 24: "PCM_24", 32: "PCM_32", "float": "FLOAT"},
    "FLAC": {8: "PCM_S8", 16: "PCM_16", 24: "PCM_24"},
}
"""Names in libsndfile of the subtypes by format and bits."""
LARGEST = {
    **{f"PCM_{name}": 1 - 2.0 ** (1 - bits) for name, bits in (
        ("U8", 8), ("S8", 8), ("16", 16), ("24", 24), ("32", 32)
    )},
    "ULAW": 32124 / 2**15, "ALAW": 32256 / 2**15,
}  # fmt: skip
"""Largest sample by subtype; that of floats is unknown. ITU-T G.711 for the laws, whose
codes of 8 bits libsndfile expands to 16."""
READ_SUBTYPES = {"FLOAT", "DOUBLE", *LARGEST}
FORMATS = ("WAV", "WAVEX", "RF64", "FLAC")
EXPECTED = "expected a sound file, WAV or FLAC"
MAX_BYTES = 2**32 - 2**16
"""Largest size of the samples of a WAV file: its sizes have 32 bits, and 64 KiB are
left for the header."""
MAX_FRAMES = 2**36
"""Limit of the number of samples in a FLAC header, where 0 means unknown."""
FLAC_BLOCK = 4096
"""Samples of a read from a damaged FLAC file: the usual size of its own blocks."""
STREAMED = 0xFFFFFFFF
"""Size in a header that means "until the end of the file": written by programs that
cannot seek back, and in RF64, where the chunk `ds64` has the true size."""


class SoundRecord(NamedTuple):
    """Samples of a sound file.

    Attributes:
        samples: Whole numbers as a share of full scale, -1 to 1; floats unchanged.
        rate_hz: Sampling rate of each channel [Hz].
        subtype: Subtype in libsndfile: "PCM_24", "FLOAT".
        dead_channels: Channels, counted from 0, that contain only zeros.
        notes: Notes of the reader, a sentence each.
    """

    samples: Float[np.ndarray, "channel sample"]
    rate_hz: int
    subtype: str
    dead_channels: tuple[int, ...]
    notes: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return self.samples.shape[1] / self.rate_hz


def read_sound(path: str | os.PathLike[str]) -> SoundRecord:
    """Return the samples of a sound file, in double precision.

    Raises:
        InputError: There is no such file; it is empty or not a sound file; it has no
            samples, some that are not finite, or more than eight channels; or its
            compression is lossy.
    """
    path = Path(path)
    with opened_sound(path) as (file, length, notes):
        rate_hz, subtype = file.samplerate, file.subtype
        samples = file.read(length, dtype="float64", always_2d=True).T
    _check_finite(path, samples, rate_hz)
    dead = tuple(int(i) for i in np.flatnonzero(~samples.any(axis=1)))
    return SoundRecord(np.ascontiguousarray(samples), rate_hz, subtype, dead, notes)


def write_sound(
    path: str | os.PathLike[str],
    samples: Float[np.ndarray, "..."],
    rate_hz: float | int,
    bits: Bits = "float",
) -> None:
    """Write a sound file completely or not at all.

    Args:
        path: Path ending in .wav or .flac; an existing file is replaced.
        samples: Samples by channel and sample, or of one channel. Floats of 32 bits are
            written unchanged. For whole numbers they are shares of full scale, -1 to 1,
            rounded to the nearest; 1 itself becomes the largest code.
        rate_hz: Sampling rate, a whole number [Hz].
        bits: Bits of a sample; FLAC has up to 24, and no floats.

    Raises:
        InputError: The format cannot store these samples, or there are none.
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

    If the packets end with an error or an interruption, those before it are written as
    a complete file, and the error is raised again.

    Args:
        path: As for `write_sound`.
        packets: Samples as for `write_sound`, all with the same number of channels.
        rate_hz: Sampling rate, a whole number [Hz].
        bits: Bits of a sample.

    Returns:
        Number of samples of each channel.

    Raises:
        InputError: The format cannot store these samples or this number of them, or
            there are none.
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
    if channels > MAX_CHANNELS:
        raise InputError(
            f"{path}: expected at most {MAX_CHANNELS} channels, got {channels}"
        )
    # bytes of one sample of all channels
    step = channels * (4 if bits == "float" else bits // 8)
    broken: BaseException | None = None
    with (
        replacing(path) as temporary,
        undated(temporary),
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
                if (written + codes.shape[1]) * step > MAX_BYTES:
                    raise InputError(
                        f"{path}: expected at most {MAX_BYTES // step:,} samples, "
                        "the limit of a WAV file, got more; write a shorter one"
                    )
                file.write(codes.T)
                written += codes.shape[1]
        except BaseException as error:
            if not written:
                # nothing to keep: what was there before stays
                raise
            broken = error
    if broken is not None:
        raise broken
    return written


@contextmanager
def undated(path: Path) -> Iterator[None]:
    """Remove the date of writing from a WAV file, which libsndfile adds to floats.

    With it, two equal records would be different files.
    """
    yield
    with path.open("r+b") as file:
        head = file.read(256)
        at = head.find(b"PEAK")
        # the date follows the sizes of the chunk's name, length and version
        if head.startswith(b"RIFF") and at >= 0:
            file.seek(at + 12)
            file.write(bytes(4))


def resampled(
    samples: Float[np.ndarray, "*channel sample"],
    from_hz: float | int,
    to_hz: float | int,
) -> Float[np.ndarray, "*channel resampled"]:
    """Return samples at another rate, without aliases or a delay.

    The filter is that of `scipy.signal.resample_poly`: a linear-phase low-pass, 6 dB
    down at the lower of the two Nyquist frequencies, with silence before and after the
    samples.

    Args:
        samples: Samples along the last axis.
        from_hz: Sampling rate, a whole number [Hz].
        to_hz: New sampling rate, a whole number [Hz].

    Raises:
        InputError: A rate is not positive, or not a whole number.
    """
    ratio = Fraction(whole_rate(to_hz), whole_rate(from_hz))
    # without SciPy, whose import takes longer than reading most files
    if ratio == 1:
        return np.asarray(samples)
    from scipy.signal import resample_poly

    return resample_poly(samples, ratio.numerator, ratio.denominator, axis=-1)


def _check_finite(
    path: Path, samples: Float[np.ndarray, "channel sample"], rate_hz: int
) -> None:
    """Raise an error for samples that are not finite, with the first one."""
    if np.isfinite(samples).all():
        return
    # in the order of time
    bad = np.argwhere(~np.isfinite(samples.T))
    sample, channel = (int(i) for i in bad[0])
    raise InputError(
        f"{path}: expected finite samples, got {samples[channel, sample]} in channel "
        f"{channel + 1} at {sample / rate_hz:.6g} s (sample {sample + 1}; "
        f"{len(bad):,} of {samples.size:,} in total)"
    )


def open_sound(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the recording of a sound file, before its samples are read.

    Whole numbers clip at the largest code; the clipping level of floats is unknown.

    Raises:
        InputError: As for `read_sound`, except for samples that are not finite.
    """
    with opened_sound(path) as (file, length, notes):
        channels, rate_hz = file.channels, file.samplerate
        largest = LARGEST.get(file.subtype)
    factor = 1.0 if scaling.full_scale_pa is None else scaling.full_scale_pa

    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        # without the checks of the whole file, which decode a damaged one
        with _opened(path) as (file, _):
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
        full_scale=None if largest is None else factor * largest,
        notes=notes,
    )
    return (recording,)


@contextmanager
def opened_sound(
    path: Path,
) -> Iterator[tuple["soundfile.SoundFile", int, tuple[str, ...]]]:
    """Open a sound file for reading, with its number of samples and notes.

    Raises:
        InputError: There is no such file; it is empty or not a sound file; it has no
            samples or more than eight channels; or its compression is lossy.
    """
    # imported here: loading libsndfile would delay readers of other formats
    import soundfile

    if not path.exists():
        raise InputError(f"{path}: no such file; {EXPECTED}")
    if path.is_dir():
        raise InputError(f"{path}: is a directory; {EXPECTED}")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path}: is empty; {EXPECTED}")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path}: may not be read; {EXPECTED}")
    try:
        with _opened(path) as (file, sizes):
            check_kind(path, file.format, file.subtype, file.channels)
            length, notes = file.frames, ()
            if sizes.unset:
                notes = ("its header has no size: read to the end of the file",)
            elif file.format == "FLAC":
                length = _intact(path, length)
            if length < file.frames or sizes.missing:
                lost = f"{sizes.missing:,} bytes"
                if length < file.frames:
                    lost = f"{(file.frames - length) / file.samplerate:.4g} s"
                notes = (
                    f"cut short: {length / file.samplerate:.6g} s are read, and at "
                    f"least {lost} are missing at its end",
                )
            check_declared(path, length * file.channels)
            if length == 0:
                raise InputError(
                    f"{path}: is cut short: expected samples, got the header alone"
                    if sizes.missing or file.frames
                    else f"{path}: expected a sound file with samples, got none"
                )
            yield file, length, notes
    except soundfile.LibsndfileError as error:
        with path.open("rb") as file:
            start = file.read(4)
        if any(mark.startswith(start) for mark in (b"RIFF", b"RF64", b"fLaC")):
            reason = error.error_string.strip().rstrip(".")
            fault = f"{path}: is cut short or damaged ({reason})"
        else:
            fault = f"{path}: is not a sound file; {EXPECTED}"
        raise InputError(fault) from None


def check_kind(path: Path, kind: str, subtype: str, channels: int) -> None:
    """Raise an error for lossy compression or too many channels.

    Raises:
        InputError: The file has one of these.
    """
    if kind not in FORMATS or subtype not in READ_SUBTYPES:
        raise InputError(
            f"{path}: {EXPECTED} of 8 to 32 bits or float, got {kind} {subtype}"
        )
    if channels > MAX_CHANNELS:
        raise InputError(
            f"{path}: expected at most {MAX_CHANNELS} channels, got {channels}"
        )


def format_of(path: str | os.PathLike[str], bits: Bits) -> str:
    """Return the format by the name of a file.

    Raises:
        InputError: The name has no known suffix, or the format no samples of these
            bits.
    """
    kind = Path(path).suffix.lower().removeprefix(".").upper()
    if kind not in SUBTYPES:
        raise InputError(f"{path}: expected a name in .wav or .flac")
    if bits not in SUBTYPES[kind]:
        expected = ", ".join(map(str, SUBTYPES[kind]))
        raise InputError(
            f"{path}: expected bits of {kind} ({expected}), got {shown(bits)}"
        )
    return kind


def whole_rate(rate_hz: float | int, path: str | os.PathLike[str] | None = None) -> int:
    """Return a sampling rate as a whole number [Hz].

    Raises:
        InputError: The rate is not a whole number, or not positive.
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
    """Return samples in a form that libsndfile writes without rounding.

    These are the upper bits of 32. From floats libsndfile would make 32767 of 1, while
    it reads 1 from 32768.

    Raises:
        InputError: A sample is not finite, or beyond full scale for whole numbers.
    """
    if bits == "float":
        # what is too large is refused below
        with np.errstate(over="ignore"):
            samples = samples.astype(np.float32)
    if not np.isfinite(samples).all():
        channel, at = np.argwhere(~np.isfinite(samples))[0]
        raise InputError(
            f"{path}: expected finite samples to write, got {samples[channel, at]} at "
            f"sample {at + 1} of channel {channel + 1}"
        )
    if bits == "float":
        return samples
    most = float(np.abs(samples).max(initial=0.0))
    if most > 1.0:
        raise InputError(
            f"{path}: expected samples from -1 to 1 of full scale, got {most:g}"
        )
    scale = 2 ** (bits - 1)
    # 64 bits, as full scale of 32 bits overflows before the limit below
    codes = np.rint(samples.astype(np.float64) * scale).astype(np.int64)
    return (np.minimum(codes, scale - 1) << (32 - bits)).astype(np.int32)


class _Sizes(NamedTuple):
    """Sizes in the header of a WAV file.

    Attributes:
        missing: Smallest number of bytes missing at the end of the file.
        unset: Position of a size that was never written, and the right bytes.
    """

    missing: int
    unset: tuple[int, bytes] | None = None


def _sizes(path: Path) -> _Sizes:
    """Return the sizes in a header that do not agree with the file.

    References:
        Multimedia Programming Interface and Data Specifications 1.0 (IBM, Microsoft,
        1991); EBU Tech 3306 for RF64.
    """
    there = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(12)
        if not head.startswith((b"RIFF", b"RF64")) or len(head) < 12:
            return _Sizes(0)
        whole = 8 + struct.unpack("<I", head[4:8])[0]
        long_size, long_at = STREAMED, 0
        while len(head := file.read(8)) == 8:
            name, size = struct.unpack("<4sI", head)
            if name == b"ds64":
                long_at = file.tell()
                long_whole, long_size = struct.unpack(
                    "<QQ", file.read(16).ljust(16, b"\0")
                )
                whole = 8 + long_whole
                file.seek(size - 16, 1)
                continue
            if name == b"data":
                at = file.tell()
                is_long = size == STREAMED and long_at > 0
                size = long_size if is_long else size
                # other chunks behind no samples are within the size of the whole
                if size == 0 and at < there != whole:
                    if is_long:
                        fix = long_at + 8, struct.pack("<Q", there - at)
                    else:
                        fix = at - 4, struct.pack("<I", min(there - at, STREAMED))
                    return _Sizes(0, fix)
                stated = 0 if size == STREAMED else at + size
                return _Sizes(max(stated - there, 0))
            # chunks begin at even positions
            file.seek(size + size % 2, 1)
    # the file ends before the header of its samples
    return _Sizes(8 - len(head))


@contextmanager
def _opened(path: Path) -> Iterator[tuple["soundfile.SoundFile", _Sizes]]:
    """Open a sound file with the sizes of the file in its header, and yield both."""
    import soundfile

    sizes = _sizes(path)
    with ExitStack() as stack:
        source: Any = path
        if sizes.unset:
            file = stack.enter_context(path.open("rb"))
            # a copy of the pages that are changed, not of the file
            source = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
            stack.enter_context(source)
            at, octets = sizes.unset
            source[at : at + len(octets)] = octets
        yield stack.enter_context(soundfile.SoundFile(source)), sizes


def _intact(path: Path, frames: int) -> int:
    """Return the number of samples of a FLAC file that can be read."""
    import soundfile

    if frames > MAX_FRAMES:
        raise InputError(
            f"{path}: expected the number of samples in its header, got none, as of a "
            "stream; decode it to WAV (flac -d)"
        )
    with suppress(soundfile.LibsndfileError), soundfile.SoundFile(path) as file:
        file.seek(frames - 1)
        if len(file.read(1)) == 1:
            return frames
    length = 0
    with suppress(soundfile.LibsndfileError), soundfile.SoundFile(path) as file:
        while got := len(file.read(FLAC_BLOCK)):
            length += got
    return length
