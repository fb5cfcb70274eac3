"""An instant as people write it: ISO 8601, or a time of day whose date is known.

Instants are whole nanoseconds since 1970 in UTC (POSIX: no leap seconds are counted),
so that differences lose nothing before they become floating-point seconds.
"""

import re
from datetime import UTC, date, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from typing import NamedTuple

from jblast.errors import InputError, argument, nearest, shown

SECOND = 1_000_000_000
"""Nanoseconds."""
YEARS = (1800, 2200)
"""Between which a blast was recorded by a clock; further off a zone has no meaning."""
_DAY = re.compile(r"(\d{4})-(\d{2})-(\d{2})[T ]\s*")
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,9}))?)?\s*")
_OFFSET = re.compile(r"([+-])(\d{2}):?(\d{2})?")
EXAMPLE = "2020-08-04T15:08:18.310Z"


class NotAnInstant(Exception):
    """What was expected, in words that go on after "expected"."""


def instant(text: str, day: date | None, zone: tzinfo | None) -> int:
    """Return nanoseconds since 1970, UTC.

    Args:
        text: `2020-08-04T15:08:18.310Z`, or with an offset such as +03:00 in place of
            the Z, or without date, or without zone; a decimal comma is one too.
        day: The date of a text without one.
        zone: The zone of a text without one.

    Raises:
        NotAnInstant: It cannot be read so; the message says why.
    """
    rest = text.strip()
    if dated := _DAY.match(rest):
        day, rest = _day(dated), rest[dated.end() :]
    clock = _CLOCK.match(rest)
    if not clock:
        raise NotAnInstant(f"a time as {EXAMPLE} or 15:08:18.310, got {shown(text)}")
    hour, minute, second = (int(clock[i] or 0) for i in (1, 2, 3))
    if second == 60:
        raise NotAnInstant(
            "seconds below 60: a leap second has no number of its own in UTC as "
            f"counted here; got {shown(text)}: move all times by a second, or give "
            "them as value, in seconds from any one moment"
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
    nanoseconds = int((clock[4] or "").ljust(9, "0"))
    if not YEARS[0] <= day.year <= YEARS[1]:
        raise NotAnInstant(f"a year from {YEARS[0]} to {YEARS[1]}, got {shown(text)}")
    seconds = _seconds(datetime(day.year, day.month, day.day, hour, minute), own_zone)
    return (seconds + second) * SECOND + nanoseconds


class Said(NamedTuple):
    """What a text says of its instant, beside the time of the day.

    Attributes:
        date: Whether it names the day.
        zone: What stands behind the time of day: "", "Z", "+03:00".
    """

    date: bool
    zone: str


def said(text: str) -> Said:
    """Return what a time, as `instant` reads it, says of its day and zone."""
    rest = text.strip()
    dated = _DAY.match(rest)
    rest = rest[dated.end() :] if dated else rest
    clock = _CLOCK.match(rest)
    return Said(dated is not None, rest[clock.end() :] if clock else "")


def zone_named(name: str) -> tzinfo:
    """Return a time zone: `UTC`, `Z`, `+02:00`, or a name of IANA's, `Europe/Paris`.

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
    except (KeyError, OSError, ValueError):  # no zone; no name of a file
        raise InputError(
            f"{argument('zone')}: expected a zone as Asia/Beirut, +02:00 or UTC, got "
            f"{shown(name)}{nearest(name, available_timezones())}"
        ) from None


def day_named(text: str) -> date:
    """Return the day of YYYY-MM-DD.

    Raises:
        InputError: It is none.
    """
    try:
        if len(text) == 10:
            return datetime.strptime(text, "%Y-%m-%d").date()
    except ValueError:
        pass
    raise InputError(
        f"{argument('date')}: expected a day as 2020-08-04, got {shown(text)}"
    )


def moment(nanoseconds: int) -> datetime:
    """Return an instant in UTC, to the microsecond below."""
    seconds, rest = divmod(nanoseconds, SECOND)
    since = timedelta(seconds=seconds, microseconds=rest // 1000)
    return datetime(1970, 1, 1, tzinfo=UTC) + since


def written(epoch: datetime, seconds: float) -> str:
    """Return an instant as `instant` reads it, to the nanosecond.

    Args:
        epoch: UTC of time zero.
        seconds: Since then.
    """
    since = epoch - datetime(1970, 1, 1, tzinfo=UTC)
    whole = since // timedelta(microseconds=1) * 1000
    nanoseconds = whole + round(seconds * SECOND)
    text = moment(nanoseconds).strftime("%Y-%m-%dT%H:%M:%S")
    return f"{text}.{nanoseconds % SECOND:09d}Z"


def _day(match: re.Match[str]) -> date:
    try:
        return date(*map(int, match.groups()))
    except ValueError:
        raise NotAnInstant(f"a day of the calendar, got {match[0].strip()!r}") from None


def _offset(text: str, whole: str) -> tzinfo:
    """Return the zone that stands behind a time."""
    if text in ("Z", "z", "UTC"):
        return UTC
    match = _OFFSET.fullmatch(text)
    if not match:
        raise NotAnInstant(f"Z or an offset as +03:00 behind it, got {shown(whole)}")
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
    """Return whole seconds since 1970 of a local time that happened once.

    Offsets were no whole minutes everywhere: in Monrovia 44 min 30 s until 1972.

    Raises:
        NotAnInstant: Clocks were moved then: it never happened, or twice.
    """
    both = [local.replace(tzinfo=zone, fold=fold) for fold in (0, 1)]
    happened = [
        when
        for when in both
        if when.astimezone(UTC).astimezone(zone).replace(tzinfo=None) == local
    ]
    if not happened:
        raise NotAnInstant(
            f"a time that there was in {zone}, got {local:%Y-%m-%d %H:%M}: clocks "
            "were put forward over it"
        )
    offsets = {when.utcoffset() for when in happened}
    if len(offsets) > 1:
        said = " or ".join(f"{when:%z}" for when in happened)
        raise NotAnInstant(
            f"a time that there was once in {zone}, got {local:%Y-%m-%d %H:%M}, which "
            f"came twice as clocks were put back; say {said} behind it"
        )
    since = happened[0] - datetime(1970, 1, 1, tzinfo=UTC)
    return since // timedelta(seconds=1)
