"""The column `value_utc`: clock times in place of values."""

from collections.abc import Callable, MutableMapping, Sequence
from datetime import datetime
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from jblast.observations.times.instant import (
    SECOND,
    NotAnInstant,
    day_named,
    instant,
    moment,
    said,
    zone_named,
)
from jblast.observations.understood import ClockTimesTaken
from jblast.quantities import CLOCK_TIMES
from jblast.quantity_table import QUANTITIES

COLUMN = "value_utc"
HALF_DAY = 12 * 3600 * SECOND


@runtime_checkable
class Columns(Protocol):
    """The columns of a table: `observations.rows.Rows` is one."""

    @property
    def texts(self) -> MutableMapping[str, list[str]]:
        """Each column as it was written."""
        ...

    def refuse(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        expected: Callable[[int], str],
    ) -> None:
        """Tell bad rows, with what the column should hold."""
        ...


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
        InputError: A time cannot be read, stands beside a value, is given for what is
            no clock time, or beside clock times in seconds; unless faults are gathered.
    """
    day, place = date and day_named(date), zone and zone_named(zone)
    texts = rows.texts.get(COLUMN)
    if texts is None or not any(texts):
        return None
    quantity = rows.texts["quantity"]
    values = list(rows.texts.get("value") or [""] * len(texts))
    dated = np.array([bool(text) for text in texts])
    timed = np.isin(quantity, CLOCK_TIMES)
    rows.refuse(
        dated & [bool(value) for value in values],
        COLUMN,
        lambda _: "either value or value_utc, got both",
    )
    # of an unknown quantity that is told, and no more is known
    rows.refuse(
        dated & ~timed & np.isin(quantity, tuple(QUANTITIES)),
        COLUMN,
        lambda row: f"nothing, as {quantity[row]} is no time of a clock; use value",
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
    rows.refuse([row in why for row in range(len(texts))], COLUMN, why.__getitem__)
    for row in why:
        values[row] = "0"  # that it has no time is told, and the row is left out
    rows.texts["value"] = values
    if not found:
        return None
    if day:
        _refuse_over_midnight(rows, texts, found)
    first = min(found.values()) // SECOND * SECOND
    for row, when in found.items():
        values[row] = repr((when - first) / SECOND)
    rows.texts["value"] = values
    return moment(first)


def told_clock_times(
    texts: Sequence[str], date: str | None, zone: str | None
) -> list[ClockTimesTaken]:
    """Return what was supplied to clock times, or converted; nothing of UTC with dates.

    Args:
        texts: Column `value_utc`, as written.
        date: The day of those without one.
        zone: The zone of those without one.
    """
    of = [said(text) for text in texts if text]
    unzoned = sum(not one.zone for one in of)
    utc = sum(one.zone.upper() in ("Z", "UTC") for one in of)
    found = ClockTimesTaken(
        date=date or "",
        undated=sum(not one.date for one in of) if date else 0,
        zone=zone or "",
        unzoned=unzoned if zone else 0,
        moved=len(of) - unzoned - utc,
    )
    return [found] if found.undated or found.unzoned or found.moved else []


def _refuse_over_midnight(
    rows: Columns, texts: Sequence[str], found: dict[int, int]
) -> None:
    """Refuse times of one day that lie at both its ends: midnight was between them."""
    last = max(found.values())
    early = [last - found.get(row, last) > HALF_DAY for row in range(len(texts))]
    late = texts[max(found, key=found.__getitem__)]
    rows.refuse(
        [flag and "-" not in texts[row][:8] for row, flag in enumerate(early)],
        COLUMN,
        lambda row: (
            f"times within half a day, got {texts[row]} beside {late}: where midnight "
            "was between them, write dates, as 2020-08-05T00:00:00.310Z"
        ),
    )
