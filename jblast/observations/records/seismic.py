"""miniSEED and SAC: traces with the time of day of their first sample, by ObsPy.

The records of a miniSEED file are put in the order of time, and repeated ones are
dropped. Each record has its own start time: where these disagree with the rate in the
header, the rate is that of the line through them, and times more than a quarter of a
step off that line are interpolated between the records. A gap divides a trace into
segments.

Channels are selected by the instrument, the second letter of a SEED channel code
(Standard for the Exchange of Earthquake Data 2.4, appendix A).
"""

import re
import warnings
from collections import defaultdict
from collections.abc import Callable
from datetime import timedelta
from functools import partial
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Num

from jblast.errors import InputError, needed
from jblast.observations.records.recording import (
    BILLION,
    RATE_TOLERANCE,
    START,
    Clock,
    Column,
    Group,
    rounded,
)

IDEP = {6: "ground displacement", 7: "ground velocity", 8: "ground acceleration"}
"""Codes of SAC's header for other quantities than pressure (IDISP, IVEL, IACC)."""
IDEP_VOLTS = 50
"""Code of SAC's header for a velocity in volts (IVOLTS), the only one for volts."""
SINGLE_SPACING = 2.0**-23
"""Relative spacing of floats of 32 bits, the precision of SAC's step."""
GROUND = {
    "A": "tilt", "G": "ground acceleration", "H": "ground velocity",
    "J": "ground rotation", "L": "ground velocity", "M": "mass position",
    "N": "ground acceleration", "P": "ground velocity", "S": "strain",
}  # fmt: skip
"""Quantities by the second letter of a SEED channel code; D is pressure."""
HEADER = re.compile(rb"[0-9 \0]{6}[DRQM][ \0]")
"""First bytes of a record of data. Control headers of full SEED, and blank or zero
records, are skipped."""
LEAST_BYTES = 128
"""Smallest size of a record; sizes are powers of 2."""
LEAST_TIME_S = 1e-4
"""Precision of the start times of records without microseconds [s]."""
MAX_RATE_OFFSET = 1e-3
"""Largest relative difference of a true rate from that of the header. Crystals are
within 1e-4; a larger difference is a gap in each record."""
LEAST_RECORDS = 4
"""Smallest number of records whose median step is that of the clock: of fewer, one gap
could be half of the steps."""
MAX_NAMED = 3
"""Gaps that a note names."""


class _Record(NamedTuple):
    """A record of a trace.

    Attributes:
        start: Nanoseconds since 1970, UTC, of its first sample.
        samples: Its samples.
    """

    start: int
    samples: Num[np.ndarray, " sample"]


class _Segment(NamedTuple):
    """An interval of a trace without gaps.

    Attributes:
        begin: Its first sample, counted from the first of the trace.
        first: First sample of each record, counted from `begin`; then the end.
        start: Times of these, nanoseconds since 1970, UTC.
    """

    begin: int
    first: list[int]
    start: list[int]


def open_seismic(path: Path) -> tuple[Group, ...]:
    """Return the traces of a file of miniSEED or SAC, with a clock for each segment.

    The samples are counts, whose scale is in another file. A channel is also named by
    its SEED code, `NET.STA.LOC.CHA`, and its station, as files of stations name it.

    Raises:
        InputError: ObsPy cannot read the file; it has no channel of pressure; or
            records of one time differ.
    """
    obspy = needed("obspy", "seismic", path, "miniSEED or SAC is read")
    # by default ObsPy rounds SAC's step to a microsecond: 1.4 % at 44.1 kHz
    read = partial(obspy.read, round_sampling_interval=False)
    notes: list[str] = []
    try:
        with warnings.catch_warnings():
            # of a last record that is cut short, which is noted below
            warnings.simplefilter("ignore", UserWarning)
            headers = read(str(path), headonly=True)
        if headers[0].stats._format == "MSEED":
            held = _records(read, path.read_bytes(), notes)
        else:
            held = {
                one.id: [_Record(one.stats.starttime.ns, np.asarray(one.data))]
                for one in read(str(path))
            }
    # each of ObsPy's parsers has exceptions of its own
    except Exception as error:
        raise InputError(
            f"{path}: expected miniSEED or SAC, got a file that ObsPy cannot read "
            f"({str(error) or type(error).__name__})"
        ) from None
    if not held:
        raise InputError(f"{path}: expected samples, got none")
    stats = {trace.id: trace.stats for trace in headers}
    names, others = _of_pressure(path, list(held))
    for trace in headers:
        rate, other = stats[trace.id].sampling_rate, trace.stats.sampling_rate
        if trace.id in names and abs(other / rate - 1.0) > MAX_RATE_OFFSET:
            raise InputError(
                f"{path}: trace {trace.id}: expected one sampling rate, got {other:g} "
                f"and {rate:g} Hz; cut the record there"
            )
    notes += [
        f"trace {name}: its header's factor of {stats[name].calib:g} is not applied"
        for name in names
        if stats[name].calib not in (0.0, 1.0)
    ]
    notes += [f"left out, not pressure: {', '.join(others)}"] if others else []
    columns = []
    zero = min(record.start for name in names for record in held[name])
    for name in names:
        rate_hz, label = _rate(stats[name]), f"trace {name}"
        samples, segments = _divided(f"{path}: {label}", held[name], rate_hz)
        clocks = [_clock(zero, rate_hz, segment) for segment in segments]
        own = _gaps(segments)
        # with gaps, the rate of the longest segment
        longest = max(clocks, key=lambda clock: clock.length)
        if longest.rate_hz != rate_hz:
            own += (
                f"{label}: {longest.rate_hz:.7g} Hz by the times of its records, "
                f"{rate_hz:.7g} Hz in its header",
            )
        columns.append(
            Column(
                name=name,
                unit=_unit(path, label, stats[name]),
                length=samples.size,
                read=partial(lambda of, start, stop: of[start:stop], samples),
                kind="trace",
                clocks=tuple(clocks),
                aliases=(name, stats[name].station),
                notes=own,
            )
        )
    return (Group(tuple(columns), notes=tuple(notes)),)


def _records(
    read: Callable[..., Any], data: bytes, notes: list[str]
) -> dict[str, list[_Record]]:
    """Return the records of miniSEED by trace, in the order of time, each once."""
    from obspy.io.mseed.util import get_record_information

    packed: dict[str, dict[tuple[int, bytes], int]] = defaultdict(dict)
    # ObsPy reads the first record again in a file whose size is not a multiple of 128,
    # or where no record begins
    stream, at, twice = BytesIO(data + bytes(-len(data) % LEAST_BYTES)), 0, 0
    while at < len(data):
        if not HEADER.match(data, at):
            at += LEAST_BYTES
            continue
        info = get_record_information(stream, offset=at)
        end = at + info["record_length"]
        if end > len(data):
            notes.append(f"cut short: the last {len(data) - at:,} bytes are no record")
            break
        if info["npts"] and info["samp_rate"]:
            name = ".".join(
                info[part] for part in ("network", "station", "location", "channel")
            )
            # the first 8 bytes are a number and a flag, which copies may have changed
            key = (info["starttime"].ns, data[at + 8 : end])
            twice += key in packed[name]
            packed[name][key] = info["npts"]
        at = end
    if twice:
        notes.append(f"{twice} repeated records are ignored")
    found: dict[str, list[_Record]] = {}
    for name, records in packed.items():
        order = sorted(records)
        # one call reads all records, which takes a tenth of the time of a call for each
        joined = b"".join(b"000000D " + record for _, record in order)
        traces = read(BytesIO(joined), format="MSEED")
        samples = np.concatenate([trace.data for trace in traces])
        ends = np.cumsum([records[key] for key in order])
        if ends[-1] != samples.size:
            raise ValueError(f"{samples.size} samples of {ends[-1]} in {name}")
        found[name] = [
            _Record(start, own)
            for (start, _), own in zip(order, np.split(samples, ends[:-1]), strict=True)
        ]
    return found


def _of_pressure(path: Path, names: list[str]) -> tuple[list[str], list[str]]:
    """Return the traces of pressure, and the descriptions of the other ones.

    Without a channel of pressure (D) those of unknown instruments are used.

    Raises:
        InputError: All channels are of ground motion.
    """
    codes = {name: name.rpartition(".")[2] for name in names}
    seed = {n: c[1] for n, c in codes.items() if re.fullmatch("[A-Z]{2}[A-Z0-9]", c)}
    pressure = [name for name in names if seed.get(name) == "D"]
    used = pressure or [name for name in names if seed.get(name) not in GROUND]
    kinds = {name: GROUND.get(seed.get(name, ""), "another quantity") for name in names}
    others = [f"{name} ({kinds[name]})" for name in names if name not in used]
    if not used:
        raise InputError(
            f"{path}: expected a channel of pressure, whose code has D as its second "
            f"letter (HDF, BDF), got {', '.join(others)}; if the sensor is a "
            "microphone, write the file again with such a code"
        )
    return used, others


def _divided(
    where: str, records: list[_Record], rate_hz: float
) -> tuple[Num[np.ndarray, " sample"], list[_Segment]]:
    """Return the samples of a trace, and its segments between gaps.

    Samples of one time that two records contain are used once.

    Raises:
        InputError: Two records have different samples at one time.
    """
    step = _step(records, rate_hz)
    samples = np.concatenate([record.samples for record in records])
    segments: list[_Segment] = []
    count = 0
    for start, own in records:
        late = (start - segments[-1].start[-1]) / step if segments else np.inf
        if (again := round(max(-late, 0.0))) > 0:
            held = samples[max(count - again, segments[-1].begin) : count]
            same = min(held.size, own.size)
            if held.size < again or not np.array_equal(held[:same], own[:same]):
                raise InputError(
                    f"{where}: expected one sample at each time, got an overlap of "
                    f"{again * step / BILLION:.6g} s with other samples before "
                    f"{_utc(segments[-1].start[-1])}; remove one of the two records"
                )
            if (own := own[again:]).size == 0:
                continue
            start += round(again * step)
        elif late >= 0.5:
            segments.append(_Segment(count, [], []))
        # the end of the last record is replaced by the start of this one
        del segments[-1].first[-1:], segments[-1].start[-1:]
        samples[count : count + own.size] = own
        count += own.size
        begin = segments[-1].begin
        segments[-1].first.extend([count - own.size - begin, count - begin])
        segments[-1].start.extend([start, start + round(own.size * step)])
    return samples[:count], segments


def _step(records: list[_Record], rate_hz: float) -> float:
    """Return the step of a trace by the times of its records [ns]."""
    nominal = BILLION / rate_hz
    if len(records) <= LEAST_RECORDS:
        return nominal
    starts = np.array([record.start for record in records])
    steps = np.diff(starts) / [record.samples.size for record in records[:-1]]
    # the median is not changed by gaps
    step = float(np.median(steps))
    return step if abs(step / nominal - 1.0) < MAX_RATE_OFFSET else nominal


def _clock(zero: int, rate_hz: float, segment: _Segment) -> Clock:
    """Return the clock of one segment of a trace.

    Args:
        zero: Start of the file, nanoseconds since 1970.
        rate_hz: Rate in the header.
        segment: The segment.
    """
    first = np.array(segment.first)
    # relative to the first, as nanoseconds since 1970 exceed the digits of a float
    since = np.array([(at - segment.start[0]) / BILLION for at in segment.start])
    offset = None
    # the end of the last record is no time of the file
    off = np.abs(since - first / rate_hz)[:-1].max()
    if off > max(RATE_TOLERANCE / rate_hz, LEAST_TIME_S):
        rate_hz = float(f"{first[-2] / since[-2]:.9g}")
        offset = partial(np.interp, xp=first, fp=since)
    start_s = (segment.start[0] - zero) / BILLION
    return Clock(rate_hz, start_s, zero, segment.begin, int(first[-1]), offset)


def _gaps(segments: list[_Segment]) -> tuple[str, ...]:
    """Return the note on the gaps of a trace; none without one."""
    gaps = [
        f"{(after.start[0] - before.start[-1]) / BILLION:.6g} s after "
        f"{_utc(before.start[-1])}"
        for before, after in pairwise(segments)
    ]
    if not gaps:
        return ()
    more = f" and {len(gaps) - MAX_NAMED} more" if len(gaps) > MAX_NAMED else ""
    named = ", ".join(gaps[:MAX_NAMED])
    return (f"gaps of {named}{more}; the segments between them are picked one by one",)


def _utc(nanoseconds: int) -> str:
    """Return a time to the millisecond."""
    when = START + timedelta(microseconds=nanoseconds // 1000)
    return when.strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"


def _rate(stats: Any) -> float:
    """Return the sampling rate in a header [Hz], to the precision of SAC's step."""
    return rounded(stats.sampling_rate, SINGLE_SPACING)


def _unit(path: Path, label: str, stats: Any) -> str:
    """Return the unit in a header; only SAC has one."""
    kind = int(stats["sac"].get("idep", 5)) if "sac" in stats else 5
    if kind in IDEP:
        raise InputError(
            f"{path}: {label}: expected pressure, got {IDEP[kind]} (idep {kind})"
        )
    return "V" if kind == IDEP_VOLTS else "count"
