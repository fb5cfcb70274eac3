"""Phrases that sentences about a doubt are made of."""

from jblast.observations import Observations
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
    value = printed_number(quantity, log.value[row], 4)
    return f"{log.sensor[row]}: {quantity_words(quantity)} of {value}"


def place(doubt: Doubt) -> str:
    """Print the place that a doubt names."""
    east, north = doubt.numbers["east_m"], doubt.numbers["north_m"]
    return f"east {east:.4g} m, north {north:.4g} m"
