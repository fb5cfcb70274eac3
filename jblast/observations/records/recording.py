"""Recordings: the channels of one clock, their units and their sampling rate.

A `Recording` is a file that is open for reading, of which no samples have been read; a
`PressureRecord` contains the samples of one channel. Both have a constant sampling
rate. Times in a file are replaced by the straight line through them (least squares),
with the rate rounded as far as that moves no sample by 1 % of a step. Times more than a
quarter of a step off that line, gaps and repeated times are refused.

Units are part of the names of channels (`pressure_kpa`, `Pressure (kPa)`) or given with
them. Samples become pascals by their unit of pressure, or by the sensitivity or full
scale that the user specifies. Without one, volts are refused; counts and shares of full
scale keep their unit and are marked as not calibrated.

The time of the first sample is an epoch, a whole second in UTC, and seconds after it.
Seconds since 1970 in double precision are 2.4e-7 s apart; seconds after the epoch are
finer.
"""

import logging
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, reading, shown
from jblast.units import si_factor, unit_spelt

BLOCK_SAMPLES = 2**20
"""Number of samples of all channels that are read together: 8 MB, large enough that
opening the file costs little, small enough for any memory."""
RATES = ("rate_hz", "sampling_rate_hz", "sampling_rate", "sample_rate", "fs_hz", "fs")
"""Names of the sampling rate in files without times."""
VOLTS = {
    "v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "millivolts": 1e-3, "uv": 1e-6,
}  # fmt: skip
PSI = 6894.757293168
PRESSURES = {
    "pascal": 1.0, "pascals": 1.0, "n_m2": 1.0, "n_m_2": 1.0, "n_mm2": 1e6,
    "n_mm_2": 1e6, "lbf_in2": PSI, "lbf_in_2": PSI, "lb_in2": PSI, "lb_in_2": PSI,
    "poundspersquareinch": PSI, "pounds_per_square_inch": PSI,
    "inh2o": 249.08891, "mmh2o": 9.80665, "cmh2o": 98.0665, "kgf_cm2": 98066.5,
    "kgf_cm_2": 98066.5,
    "psia": PSI, "kpaa": 1e3, "bara": 1e5, "mbara": 1e2,
}  # fmt: skip
"""Pascals per unit in files of samples, besides those of `units`. Absolute pressures
are among them: readings count from the level before the front. A column of water is
that of ISO 80000-4 (conventional, 1000 kg/m^3, 9.80665 m/s^2) [Pa]."""
TIMES = {
    "second": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9,
    "seconds": 1.0, "minutes": 60.0, "hours": 3600.0,
}  # fmt: skip
NO_UNIT_WORDS = {"", "1", "count", "counts", "none", "unknown", "dimensionless", "fs"}
"""Units in files that are no units, or that cannot be converted."""
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
NOT_OF_THE_FILE = (
    DeprecationWarning, PendingDeprecationWarning, FutureWarning, ImportWarning,
    ResourceWarning,
)  # fmt: skip
"""Warnings of libraries that do not concern a file."""
START = datetime(1970, 1, 1, tzinfo=UTC)
"""Zero of POSIX time."""
BILLION = 1_000_000_000
"""Nanoseconds per second."""
ZEROS = tuple(datetime(year, 1, 1, tzinfo=UTC) for year in (1904, 1970, 1980))
"""Zero of the clocks of LabVIEW, of POSIX and of GPS (5 days later) or DOS: a recorder
whose clock was not set begins there."""
UNSET_S = 31 * 86400.0
"""Longest time after one of them at which a clock is not set [s]: a recorder runs for
weeks without a fix, and records of blasts of those months are few."""


@dataclass(frozen=True)
class PressureRecord:
    """Samples of one channel on an even clock.

    Attributes:
        name: The stem of its file, or stem.channel.
        samples: Samples in double precision: overpressure [Pa] if `calibrated`, else in
            an unknown unit, as shares of full scale or counts.
        rate_hz: Sampling rate [Hz].
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None if unknown.
        calibrated: True for samples in pascals.
        full_scale: Largest absolute value of a sample, in their unit; None without
            clipping, or if unknown.
        high_pass_hz: Corner of the recorder's first-order high-pass [Hz]; None without
            one, or if unknown.
        source: The file.
        notes: Notes of the reader, a sentence each.
        alias: Its name by number: stem.1; "" without one.
    """

    name: str
    samples: Float[np.ndarray, " sample"]
    rate_hz: float
    start_s: float = 0.0
    epoch: datetime | None = None
    calibrated: bool = True
    full_scale: float | None = None
    high_pass_hz: float | None = None
    source: str = ""
    notes: tuple[str, ...] = ()
    alias: str = ""

    def __post_init__(self):
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise ValueError(f"rate_hz must be positive, got {self.rate_hz:g} Hz")
        if not math.isfinite(self.start_s):
            raise ValueError(f"start_s must be finite, got {self.start_s} s")
        if self.epoch is not None and self.epoch.tzinfo is None:
            raise ValueError(f"epoch must have a time zone, got {self.epoch}")

    @property
    def time_s(self) -> Float[np.ndarray, " sample"]:
        """Time of each sample on the recorder's clock [s]."""
        return self.start_s + np.arange(self.samples.size) / self.rate_hz

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return self.samples.size / self.rate_hz


@dataclass(frozen=True)
class Recording:
    """Channels of one file with a common rate and start, before their samples are read.

    Attributes:
        source: The file.
        names: Names of the channels: the stem of the file, or stem.channel with the
            channel's name in the file, or its number from 1.
        labels: Names of the channels in messages: "channel 2", "column pressure_kpa".
        rate_hz: Sampling rate [Hz].
        length: Number of samples of each channel.
        read: Function that returns the samples in a range, the last one excluded, in
            pascals if `calibrated`; NaN for missing numbers.
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None if unknown.
        calibrated: True for samples in pascals.
        full_scale: Largest absolute value of a sample; None if unknown.
        notes: Notes of the reader, a sentence each.
        first_line: Line of the first sample in a text; None for other formats.
        aliases: Names of the channels by number, which tables of stations may have.
        offset: Function that returns the time of a sample after the first one [s], for
            a rate that varies; None for a constant rate.
        clock_is_set: False for a recorder whose clock began at zero when it started.
    """

    source: str
    names: tuple[str, ...]
    labels: tuple[str, ...]
    rate_hz: float
    length: int
    read: Callable[[int, int], Float[np.ndarray, "channel sample"]]
    start_s: float = 0.0
    epoch: datetime | None = None
    calibrated: bool = True
    full_scale: float | None = None
    notes: tuple[str, ...] = ()
    first_line: int | None = None
    aliases: tuple[str, ...] = ()
    offset: Callable[[int], float] | None = None
    clock_is_set: bool = True

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return self.length / self.rate_hz

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
        where = f"{self.source}: {self.labels[channel]}"
        if not np.isfinite(samples[channel]).any():
            raise InputError(f"{where}: expected samples, got no finite number")
        nth = max(start, 0) + int(sample)
        raise InputError(
            f"{where}, {self.place(nth)}: expected a finite sample, "
            f"got {samples[channel, sample]}"
        )

    def place(self, sample: int) -> str:
        """Return a sample's position for messages: its line, or number and time."""
        if self.first_line is not None:
            return f"line {self.first_line + sample}"
        return f"sample {sample + 1} ({self.time_s(sample):.6g} s)"

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
        return self.stretch(channel, start, self.samples(start, stop)[channel])

    def stretch(
        self, channel: int, start: int, samples: Float[np.ndarray, " sample"]
    ) -> PressureRecord:
        """Return existing samples of a channel as a `PressureRecord`."""
        return PressureRecord(
            name=self.names[channel],
            samples=samples,
            rate_hz=self.rate_hz,
            start_s=self.time_s(start),
            epoch=self.epoch,
            calibrated=self.calibrated,
            full_scale=self.full_scale,
            source=self.source,
            notes=self.notes,
            alias=self.aliases[channel] if self.aliases else "",
        )


def channel_names(stem: str, count: int) -> tuple[str, ...]:
    """Return a file's channels by number: its stem, or stem.1 and so on."""
    if count == 1:
        return (stem,)
    return tuple(f"{stem}.{number}" for number in range(1, count + 1))


def named_channels(stem: str, words: Sequence[str]) -> tuple[str, ...]:
    """Return the names of a file's channels: stem.name, or by number without names.

    Args:
        stem: Stem of the file.
        words: Names of the channels in the file; "" without one.
    """
    # a comma or quote separates fields of a log, # is followed by a bang's number
    words = [re.sub(r"[\s,;\"'#]+", " ", word).strip() for word in words]
    if len(words) == 1 or "" in words or len(set(words)) < len(words):
        return channel_names(stem, len(words))
    return tuple(f"{stem}.{word}" for word in words)


class SampleClock(NamedTuple):
    """Times of samples.

    Attributes:
        start_s: Time of the first one on the recorder's clock [s].
        rate_hz: Sampling rate [Hz].
        epoch: UTC of that clock's time zero; None if unknown.
    """

    start_s: float
    rate_hz: float
    epoch: datetime | None = None


class Piece(NamedTuple):
    """An array of samples within a file.

    Attributes:
        label: Its name in messages: "variable pressure_kpa".
        unit: Its unit as written; "" without one.
        channels: Number of channels.
        length: Number of samples of each.
        read: Function that returns the samples in a range, in that unit.
        clock: Times of the samples.
        name: Name of the channel in names of records; "" for its number.
    """

    label: str
    unit: str
    channels: int
    length: int
    read: Callable[[int, int], Float[np.ndarray, "channel sample"]]
    clock: SampleClock
    name: str = ""


class Scaling(NamedTuple):
    """Scale of the recorders as specified by the user.

    Attributes:
        full_scale_pa: Overpressure of a sample of 1 in a sound file [Pa].
        sensitivity: Pascals per volt, or per count for formats with counts.
    """

    full_scale_pa: float | None = None
    sensitivity: float | None = None


def recordings_of(
    path: Path, pieces: Sequence[Piece], scaling: Scaling, notes: tuple[str, ...] = ()
) -> tuple[Recording, ...]:
    """Return a recording for each array, its channels named or numbered in the file.

    Raises:
        InputError: One contains volts without a sensitivity, or no pressure.
    """
    aliases = channel_names(path.stem, sum(piece.channels for piece in pieces))
    # channels of one array have no names of their own
    named = len(pieces) > 1 and all(piece.name for piece in pieces)
    words = [
        f"{piece.name}.{n + 1}" if piece.channels > 1 else piece.name
        for piece in pieces
        for n in range(piece.channels)
    ]
    names = named_channels(path.stem, words) if named else aliases
    recordings, first = [], 0
    for piece in pieces:
        last = first + piece.channels
        labels = tuple(
            piece.label if piece.channels == 1 else f"{piece.label}, channel {n + 1}"
            for n in range(piece.channels)
        )
        scale = scale_of(piece.unit, scaling, f"{path}: {piece.label}")
        recordings.append(
            Recording(
                source=str(path),
                names=names[first:last],
                labels=labels,
                rate_hz=piece.clock.rate_hz,
                length=piece.length,
                read=_scaled(piece, scale.factor),
                start_s=piece.clock.start_s,
                epoch=piece.clock.epoch,
                calibrated=scale.calibrated,
                notes=notes,
                aliases=aliases[first:last],
            )
        )
        first = last
    return tuple(recordings)


@contextmanager
def warned() -> Iterator[list[str]]:
    """Collect the warnings of a library that reads a file: logged, or Python's own."""
    found: list[str] = []

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            found.append(f"{record.name.split('.')[0]}: {record.getMessage()}")

    handler, root = Handler(logging.WARNING), logging.getLogger()
    root.addHandler(handler)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield found
    finally:
        root.removeHandler(handler)
    # of the others the reader's author is the addressee
    found += [
        f"{one.category.__name__}: {one.message}"
        for one in caught
        if not issubclass(one.category, NOT_OF_THE_FILE)
    ]


def left_out(labels: Sequence[str], head: str = "left out") -> tuple[str, ...]:
    """Return the note on arrays or columns without pressure."""
    return (f"{head}, not pressure: {', '.join(labels)}",) if labels else ()


def _scaled(
    piece: Piece, factor: float
) -> Callable[[int, int], Float[np.ndarray, "channel sample"]]:
    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        return factor * np.asarray(piece.read(start, stop), np.float64)

    return read


class Scale(NamedTuple):
    """Factor on samples, and whether the result is in pascals."""

    factor: float
    calibrated: bool


def plain_unit(text: str) -> str:
    """Return a unit in the spelling of the tables: `m/s` is m_s."""
    # the micro sign and the Greek letter are two characters
    text = text.strip().replace("µ", "u").replace("μ", "u")
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def pressure_factor(unit: str) -> float | None:
    """Return pascals per unit; None for other units, and for mpa in lower case."""
    return PRESSURES.get(plain_unit(unit)) or _factor(unit, "pressure")


def volts_factor(unit: str) -> float | None:
    """Return volts per unit; None for other units."""
    return VOLTS.get(plain_unit(unit))


def time_factor(unit: str) -> float | None:
    """Return seconds per unit; None for other units."""
    return TIMES.get(plain_unit(unit)) or _factor(unit, "time")


def _factor(unit: str, dimension: str) -> float | None:
    """Return the factor to SI units; None for other dimensions or ambiguous units."""
    # mpa may be MPa or mPa, nine orders of magnitude apart: two meanings are none
    meant = [of for of in unit_spelt(unit) if of.dimension == dimension]
    return si_factor(meant[0].suffix) if len(meant) == 1 else None


def holds_pressure(unit: str) -> bool:
    """Return True if samples of a unit can be pressure: pascals, volts, or no unit."""
    return (
        pressure_factor(unit) is not None
        or volts_factor(unit) is not None
        or plain_unit(unit) in NO_UNIT_WORDS
    )


def scale_of(unit: str, scaling: Scaling, where: str) -> Scale:
    """Return the factor on samples of a unit.

    Args:
        unit: Unit as in the file; "" without one.
        scaling: Scale specified by the user.
        where: File, and channel or column, for messages.

    Raises:
        InputError: The unit is volts without a sensitivity, or not one of pressure.
    """
    pascals = pressure_factor(unit)
    if pascals is not None:
        return Scale(pascals, calibrated=True)
    # without a sensitivity volts are an error, counts are not: those may be normalized
    # sound
    volts = volts_factor(unit)
    if volts is not None:
        if scaling.sensitivity is None:
            raise InputError(
                f"{where}: expected pressure, got {unit}; add the pascals per volt, "
                f"{argument('sensitivity')}"
            )
        return Scale(volts * scaling.sensitivity, calibrated=True)
    if plain_unit(unit) in NO_UNIT_WORDS:
        if scaling.sensitivity is None:
            return Scale(1.0, calibrated=False)
        return Scale(scaling.sensitivity, calibrated=True)
    known = ("Pa", "kPa", "MPa", "mbar", "bar", "psi", "V", "mV")
    raise InputError(
        f"{where}: expected a unit of pressure or volts, "
        f"got {shown(unit)}{nearest(unit, known)}"
    )


class SampleColumns(NamedTuple):
    """Contents of the columns of a table of samples.

    Attributes:
        time: Number of the column of times; None without one.
        seconds: Seconds per unit of these.
        pressures: Numbers of the columns of pressure, or volts.
        units: Units of these as written.
        left_out: Names of the other columns.
    """

    time: int | None
    seconds: float
    pressures: tuple[int, ...]
    units: tuple[str, ...]
    left_out: tuple[str, ...]


def columns_of(names: list[str], where: str, *, clocked: bool = False) -> SampleColumns:
    """Return the contents of columns by the units at the end of their names.

    Args:
        names: `time_ms`, `Pressure (kPa)`, `ch1_mV`, in any order.
        where: The file and line of the names, for messages.
        clocked: True if the samples may have no column of time.

    Raises:
        InputError: There is not one column of time, or none of pressure; one has no
            unit, or two have one word and two units.
    """
    dates: list[str] = []
    untimed: list[str] = []
    times: list[tuple[int, float]] = []
    pressures: list[tuple[int, str]] = []
    left_out: list[str] = []
    for number, name in enumerate(names):
        word, unit = word_and_unit(name)
        seconds = time_factor(unit)
        if seconds is not None:
            times.append((number, seconds))
        elif pressure_factor(unit) is not None or volts_factor(unit) is not None:
            pressures.append((number, unit))
        elif re.search(r"(^|[\s_])(date|utc|timestamp)\b", name.lower()):
            dates.append(name)
        elif re.match(r"(elapsed|time|t)\b", word.lower()) and not unit:
            untimed.append(name)
        elif word.lower().startswith("pressure") or "overpressure" in word.lower():
            raise InputError(
                f"{where}, column {name}: expected a unit of pressure in its name, as "
                f"in pressure_kpa, got {unit or 'none'}"
            )
        else:
            left_out.append(name)
    if dates and not times and not clocked:
        raise InputError(
            f"{where}, column {dates[0]}: expected seconds or milliseconds since any "
            "moment, as time_s or time_ms, got times of day; add such a column, and "
            "the time of the first sample to the column start_utc of the table of "
            "stations"
        )
    if untimed and not times and not clocked:
        raise InputError(
            f"{where}, column {untimed[0]}: expected a unit of time in its name, as in "
            "time_s or time_ms, got none"
        )
    if len(times) != 1 and not (clocked and not times):
        got = ", ".join(names[at] for at, _ in times) or shown(", ".join(names))
        log = "sensor" in (name.strip().lower() for name in names)
        raise InputError(
            f"{where}: expected one column of time, as time_s or time_ms, got {got}"
            + ("; this is a log, which jblast fit takes" if log else "")
        )
    if not pressures:
        raise InputError(
            f"{where}: expected a column of pressure, as pressure_kpa, or of volts, "
            f"got {shown(', '.join(names))}"
        )
    refuse_two_units([(names[at], unit) for at, unit in pressures], f"{where}, columns")
    time, seconds = times[0] if times else (None, 1.0)
    return SampleColumns(
        time,
        seconds,
        tuple(at for at, _ in pressures),
        tuple(unit for _, unit in pressures),
        tuple(
            n
            for n in (*left_out, *dates, *untimed)
            if n.split("_")[0].lower() not in IGNORED
        ),
    )


def refuse_two_units(pressures: Iterable[tuple[str, str]], where: str) -> None:
    """Refuse one channel in two units: it is no second one.

    Args:
        pressures: Names of channels with their units, as they are written.
        where: The file, and what the names are of, for messages.

    Raises:
        InputError: Two have one word and two units.
    """
    seen: dict[str, tuple[str, str]] = {}
    for name, unit in pressures:
        first, before = seen.setdefault(
            plain_unit(word_and_unit(name)[0]), (name, unit)
        )
        if plain_unit(before) != plain_unit(unit):
            raise InputError(
                f"{where} {first} and {name}: expected one unit for one channel, got "
                f"{before} and {unit}; keep one of them, or give two channels two names"
            )


def word_and_unit(name: str) -> tuple[str, str]:
    """Return word and unit of a name: `Pressure (kPa)` or `pressure_kpa`.

    The unit is "" if the name does not end in a known one; a name may be a unit alone.
    """
    bracketed = re.fullmatch(r"\s*(.*?)[\s_]*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*", name)
    if bracketed:
        return bracketed[1], bracketed[2]
    parts = re.split(r"[\s_]+", name.strip())
    unit = parts[-1]
    if any(known(unit) is not None for known in (time_factor, pressure_factor)):
        return " ".join(parts[:-1]), unit
    if volts_factor(unit) is not None:
        return " ".join(parts[:-1]), unit
    # a unit behind a channel's number, as of oscilloscopes: CH1V
    glued = re.fullmatch(r"(.*\d)([A-Za-z]+)", name.strip())
    if glued and (pressure_factor(glued[2]) or volts_factor(glued[2])):
        return glued[1], glued[2]
    return " ".join(parts), ""


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
        InputError: There are fewer than two times; one is not finite or not after the
            one before; some are missing; or one is off an even clock by `MAX_JITTER`.
    """
    if times_s.size < 2:
        raise InputError(
            f"{where(0)}: expected at least two samples, got {times_s.size}"
        )
    bad = np.flatnonzero(~np.isfinite(times_s))
    if bad.size:
        raise InputError(
            f"{where(int(bad[0]))}: expected a time, got {times_s[bad[0]]}"
        )
    steps = np.diff(times_s)
    back = np.flatnonzero(steps <= 0)
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
    start, step = _line(times_s)
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
    return start, _round(1.0 / step, times_s.size)


def _line(times_s: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return intercept and slope of times against their number, by least squares."""
    number = np.arange(times_s.size) - 0.5 * (times_s.size - 1)
    first = float(times_s[0])
    # relative to the first: times since 1970 would lose seven digits
    since = times_s - first
    slope = float(number @ since / (number @ number))
    return first + float(since.mean() + slope * number[0]), slope


def _round(rate_hz: float, samples: int) -> float:
    """Return the rate with the fewest digits that move no sample."""
    # printed times give 47999.9998 Hz where the recorder has 48000
    for digits in range(1, 16):
        rounded = float(f"{rate_hz:.{digits}g}")
        if abs(rounded / rate_hz - 1.0) * samples < RATE_TOLERANCE:
            return rounded
    return rate_hz


def epoch_and_start(nanoseconds: int) -> tuple[datetime, float]:
    """Return the whole second of a time (UTC), and the rest [s].

    Args:
        nanoseconds: Nanoseconds since the beginning of 1970, without leap seconds.
    """
    whole, part = divmod(nanoseconds, BILLION)
    return START + timedelta(seconds=whole), part / BILLION


def without_unset_clocks(recordings: Iterable[Recording]) -> tuple[Recording, ...]:
    """Return the recordings of a file, those of a clock that was not set without UTC.

    Their times count from the first of their samples.
    """
    recordings = tuple(recordings)
    begins = [
        one.epoch and one.epoch + timedelta(seconds=math.floor(one.start_s))
        for one in recordings
    ]
    unset = [
        at
        for at in begins
        if at and any(0 <= (at - zero).total_seconds() < UNSET_S for zero in ZEROS)
    ]
    return tuple(
        replace(
            one,
            epoch=None,
            start_s=(one.epoch - min(unset)).total_seconds() + one.start_s,
            clock_is_set=False,
            notes=(
                *one.notes,
                "no time of day, as its clock was not set: it begins in "
                f"{min(unset).year}",
            ),
        )
        if one.epoch and begin in unset
        else one
        for one, begin in zip(recordings, begins, strict=True)
    )
