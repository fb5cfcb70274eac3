"""Doubts about clocks and shots: who heard what, and by which clock."""

from datetime import UTC, datetime

import numpy as np

from jblast.observations.check.doubt import Doubt
from jblast.observations.table import Observations
from jblast.quantities import ARRIVALS, CLOCK_TIMES
from jblast.quantity_table import QUANTITIES

EARLY = 5.0
"""An arrival this many sigmas before the flash is no error of reading."""

FROM_2000, TO_2100 = 946_684_800.0, 4_102_444_800.0
"""Seconds since 1970 at the first of January of these years."""

COUNTED_IN = {
    "seconds": 1.0,
    "milliseconds": 1e3,
    "microseconds": 1e6,
    "nanoseconds": 1e9,
}
"""What computers count time since 1970 in, of a second."""


def clocks_doubted(observations: Observations) -> list[Doubt]:
    """Return what is odd about the clocks and the shots of a log."""
    return [
        *_since_1970(observations),
        *_unheard(observations),
        *_lonely(observations),
        *_before_the_flash(observations),
    ]


def _since_1970(observations: Observations) -> list[Doubt]:
    """Find clock times that are no time of a blast, but a date as computers count."""
    if observations.epoch is not None:
        return []
    value = observations.value
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    found = []
    for unit, factor in COUNTED_IN.items():
        since = value / factor
        rows = np.flatnonzero(timed & (since > FROM_2000) & (since < TO_2100))
        if rows.size:
            when = datetime.fromtimestamp(float(since[rows[0]]), UTC)
            names = unit, f"{when:%Y-%m-%dT%H:%M:%S}.{when.microsecond // 1000:03d}Z"
            found.append(Doubt("since_1970", tuple(rows.tolist()), {}, names))
    return found


def _unheard(observations: Observations) -> list[Doubt]:
    """Find shots of which nothing but light is told: no mass follows from that."""
    rows: dict[str, list[int]] = {}
    for row, shot in enumerate(observations.shot):
        rows.setdefault(shot, []).append(row)
    return [
        Doubt("shot_unheard", tuple(its), {}, (shot,))
        for shot, its in rows.items()
        if all(QUANTITIES[observations.quantity[row]].kind == "flash" for row in its)
    ]


def _lonely(observations: Observations) -> list[Doubt]:
    """Find clocks with one reading, which a free offset would answer alone."""
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    rows: dict[str, list[int]] = {}
    for row in np.flatnonzero(timed):
        rows.setdefault(observations.clock[row], []).append(int(row))
    return [
        Doubt("clock_of_one_row", tuple(its), {}, (clock,))
        for clock, its in rows.items()
        if clock and len(its) == 1 and len(rows) > 1
    ]


def _before_the_flash(observations: Observations) -> list[Doubt]:
    """Find waves that came before the light of their shot, by one clock."""
    found = []
    flash: dict[tuple[str, str], int] = {}
    quantity, value = observations.quantity, observations.value
    sigma = np.nan_to_num(observations.sigma)
    by = [
        (shot, clock or sensor)
        for shot, clock, sensor in zip(
            observations.shot, observations.clock, observations.sensor, strict=True
        )
    ]
    for row, key in enumerate(by):
        if quantity[row] == "flash_time_s":
            flash.setdefault(key, row)
    for row, key in enumerate(by):
        if quantity[row] not in ARRIVALS or key not in flash:
            continue
        seen = flash[key]
        allowed = EARLY * float(np.hypot(sigma[row], sigma[seen]))
        if value[row] + allowed < value[seen]:
            early = float(value[seen] - value[row])
            found.append(Doubt("arrival_before_flash", (row, seen), {"early_s": early}))
    return found
