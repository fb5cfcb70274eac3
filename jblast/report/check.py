"""The answer of `jblast check`: mistakes in a log, and magnitudes no law explains."""

import re
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from jblast.errors import InputError
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.check import Doubt
from jblast.observations.scenes import for_log
from jblast.report.words import (
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
)
from jblast.results import Document
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

MAX_NAMED = 8
"""Largest number of rows that are named one by one."""
WIDTH = 79
MOST_LINES = 5
"""Lines that are named of one warning, or of one fault."""
KNOWN = re.compile(r"; expected (?:one|some) of [\w, ]+$")
"""A list of all that could have been meant, at the end of a message."""
MOST_WARNINGS = 40
"""Warnings that are printed one by one; a document has all of them."""
LINE = re.compile(r"line (\d+)([:,].*)", re.DOTALL)
"""How a message of one line of the file begins."""
REFUSED = 2
"""Exit code where a fit would refuse the log."""


def setting_lines(log: Observations, uncertain: UncertainScene) -> list[str]:
    """Return a sentence each on datum, clock and what is not known.

    Args:
        log: As it was read.
        uncertain: The scene it is checked beside.
    """
    lines = []
    if log.frame is not None:
        from jblast.report.fit.place import degrees  # with all of a report

        frame = log.frame
        middle = uncertain.place is None
        whose = "the middle of the sensors" if middle else "as the scene says"
        lines.append(
            "places are degrees of WGS84; east, north and up count from "
            f"{degrees(frame.lat_deg, frame.lon_deg)}, {frame.alt_m:.6g} m, {whose}"
        )
    if log.epoch is not None:
        start = log.epoch.astimezone(UTC)
        lines.append(f"times count from {start:%Y-%m-%d %H:%M:%S} UTC")
    if not len(log) or len(set(log.shot)) > 1:
        return lines
    free = [parameter_words(name) for name in for_log(uncertain, log).beliefs]
    if uncertain.source == NO_SCENE and len(free) > 1:
        more = [f"{len(free) - MAX_NAMED} more"] if len(free) > MAX_NAMED else []
        lines.append(
            f"without a scene a fit leaves free {joined(free[:MAX_NAMED] + more)}"
        )
    return lines


@dataclass(frozen=True)
class Warned:
    """Something odd that stops no fit.

    Attributes:
        kind: What is odd, in one word for programs.
        lines: Lines of the file, the one to look at first; rows from 1 where the log is
            no text.
        sensors: Whose rows these are.
        message: The same in a sentence.
    """

    kind: str
    lines: tuple[int, ...]
    sensors: tuple[str, ...]
    message: str


@dataclass(frozen=True)
class CheckAnswer(Document):
    """All that can be said of a log before it is fitted.

    Attributes:
        source: The file.
        rows: Rows that could be read.
        sensors: How many sensors they are of.
        quantities: How many rows each quantity has.
        shots: Names of the shots; none where the log has one alone.
        clocks: Names of the clocks; none where all rows are by the common one.
        places: How many sensors have a position, how many a range, how many neither.
        lower_bounds: Rows that are lower bounds.
        understood: What was converted, skipped or supplied, a sentence each.
        faults: Why a fit would refuse the log, a message each, all of them.
        warnings: What is odd and stops no fit.
    """

    source: str
    rows: int
    sensors: int
    quantities: Mapping[str, int]
    shots: tuple[str, ...]
    clocks: tuple[str, ...]
    places: Mapping[str, int]
    lower_bounds: int
    understood: tuple[str, ...]
    faults: tuple[str, ...]
    warnings: tuple[Warned, ...]

    @property
    def exit_code(self) -> int:
        """0, or 2 where a fit would refuse the log."""
        return REFUSED if self.faults else 0


def check_text(answer: CheckAnswer) -> str:
    """Return what was understood, what a fit refuses and what is odd."""
    parts = [_head(answer)]
    faults, warnings = (
        _number(len(found), word)
        for found, word in ((answer.faults, "fault"), (answer.warnings, "warning"))
    )
    odd = [f"{_lines([str(n) for n in w.lines])}: {w.message}" for w in answer.warnings]
    if len(odd) > MOST_WARNINGS:
        odd[MOST_WARNINGS:] = [f"and {len(odd) - MOST_WARNINGS:,} more"]
    for title, lines in (
        ("Understood", answer.understood),
        (f"A fit would refuse it: {faults}", _folded(answer.faults, answer.source)),
        (f"Worth a look, though no fit stops there: {warnings}", odd),
    ):
        if lines:
            parts.append("\n".join([title, *map(_item, lines)]))
    if not answer.faults:
        parts.append("Nothing stops a fit." if answer.warnings else "Nothing is wrong.")
    return "\n\n".join(parts) + "\n"


def _head(answer: CheckAnswer) -> str:
    if not answer.rows:
        return f"{answer.source}: no row could be read"
    sentences = [
        f"{answer.source}: {_number(answer.rows, 'row')} of "
        f"{_number(answer.sensors, 'sensor')}"
        + (f", {_number(len(answer.shots), 'shot')}" if len(answer.shots) > 1 else "")
    ]
    counted = [
        f"{quantity_words(quantity)} {count}"
        for quantity, count in answer.quantities.items()
    ]
    sentences.append(f"Quantities: {', '.join(counted)}")
    where = [
        f"{count} {words}"
        for key, words in (
            ("position", "by position"),
            ("range", "by range"),
            ("neither", "by neither"),
        )
        if (count := answer.places[key])
    ]
    sentences.append(f"Places of sensors: {', '.join(where)}")
    if answer.clocks:
        sentences.append(f"Clocks: {joined(answer.clocks)}")
    if answer.lower_bounds:
        sentences.append(f"Lower bounds: {_number(answer.lower_bounds, 'row')}")
    return "\n".join(
        textwrap.fill(line, WIDTH, subsequent_indent="  ") for line in sentences
    )


def _item(line: str) -> str:
    return textwrap.fill(
        line, WIDTH, initial_indent="  ", subsequent_indent="    ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _folded(faults: Sequence[str], source: str) -> list[str]:
    """Tell once what is said of many lines, and each list of all that is known.

    The name of the file stands above. Of a warning on many lines the first is printed.
    """
    lines: dict[str, list[str]] = {}
    came: dict[str, list[str]] = {}
    lists: set[str] = set()
    for fault in faults:
        numbered = LINE.fullmatch(fault.removeprefix(f"{source}: "))
        what = numbered.group(2) if numbered else fault.removeprefix(f"{source}: ")
        known = KNOWN.search(what)
        if known and known.group() in lists and what not in lines:
            what = what.removesuffix(known.group())
        elif known:
            lists.add(known.group())
        what, got, text = what.partition("; got ") if numbered else (what, "", "")
        lines.setdefault(what, []).extend([numbered.group(1)] if numbered else [])
        came.setdefault(what, []).extend([got + text] if got else [])
    return [
        _lines(numbers)
        + what
        + "".join(came[what][:1])
        + (" and others" if len(set(came[what])) > 1 else "")
        for what, numbers in lines.items()
    ]


def _lines(numbers: Sequence[str]) -> str:
    """Name the lines that something is said of."""
    if len(numbers) < 2:
        return "".join(f"line {number}" for number in numbers)
    kept = list(numbers[:MOST_LINES])
    if len(numbers) > MOST_LINES:
        kept.append(f"{len(numbers) - MOST_LINES} more")
    return f"lines {joined(kept)}"


def _number(count: int, word: str) -> str:
    return f"{count:,} {word}{'' if count == 1 else 's'}"


def check_answer(
    observations: Observations,
    faults: Sequence[InputError],
    doubts: Sequence[Doubt],
    understood: Sequence[str] = (),
    readings: Observations | None = None,
) -> CheckAnswer:
    """Put together what was found.

    Args:
        observations: The rows that could be read.
        faults: Why a fit would refuse the log.
        doubts: From `inference.sanity.doubts`.
        understood: What the reader made of the file, a sentence each.
        readings: The rows that doubts are of, where records of samples were picked.
    """
    log = observations
    doubted = log if readings is None else readings
    return CheckAnswer(
        source=log.source,
        rows=len(log),
        sensors=len(set(log.sensor)),
        quantities=dict(Counter(log.quantity)),
        shots=tuple(dict.fromkeys(shot for shot in log.shot if shot)),
        clocks=tuple(dict.fromkeys(clock for clock in log.clock if clock)),
        places=_places(log),
        lower_bounds=int(log.bounds().sum()),
        understood=tuple(understood),
        faults=tuple(sorted(map(str, faults), key=_line)),
        warnings=tuple(_warned(doubt, doubted) for doubt in doubts),
    )


def _line(fault: str) -> int:
    """Return the line that a message names; 0, before all, where it names none."""
    numbered = re.search(r": line (\d+)[:,]", fault)
    return int(numbered.group(1)) if numbered else 0


def _warned(doubt: Doubt, log: Observations) -> Warned:
    return Warned(
        kind=doubt.kind,
        lines=tuple(log.line[row] if log.line else row + 1 for row in doubt.rows),
        sensors=tuple(dict.fromkeys(log.sensor[row] for row in doubt.rows)),
        message=sentence(doubt, log),
    )


def _places(log: Observations) -> dict[str, int]:
    """Count sensors by how the log gives their positions."""
    known: dict[str, str] = {}
    positioned = np.asarray(~np.isnan(log.position).any(axis=1))
    ranged = ~np.isnan(log.slant_range)
    for row, sensor in enumerate(log.sensor):
        kind = "position" if positioned[row] else "range" if ranged[row] else ""
        known[sensor] = known.get(sensor, "") or kind
    counts = Counter(known.values())
    return {kind or "neither": counts[kind] for kind in ("position", "range", "")}


def _fast(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{reading(doubt, log)}: {metres(numbers['distance_m'])} in "
        f"{seconds(numbers['took_s'])}; the strongest shock there is runs at "
        f"{significant(numbers['fastest_m_s'])} m/s"
    )


def _in_fireball(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"{reading(doubt, log)} at {metres(numbers['distance_m'])} is that of "
        f"{kilograms(numbers['mass_kg'])}, whose fireball has a radius of "
        f"{metres(numbers['fireball_m'])}: is the unit right?"
    )


def _no_blast(doubt: Doubt, log: Observations) -> str:
    mass = kilograms(doubt.numbers["mass_kg"])
    return (
        f"{reading(doubt, log)} at {metres(doubt.numbers['distance_m'])} is that of "
        f"{mass}: no blast is such"
    )


def _no_mass(doubt: Doubt, log: Observations) -> str:
    largest = value_of(doubt, "largest")
    if "distance_m" not in doubt.numbers:
        return f"{reading(doubt, log)}: no charge gives that; laws end at {largest}"
    return (
        f"{reading(doubt, log)} at {metres(doubt.numbers['distance_m'])}: no charge "
        f"gives that; laws end at {largest} there"
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


def _slow(doubt: Doubt, log: Observations) -> str:
    numbers = doubt.numbers
    speed = significant(numbers["distance_m"] / numbers["took_s"])
    return (
        f"{reading(doubt, log)}: {metres(numbers['distance_m'])} in "
        f"{seconds(numbers['took_s'])} is {speed} m/s; no wave in air is slower than "
        f"{numbers['slowest_m_s']:.0f} m/s"
    )


def _slow_between(doubt: Doubt, log: Observations) -> str:
    numbers, other = doubt.numbers, log.sensor[doubt.rows[1]]
    late, apart = numbers["late_s"], numbers["apart_m"]
    speed = significant(apart / late) if apart else "0"
    return (
        f"{log.sensor[doubt.rows[0]]} and {other} are {metres(apart)} apart and heard "
        f"it {seconds(late)} apart, {speed} m/s; no wave in air is slower than "
        f"{numbers['slowest_m_s']:.0f} m/s: a clock, a place or a unit is wrong"
    )


def _slow_together(doubt: Doubt, _: Observations) -> str:
    numbers = doubt.numbers
    return (
        f"the {len(doubt.rows)} air arrivals together imply a speed of "
        f"{numbers['speed_m_s']:.0f} m/s from one place, slower than sound "
        f"({numbers['slowest_m_s']:.0f} m/s or more): positions, a unit, or "
        "temperature and wind of the scene are wrong"
    )


OF_MAGNITUDES: dict[str, Callable[[Doubt, Observations], str]] = {
    "no_mass_gives_it": _no_mass,
    "mass_of_no_blast": _no_blast,
    "in_the_fireball": _in_fireball,
    "peak_rises": _rises,
    "radius_shrinks": _shrinks,
    "too_slow_between": _slow_between,
    "slow_together": _slow_together,
    "too_slow": _slow,
    "too_fast": _fast,
}


def _before_flash(doubt: Doubt, log: Observations) -> str:
    early = seconds(doubt.numbers["early_s"])
    return f"{reading(doubt, log)} is {early} before the flash by the same clock"


def _copied(doubt: Doubt, _: Observations) -> str:
    one, other = doubt.names
    return (
        f"{other} stands where {one} does and reads the same to the last digit: is it "
        "one sensor under two names?"
    )


def _degrees(doubt: Doubt, _: Observations) -> str:
    lat, lon = doubt.numbers["lat_deg"], doubt.numbers["lon_deg"]
    return (
        f"{doubt.names[0]} stands {metres(doubt.numbers['apart_m'])} from the others "
        f"at latitude {lat:.6g}, longitude {lon:.6g}; swapped it would be among them"
    )


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


def _lonely(doubt: Doubt, _: Observations) -> str:
    return (
        f"clock {doubt.names[0]} has this one reading: if its offset is free, the "
        "reading tells nothing else"
    )


def _since_1970(doubt: Doubt, log: Observations) -> str:
    unit, when = doubt.names
    many = len(doubt.rows)
    these = "this looks" if many == 1 else f"these {many} rows look"
    return (
        f"{log.sensor[doubt.rows[0]]}: {these} like {unit} since 1970, here {when}; "
        "taken for seconds of an unknown start, as nothing says so: dates belong in "
        "column value_utc, written like this one"
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


def _two_places(doubt: Doubt, _: Observations) -> str:
    apart = metres(doubt.numbers["apart_m"])
    return f"{doubt.names[0]} stands {apart} from where an earlier row puts it"


def _unheard(doubt: Doubt, _: Observations) -> str:
    shot = f"shot {doubt.names[0]}" if doubt.names[0] else "the shot"
    return f"{shot} was seen, but nobody heard it: light alone tells no mass"


OF_PLAIN_FAULTS: dict[str, Callable[[Doubt, Observations], str]] = {
    "sensor_copied": _copied,
    "two_sensors_at_one_place": _together,
    "sensor_at_two_places": _two_places,
    "since_1970": _since_1970,
    "shot_unheard": _unheard,
    "clock_of_one_row": _lonely,
    "arrival_before_flash": _before_flash,
    "sigma_too_fine": _fine,
    "sigma_large": _large,
    "lat_lon_swapped": _degrees,
}


def _another_time(doubt: Doubt, _: Observations) -> str:
    return (
        "the log is not of a charge at time 0, but agrees with one at another time: a "
        "scene, or freeing the time, has to say so"
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


def _factor(doubt: Doubt, log: Observations) -> str:
    ratio = doubt.numbers["ratio"]
    size = (
        f"{significant(ratio)} times" if ratio > 1 else f"1/{significant(1 / ratio)} of"
    )
    return (
        f"{reading(doubt, log)} is {size} what the blast of "
        f"{kilograms(doubt.numbers['mass_kg'])} gives that the other rows agree on"
    )


def _late(doubt: Doubt, log: Observations) -> str:
    late = doubt.numbers["late_s"]
    way = "late" if late > 0 else "early"
    return (
        f"{reading(doubt, log)} is {seconds(abs(late))} too {way} for the blast of "
        f"{kilograms(doubt.numbers['mass_kg'])} that the other rows agree on"
    )


def _reads_as_if(asked: str) -> Callable[[Doubt, Observations], str]:
    """Say where a sensor reads as if it stood, and ask what that may come from."""

    def sentence(doubt: Doubt, log: Observations) -> str:
        sensor = doubt.names[0]
        return f"{sensor} reads as if it stood at {place(doubt, log)}: {asked}?"

    return sentence


def _unit(doubt: Doubt, log: Observations) -> str:
    name = doubt.names[1]
    return f"{reading(doubt, log)} {_as_if(name)}, by what the other rows agree on"


def _units(doubt: Doubt, log: Observations) -> str:
    quantity, name = doubt.names
    return (
        f"every {quantity_words(quantity)} ({len(doubt.rows)} rows) {_as_if(name)}: "
        "then all rows would agree"
    )


def _zone(doubt: Doubt, _: Observations) -> str:
    late = doubt.numbers["late_s"]
    way = "fast" if late > 0 else "slow"
    return (
        f"the clock of {doubt.names[0]} looks {seconds(abs(late))} {way}: is it that "
        "of another zone, or of summer time?"
    )


OF_SLIPS: dict[str, Callable[[Doubt, Observations], str]] = {
    "unit_slip": _unit,
    "units_of_a_quantity": _units,
    "clock_of_another_zone": _zone,
    "east_north_swapped": _reads_as_if("are east and north swapped"),
    "place_in_feet": _reads_as_if("is it in feet"),
    "place_in_km": _reads_as_if("is it in km"),
    "sign_of_east": _reads_as_if("is a sign wrong"),
    "sign_of_north": _reads_as_if("is a sign wrong"),
    "off_in_time": _late,
    "off_by_factor": _factor,
    "of_no_one_blast": _divided,
    "not_at_the_origin": _elsewhere,
    "not_at_time_0": _another_time,
}
SENTENCES = OF_PLAIN_FAULTS | OF_MAGNITUDES | OF_SLIPS
"""By kind of doubt, the function that words it."""


def sentence(doubt: Doubt, observations: Observations) -> str:
    """Return a doubt as a sentence, without the place in the file."""
    return SENTENCES[doubt.kind](doubt, observations)


def _as_if(name: str) -> str:
    if "written" in name:
        return f"looks like {name}"
    return f"looks {name} what it should be"


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
        from jblast.report.fit.place import degrees  # with all of a report

        lat, lon, _ = log.frame.to_geodetic(np.array([east, north, 0.0])).tolist()
        return degrees(lat, lon)
    return f"east {east:.4g} m, north {north:.4g} m"
