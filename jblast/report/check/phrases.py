"""Phrases that sentences about a doubt are made of."""

from datetime import UTC, datetime, timedelta

import numpy as np

from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.numbers import printed_number
from jblast.report.words import quantity_words


def seconds(number: float) -> str:
    """Print a time; hours from one on."""
    if abs(number) >= 3600:
        return f"{number / 3600:.4g} h"
    return printed_number("_s", number, 3)


def metres(number: float) -> str:
    """Print a length."""
    return printed_number("_m", number, 3)


def kilograms(number: float) -> str:
    """Print a mass."""
    return printed_number("_kg", number, 2)


def value_of(doubt: Doubt, key: str = "value") -> str:
    """Print one of a doubt's numbers, of the quantity that it names."""
    return printed_number(doubt.names[0], doubt.numbers[key], 3)


def reading(doubt: Doubt, log: Observations) -> str:
    """Name what a doubt is about: sensor, quantity and value of its first row."""
    row = doubt.rows[0]
    quantity = log.quantity[row]
    if log.epoch is not None and quantity in CLOCK_TIMES:
        when = utc(log.epoch, float(log.value[row]))
        return f"{log.sensor[row]}: {quantity_words(quantity)} at {when}"
    value = printed_number(quantity, log.value[row], 4)
    return f"{log.sensor[row]}: {quantity_words(quantity)} of {value}"


def utc(epoch: datetime, seconds_since: float) -> str:
    """Print a clock time as it came, in UTC, to the millisecond."""
    when = (epoch + timedelta(seconds=seconds_since)).astimezone(UTC)
    return f"{when:%H:%M:%S}.{when.microsecond // 1000:03d} UTC"


def place(doubt: Doubt, log: Observations) -> str:
    """Print the place that a doubt names; in degrees where the log is in degrees."""
    east, north = doubt.numbers["east_m"], doubt.numbers["north_m"]
    if log.frame is not None:
        from jblast.report.fit.place.map_words import degrees  # with all of a report

        lat, lon, _ = log.frame.to_geodetic(np.array([east, north, 0.0])).tolist()
        return degrees(lat, lon)
    return f"east {east:.4g} m, north {north:.4g} m"
