"""Doubts about a log in words: what was read, why it is odd, what it may be."""

from collections.abc import Callable

from jblast.observations import Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.numbers import printed_number, significant
from jblast.report.words import joined, quantity_words


def sentence(doubt: Doubt, observations: Observations) -> str:
    """Return a doubt as a sentence, without the place in the file."""
    return SENTENCES[doubt.kind](doubt, observations)


def _seconds(number: float) -> str:
    if abs(number) >= 3600:
        return f"{number / 3600:.4g} h"
    return printed_number("_s", number, 3)


def _metres(number: float) -> str:
    return printed_number("_m", number, 3)


def _mass(number: float) -> str:
    return printed_number("_kg", number, 2)


def _value(doubt: Doubt, key: str = "value") -> str:
    return printed_number(doubt.names[0], doubt.numbers[key], 3)


def _what(doubt: Doubt, log: Observations) -> str:
    """Name what a doubt is about: sensor, quantity and value of its first row."""
    row = doubt.rows[0]
    quantity = log.quantity[row]
    value = printed_number(quantity, log.value[row], 4)
    return f"{log.sensor[row]}: {quantity_words(quantity)} of {value}"


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
    apart = _metres(doubt.numbers["apart_m"])
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
    early = _seconds(doubt.numbers["early_s"])
    return f"{_what(doubt, log)} is {early} before the flash by the same clock"


def _fine(doubt: Doubt, log: Observations) -> str:
    return (
        f"{_what(doubt, log)} has a sigma of {significant(doubt.numbers['share'])} of "
        "it, finer than any gauge: a log's sigma is in the unit of its value"
    )


def _large(doubt: Doubt, log: Observations) -> str:
    return (
        f"{_what(doubt, log)} has a sigma of {significant(doubt.numbers['share'])} "
        "times itself: a log's sigma is in the unit of its value"
    )


def _no_mass(doubt: Doubt, log: Observations) -> str:
    largest = _value(doubt, "largest")
    return (
        f"{_what(doubt, log)} at {_metres(doubt.numbers['distance_m'])}: no charge "
        f"gives that; laws end at {largest} there"
    )


def _no_blast(doubt: Doubt, log: Observations) -> str:
    mass = _mass(doubt.numbers["mass_kg"])
    return (
        f"{_what(doubt, log)} at {_metres(doubt.numbers['distance_m'])} is that of "
        f"{mass}: no blast is such"
    )


def _in_fireball(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{_what(doubt, log)} at {_metres(numbers['distance_m'])} is that of "
        f"{_mass(numbers['mass_kg'])}, whose fireball has a radius of "
        f"{_metres(numbers['fireball_m'])}: is the unit right?"
    )


def _rises(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{_what(doubt, log)} at {_metres(numbers['distance_m'])} is larger than the "
        f"{_value(doubt, 'nearer')} at {_metres(numbers['nearer_m'])}: peaks fall with "
        "distance"
    )


def _shrinks(doubt: Doubt, log: Observations) -> str:
    before = _metres(doubt.numbers["before"])
    return f"{_what(doubt, log)} comes after one of {before}: shocks do not turn back"


def _slow_between(doubt: Doubt, log: Observations) -> str:
    numbers, other = doubt.numbers, log.sensor[doubt.rows[1]]
    late, apart = numbers["late_s"], numbers["apart_m"]
    speed = significant(apart / late) if apart else "0"
    return (
        f"{log.sensor[doubt.rows[0]]} and {other} are {_metres(apart)} apart and heard "
        f"it {_seconds(late)} apart, {speed} m/s; no wave in air is slower than "
        f"{numbers['slowest_m_s']:.0f} m/s: a clock, a place or a unit is wrong"
    )


def _slow(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    speed = significant(numbers["distance_m"] / numbers["took_s"])
    return (
        f"{_what(doubt, log)}: {_metres(numbers['distance_m'])} in "
        f"{_seconds(numbers['took_s'])} is {speed} m/s; no wave in air is slower than "
        f"{numbers['slowest_m_s']:.0f} m/s"
    )


def _fast(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{_what(doubt, log)}: {_metres(numbers['distance_m'])} in "
        f"{_seconds(numbers['took_s'])}; the strongest shock there is runs at "
        f"{significant(numbers['fastest_m_s'])} m/s"
    )


def _unit(doubt: Doubt, log: Observations) -> str:
    name = doubt.names[1]
    return f"{_what(doubt, log)} {_as_if(name)}, by what the other rows agree on"


def _units(doubt: Doubt, log: Observations) -> str:
    quantity, name = doubt.names
    return (
        f"every {quantity_words(quantity)} ({len(doubt.rows)} rows) {_as_if(name)}: "
        "then all rows would agree"
    )


def _as_if(name: str) -> str:
    if name.endswith(":"):
        return f"looks written {name.rstrip(':')}"
    return f"looks {name} what it should be"


def _zone(doubt: Doubt, _: Observations) -> str:
    late = doubt.numbers["late_s"]
    way = "fast" if late > 0 else "slow"
    return (
        f"the clock of {doubt.names[0]} looks {_seconds(abs(late))} {way}: is it that "
        "of another zone, or of summer time?"
    )


def _swapped(doubt: Doubt, _: Observations) -> str:
    return (
        f"{doubt.names[0]} reads as if it stood at {_place(doubt)}: are east and north "
        "swapped?"
    )


def _in_feet(doubt: Doubt, _: Observations) -> str:
    return f"{doubt.names[0]} reads as if it stood at {_place(doubt)}: is it in feet?"


def _in_km(doubt: Doubt, _: Observations) -> str:
    return f"{doubt.names[0]} reads as if it stood at {_place(doubt)}: is it in km?"


def _sign(doubt: Doubt, _: Observations) -> str:
    return f"{doubt.names[0]} reads as if it stood at {_place(doubt)}: is a sign wrong?"


def _degrees(doubt: Doubt, _: Observations) -> str:
    lat, lon = doubt.numbers["lat_deg"], doubt.numbers["lon_deg"]
    return (
        f"{doubt.names[0]} stands {_metres(doubt.numbers['apart_m'])} from the others "
        f"at latitude {lat:.6g}, longitude {lon:.6g}; swapped it would be among them"
    )


def _place(doubt: Doubt) -> str:
    east, north = doubt.numbers["east_m"], doubt.numbers["north_m"]
    return f"east {east:.4g} m, north {north:.4g} m"


def _late(doubt: Doubt, log: Observations) -> str:
    late = doubt.numbers["late_s"]
    way = "late" if late > 0 else "early"
    return (
        f"{_what(doubt, log)} is {_seconds(abs(late))} too {way} for the blast of "
        f"{_mass(doubt.numbers['mass_kg'])} that the other rows agree on"
    )


def _factor(doubt: Doubt, log: Observations) -> str:
    ratio = doubt.numbers["ratio"]
    size = (
        f"{significant(ratio)} times" if ratio > 1 else f"1/{significant(1 / ratio)} of"
    )
    return (
        f"{_what(doubt, log)} is {size} what the blast of "
        f"{_mass(doubt.numbers['mass_kg'])} gives that the other rows agree on"
    )


def _divided(doubt: Doubt, log: Observations) -> str:
    sensors = joined(list(dict.fromkeys(log.sensor[row] for row in doubt.rows))[:5])
    return (
        f"no blast explains more than {doubt.numbers['agree']:.0f} of "
        f"{doubt.numbers['rows']:.0f} rows; not those of {sensors}"
    )


def _elsewhere(doubt: Doubt, _: Observations) -> str:
    return (
        "the log is not of a charge at the origin at time 0, but agrees with one near "
        f"{_place(doubt)}: a scene, or freeing place and time, has to say so"
    )


def _another_time(doubt: Doubt, _: Observations) -> str:
    return (
        "the log is not of a charge at time 0, but agrees with one at another time: a "
        "scene, or freeing the time, has to say so"
    )


SENTENCES: dict[str, Callable[[Doubt, Observations], str]] = {
    "sensor_copied": _copied,
    "two_sensors_at_one_place": _together,
    "sensor_at_two_places": _moved,
    "shot_unheard": _unheard,
    "clock_of_one_row": _lonely,
    "arrival_before_flash": _before_flash,
    "sigma_too_fine": _fine,
    "sigma_large": _large,
    "no_mass_gives_it": _no_mass,
    "mass_of_no_blast": _no_blast,
    "in_the_fireball": _in_fireball,
    "peak_rises": _rises,
    "radius_shrinks": _shrinks,
    "too_slow_between": _slow_between,
    "too_slow": _slow,
    "too_fast": _fast,
    "unit_slip": _unit,
    "units_of_a_quantity": _units,
    "clock_of_another_zone": _zone,
    "east_north_swapped": _swapped,
    "lat_lon_swapped": _degrees,
    "place_in_feet": _in_feet,
    "place_in_km": _in_km,
    "sign_of_east": _sign,
    "sign_of_north": _sign,
    "off_in_time": _late,
    "off_by_factor": _factor,
    "of_no_one_blast": _divided,
    "not_at_the_origin": _elsewhere,
    "not_at_time_0": _another_time,
}
"""By kind of doubt, what is said of it."""
