"""Sound files: WAV and FLAC of 8 to 32 bits, float, mu-law or A-law; 1 to 8 channels.

Whole numbers are read as a share of full scale, floating-point numbers as they stand.
Other compression with loss and samples that are not finite are refused; nothing is
clipped or filled in. The header of a WAV file (RIFF, or RF64 by EBU Tech 3306) is
compared with the size of the file: of a truncated file, and of one whose recorder
stopped before it wrote the size, the samples that are present are read, with a note. A
truncated FLAC file is refused. The time of the first sample is that of the chunk `bext`
(EBU Tech 3285), or of the comment of an AudioMoth. Whole numbers are passed to
libsndfile in the upper bits of 32, because its own conversion from floats is not the
inverse of its reading. WAV files are written up to 4 GiB.
"""

import math
import mmap
import os
import re
import struct
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime, timedelta
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError, shown
from jblast.files import replacing
from jblast.observations.records.recording import (
    BILLION,
    FULL_SCALE,
    START,
    Clock,
    Column,
    Group,
    Scaling,
    first_bytes,
    recordings_of,
)

if TYPE_CHECKING:
    import soundfile

Bits = int | Literal["float"]
"""Bits of a sample: 8, 16, 24 or 32 for whole numbers, or floats of 32 bits."""
MAX_CHANNELS = 8
"""Largest number of channels, that of FLAC and of common field recorders."""
SUBTYPES: dict[str, dict[int | str, str]] = {
    ".wav": {8: "PCM_U8", 16: "PCM_16", 24: "PCM_24", 32: "PCM_32", "float": "FLOAT"},
    ".flac": {8: "PCM_S8", 16: "PCM_16", 24: "PCM_24"},
}
"""Names in libsndfile of the subtypes by suffix and bits."""
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
EXPECTED = "a sound file, WAV or FLAC"
MAX_BYTES = 2**32 - 2**16
"""Largest size of the samples of a WAV file: its sizes have 32 bits, and 64 KiB are
left for the header."""
STREAMED = 0xFFFFFFFF
"""Size in a header that means "until the end of the file": written by programs that
cannot seek back, and in RF64, where the chunk `ds64` has the true size."""
BEXT_TIME, BEXT_BYTES = ((320, 330), (330, 338)), 346
"""Position of date and time in `bext`, and the end of the number of samples since
midnight, 64 bits."""
RECORDED_AT = re.compile(
    r"Recorded at (\d\d:\d\d:\d\d(?:\.\d+)?) (\d\d)/(\d\d)/(\d{4}) "
    r"\(UTC(?:([+-])(\d\d?)(?::(\d\d))?)?\)"
)
"""Time in the comment of an AudioMoth: "Recorded at 14:05:00 01/02/2024 (UTC+1)"."""


class SoundRecord(NamedTuple):
    """Samples of a sound file.

    Attributes:
        samples: Whole numbers as a share of full scale, -1 to 1; floats unchanged.
        rate_hz: Sampling rate of each channel [Hz].
        notes: Notes of the reader, a sentence each.
    """

    samples: Float[np.ndarray, "channel sample"]
    rate_hz: int
    notes: tuple[str, ...] = ()


def read_sound(path: str | os.PathLike[str]) -> SoundRecord:
    """Return the samples of a sound file, in double precision.

    Raises:
        InputError: There is no such file; it is empty or not a sound file; it has no
            samples, some that are not finite, or more than eight channels; or its
            compression is lossy.
    """
    (group,) = groups = open_sound(Path(path))
    (one,) = recordings_of(Path(path), groups, Scaling())
    samples = one.samples(0, one.length)
    return SoundRecord(samples, int(one.rate_hz), group.columns[0].notes)


def write_sound(
    path: str | os.PathLike[str],
    samples: Float[np.ndarray, "..."] | Iterator[Float[np.ndarray, "..."]],
    rate_hz: float | int,
    bits: Bits = "float",
) -> int:
    """Write a sound file completely or not at all, and return its number of samples.

    If packets of samples end with an error or an interruption, those before it are
    written as a complete file, and the error is raised again.

    Args:
        path: Path ending in .wav or .flac; an existing file is replaced.
        samples: Samples by channel and sample, or of one channel; or an iterator of
            such packets, which are written in constant memory. Floats of 32 bits are
            written unchanged. For whole numbers they are shares of full scale, -1 to 1,
            rounded to the nearest; 1 itself becomes the largest code.
        rate_hz: Sampling rate, a whole number [Hz].
        bits: Bits of a sample; FLAC has up to 24, and no floats.

    Raises:
        InputError: The format cannot store these samples or this number of them, or
            there are none.
    """
    import soundfile

    suffix = Path(path).suffix.lower()
    if bits not in SUBTYPES.get(suffix, {}):
        options = (f"{end} of {', '.join(map(str, SUBTYPES[end]))}" for end in SUBTYPES)
        raise InputError(
            f"{path}: expected {' or '.join(options)} bits, got {shown(bits)}"
        )
    whole_rate_hz = whole_rate(rate_hz)
    packets = samples if isinstance(samples, Iterator) else iter([samples])
    arrays = (np.atleast_2d(np.asarray(packet)) for packet in packets)
    first = next(arrays, np.zeros((1, 0)))
    if first.ndim != 2 or len(first) > MAX_CHANNELS:
        raise InputError(
            f"{path}: expected samples [channel, sample] of at most {MAX_CHANNELS} "
            f"channels, got the shape {first.shape}"
        )
    # bytes of one sample of all channels
    step, written = len(first) * (4 if bits == "float" else bits // 8), 0
    broken: BaseException | None = None
    with replacing(path) as temporary:
        with soundfile.SoundFile(
            temporary,
            mode="w",
            samplerate=whole_rate_hz,
            channels=len(first),
            format=suffix[1:].upper(),
            subtype=SUBTYPES[suffix][bits],
        ) as file:
            try:
                for packet in chain([first], arrays):
                    if (written + packet.shape[1]) * step > MAX_BYTES:
                        raise InputError(
                            f"{path}: expected at most {MAX_BYTES // step:,} samples, "
                            "the limit of a WAV file, got more; write a shorter one"
                        )
                    file.write(_encoded(path, packet, bits).T)
                    written += packet.shape[1]
            except BaseException as error:
                broken = error
        # nothing to keep: what was there before stays
        if not written:
            raise broken or InputError(f"{path}: expected samples to write, got none")
        with temporary.open("r+b") as file:
            head = file.read(256)
            at = head.find(b"PEAK")
            # libsndfile adds the date of writing to floats: two equal records would be
            # different files. It follows the chunk's name, size and version
            if head.startswith(b"RIFF") and at >= 0:
                file.seek(at + 12)
                file.write(bytes(4))
    if broken is not None:
        raise broken
    return written


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


def open_sound(path: Path) -> tuple[Group, ...]:
    """Return the channels of a sound file, before its samples are read.

    Whole numbers clip at the largest code; the clipping level of floats is unknown.

    Raises:
        InputError: As for `read_sound`, except for samples that are not finite.
    """
    with opened_sound(path) as (file, header):
        zero, notes = _start(file, header)
        length, channels, rate_hz = file.frames, file.channels, float(file.samplerate)

    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        with opened_sound(path) as (opened, _):
            opened.seek(start)
            samples = opened.read(stop - start, dtype="float64", always_2d=True).T
        if samples.shape[1] < stop - start:
            raise InputError(
                f"{path}: is cut short: expected {stop - start} samples, got "
                f"{samples.shape[1]}"
            )
        return samples

    column = Column(
        name="",
        unit=FULL_SCALE,
        length=length,
        read=read,
        channels=channels,
        clocks=(Clock(rate_hz, 0.0, zero),),
        full_scale=LARGEST.get(file.subtype),
        notes=header.notes,
    )
    return (Group((column,), notes),)


@contextmanager
def opened_sound(path: Path) -> Iterator[tuple["soundfile.SoundFile", "_Header"]]:
    """Open a sound file for reading, with a size in its header.

    Raises:
        InputError: There is no such file; it is empty or not a sound file; it has no
            samples or more than eight channels; or its compression is lossy.
    """
    # imported here: loading libsndfile would delay readers of other formats
    import soundfile

    first_bytes(path, EXPECTED)
    header = _header(path)
    try:
        with ExitStack() as stack:
            source: Any = path
            if header.fix:
                file = stack.enter_context(path.open("rb"))
                # a copy of the pages that are changed, not of the file
                source = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
                stack.enter_context(source)
                at, octets = header.fix
                source[at : at + len(octets)] = octets
            file = stack.enter_context(soundfile.SoundFile(source))
            if (
                file.format not in FORMATS
                or file.subtype not in READ_SUBTYPES
                or file.channels > MAX_CHANNELS
            ):
                raise InputError(
                    f"{path}: expected {EXPECTED}, of 8 to 32 bits or float, with at "
                    f"most {MAX_CHANNELS} channels, got {file.format} {file.subtype} "
                    f"with {file.channels}"
                )
            if file.frames == 0:
                raise InputError(
                    f"{path}: expected {EXPECTED}, with samples, got none; is it "
                    "cut short?"
                )
            if header.missing:
                note = (
                    f"cut short: {file.frames / file.samplerate:.6g} s are read, and "
                    f"at least {header.missing:,} bytes are missing at its end"
                )
                header = header._replace(notes=(note,))
            yield file, header
    except soundfile.LibsndfileError as error:
        reason = error.error_string.strip().rstrip(".")
        raise InputError(
            f"{path}: expected {EXPECTED}, got one that is cut short, damaged or of "
            f"another format ({reason})"
        ) from None


def whole_rate(rate_hz: float | int) -> int:
    """Return a sampling rate as a whole number [Hz].

    Raises:
        InputError: The rate is not a whole number, or not positive.
    """
    if not (math.isfinite(rate_hz) and rate_hz == int(rate_hz) and 0 < rate_hz < 2**31):
        raise InputError(
            "sampling rate: expected a positive, whole number of samples a second, got "
            f"{rate_hz:g} Hz"
        )
    return int(rate_hz)


def _encoded(
    path: str | os.PathLike[str], samples: Float[np.ndarray, "channel n"], bits: Bits
) -> Float[np.ndarray, "channel n"] | Int[np.ndarray, "channel n"]:
    """Return samples in a form that libsndfile writes without rounding.

    These are the upper bits of 32. From floats libsndfile would make 32767 of 1, while
    it reads 1 from 32768.

    Raises:
        InputError: A sample is not finite, or beyond full scale for whole numbers.
    """
    limit = float(np.finfo(np.float32).max) if bits == "float" else 1.0
    most = float(np.abs(samples).max(initial=0.0))
    # also if one is NaN
    if not most <= limit:
        raise InputError(
            f"{path}: expected finite samples from {-limit:g} to {limit:g}, got {most}"
        )
    if bits == "float":
        return samples.astype(np.float32)
    scale = 2 ** (bits - 1)
    # 64 bits, as full scale of 32 bits overflows before the limit below
    codes = np.rint(samples.astype(np.float64) * scale).astype(np.int64)
    return (np.minimum(codes, scale - 1) << (32 - bits)).astype(np.int32)


class _Header(NamedTuple):
    """The header of a WAV file, as far as libsndfile does not use it.

    Attributes:
        missing: Smallest number of bytes missing at the end of the file.
        fix: Position of a size that was never written, and the right bytes.
        bext: Contents of the chunk of broadcast files; b"" without one.
        notes: Notes, a sentence each.
    """

    missing: int = 0
    fix: tuple[int, bytes] | None = None
    bext: bytes = b""
    notes: tuple[str, ...] = ()


def _header(path: Path) -> _Header:
    """Return the header of a WAV file; of another file an empty one.

    References:
        Multimedia Programming Interface and Data Specifications 1.0 (IBM, Microsoft,
        1991); EBU Tech 3306 for RF64.
    """
    there = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(12)
        if not head.startswith((b"RIFF", b"RF64")) or len(head) < 12:
            return _Header()
        whole, bext, ds64 = 8 + struct.unpack("<I", head[4:8])[0], b"", None
        while len(head := file.read(8)) == 8:
            name, size = struct.unpack("<4sI", head)
            at = file.tell()
            if name == b"data":
                break
            if name == b"ds64":
                whole, long = struct.unpack("<QQ", file.read(16).ljust(16, b"\0"))
                whole, ds64 = whole + 8, (at + 8, "<Q", long)
            if name == b"bext":
                bext = file.read(min(size, BEXT_BYTES))
            # chunks begin at even positions
            file.seek(at + size + size % 2)
        else:
            # the file ends before the header of its samples
            return _Header(8 - len(head))
    rest, field, form = there - at, at - 4, "<I"
    if size == STREAMED and ds64:
        field, form, size = ds64
    # other chunks behind no samples are within the size of the whole
    if size == 0 < rest and there != whole:
        right = struct.pack(form, rest if form == "<Q" else min(rest, STREAMED))
        note = "its header has no size: read to the end of the file"
        return _Header(0, (field, right), bext, (note,))
    return _Header(0 if size == STREAMED else max(size - rest, 0), None, bext)


def _start(
    file: "soundfile.SoundFile", header: _Header
) -> tuple[int | None, tuple[str, ...]]:
    """Return the time of the first sample, in nanoseconds since 1970, and a note.

    References:
        EBU Tech 3285: `bext` has date, time and the samples since midnight, of a clock
        whose zone is not stated.
    """
    samples, note = 0, "its comment, to the second"
    if found := RECORDED_AT.search(file.comment):
        time, day, month, year, sign, hours, minutes = found.groups()
        zone = f"{sign or '+'}{int(hours or 0):02}:{minutes or '00'}"
        text = f"{year}-{month}-{day}T{time}{zone}"
    else:
        note = "its chunk bext, which has no time zone and is read as UTC"
        date, time = (header.bext[a:b].decode("ascii", "replace") for a, b in BEXT_TIME)
        samples = int.from_bytes(header.bext[BEXT_TIME[-1][1] : BEXT_BYTES], "little")
        time = "00:00:00" if samples else re.sub(r"\D", ":", time)
        text = re.sub(r"\D", "-", date) + f"T{time}+00:00"
    try:
        start = datetime.fromisoformat(text)
    except ValueError:
        return None, ()
    zero = (start - START) // timedelta(microseconds=1) * 1000
    zero += round(samples * BILLION / file.samplerate)
    return zero, (f"time of day by {note}",)
