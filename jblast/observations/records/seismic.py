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
from pathlib import Path
from typing import Any

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

IDEP = {6: "ground motion", 7: "ground motion", 8: "ground motion", 50: "V"}
"""Quantities, and volts, by codes of SAC's header (IDISP, IVEL, IACC, IVOLTS)."""
SINGLE_SPACING = 2.0**-23
"""Relative spacing of floats of 32 bits, the precision of SAC's step."""
GROUND = "AGHJLMNPS"
"""Second letters of SEED channel codes of ground motion (velocity, acceleration, tilt,
rotation, strain, position of the mass); D is pressure."""
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
Record = tuple[int, Num[np.ndarray, "..."]]
"""Start of a record, nanoseconds since 1970 in UTC, and its samples."""
Segment = list[tuple[int, int]]
"""An interval of a trace without gaps: the first sample of each record, counted from
that of the trace, and its time, nanoseconds since 1970 in UTC; then the end."""


def open_seismic(path: Path) -> tuple[Group, ...]:
    """Return the traces of a file of miniSEED or SAC, with a clock for each segment.

    The samples are counts, whose scale is in another file. A channel is also named by
    its SEED code, `NET.STA.LOC.CHA`, and its station, as files of stations name it.

    Raises:
        InputError: Records of a channel of pressure have several rates, or differ at
            one time.
    """
    obspy = needed("obspy", "seismic", path, "miniSEED or SAC is read")
    # by default ObsPy rounds SAC's step to a microsecond: 1.4 % at 44.1 kHz
    read = partial(obspy.read, round_sampling_interval=False)
    notes: list[str] = []
    with warnings.catch_warnings():
        # of a last record that is cut short, which is noted below
        warnings.simplefilter("ignore", UserWarning)
        headers = read(str(path), headonly=True)
    if headers[0].stats._format == "MSEED":
        held = _records(read, path.read_bytes(), notes)
    else:
        held = {
            one.id: [(one.stats.starttime.ns, np.asarray(one.data))]
            for one in read(str(path))
        }
    stats = {trace.id: trace.stats for trace in headers}
    units = _units({name: stats[name] for name in held})
    used = [name for name, unit in units.items() if unit in ("count", "V")]
    zero = min((start for name in used for start, _ in held[name]), default=0)
    columns = []
    for name, unit in units.items():
        column = Column(name, unit, aliases=(name, stats[name].station))
        if name in used:
            rates = [one.stats.sampling_rate for one in headers if one.id == name]
            if max(rates) / min(rates) > 1.0 + MAX_RATE_OFFSET:
                raise InputError(
                    f"{path}: trace {name}: expected one sampling rate, got "
                    f"{min(rates):g} and {max(rates):g} Hz; cut the record there"
                )
            # SAC's step has 32 bits
            rate_hz = rounded(rates[0], SINGLE_SPACING)
            samples, segments = _divided(f"{path}: trace {name}", held[name], rate_hz)
            clocks = tuple(_clock(zero, rate_hz, segment) for segment in segments)
            own, factor = (), stats[name].calib
            if len(segments) > 1:
                end = segments[0][-1][1]
                gap_s = (segments[1][0][1] - end) / BILLION
                own = (
                    f"{len(segments) - 1} gaps, the first of {gap_s:.6g} s after "
                    f"{_utc(end)}; the segments between them are picked one by one",
                )
            if factor not in (0.0, 1.0):
                own += (
                    f"trace {name}: its header's factor of {factor:g} is not applied",
                )
            # with gaps, the rate of the longest segment
            true_hz = max(clocks, key=lambda clock: clock.length).rate_hz
            if true_hz != rate_hz:
                own += (
                    f"trace {name}: {true_hz:.7g} Hz by the times of its records, "
                    f"{rate_hz:.7g} Hz in its header",
                )
            part = partial(lambda of, start, stop: of[start:stop], samples)
            column = column._replace(
                length=samples.size, read=part, clocks=clocks, notes=own
            )
        columns.append(column)
    return (Group(tuple(columns), notes=tuple(notes)),)


def _records(
    read: Callable[..., Any], data: bytes, notes: list[str]
) -> dict[str, list[Record]]:
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
        info: dict[str, Any] = get_record_information(stream, offset=at)
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
    found: dict[str, list[Record]] = {}
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
            (start, own)
            for (start, _), own in zip(order, np.split(samples, ends[:-1]), strict=True)
        ]
    return found


def _units(stats: dict[str, Any]) -> dict[str, str]:
    """Return the unit of each trace; for other quantities than pressure their name.

    Without a channel of pressure (D) those of unknown instruments are used.
    """
    codes = {name: name.rpartition(".")[2] for name in stats}
    seed = {n: c[1] for n, c in codes.items() if re.fullmatch("[A-Z]{2}[A-Z0-9]", c)}
    units = {}
    for name, one in stats.items():
        # of SAC only
        kind = int(one["sac"].get("idep", 5)) if "sac" in one else 5
        units[name] = IDEP.get(kind, "count")
        if seed.get(name, "-") in GROUND:
            units[name] = "ground motion"
        elif "D" in seed.values() and seed.get(name) != "D":
            units[name] = "another quantity"
    return units


def _divided(
    where: str, records: list[Record], rate_hz: float
) -> tuple[Num[np.ndarray, " sample"], list[Segment]]:
    """Return the samples of a trace, and its segments between gaps.

    Samples of one time that two records contain are used once.

    Raises:
        InputError: Two records have different samples at one time.
    """
    step = _step(records, rate_hz)
    samples = np.concatenate([own for _, own in records])
    segments: list[Segment] = []
    count = 0
    for start, own in records:
        end = segments[-1][-1][1] if segments else -np.inf
        late = (start - end) / step
        if (again := round(max(-late, 0.0))) > 0:
            held = samples[max(count - again, segments[-1][0][0]) : count]
            same = min(held.size, own.size)
            if held.size < again or not np.array_equal(held[:same], own[:same]):
                raise InputError(
                    f"{where}: expected one sample at each time, got an overlap of "
                    f"{again * step / BILLION:.6g} s with other samples before "
                    f"{_utc(segments[-1][-1][1])}; remove one of the two records"
                )
            if (own := own[again:]).size == 0:
                continue
            start += round(again * step)
        elif late >= 0.5:
            segments.append([])
        samples[count : count + own.size] = own
        end = count + own.size, start + round(own.size * step)
        # the end of the last record is replaced by the start of this one
        segments[-1][-1:] = [(count, start), end]
        count += own.size
    return samples[:count], segments


def _step(records: list[Record], rate_hz: float) -> float:
    """Return the step of a trace by the times of its records [ns]."""
    nominal = BILLION / rate_hz
    if len(records) <= LEAST_RECORDS:
        return nominal
    starts = np.array([start for start, _ in records])
    steps = np.diff(starts) / [own.size for _, own in records[:-1]]
    # the median is not changed by gaps
    step = float(np.median(steps))
    return step if abs(step / nominal - 1.0) < MAX_RATE_OFFSET else nominal


def _clock(zero: int, rate_hz: float, segment: Segment) -> Clock:
    """Return the clock of one segment of a trace.

    Args:
        zero: Start of the file, nanoseconds since 1970.
        rate_hz: Rate in the header.
        segment: The segment.
    """
    begin, start = segment[0]
    # relative to the first, as nanoseconds since 1970 exceed the digits of a float
    number = np.array([sample - begin for sample, _ in segment])
    since = np.array([(time - start) / BILLION for _, time in segment])
    offset = None
    # the end of the last record is no time of the file
    off = np.abs(since - number / rate_hz)[:-1].max()
    if off > max(RATE_TOLERANCE / rate_hz, LEAST_TIME_S):
        rate_hz = float(f"{number[-2] / since[-2]:.9g}")
        offset = partial(np.interp, xp=number, fp=since)
    start_s = (start - zero) / BILLION
    return Clock(rate_hz, start_s, zero, begin, int(number[-1]), offset)


def _utc(nanoseconds: int) -> str:
    """Return a time to the millisecond."""
    when = START + timedelta(microseconds=nanoseconds // 1000)
    return when.isoformat(timespec="milliseconds").replace("+00:00", "Z")
