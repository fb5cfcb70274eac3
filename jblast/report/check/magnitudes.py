"""Doubts about magnitudes and speeds in words."""

from collections.abc import Callable

from jblast.observations import Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.check.phrases import kilograms, metres, reading, seconds, value_of
from jblast.report.numbers import significant


def _no_mass(doubt: Doubt, log: Observations) -> str:
    largest = value_of(doubt, "largest")
    if "distance_m" not in doubt.numbers:
        return f"{reading(doubt, log)}: no charge gives that; laws end at {largest}"
    return (
        f"{reading(doubt, log)} at {metres(doubt.numbers['distance_m'])}: no charge "
        f"gives that; laws end at {largest} there"
    )


def _no_blast(doubt: Doubt, log: Observations) -> str:
    mass = kilograms(doubt.numbers["mass_kg"])
    return (
        f"{reading(doubt, log)} at {metres(doubt.numbers['distance_m'])} is that of "
        f"{mass}: no blast is such"
    )


def _in_fireball(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{reading(doubt, log)} at {metres(numbers['distance_m'])} is that of "
        f"{kilograms(numbers['mass_kg'])}, whose fireball has a radius of "
        f"{metres(numbers['fireball_m'])}: is the unit right?"
    )


def _rises(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{reading(doubt, log)} at {metres(numbers['distance_m'])} is larger than "
        f"{value_of(doubt, 'nearer')} at {metres(numbers['nearer_m'])}: peaks fall "
        "with distance; a factor of 2 to 8 suggests a reflected reading"
    )


def _shrinks(doubt: Doubt, log: Observations) -> str:
    before = metres(doubt.numbers["before"])
    return f"{reading(doubt, log)} comes after one of {before}: shocks do not turn back"


def _slow_between(doubt: Doubt, log: Observations) -> str:
    numbers, other = doubt.numbers, log.sensor[doubt.rows[1]]
    late, apart = numbers["late_s"], numbers["apart_m"]
    speed = significant(apart / late) if apart else "0"
    return (
        f"{log.sensor[doubt.rows[0]]} and {other} are {metres(apart)} apart and heard "
        f"it {seconds(late)} apart, {speed} m/s; no wave in air is slower than "
        f"{numbers['slowest_m_s']:.0f} m/s: a clock, a place or a unit is wrong"
    )


def _slow(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    speed = significant(numbers["distance_m"] / numbers["took_s"])
    return (
        f"{reading(doubt, log)}: {metres(numbers['distance_m'])} in "
        f"{seconds(numbers['took_s'])} is {speed} m/s; no wave in air is slower than "
        f"{numbers['slowest_m_s']:.0f} m/s"
    )


def _fast(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{reading(doubt, log)}: {metres(numbers['distance_m'])} in "
        f"{seconds(numbers['took_s'])}; the strongest shock there is runs at "
        f"{significant(numbers['fastest_m_s'])} m/s"
    )


SENTENCES: dict[str, Callable[[Doubt, Observations], str]] = {
    "no_mass_gives_it": _no_mass,
    "mass_of_no_blast": _no_blast,
    "in_the_fireball": _in_fireball,
    "peak_rises": _rises,
    "radius_shrinks": _shrinks,
    "too_slow_between": _slow_between,
    "too_slow": _slow,
    "too_fast": _fast,
}
