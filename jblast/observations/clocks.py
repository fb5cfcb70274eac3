"""Clocks of a log, and clock times in ISO 8601.

All clocks are set by a common one: that of the rows without a clock where others name
theirs, otherwise the first of the log. A log is refused if a clock has two settings or
none, if its clock times are fewer than its unknown offsets and origin times, and if
floating-point numbers near its clock times are further apart than their sigma (128 s
for seconds since 1970 in single precision).

The column `value_utc` holds clock times in place of values. Instants are whole
nanoseconds since 1970 in UTC (POSIX: leap seconds are not counted), and become seconds
only after the whole second before the first of them is subtracted, so that no digit is
lost. Leap seconds themselves, local times that occurred twice or never, and times on
both sides of midnight without a date are refused.
"""

import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from datetime import UTC, date, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from jblast.errors import InputError, argument, nearest, shown
from jblast.observations.places import Columns
from jblast.observations.table import ClockTimesTaken, Observations
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import CLOCK_TIMES, QUANTITIES
from jblast.scene import Free, Scene, UncertainScene

VALUE_UTC = "value_utc"
SECOND = 1_000_000_000
"""Nanoseconds per second."""
HALF_DAY = 12 * 3600 * SECOND
"""Largest span of times of day without a date [ns]: a larger one is a midnight between
them, a smaller one is an unsorted log."""
YEARS = (1800, 2200)
"""Range of years of clock times; before it there were no time zones, and nanoseconds
since 1970 in 64 bits end in 2262."""
_DAY = re.compile(r"(\d{4})-(\d{2})-(\d{2})[T ]\s*")
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,9}))?)?\s*")
_OFFSET = re.compile(r"([+-])(\d{2}):?(\d{2})?")
EXAMPLE = "2020-08-04T15:08:18.310Z"


def check_clocks(
    observations: Observations, scene: Scene, beliefs: Collection[str]
) -> None:
    """Raise an error for clocks that are not in the log, or not set exactly once.

    The first clock of the log is the common one, by which all others are set; or that
    of the rows whose column `clock` is empty, where others name theirs.

    Raises:
        InputError: There is such a clock; the message names it.
    """
    source = observations.source or "observations"
    named = list(dict.fromkeys(clock for clock in observations.clock if clock))
    sensors = {sensor.name: sensor for sensor in scene.sensors}
    for clock in scene.clocks:
        known = list(dict.fromkeys(observations.clocks()))
        if clock.name not in known:
            raise InputError(
                f"{CLOCK_OFFSET}.{clock.name}: {source} has no such clock"
                f"{nearest(clock.name, known)}; expected one of {', '.join(known)}"
            )
    if (
        named
        and f"{CLOCK_OFFSET}.{named[0]}" in beliefs
        # with a common clock all named clocks may have offsets
        and not has_common_clock(observations)
    ):
        others = " or ".join(f"{CLOCK_OFFSET}.{other}" for other in named[1:])
        raise InputError(
            f"{CLOCK_OFFSET}.{named[0]}: {shown(named[0])} is the first clock of "
            f"{source}, by which the others are set; expected {others or 'no clock'}"
        )
    for row, (clock, sensor) in enumerate(
        zip(observations.clock, observations.sensor, strict=True)
    ):
        own = sensors.get(sensor)
        if not clock or clock == sensor or own is None:
            continue
        if float(own.clock_offset_s) != 0 or f"{CLOCK_OFFSET}.{sensor}" in beliefs:
            raise InputError(
                f"{observations.where(row)}, column clock: got {shown(clock)}, but the "
                f"scene gives sensor {shown(sensor)} a clock_offset_s of its own; "
                "expected one of the two"
            )


def has_common_clock(observations: Observations) -> bool:
    """Return True if some clock times are on the common clock, others on named ones."""
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    named = np.array([bool(clock) for clock in observations.clock])
    return bool(named.any() and (timed & ~named).any())


def clocks_apart(observations: Observations) -> list[str]:
    """Return the clocks named in a log, except the one by which others are set."""
    named = list(dict.fromkeys(clock for clock in observations.clock if clock))
    return named if has_common_clock(observations) else named[1:]


def untied_flashes(
    observations: Observations, known: Collection[str]
) -> Bool[np.ndarray, " row"]:
    """Return True for rows of flashes on clocks without a relation to the others.

    Such a clock is named in the column `clock`, has flashes only, and its offset is
    neither given nor fitted. The first clock is related to others whose offsets are
    given or fitted. If no other clock has other readings, all rows are False.

    Args:
        observations: The log.
        known: Clocks whose offset is given or fitted.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    flash = np.isin(observations.quantity, "flash_time_s")
    clocks = np.array(observations.clocks(), object)
    named = np.array([bool(clock) for clock in observations.clock])
    tied = set(clocks[timed & ~flash]) | set(clocks[timed & ~named]) | set(known)
    if set(observations.clock) & set(known) and not has_common_clock(observations):
        tied.add(next((clock for clock in observations.clock if clock), ""))
    untied = flash & ~np.isin(clocks, list(tied))
    return untied if (timed & ~untied).any() else np.zeros(len(observations), bool)


def refuse_unsolvable_clocks(
    observations: Observations, uncertain: UncertainScene
) -> None:
    """Refuse unknown clocks that the clock times of a log cannot determine.

    Each clock time determines one offset or origin time at most. Where there are no
    more times than these, the times do not constrain the position; the other readings
    must then determine all other unknowns.

    Raises:
        InputError: There are fewer times than unknown offsets and origin times, or as
            many, and fewer other readings than other unknowns. The message names the
            unknowns and possible remedies.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    read = set(np.array(observations.clocks(), object)[timed])
    # a prior constrains an offset, so only free ones count
    free = [name for name, of in uncertain.beliefs.items() if isinstance(of, Free)]
    offsets = [n for n in free if n.startswith(f"{CLOCK_OFFSET}.")]
    # an offset of a clock without readings changes nothing
    offsets = [n for n in offsets if n.partition(".")[2] in read]
    origins = [n for n in free if n.partition(".")[0] == "origin_time_s"]
    clocks, times = len(offsets) + len(origins), int(timed.sum())
    others = len(free) - clocks
    too_few = times == clocks and len(observations) - times < others
    if not offsets or not (times < clocks or too_few):
        return
    left = f" and {others} other unknowns" if too_few else ""
    raise InputError(
        f"{observations.source or 'observations'}: {times} clock times and "
        f"{len(observations) - times} other readings cannot determine {clocks} unknown "
        f"clocks ({', '.join([*offsets, *origins])}){left}; expected recorders on a "
        "common clock (one name in the column clock), a flash_time_s beside the "
        "arrival on each clock, or known offsets ([[clock]] offset_s in the scene)"
    )


def refuse_unresolved(
    observations: Observations, dtype: type[np.floating[Any]] | None = None
) -> None:
    """Raise an error for clock times that are too coarse in the computation's numbers.

    A time since 1970 in single precision has steps of 128 s, and a fit would converge
    to a wrong result. Neighbouring numbers may be one sigma apart, a rounding error of
    0.3 sigma.

    Args:
        observations: The log.
        dtype: Type of the computation; JAX's default.

    Raises:
        InputError: There is a row with such a time; the message names the first.
    """
    if dtype is None:
        dtype = jnp.zeros(()).dtype.type
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    value = np.where(timed, observations.value, 0.0)
    # distance to the next representable number at each value
    spacing = np.spacing(np.abs(value).astype(dtype)).astype(float)
    # false for NaN: without a sigma there is nothing to compare
    coarse = timed & (spacing > observations.sigma)
    for row in np.flatnonzero(coarse):
        raise InputError(
            f"{observations.where(int(row))}: {observations.quantity[row]} = "
            f"{value[row]:.10g} s with a sigma of {observations.sigma[row]:g} s: in "
            f"{np.dtype(dtype).name} such times are {spacing[row]:.3g} s apart; "
            "expected times counted from near the shot, or float64 (jax_enable_x64)"
        )


def take_clock_times(
    rows: Columns, date: str | None = None, zone: str | None = None
) -> datetime | None:
    """Put seconds since an epoch into column `value` where `value_utc` holds a time.

    The epoch is the whole second before the first of them. They are subtracted as
    integers: float64 seconds since 1970 are 0.2 us apart.

    Args:
        rows: The table; its column `value` is changed.
        date: The day, YYYY-MM-DD, of times of day without one, in their zone.
        zone: The zone of times without one.

    Returns:
        The epoch, UTC; None if no row has a clock time.

    Raises:
        InputError: A time cannot be read, its row also has a value or another quantity
            than a clock time, or other clock times are in seconds; unless faults are
            gathered.
    """
    day, place = date and day_named(date), zone and zone_named(zone)
    texts = rows.texts.get(VALUE_UTC)
    if texts is None or not any(texts):
        return None
    quantity = rows.texts["quantity"]
    values = list(rows.texts.get("value") or [""] * len(texts))
    dated = np.array([bool(text) for text in texts])
    timed = np.isin(quantity, CLOCK_TIMES)
    rows.refuse(
        dated & [bool(value) for value in values],
        VALUE_UTC,
        lambda _: "either value or value_utc, got both",
    )
    # an unknown quantity is reported elsewhere
    rows.refuse(
        dated & ~timed & np.isin(quantity, tuple(QUANTITIES)),
        VALUE_UTC,
        lambda row: f"nothing, as {quantity[row]} is not a clock time; use value",
    )
    rows.refuse(
        timed & ~dated & [bool(value) for value in values],
        "value",
        lambda row: (
            f"value_utc for {quantity[row]} as in the other rows, got "
            f"{values[row]} s of an unknown start"
        ),
    )
    rows.refuse(
        dated & [bool(text) for text in rows.texts.get("time_s") or [""] * len(texts)],
        "time_s",
        lambda _: "nothing beside value_utc, as its start is unknown",
    )
    found: dict[int, int] = {}
    why: dict[int, str] = {}
    for row in map(int, np.flatnonzero(dated)):
        try:
            found[row] = instant(texts[row], day or None, place or None)
        except NotAnInstant as reason:
            why[row] = str(reason)
    rows.refuse([row in why for row in range(len(texts))], VALUE_UTC, why.__getitem__)
    for row in why:
        # the fault is reported, and the row is left out
        values[row] = "0"
    rows.texts["value"] = values
    if not found:
        return None
    if day:
        _refuse_over_midnight(rows, texts, found)
    # a whole second, so that the epoch is an exact datetime
    first = min(found.values()) // SECOND * SECOND
    for row, when in found.items():
        # repr reads back as the same number
        values[row] = repr((when - first) / SECOND)
    rows.texts["value"] = values
    return moment(first)


def converted_clock_times(
    texts: Sequence[str], date: str | None, zone: str | None
) -> list[ClockTimesTaken]:
    """Return the dates and zones supplied or converted; empty for UTC with dates.

    Args:
        texts: Column `value_utc`, as written.
        date: The day of those without one.
        zone: The zone of those without one.
    """
    days, zones = [], []
    for text in filter(None, texts):
        rest = text.strip()
        if dated := _DAY.match(rest):
            rest = rest[dated.end() :]
        clock = _CLOCK.match(rest)
        days.append(dated)
        zones.append(rest[clock.end() :] if clock else "")
    unzoned = zones.count("")
    utc = sum(own.upper() in ("Z", "UTC") for own in zones)
    found = ClockTimesTaken(
        date=date or "",
        undated=days.count(None) if date else 0,
        zone=zone or "",
        unzoned=unzoned if zone else 0,
        moved=len(zones) - unzoned - utc,
    )
    return [found] if found.undated or found.unzoned or found.moved else []


def _refuse_over_midnight(
    rows: Columns, texts: Sequence[str], found: dict[int, int]
) -> None:
    """Raise an error for times of one day more than half a day apart: past midnight."""
    last = max(found.values())
    early = [last - found.get(row, last) > HALF_DAY for row in range(len(texts))]
    late = texts[max(found, key=found.__getitem__)]
    rows.refuse(
        [flag and "-" not in texts[row][:8] for row, flag in enumerate(early)],
        VALUE_UTC,
        lambda row: (
            f"times within half a day, got {texts[row]} and {late}; if midnight was "
            "between them, write dates, as 2020-08-05T00:00:00.310Z"
        ),
    )


class NotAnInstant(Exception):
    """The expected text, in words that continue "expected"."""


def instant(text: str, day: date | None, zone: tzinfo | None) -> int:
    """Return nanoseconds since 1970, UTC.

    Args:
        text: `2020-08-04T15:08:18.310Z`, or with an offset such as +03:00 in place of
            the Z, or without date, or without zone; a decimal comma is one too.
        day: The date of a text without one.
        zone: The zone of a text without one.

    Raises:
        NotAnInstant: It cannot be read; the message has the reason.
    """
    rest = text.strip()
    if dated := _DAY.match(rest):
        try:
            day, rest = date(*map(int, dated.groups())), rest[dated.end() :]
        except ValueError:
            got = repr(dated[0].strip())
            raise NotAnInstant(f"a day of the calendar, got {got}") from None
    clock = _CLOCK.match(rest)
    if not clock:
        raise NotAnInstant(f"a time as {EXAMPLE} or 15:08:18.310, got {shown(text)}")
    hour, minute, second = (int(clock[i] or 0) for i in (1, 2, 3))
    if second == 60:
        raise NotAnInstant(
            "seconds below 60, as leap seconds are not counted; got "
            f"{shown(text)}: shift all times by a second, or give them as value, in "
            "seconds from any instant"
        )
    if hour > 23 or minute > 59 or second > 59:
        raise NotAnInstant(f"a time of day from 00:00:00 to 23:59:59, got {text!r}")
    own = rest[clock.end() :]
    own_zone = _offset(own, text) if own else zone
    if day is None:
        raise NotAnInstant(
            f"a date, as in {EXAMPLE}, or {argument('date')} YYYY-MM-DD for all"
            + ("" if own_zone else f" (and {argument('zone')}, as +02:00)")
            + f"; got {shown(text)}"
        )
    if own_zone is None:
        raise NotAnInstant(
            f"a zone, as in {EXAMPLE} or 15:08:18.310+03:00, or {argument('zone')} for "
            f"all, as +02:00 or Asia/Beirut; got {shown(text)}"
        )
    # digits of the fraction as an integer: a float would round them
    nanoseconds = int((clock[4] or "").ljust(9, "0"))
    if not YEARS[0] <= day.year <= YEARS[1]:
        raise NotAnInstant(f"a year from {YEARS[0]} to {YEARS[1]}, got {shown(text)}")
    seconds = _seconds(datetime(day.year, day.month, day.day, hour, minute), own_zone)
    return (seconds + second) * SECOND + nanoseconds


def zone_named(name: str) -> tzinfo:
    """Return a time zone: `UTC`, `Z`, `+02:00`, or an IANA name, `Europe/Paris`.

    Raises:
        InputError: There is no such zone.
    """
    if name.upper() in ("Z", "UTC"):
        return UTC
    if match := _OFFSET.fullmatch(name):
        return _fixed(match, name)
    from zoneinfo import ZoneInfo, available_timezones

    try:
        return ZoneInfo(name)
    # no such zone, or a name that is not one of a file
    except (KeyError, OSError, ValueError):
        raise InputError(
            f"{argument('zone')}: expected a zone as Asia/Beirut, +02:00 or UTC, got "
            f"{shown(name)}{nearest(name, available_timezones())}"
        ) from None


def day_named(text: str) -> date:
    """Return the day of YYYY-MM-DD.

    Raises:
        InputError: It is not a day in this form.
    """
    if len(text) == 10:
        with suppress(ValueError):
            return datetime.strptime(text, "%Y-%m-%d").date()
    raise InputError(
        f"{argument('date')}: expected a day as 2020-08-04, got {shown(text)}"
    )


def moment(nanoseconds: int) -> datetime:
    """Return an instant in UTC, to the microsecond below."""
    seconds, rest = divmod(nanoseconds, SECOND)
    since = timedelta(seconds=seconds, microseconds=rest // 1000)
    return datetime(1970, 1, 1, tzinfo=UTC) + since


def written(epoch: datetime, seconds: float) -> str:
    """Return an instant as text that `instant` reads, to the nanosecond.

    Args:
        epoch: UTC of time zero.
        seconds: Seconds since then.
    """
    since = epoch - datetime(1970, 1, 1, tzinfo=UTC)
    whole = since // timedelta(microseconds=1) * 1000
    nanoseconds = whole + round(seconds * SECOND)
    text = moment(nanoseconds).strftime("%Y-%m-%dT%H:%M:%S")
    return f"{text}.{nanoseconds % SECOND:09d}Z"


def _offset(text: str, whole: str) -> tzinfo:
    """Return the zone from the text after a time."""
    if text in ("Z", "z", "UTC"):
        return UTC
    match = _OFFSET.fullmatch(text)
    if not match:
        raise NotAnInstant(f"Z or an offset as +03:00 after it, got {shown(whole)}")
    try:
        return _fixed(match, text)
    except InputError:
        raise NotAnInstant(f"an offset within a day, got {shown(whole)}") from None


def _fixed(match: re.Match[str], name: str) -> timezone:
    hours, minutes = int(match[2]), int(match[3] or 0)
    if hours > 23 or minutes > 59:
        raise InputError(
            f"{argument('zone')}: expected an offset within a day, got {shown(name)}"
        )
    ahead = timedelta(hours=hours, minutes=minutes)
    return timezone(ahead if match[1] == "+" else -ahead)


@lru_cache(maxsize=4096)
def _seconds(local: datetime, zone: tzinfo) -> int:
    """Return whole seconds since 1970 of a local time that occurred once.

    Raises:
        NotAnInstant: The time occurred twice or never, as clocks were changed.
    """
    # not all offsets are whole minutes: that of Monrovia was 44 min 30 s until 1972
    both = [local.replace(tzinfo=zone, fold=fold) for fold in (0, 1)]
    happened = [
        when
        for when in both
        if when.astimezone(UTC).astimezone(zone).replace(tzinfo=None) == local
    ]
    # a local time survives the round trip through UTC only if it occurred
    if not happened:
        raise NotAnInstant(
            f"a time that occurred in {zone}, got {local:%Y-%m-%d %H:%M}, which clocks "
            "skipped when they were put forward"
        )
    offsets = {when.utcoffset() for when in happened}
    if len(offsets) > 1:
        zones = " or ".join(f"{when:%z}" for when in happened)
        raise NotAnInstant(
            f"a time that occurred once in {zone}, got {local:%Y-%m-%d %H:%M}, which "
            f"occurred twice as clocks were put back; add {zones} to it"
        )
    since = happened[0] - datetime(1970, 1, 1, tzinfo=UTC)
    return since // timedelta(seconds=1)
