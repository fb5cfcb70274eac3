"""Rows that disagree with the others in words, and the slip it may be."""

from collections.abc import Callable

from jblast.observations import Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.check.phrases import kilograms, place, reading, seconds
from jblast.report.numbers import significant
from jblast.report.words import joined, quantity_words


def _unit(doubt: Doubt, log: Observations) -> str:
    name = doubt.names[1]
    return f"{reading(doubt, log)} {_as_if(name)}, by what the other rows agree on"


def _units(doubt: Doubt, log: Observations) -> str:
    quantity, name = doubt.names
    return (
        f"every {quantity_words(quantity)} ({len(doubt.rows)} rows) {_as_if(name)}: "
        "then all rows would agree"
    )


def _as_if(name: str) -> str:
    if "written" in name:
        return f"looks like {name}"
    return f"looks {name} what it should be"


def _zone(doubt: Doubt, _: Observations) -> str:
    late = doubt.numbers["late_s"]
    way = "fast" if late > 0 else "slow"
    return (
        f"the clock of {doubt.names[0]} looks {seconds(abs(late))} {way}: is it that "
        "of another zone, or of summer time?"
    )


def _moved(asked: str) -> Callable[[Doubt, Observations], str]:
    """Say where a sensor reads as if it stood, and ask what that may come from."""

    def sentence(doubt: Doubt, log: Observations) -> str:
        sensor = doubt.names[0]
        return f"{sensor} reads as if it stood at {place(doubt, log)}: {asked}?"

    return sentence


def _late(doubt: Doubt, log: Observations) -> str:
    late = doubt.numbers["late_s"]
    way = "late" if late > 0 else "early"
    return (
        f"{reading(doubt, log)} is {seconds(abs(late))} too {way} for the blast of "
        f"{kilograms(doubt.numbers['mass_kg'])} that the other rows agree on"
    )


def _factor(doubt: Doubt, log: Observations) -> str:
    ratio = doubt.numbers["ratio"]
    size = (
        f"{significant(ratio)} times" if ratio > 1 else f"1/{significant(1 / ratio)} of"
    )
    return (
        f"{reading(doubt, log)} is {size} what the blast of "
        f"{kilograms(doubt.numbers['mass_kg'])} gives that the other rows agree on"
    )


def _divided(doubt: Doubt, log: Observations) -> str:
    sensors = joined(list(dict.fromkeys(log.sensor[row] for row in doubt.rows))[:5])
    return (
        f"no blast explains more than {doubt.numbers['agree']:.0f} of "
        f"{doubt.numbers['rows']:.0f} rows; not those of {sensors}"
    )


def _elsewhere(doubt: Doubt, log: Observations) -> str:
    return (
        "the log is not of a charge at the origin at time 0, but agrees with one near "
        f"{place(doubt, log)}: a scene, or freeing place and time, has to say so"
    )


def _another_time(doubt: Doubt, _: Observations) -> str:
    return (
        "the log is not of a charge at time 0, but agrees with one at another time: a "
        "scene, or freeing the time, has to say so"
    )


SENTENCES: dict[str, Callable[[Doubt, Observations], str]] = {
    "unit_slip": _unit,
    "units_of_a_quantity": _units,
    "clock_of_another_zone": _zone,
    "east_north_swapped": _moved("are east and north swapped"),
    "place_in_feet": _moved("is it in feet"),
    "place_in_km": _moved("is it in km"),
    "sign_of_east": _moved("is a sign wrong"),
    "sign_of_north": _moved("is a sign wrong"),
    "off_in_time": _late,
    "off_by_factor": _factor,
    "of_no_one_blast": _divided,
    "not_at_the_origin": _elsewhere,
    "not_at_time_0": _another_time,
}
