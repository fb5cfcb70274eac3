"""Recordings: the channels of one clock, their units and their sampling rate.

A `Recording` is open for reading, of which no samples have been read; a
`PressureRecord` contains the samples of one channel. Both have a constant sampling
rate. Times in a file are replaced by the straight line through them (least squares),
with the rate rounded as far as that moves no sample by 1 % of a step. Times more than a
quarter of a step off that line, gaps and repeated times are refused.

The readers of all formats return the columns of a file with their units (`Group`). One
rule, `recordings_of`, finds among them time and pressure. Units are given with a column
or part of its name (`pressure_kpa`, `Pressure (kPa)`). Samples become pascals by their
unit of pressure, or by the sensitivity or full scale that the user specifies. Without
one, volts are refused; counts and shares of full scale keep their unit and are marked
as not calibrated.

The time of the first sample is an epoch, a whole second in UTC, and seconds after it.
Seconds since 1970 in double precision are 2.4e-7 s apart; seconds after the epoch are
finer.
"""

import logging
import math
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import islice
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Num

from jblast.errors import (
    InputError,
    argument,
    check_declared,
    read_bytes,
    reading,
    shown,
)
from jblast.units import NO_UNITS, sample_unit, spelt, word_and_unit

BLOCK_SAMPLES = 2**20
"""Number of samples of all channels that are read together: 8 MB, large enough that
opening the file costs little, small enough for any memory."""
RATES = ("rate_hz", "sampling_rate_hz", "sampling_rate", "sample_rate", "fs_hz", "fs")
"""Names of the sampling rate in files without times."""
FULL_SCALE = "full scale"
"""Unit of sound: shares of the largest sample."""
IGNORED = ("note", "comment", "index", "sample", "number", "n", "")
"""First words of columns without measurements."""
MAX_JITTER = 0.25
"""Largest deviation of a time from an even clock, over the step: rounded times deviate
by up to half of their last digit, and a deviation of half a step could be another
sample."""
GAP_STEPS = 1.75
"""Step from which on samples are missing, over the median step: one missing sample
makes it 2, jitter at most 1.5."""
RATE_TOLERANCE = 0.01
"""Largest shift of the last sample by a rounded rate, in steps: far below the error of
any arrival."""
START = datetime(1970, 1, 1, tzinfo=UTC)
"""Zero of POSIX time."""
BILLION = 1_000_000_000
"""Nanoseconds per second."""


@dataclass(frozen=True, kw_only=True)
class Sampled:
    """Clock and scale of samples.

    Attributes:
        rate_hz: Sampling rate [Hz].
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None if unknown.
        calibrated: True for samples in pascals; else their unit is unknown, as that of
            shares of full scale or counts.
        full_scale: Largest absolute value of a sample, in their unit; None without
            clipping, or if unknown.
        source: The file.
        notes: Notes of the reader, a sentence each.
    """

    rate_hz: float
    start_s: float = 0.0
    epoch: datetime | None = None
    calibrated: bool = True
    full_scale: float | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise ValueError(f"rate_hz must be positive, got {self.rate_hz:g} Hz")
        if not math.isfinite(self.start_s):
            raise ValueError(f"start_s must be finite, got {self.start_s} s")
        if self.epoch is not None and self.epoch.tzinfo is None:
            raise ValueError(f"epoch must have a time zone, got {self.epoch}")


@dataclass(frozen=True)
class PressureRecord(Sampled):
    """Samples of one channel on an even clock.

    Attributes:
        name: The stem of its file, or stem.channel.
        samples: Samples in double precision: overpressure [Pa] if `calibrated`.
        high_pass_hz: Corner of the recorder's first-order high-pass [Hz]; None without
            one, or if unknown.
        aliases: Other names of the channel, which a table of stations may have.
        shot: Name of the event, if the folder of the file is one; "" without one.
    """

    name: str
    samples: Float[np.ndarray, " sample"]
    high_pass_hz: float | None = None
    aliases: tuple[str, ...] = ()
    shot: str = ""

    @property
    def time_s(self) -> Float[np.ndarray, " sample"]:
        """Time of each sample on the recorder's clock [s]."""
        return self.start_s + np.arange(self.samples.size) / self.rate_hz

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return self.samples.size / self.rate_hz


@dataclass(frozen=True)
class Recording(Sampled):
    """Channels of one file with a common rate and start, before their samples are read.

    Attributes:
        names: Names of the channels: the stem of the file, or stem.channel with the
            channel's name in the file, or its number from 1.
        length: Number of samples of each channel.
        read: Function that returns the samples in a range, the last one excluded, in
            pascals if `calibrated`; NaN for missing numbers.
        aliases: Other names of each channel, which a table of stations may have.
        offset: Function that returns the time of a sample after the first one [s], for
            a rate that varies; None for a constant rate.
        own_start_s: Time of the first sample from the zero of the file's own times: the
            trigger, or the first sample of the file [s].
        clock_is_set: False for a recorder whose clock began at zero when it started.
    """

    names: tuple[str, ...]
    length: int
    read: Callable[[int, int], Float[np.ndarray, "channel sample"]]
    aliases: tuple[tuple[str, ...], ...] = ()
    offset: Callable[[int], float] | None = None
    own_start_s: float = 0.0
    clock_is_set: bool = True

    def samples(self, start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        """Return an interval of every channel.

        Raises:
            InputError: A sample is not finite.
        """
        with reading(self.source, "samples"):
            samples = self.read(max(start, 0), min(stop, self.length))
        if np.isfinite(samples).all():
            return samples
        # transposed, so that the first one in time is reported
        channel, sample = np.argwhere(~np.isfinite(samples.T))[0][::-1]
        where = f"{self.source}: channel {self.names[channel]}"
        if not np.isfinite(samples[channel]).any():
            raise InputError(f"{where}: expected samples, got no finite number")
        nth = max(start, 0) + int(sample)
        raise InputError(
            f"{where}, sample {nth + 1} ({self.time_s(nth):.6g} s): expected a finite "
            f"sample, got {samples[channel, sample]}"
        )

    def time_s(self, sample: int) -> float:
        """Return the time of a sample on the recorder's clock [s]."""
        if self.offset is None:
            return self.start_s + sample / self.rate_hz
        return self.start_s + float(self.offset(sample))

    def blocks(self) -> Iterator[tuple[int, Float[np.ndarray, "channel sample"]]]:
        """Yield the first sample of each block and the block, in constant memory."""
        size = max(BLOCK_SAMPLES // len(self.names), 1)
        for start in range(0, self.length, size):
            yield start, self.samples(start, start + size)

    def record(
        self, channel: int, start: int = 0, stop: int | None = None
    ) -> PressureRecord:
        """Return an interval of one channel, counted from 0, as a `PressureRecord`."""
        start, stop = max(start, 0), self.length if stop is None else stop
        common: dict[str, Any] = {
            n.name: getattr(self, n.name) for n in fields(Sampled)
        }
        common["start_s"] = self.time_s(start)
        return PressureRecord(
            self.names[channel],
            self.samples(start, stop)[channel],
            aliases=self.aliases[channel] if self.aliases else (),
            **common,
        )


def first_bytes(path: Path, expected: str) -> bytes:
    """Return the first bytes of a file.

    Raises:
        InputError: There is no such file, or it is empty or cannot be read.
    """
    start = read_bytes(path, expected, 8)
    if not start:
        raise InputError(f"{path}: is empty; expected {expected}")
    return start


class Scaling(NamedTuple):
    """Scale of the recorders as specified by the user.

    Attributes:
        full_scale_pa: Overpressure of a sample of 1 in a sound file [Pa].
        sensitivity: Pascals per volt, or per count for formats with counts.
    """

    full_scale_pa: float | None = None
    sensitivity: float | None = None


class Clock(NamedTuple):
    """Times of samples.

    Attributes:
        rate_hz: Sampling rate [Hz].
        start_s: Time of the first sample from the file's own zero [s].
        zero: UTC of that zero, nanoseconds since 1970; None if unknown.
        begin: Its first sample within the column, of a column with gaps.
        length: Number of samples; 0 for those of the column.
        offset: As in `Recording`.
    """

    rate_hz: float
    start_s: float = 0.0
    zero: int | None = None
    begin: int = 0
    length: int = 0
    offset: Callable[[int], float] | None = None


class Column(NamedTuple):
    """An array of samples or times within a file.

    Attributes:
        name: Its name in the file; "" for its number.
        unit: Its unit as written; "" for the one in its name.
        length: Number of samples.
        read: Function that returns the samples in a range, in that unit.
        channels: Number of channels.
        clocks: Its own clocks, several of a column with gaps; without one that of a
            column of times of the same length.
        full_scale: Largest absolute value of a sample, in its unit; None if unknown.
        aliases: Other names of the channel.
        notes: Notes, a sentence each.
    """

    name: str
    unit: str
    length: int = 0
    read: Callable[[int, int], Num[np.ndarray, "..."]] = lambda *_: np.zeros(0)
    channels: int = 1
    clocks: tuple[Clock, ...] = ()
    full_scale: float | None = None
    aliases: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def word(self) -> str:
        """Its name without a unit."""
        word, unit = word_and_unit(self.name)
        return word if word and sample_unit(unit).dimension else self.name

    @property
    def its_unit(self) -> str:
        """Its unit, with that of its name if no other is given."""
        plain = self.unit.strip().lower()
        return word_and_unit(self.name)[1] if plain in NO_UNITS else self.unit

    @property
    def dimension(self) -> str:
        """Dimension of the unit, as in `sample_unit`; "share" of full scale."""
        if self.unit == FULL_SCALE:
            return "share"
        return sample_unit(self.its_unit).dimension

    @property
    def label(self) -> str:
        """Its name for messages."""
        return f"column {self.name}".strip()


class Group(NamedTuple):
    """Columns that may have common times: a text, a struct, a group of a file.

    Attributes:
        columns: The columns.
        notes: Notes, a sentence each.
        line: Function that returns the position of a sample in a text, for messages;
            None for other formats.
    """

    columns: tuple[Column, ...]
    notes: tuple[str, ...] = ()
    line: Callable[[int], str] | None = None


class Channels(NamedTuple):
    """A column of pressure, and the names of its channels.

    Attributes:
        group: Its group.
        column: The column.
        names: Names of each channel, of which the first is used: the stem of the file,
            or stem.channel.
    """

    group: Group
    column: Column
    names: tuple[tuple[str, ...], ...]


def channels_of(path: Path, groups: Sequence[Group]) -> tuple[Channels, ...]:
    """Return the columns of a file that are pressure, by their units.

    These are pascals and volts; without any, counts and shares of full scale.

    Raises:
        InputError: There are none, or one has two units, or two of one word have.
    """
    held = [(group, column) for group in groups for column in group.columns]
    for _, column in held:
        own = word_and_unit(column.name)[1]
        meant, stated = sample_unit(own), sample_unit(column.its_unit)
        if meant.dimension and stated.dimension and meant != stated:
            raise InputError(
                f"{path}: {column.label}: expected one unit, got {own} in its name and "
                f"{column.unit}"
            )
    used = [one for one in held if one[1].dimension in ("pressure", "voltage")]
    used = used or [one for one in held if one[1].dimension in ("count", "share")]
    if not used:
        got = ", ".join(_listed(column) for _, column in held)
        log = "sensor" in (column.name.strip().lower() for _, column in held)
        raise InputError(
            f"{path}: expected pressure, as pressure_kpa, or volts, got "
            f"{shown(got) if got else 'no numbers'}"
            + ("; this is a log, which jblast fit takes" if log else "")
        )
    seen: dict[tuple[int, str], Column] = {}
    for group, column in used:
        bare = spelt(word_and_unit(column.name)[0])
        first = seen.setdefault((id(group), bare), column)
        if column.name and spelt(first.its_unit) != spelt(column.its_unit):
            raise InputError(
                f"{path}: columns {first.name} and {column.name}: "
                f"expected one unit for one channel, got {first.its_unit} and "
                f"{column.its_unit}; keep one of them, or give two channels two names"
            )
    # a comma or quote separates fields of a log, # is followed by a bang's number
    words = [
        re.sub(r"[\s,;\"'#]+", " ", column.word).strip()
        + (f".{number + 1}" if column.channels > 1 else "")
        for _, column in used
        for number in range(column.channels)
    ]
    named = len(used) > 1 and len(set(words)) == len(words) and "" not in words
    found, numbered = [], enumerate(words, start=1)
    for group, column in used:
        names = []
        for number, word in islice(numbered, column.channels):
            by_number = f"{path.stem}.{number}" if len(words) > 1 else path.stem
            by_word = [f"{path.stem}.{word}", word] if word else []
            first = by_word[0] if named else by_number
            names.append((first, by_number, *by_word, *column.aliases))
        own = tuple(tuple(dict.fromkeys(one)) for one in names)
        found.append(Channels(group, column, own))
    return tuple(found)


def recordings_of(
    path: Path, groups: Sequence[Group], scaling: Scaling
) -> tuple[Recording, ...]:
    """Return a recording for each column of pressure and each of its clocks.

    Raises:
        InputError: As for `channels_of`; or a column has no clock, or is in volts
            without a sensitivity.
    """
    found = channels_of(path, groups)
    # samples of a record are at least a byte each, compressed ones less
    check_declared(path, sum(one.length * one.channels for _, one, _ in found))
    used = {id(one.column) for one in found}
    others = [
        _listed(column)
        for group in groups
        for column in group.columns
        if id(column) not in used
        and column.dimension != "time"
        and re.split(r"[\s_]", column.name.lower())[0] not in IGNORED
    ]
    notes = (f"left out, not pressure: {', '.join(others)}",) if others else ()
    recordings: list[Recording] = []
    clocks: dict[int, Clock] = {}
    for group, column, names in found:
        factor, calibrated = _scale(path, column, scaling)
        full_scale = column.full_scale and factor * column.full_scale
        for clock in column.clocks or (_clock(path, group, column, clocks),):
            epoch, start_s = None, clock.start_s
            if clock.zero is not None:
                start = clock.zero + round(clock.start_s * BILLION)
                whole, part = divmod(start, BILLION)
                epoch, start_s = START + timedelta(seconds=whole), part / BILLION
            recordings.append(
                Recording(
                    source=str(path),
                    names=tuple(own[0] for own in names),
                    rate_hz=clock.rate_hz,
                    length=clock.length or column.length,
                    read=partial(_scaled, column, clock.begin, factor),
                    start_s=start_s,
                    epoch=epoch,
                    calibrated=calibrated,
                    full_scale=full_scale,
                    notes=(*group.notes, *column.notes, *notes),
                    aliases=tuple(own[1:] for own in names),
                    offset=clock.offset,
                    own_start_s=clock.start_s,
                )
            )
    return tuple(recordings)


def _listed(column: Column) -> str:
    """Return a column's name with its unit, for lists."""
    stated = column.unit and column.unit not in column.name
    return f"{column.name} ({column.unit})" if stated else column.name


def _scaled(
    column: Column, begin: int, factor: float, start: int, stop: int
) -> Float[np.ndarray, "channel sample"]:
    samples = np.asarray(column.read(begin + start, begin + stop), np.float64)
    return np.multiply(np.atleast_2d(samples), factor, order="C")


def _scale(path: Path, column: Column, scaling: Scaling) -> tuple[float, bool]:
    """Return the factor on samples, and whether the result is in pascals.

    Raises:
        InputError: The unit is volts, and there is no sensitivity.
    """
    dimension, factor, _ = sample_unit(column.its_unit)
    if dimension == "pressure":
        return factor, True
    share = column.dimension == "share"
    given = scaling.full_scale_pa if share else scaling.sensitivity
    if given is not None:
        return factor * given, True
    # counts without a sensitivity may be normalized sound
    if dimension == "voltage":
        raise InputError(
            f"{path}: {column.label}: expected pressure, got {column.its_unit}; "
            f"add the pascals per volt, {argument('sensitivity')}"
        )
    return 1.0, False


def _clock(path: Path, group: Group, column: Column, known: dict[int, Clock]) -> Clock:
    """Return the clock of a column by the times of its group.

    Raises:
        InputError: There is no column of time of the same length, or several.
    """
    others = [one for one in group.columns if one is not column]
    times = [one for one in others if one.dimension == "time" and one.channels == 1]
    fitting = [one for one in times if one.length == column.length]
    if len(fitting) == 1:
        (one,) = fitting
        if id(one) not in known:
            known[id(one)] = _read_clock(path, group, one)
        return known[id(one)]
    got = ", ".join(
        one.name + f" ({one.length})" * (one.length not in (0, column.length))
        for one in fitting or others
    )
    days = "; times of day belong in column start_utc of the table of stations"
    raise InputError(
        f"{path}: {column.label}: expected one column of time of its "
        f"{column.length} samples, as time_s or time_ms, or a sampling rate, got "
        f"{shown(got) if got else 'neither'}"
        + days
        * bool(re.search("date|utc|stamp", got.lower()))
    )


def _read_clock(path: Path, group: Group, column: Column) -> Clock:
    """Return the clock of a column of times."""
    _, factor, zero = sample_unit(column.its_unit)
    times = np.asarray(column.read(0, column.length)).ravel()
    # stamps in nanoseconds since 1970 have more digits than a float
    first = (
        int(times[0]) if np.issubdtype(times.dtype, np.integer) and times.size else 0
    )

    def where(sample: int) -> str:
        row = group.line(sample) if group.line else f"sample {sample + 1}"
        return f"{path}: {row}, {column.label}"

    start_s, rate_hz = even_clock(factor * (times - first).astype(np.float64), where)
    if not zero:
        return Clock(rate_hz, start_s + factor * first)
    try:
        since = datetime.fromisoformat(zero.replace(" UTC", "+00:00"))
    except ValueError:
        raise InputError(
            f"{path}: {column.label}: expected a unit as days since 2020-08-04, got "
            f"{shown(column.its_unit)}"
        ) from None
    # CF conventions: a time without a zone is UTC
    since = since if since.tzinfo else since.replace(tzinfo=UTC)
    at = (since - START) // timedelta(microseconds=1) * 1000
    return Clock(rate_hz, start_s, at + first * round(factor * BILLION))


@contextmanager
def warned() -> Iterator[list[str]]:
    """Collect the warnings of a library that reads a file: logged, or Python's own.

    They are in the list when the context ends.
    """
    found: list[str] = []
    logged, root = BufferingHandler(sys.maxsize), logging.getLogger()
    logged.setLevel(logging.WARNING)
    root.addHandler(logged)
    try:
        with warnings.catch_warnings(record=True) as caught:
            # others concern the library, not the file
            warnings.simplefilter("ignore")
            for category in (UserWarning, RuntimeWarning):
                warnings.simplefilter("always", category)
            yield found
    finally:
        root.removeHandler(logged)
    found += [f"{one.name.split('.')[0]}: {one.getMessage()}" for one in logged.buffer]
    found += [f"{one.category.__name__}: {one.message}" for one in caught]


def even_clock(
    times_s: Float[np.ndarray, " sample"], where: Callable[[int], str]
) -> tuple[float, float]:
    """Return the first time [s] and the rate [Hz] of samples.

    The rate is that of the straight line through all times, rounded as far as that
    moves none of them. It is more precise than the digits of a single step.

    Args:
        times_s: Time of each sample [s].
        where: Function that names file and sample, for messages.

    Raises:
        InputError: There are fewer than two times; one is not finite, or not after the
            one before; some are missing; or one is off an even clock by `MAX_JITTER`.
    """
    if times_s.size < 2:
        raise InputError(
            f"{where(0)}: expected at least two samples, got {times_s.size}"
        )
    steps = np.diff(times_s)
    # also for times that are not finite
    back = np.flatnonzero(~((steps > 0) & np.isfinite(steps)))
    if back.size:
        at = int(back[0]) + 1
        twice = " (with too few digits?)" if steps[at - 1] == 0 else ""
        raise InputError(
            f"{where(at)}: expected a time after that of the sample before, "
            f"{times_s[at - 1]:.9g} s; got {times_s[at]:.9g} s{twice}"
        )
    # the median is not changed by a gap, the mean is
    step = float(np.median(steps))
    gap = int(np.argmax(steps))
    if steps[gap] > GAP_STEPS * step:
        raise InputError(
            f"{where(gap + 1)}: expected a sample every {step:.6g} s, got a gap of "
            f"{steps[gap]:.6g} s after {times_s[gap]:.9g} s; cut the record there"
        )
    # the straight line by least squares, relative to the first time: times since 1970
    # would lose seven digits
    number = np.arange(times_s.size) - 0.5 * (times_s.size - 1)
    since = times_s - times_s[0]
    step = float(number @ since / (number @ number))
    start = float(times_s[0] + (since.mean() + step * number[0]))
    off = np.abs(times_s - start - step * np.arange(times_s.size))
    worst = int(np.argmax(off))
    if off[worst] > MAX_JITTER * step:
        raise InputError(
            f"{where(worst)}: expected times {step:.6g} s apart, got "
            f"{times_s[worst]:.9g} s, {off[worst] / step:.2g} steps off; resample the "
            "record evenly"
        )
    # the intercept of rounded times has noise in its last digits
    if abs(times_s[0] - start) < RATE_TOLERANCE * step:
        start = float(times_s[0])
    return start, rounded(1.0 / step, RATE_TOLERANCE / times_s.size)


def rounded(rate_hz: float, tolerance: float) -> float:
    """Return the rate with the fewest digits within a relative tolerance.

    Printed times give 47999.9998 Hz where the recorder has 48000.
    """
    options = (float(f"{rate_hz:.{digits}g}") for digits in range(1, 18))
    return next(one for one in options if abs(one / rate_hz - 1.0) <= tolerance)
