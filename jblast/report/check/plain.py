"""Doubts that need no physics, in words: places, clocks, errors."""

from collections.abc import Callable

from jblast.observations import Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.check.phrases import metres, reading, seconds
from jblast.report.numbers import printed_number, significant
from jblast.report.words import quantity_words


def _since_1970(doubt: Doubt, log: Observations) -> str:
    unit, when = doubt.names
    many = len(doubt.rows)
    these = "this looks" if many == 1 else f"these {many} rows look"
    return (
        f"{log.sensor[doubt.rows[0]]}: {these} like {unit} since 1970, here {when}; "
        "taken for seconds of an unknown start, as nothing says so: dates belong in "
        "column value_utc, written like this one"
    )


def _copied(doubt: Doubt, _: Observations) -> str:
    one, other = doubt.names
    return (
        f"{other} stands where {one} does and reads the same to the last digit: is it "
        "one sensor under two names?"
    )


def _together(doubt: Doubt, log: Observations) -> str:
    other, one = doubt.names
    quantity = log.quantity[doubt.rows[0]]
    read, beside = (
        printed_number(quantity, doubt.numbers[key], 4) for key in ("value", "other")
    )
    return (
        f"{other} and {one} stand at one place, but read {read} and {beside} as "
        f"{quantity_words(quantity)}"
    )


def _moved(doubt: Doubt, _: Observations) -> str:
    apart = metres(doubt.numbers["apart_m"])
    return f"{doubt.names[0]} stands {apart} from where an earlier row puts it"


def _unheard(doubt: Doubt, _: Observations) -> str:
    shot = f"shot {doubt.names[0]}" if doubt.names[0] else "the shot"
    return f"{shot} was seen, but nobody heard it: light alone tells no mass"


def _lonely(doubt: Doubt, _: Observations) -> str:
    return (
        f"clock {doubt.names[0]} has this one reading: if its offset is free, the "
        "reading tells nothing else"
    )


def _before_flash(doubt: Doubt, log: Observations) -> str:
    early = seconds(doubt.numbers["early_s"])
    return f"{reading(doubt, log)} is {early} before the flash by the same clock"


def _fine(doubt: Doubt, log: Observations) -> str:
    share = significant(doubt.numbers["share"])
    return (
        f"{reading(doubt, log)} has a sigma of {share} of "
        "it, finer than any gauge: a log's sigma is in the unit of its value"
    )


def _large(doubt: Doubt, log: Observations) -> str:
    return (
        f"{reading(doubt, log)} has a sigma of {significant(doubt.numbers['share'])} "
        "times itself: a log's sigma is in the unit of its value"
    )


def _degrees(doubt: Doubt, _: Observations) -> str:
    lat, lon = doubt.numbers["lat_deg"], doubt.numbers["lon_deg"]
    return (
        f"{doubt.names[0]} stands {metres(doubt.numbers['apart_m'])} from the others "
        f"at latitude {lat:.6g}, longitude {lon:.6g}; swapped it would be among them"
    )


SENTENCES: dict[str, Callable[[Doubt, Observations], str]] = {
    "sensor_copied": _copied,
    "two_sensors_at_one_place": _together,
    "sensor_at_two_places": _moved,
    "since_1970": _since_1970,
    "shot_unheard": _unheard,
    "clock_of_one_row": _lonely,
    "arrival_before_flash": _before_flash,
    "sigma_too_fine": _fine,
    "sigma_large": _large,
    "lat_lon_swapped": _degrees,
}
