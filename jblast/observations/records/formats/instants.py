"""Instants as an epoch and seconds after it, so that no microsecond is lost.

Seconds since 1970 as a double are 2.4e-7 s apart; seconds since a whole second of the
record's own are not.
"""

from datetime import UTC, datetime, timedelta

START = datetime(1970, 1, 1, tzinfo=UTC)
BILLION = 1_000_000_000


def epoch_and_start(nanoseconds: int) -> tuple[datetime, float]:
    """Return the whole second of an instant (UTC), and how far after it that is [s].

    Args:
        nanoseconds: Since the beginning of 1970, without leap seconds.
    """
    whole, part = divmod(nanoseconds, BILLION)
    return START + timedelta(seconds=whole), part / BILLION
