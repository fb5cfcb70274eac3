"""Recordings: the channels of one clock, their units and their sampling rate.

A `Recording` is a file that is open for reading and has read no samples yet; a
`PressureRecord` holds the samples of one channel. Both have a constant sampling rate.
Times in a file are replaced by the straight line through them (least
squares), with the rate rounded as far as that moves no sample by 1 % of a step. Times
more than a quarter of a step off that line, gaps and repeated times are refused.

Units are part of the names of channels (`pressure_kpa`, `Pressure (kPa)`) or given with
them. Samples become pascals by their unit of pressure, or by the sensitivity or full
scale that the user states. Without one, volts are refused, and counts and shares of
full scale keep their unit and are marked as not calibrated.

The time of the first sample is an epoch, a whole second in UTC, and seconds after it.
Seconds since 1970 in double precision are 2.4e-7 s apart; seconds after the epoch are
finer.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, shown
from jblast.units import si_factor, unit_spelt

BLOCK = 2**20
"""Samples of all channels together that are read at a time: eight megabytes."""
RATES = ("rate_hz", "sampling_rate_hz", "sampling_rate", "sample_rate", "fs_hz", "fs")
"""What samples a second are called where no times stand."""
VOLTS = {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6}
PRESSURES = {"pascal": 1.0, "pascals": 1.0}
TIMES = {
    "second": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9,
    "seconds": 1.0, "minutes": 60.0, "hours": 3600.0,
}  # fmt: skip
UNSAID = {"", "1", "count", "counts", "none", "unknown", "dimensionless", "fs"}
"""What files write where they name no unit, or one that nobody can convert."""
IGNORED = ("note", "comment", "index", "sample", "number", "n", "")
"""Words that a column which holds no measurement begins with, or is."""
JITTER = 0.25
"""Share of a step by which a printed time may be off an even clock."""
GAP = 1.75
"""A step longer than so many others lacks samples."""
RATE_TOLERANCE = 0.01
"""Largest shift of the last sample by a rounded rate, in steps."""
START = datetime(1970, 1, 1, tzinfo=UTC)
"""Zero of instants: POSIX time."""
BILLION = 1_000_000_000
"""Nanoseconds of a second."""


@dataclass(frozen=True)
class PressureRecord:
    """Samples of one channel on an even clock.

    Attributes:
        name: The stem of its file, or stem.channel, channels counted from 1.
        samples: In double precision: overpressure [Pa] if `calibrated`, else in a unit
            that nobody said, as a share of full scale or counts.
        rate_hz: Samples a second [Hz].
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None where the file does not say.
        calibrated: Whether the samples are pascals.
        full_scale: Largest size that a sample can have, in their unit; None where
            nothing clips, or nobody said at what.
        high_pass_hz: Corner of the recorder's first-order high-pass [Hz]; None where
            there is none, or nobody said.
        source: The file.
        notes: What was done in reading, for the reader of an answer: a sentence each.
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
        """How long it lasts [s]."""
        return self.samples.size / self.rate_hz


@dataclass(frozen=True)
class Recording:
    """Channels of one file that share rate and start; nothing of them is read yet.

    Attributes:
        source: The file.
        names: Of the channels: the stem of the file, or stem.channel, counted from 1.
        labels: What a message calls each: "channel 2", "column pressure_kpa".
        rate_hz: Samples a second [Hz].
        length: Samples of each channel.
        read: Returns the samples from one to before another, in pascals if
            `calibrated`; what is no number stands as NaN.
        start_s: Time of the first sample on the recorder's clock [s].
        epoch: UTC of that clock's time zero; None where the file does not say.
        calibrated: Whether the samples are pascals.
        full_scale: Largest size that a sample can have; None: nobody said.
        notes: What was done in reading, a sentence each.
        first_line: Line of the first sample in a text; None where samples are counted.
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

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return self.length / self.rate_hz

    def samples(self, start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        """Return a stretch of every channel.

        Raises:
            InputError: One of the samples is no finite number.
        """
        samples = self.read(max(start, 0), min(stop, self.length))
        if np.isfinite(samples).all():
            return samples
        channel, sample = np.argwhere(~np.isfinite(samples.T))[0][::-1]
        where = f"{self.source}: {self.labels[channel]}"
        if not np.isfinite(samples[channel]).any():
            raise InputError(f"{where}: expected samples, got no number in it")
        nth = max(start, 0) + int(sample)
        raise InputError(
            f"{where}, {self.place(nth)}: expected a finite sample, "
            f"got {samples[channel, sample]}"
        )

    def place(self, sample: int) -> str:
        """Name a sample in a message: its line, or which it is and when."""
        if self.first_line is not None:
            return f"line {self.first_line + sample}"
        return f"sample {sample + 1} ({self.start_s + sample / self.rate_hz:.6g} s)"

    def blocks(self) -> Iterator[tuple[int, Float[np.ndarray, "channel sample"]]]:
        """Go through the file in constant memory: where a block begins, and it."""
        size = max(BLOCK // len(self.names), 1)
        for start in range(0, self.length, size):
            yield start, self.samples(start, start + size)

    def record(
        self, channel: int, start: int = 0, stop: int | None = None
    ) -> PressureRecord:
        """Return a stretch of one channel, counted from 0, as a `PressureRecord`."""
        start, stop = max(start, 0), self.length if stop is None else stop
        return self.stretch(channel, start, self.samples(start, stop)[channel])

    def stretch(
        self, channel: int, start: int, samples: Float[np.ndarray, " sample"]
    ) -> PressureRecord:
        """Return samples of a channel that were read before, as a `PressureRecord`."""
        return PressureRecord(
            name=self.names[channel],
            samples=samples,
            rate_hz=self.rate_hz,
            start_s=self.start_s + start / self.rate_hz,
            epoch=self.epoch,
            calibrated=self.calibrated,
            full_scale=self.full_scale,
            source=self.source,
            notes=self.notes,
        )


def channel_names(stem: str, count: int) -> tuple[str, ...]:
    """Name the channels of a file: by its stem, or stem.channel of several."""
    if count == 1:
        return (stem,)
    return tuple(f"{stem}.{number}" for number in range(1, count + 1))


class SampleClock(NamedTuple):
    """When samples were taken.

    Attributes:
        start_s: The first, on the recorder's clock [s].
        rate_hz: Samples a second [Hz].
        epoch: UTC of that clock's time zero; None where the file does not say.
    """

    start_s: float
    rate_hz: float
    epoch: datetime | None = None


class Piece(NamedTuple):
    """An array of samples within a file.

    Attributes:
        label: What a message calls it: "variable pressure_kpa".
        unit: As it is written; "" where none is.
        channels: How many it holds.
        length: Samples of each.
        read: Returns samples from one to before another, in its unit.
        clock: When they were taken.
    """

    label: str
    unit: str
    channels: int
    length: int
    read: Callable[[int, int], Float[np.ndarray, "channel sample"]]
    clock: SampleClock


class Scaling(NamedTuple):
    """What the user says of the recorders.

    Attributes:
        full_scale_pa: What a sample of 1 in a sound file stands for [Pa].
        sensitivity: Pascals a volt, or a count of formats that hold counts.
    """

    full_scale_pa: float | None = None
    sensitivity: float | None = None


def recordings_of(
    path: Path, pieces: Sequence[Piece], scaling: Scaling, notes: tuple[str, ...] = ()
) -> tuple[Recording, ...]:
    """Return a recording for each array, its channels numbered through the file.

    Raises:
        InputError: One holds volts of a sensitivity that nobody said, or no pressure.
    """
    names = channel_names(path.stem, sum(piece.channels for piece in pieces))
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
            )
        )
        first = last
    return tuple(recordings)


def left_out(labels: Sequence[str]) -> tuple[str, ...]:
    """Say which arrays hold no pressure."""
    return (f"left out, not pressure: {', '.join(labels)}",) if labels else ()


def _scaled(
    piece: Piece, factor: float
) -> Callable[[int, int], Float[np.ndarray, "channel sample"]]:
    def read(start: int, stop: int) -> Float[np.ndarray, "channel sample"]:
        return factor * np.asarray(piece.read(start, stop), np.float64)

    return read


class Scale(NamedTuple):
    """What to multiply samples by, and whether that makes them pascals."""

    factor: float
    calibrated: bool


def plain_unit(text: str) -> str:
    """Return a unit as the tables have it: `m/s` is m_s."""
    text = text.strip().replace("µ", "u").replace("μ", "u")
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def pressure_factor(unit: str) -> float | None:
    """Return pascals a unit; None if it is none of pressure, or mpa in lower case."""
    return PRESSURES.get(plain_unit(unit)) or _factor(unit, "pressure")


def volts_factor(unit: str) -> float | None:
    """Return volts a unit; None if it is none of voltage."""
    return VOLTS.get(plain_unit(unit))


def time_factor(unit: str) -> float | None:
    """Return seconds a unit; None if it is none of time."""
    return TIMES.get(plain_unit(unit)) or _factor(unit, "time")


def _factor(unit: str, dimension: str) -> float | None:
    """Return what a unit is in ours; None if it is of another dimension, or of two."""
    meant = [of for of in unit_spelt(unit) if of.dimension == dimension]
    return si_factor(meant[0].suffix) if len(meant) == 1 else None


def holds_pressure(unit: str) -> bool:
    """Return whether samples of a unit can be pressure: pascals, volts, or unsaid."""
    return (
        pressure_factor(unit) is not None
        or volts_factor(unit) is not None
        or plain_unit(unit) in UNSAID
    )


def scale_of(unit: str, scaling: Scaling, where: str) -> Scale:
    """Return what samples of a unit are to be multiplied by.

    Args:
        unit: As the file has it; "" where it has none.
        scaling: What the user says.
        where: The file, and the channel or column, for messages.

    Raises:
        InputError: They are volts and nobody said how many pascals each is, or the
            unit is none of pressure.
    """
    pascals = pressure_factor(unit)
    if pascals is not None:
        return Scale(pascals, calibrated=True)
    volts = volts_factor(unit)
    if volts is not None:
        if scaling.sensitivity is None:
            raise InputError(
                f"{where}: expected pressure, got {unit}; how many pascals a volt "
                f"stands for is told by {argument('sensitivity')}"
            )
        return Scale(volts * scaling.sensitivity, calibrated=True)
    if plain_unit(unit) in UNSAID:
        if scaling.sensitivity is None:
            return Scale(1.0, calibrated=False)
        return Scale(scaling.sensitivity, calibrated=True)
    known = ("Pa", "kPa", "MPa", "mbar", "bar", "psi", "V", "mV")
    raise InputError(
        f"{where}: expected a unit of pressure or volts, "
        f"got {shown(unit)}{nearest(unit, known)}"
    )


class SampleColumns(NamedTuple):
    """What the columns of a table of samples hold.

    Attributes:
        time: Which column the times stand in.
        seconds: Seconds a unit of them.
        pressures: Which columns hold pressure, or volts.
        units: Of each of these, as it is written.
        left_out: Names of columns that hold neither.
    """

    time: int
    seconds: float
    pressures: tuple[int, ...]
    units: tuple[str, ...]
    left_out: tuple[str, ...]


def columns_of(names: list[str], where: str) -> SampleColumns:
    """Return what columns hold, by the units that their names end in.

    Args:
        names: `time_ms`, `Pressure (kPa)`, `ch1_mV`, in any order.
        where: The file and line of the names, for messages.

    Raises:
        InputError: There is not one column of time, or none of pressure; one has no
            unit, or two have one word and two units.
    """
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
            raise InputError(
                f"{where}, column {name}: expected seconds or milliseconds since any "
                "moment, as time_s or time_ms, got times of day; when the first sample "
                "was stands in the column start_utc of the table of stations"
            )
        elif re.match(r"(elapsed|time|t)\b", word.lower()) and not unit:
            raise InputError(
                f"{where}, column {name}: expected a unit of time in its name, as in "
                "time_s or time_ms, got none"
            )
        elif word.lower().startswith("pressure") or "overpressure" in word.lower():
            raise InputError(
                f"{where}, column {name}: expected a unit of pressure in its name, as "
                f"in pressure_kpa, got {unit or 'none'}"
            )
        else:
            left_out.append(name)
    if len(times) != 1:
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
    return SampleColumns(
        *times[0],
        tuple(at for at, _ in pressures),
        tuple(unit for _, unit in pressures),
        tuple(n for n in left_out if n.split("_")[0].lower() not in IGNORED),
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
    """Take a name apart: `Pressure (kPa)` or `pressure_kpa` into word and unit.

    The unit is "" where the name ends in none that we know; a name may be a unit alone.
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
    return " ".join(parts), ""


def even_clock(
    times_s: Float[np.ndarray, " sample"], where: Callable[[int], str]
) -> tuple[float, float]:
    """Return the first time [s] and the rate [Hz] of samples.

    The rate is that of the straight line through all times, rounded as far as that
    moves none of them: what was printed with few digits is known better than a step.

    Args:
        times_s: When each sample was taken [s].
        where: Names the file and a sample, for messages.

    Raises:
        InputError: There are fewer than two; one is no number or not after the one
            before; some are missing; or one is off an even clock by `JITTER`.
    """
    if times_s.size < 2:
        raise InputError(
            f"{where(0)}: expected two samples at least, got {times_s.size}"
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
    step = float(np.median(steps))
    gap = int(np.argmax(steps))
    if steps[gap] > GAP * step:
        raise InputError(
            f"{where(gap + 1)}: expected a sample every {step:.6g} s, got a gap of "
            f"{steps[gap]:.6g} s after {times_s[gap]:.9g} s; cut the record there"
        )
    start, step = _line(times_s)
    off = np.abs(times_s - start - step * np.arange(times_s.size))
    worst = int(np.argmax(off))
    if off[worst] > JITTER * step:
        raise InputError(
            f"{where(worst)}: expected times {step:.6g} s apart, got "
            f"{times_s[worst]:.9g} s, {off[worst] / step:.2g} steps off; resample the "
            "record evenly"
        )
    if abs(times_s[0] - start) < RATE_TOLERANCE * step:
        start = float(times_s[0])
    return start, _round(1.0 / step, times_s.size)


def _line(times_s: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return intercept and slope of times against their number, by least squares."""
    number = np.arange(times_s.size) - 0.5 * (times_s.size - 1)
    first = float(times_s[0])
    since = times_s - first  # an epoch would lose digits
    slope = float(number @ since / (number @ number))
    return first + float(since.mean() + slope * number[0]), slope


def _round(rate_hz: float, samples: int) -> float:
    """Return the rate with as few digits as leave every sample where it is."""
    for digits in range(1, 16):
        rounded = float(f"{rate_hz:.{digits}g}")
        if abs(rounded / rate_hz - 1.0) * samples < RATE_TOLERANCE:
            return rounded
    return rate_hz


def epoch_and_start(nanoseconds: int) -> tuple[datetime, float]:
    """Return the whole second of an instant (UTC), and how far after it that is [s].

    Args:
        nanoseconds: Since the beginning of 1970, without leap seconds.
    """
    whole, part = divmod(nanoseconds, BILLION)
    return START + timedelta(seconds=whole), part / BILLION
