"""Clock times in ISO 8601.

The column `value_utc` holds clock times in place of values. Instants are read to the
microsecond (0.3 mm of sound) in UTC, without leap seconds, and become seconds after the
whole second before the first of them, so that no digit is lost. Leap seconds
themselves, local times that occurred twice or never, and times on both sides of
midnight without a date are refused.
"""

import re
from contextlib import suppress
from datetime import UTC, date, datetime, time, timedelta, tzinfo

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, shown
from jblast.observations.rules import Rows, Rule
from jblast.quantities import CLOCK_TIMES, QUANTITIES
from jblast.results import Note, conversion

VALUE_UTC = "value_utc"
HALF_DAY = timedelta(hours=12)
"""Largest span of times of day without a date: a larger one is a midnight between
them, a smaller one is an unsorted log."""
YEARS = (1800, 2200)
"""Range of years of clock times; before it there were no time zones."""
EXAMPLE = "2020-08-04T15:08:18.310Z"


def clock_times(
    rows: Rows, kind: np.ndarray, date: str | None = None, zone: str | None = None
) -> tuple[Float[np.ndarray, " row"], datetime | None, list[Note]]:
    """Return seconds since an epoch where `value_utc` holds a time, else NaN.

    The epoch is the whole second before the first of them.

    Args:
        rows: The table.
        kind: Quantity of each row.
        date: The day, YYYY-MM-DD, of times of day without one, in their zone.
        zone: The zone of times without one.

    Returns:
        The seconds, the epoch in UTC, None if no row has a clock time, and notes on
        supplied days and zones.
    """
    day, place = date and day_named(date), zone and zone_named(zone)
    texts, dated = rows.text(VALUE_UTC), rows.given(VALUE_UTC)
    seconds = np.full(len(texts), np.nan)
    if not dated.any():
        return seconds, None, []
    timed, valued = np.isin(kind, CLOCK_TIMES), rows.given("value")
    found: dict[int, datetime] = {}
    why: dict[int, str] = {}
    for row in np.flatnonzero(dated).tolist():
        try:
            found[row] = instant(texts[row], day or None, place or None)
        except NotAnInstant as reason:
            why[row] = f"expected {reason}"
    as_written = {row: parsed(texts[row]) for row in found}
    undated = [row for row, (own, _) in as_written.items() if own is None]
    unzoned = [row for row, (_, clock) in as_written.items() if clock.tzinfo is None]
    moved = [row for row, (_, clock) in as_written.items() if clock.utcoffset()]
    last = max(found, key=found.__getitem__, default=0)
    # without dates a midnight between times is invisible
    over = {row for row in undated if found[last] - found[row] > HALF_DAY}
    every = range(len(texts))
    # an unknown quantity is reported elsewhere
    other = dated & ~timed & np.isin(kind, tuple(QUANTITIES))
    seconds_alone = timed & ~dated & valued
    midnight = (
        f"times within half a day, got {{got}} and {texts[last]}; if midnight was "
        "between them, write dates, as 2020-08-05T00:00:00.310Z"
    )
    both = "nothing beside value_utc, as its start is unknown"
    rows.refuse(
        [
            Rule(VALUE_UTC, dated & valued, "either value or value_utc, got both"),
            Rule(
                VALUE_UTC, other, "nothing, as {quantity} is no clock time; use value"
            ),
            Rule("value", seconds_alone, "value_utc for {quantity}, as in other rows"),
            Rule("time_s", dated & rows.given("time_s"), both),
            Rule(VALUE_UTC, [row in why for row in every], why.__getitem__),
            Rule(VALUE_UTC, [row in over for row in every], midnight),
        ]
    )
    notes = [
        conversion(kind, rows=len(of), **numbers)
        for kind, of, numbers in (
            ("times_undated", undated, {"date": date}),
            ("times_unzoned", unzoned, {"zone": zone}),
            ("times_moved", moved, {}),
        )
        if of
    ]
    if not found:
        return seconds, None, notes
    # a whole second, so that the epoch is short where it is written
    epoch = min(found.values()).replace(microsecond=0)
    for row, when in found.items():
        seconds[row] = (when - epoch) / timedelta(seconds=1)
    return seconds, epoch, notes


class NotAnInstant(Exception):
    """The expected text, in words that continue "expected"."""


def parsed(text: str) -> tuple[date | None, time]:
    """Return the day of a text, if it has one, and its time with its own zone.

    Raises:
        NotAnInstant: It cannot be read.
    """
    # spreadsheets write hours of one digit
    rest = re.sub(r"(^|[T ])(\d):", r"\g<1>0\2:", text.strip())
    rest = re.sub(r"\s*(UTC|z)$", "Z", rest)
    day = re.match(r"\d{4}-\d\d-\d\d[T ]\s*", rest)
    try:
        clock = time.fromisoformat(rest[day.end() :] if day else rest)
        return date.fromisoformat(day[0][:10]) if day else None, clock
    except ValueError as error:
        leap = re.search(r":60(\D|$)", rest)
        raise NotAnInstant(
            f"a time as {EXAMPLE} or 15:08:18.310, got {shown(text)} ({error})"
            + ("; leap seconds are not counted: shift all times" if leap else "")
        ) from None


def instant(text: str, day: date | None, zone: tzinfo | None) -> datetime:
    """Return an instant in UTC, to the microsecond.

    Args:
        text: `2020-08-04T15:08:18.310Z`, or with an offset such as +03:00 in place of
            the Z, or without date, or without zone; a decimal comma is one too.
        day: The date of a text without one.
        zone: The zone of a text without one.

    Raises:
        NotAnInstant: It cannot be read, occurred twice or never; the message has the
            reason.
    """
    own_day, clock = parsed(text)
    day, zone = own_day or day, clock.tzinfo or zone
    if day is None:
        raise NotAnInstant(
            f"a date, as in {EXAMPLE}, or {argument('date')} YYYY-MM-DD for all"
            + ("" if zone else f" (and {argument('zone')}, as +02:00)")
            + f"; got {shown(text)}"
        )
    if zone is None:
        raise NotAnInstant(
            f"a zone, as in {EXAMPLE} or 15:08:18.310+03:00, or {argument('zone')} for "
            f"all, as +02:00 or Asia/Beirut; got {shown(text)}"
        )
    if not YEARS[0] <= day.year <= YEARS[1]:
        raise NotAnInstant(f"a year from {YEARS[0]} to {YEARS[1]}, got {shown(text)}")
    local = datetime.combine(day, clock.replace(tzinfo=None))
    # a local time survives the round trip through UTC only if it occurred
    happened = {
        when.astimezone(UTC)
        for when in (local.replace(tzinfo=zone, fold=fold) for fold in (0, 1))
        if when.astimezone(UTC).astimezone(zone).replace(tzinfo=None) == local
    }
    if not happened:
        raise NotAnInstant(
            f"a time that occurred in {zone}, got {local:%Y-%m-%d %H:%M}, which clocks "
            "skipped when they were put forward"
        )
    if len(happened) > 1:
        zones = " or ".join(f"{when.astimezone(zone):%z}" for when in sorted(happened))
        raise NotAnInstant(
            f"a time that occurred once in {zone}, got {local:%Y-%m-%d %H:%M}, which "
            f"occurred twice as clocks were put back; add {zones} to it"
        )
    return happened.pop()


def zone_named(name: str) -> tzinfo:
    """Return a time zone: `UTC`, `Z`, `+02:00`, or an IANA name, `Europe/Paris`.

    Raises:
        InputError: There is no such zone.
    """
    with suppress(ValueError):
        if zone := time.fromisoformat(f"00:00{name}").tzinfo:
            return zone
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
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise InputError(
            f"{argument('date')}: expected a day as 2020-08-04, got {shown(text)}"
        ) from None


def written(epoch: datetime, seconds: float) -> str:
    """Return an instant as text that `instant` reads, to the microsecond.

    Args:
        epoch: UTC of time zero.
        seconds: Seconds since then.
    """
    when = epoch.astimezone(UTC) + timedelta(seconds=seconds)
    return f"{when:%Y-%m-%dT%H:%M:%S.%f}Z"
