"""Sound files: WAV and FLAC of 8 to 32 bits or float, one to eight channels.

What is read is what was written: whole numbers against their full scale, floating
point as it stands. A file that is cut short, or holds what is no sound pressure, is
refused with one message; nothing is clipped, dropped or filled in.
"""

import os
from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.files import replacing
from jblast.observations.records.opened_sound import opened_sound
from jblast.observations.records.sound_formats import (
    MOST_BYTES,
    MOST_CHANNELS,
    SUBTYPES,
    Bits,
    encoded,
    format_of,
    whole_rate,
)


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
