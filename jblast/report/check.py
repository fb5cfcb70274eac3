"""The answer of `jblast check`: faults of a log, and values that no law explains."""

import re
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.check import Doubt
from jblast.observations.scenes import for_log
from jblast.observations.table import row_word
from jblast.report.words import (
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
    split_name,
)
from jblast.results import Document
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

MAX_NAMED = 8
"""Largest number of parameters listed in a sentence."""
WIDTH = 79
MAX_LINES = 5
"""Largest number of line numbers listed for one fault or warning."""
KNOWN = re.compile(r"; expected (?:one|some) of [\w, ]+$")
"""A list of all valid names, at the end of a message."""
MAX_WARNINGS = 40
"""Largest number of printed warnings, about one screen; the JSON has all of them."""
REFUSED = 2
"""Exit code for a log that a fit would reject."""


def setting_lines(log: Observations, uncertain: UncertainScene) -> list[str]:
    """Return sentences on geodetic datum, time zero and free parameters.

    Args:
        log: The log.
        uncertain: The scene of the check.
    """
    lines = []
    if log.frame is not None:
        # imported here: it loads all of a report, which most checks do not need
        from jblast.report.fit.place import degrees

        frame = log.frame
        middle = uncertain.place is None
        whose = "the centre of the sensors" if middle else "from the scene"
        lines.append(
            "positions are degrees of WGS84; the origin of east, north and up is "
            f"{degrees(frame.lat_deg, frame.lon_deg)}, {frame.alt_m:.6g} m, {whose}"
        )
    if log.epoch is not None:
        start = log.epoch.astimezone(UTC)
        lines.append(f"time zero is {start:%Y-%m-%d %H:%M:%S} UTC")
    if not len(log) or len(set(log.shot)) > 1:
        return lines
    free = [parameter_words(name) for name in for_log(uncertain, log).beliefs]
    if uncertain.source == NO_SCENE and len(free) > 1:
        more = [f"{len(free) - MAX_NAMED} more"] if len(free) > MAX_NAMED else []
        names = joined(free[:MAX_NAMED] + more)
        lines.append(f"free parameters of a fit without a scene: {names}")
    return lines


@dataclass(frozen=True)
class Warned:
    """A suspicious value that does not prevent a fit.

    Attributes:
        kind: Kind of the warning, for programs.
        lines: Lines of the file, the most suspicious first; rows from 1 if the log is
            not a text file.
        sensors: Sensors of these rows.
        message: The warning as a sentence.
    """

    kind: str
    lines: tuple[int, ...]
    sensors: tuple[str, ...]
    message: str


@dataclass(frozen=True)
class CheckAnswer(Document):
    """Contents, faults and warnings of a log before it is fitted.

    Attributes:
        source: The file.
        rows: Number of rows that could be read.
        sensors: Number of sensors.
        quantities: Number of rows by quantity.
        shots: Names of the shots; none if the log has only one.
        clocks: Names of the clocks; none if all rows are on the common clock.
        places: Number of sensors with a position, with a range, and with neither.
        lower_bounds: Number of rows that are lower bounds.
        understood: Conversions, omissions and defaults, as sentences.
        faults: All reasons why a fit would reject the log, as messages.
        warnings: Suspicious values that do not prevent a fit.
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
        """0, or 2 if a fit would reject the log."""
        return REFUSED if self.faults else 0


def check_text(answer: CheckAnswer, found: Sequence[InputError]) -> str:
    """Return the verdict, faults, warnings and conversions, for the terminal.

    Args:
        answer: The answer.
        found: Its faults, with their lines.
    """
    word = row_word(answer.source)
    faults, warnings = (
        _number(len(found), word)
        for found, word in ((answer.faults, "fault"), (answer.warnings, "warning"))
    )
    odd = [f"{_lines(word, w.lines)}: {w.message}" for w in answer.warnings]
    if len(odd) > MAX_WARNINGS:
        odd[MAX_WARNINGS:] = [f"and {len(odd) - MAX_WARNINGS:,} more"]
    if answer.faults:
        verdict = f"A fit would reject this log: {faults}"
    elif answer.warnings:
        verdict = f"The log can be fitted: no faults, {warnings}"
    else:
        verdict = "The log can be fitted: no faults or warnings"
    parts = [f"{verdict}\n{_head(answer)}"]
    for title, lines in (
        ("Faults", _folded(found, answer.source)),
        (f"Suspicious values, which do not prevent a fit: {warnings}", odd),
        ("Conversions", answer.understood),
    ):
        if lines:
            parts.append("\n".join([title, *map(_item, lines)]))
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
            ("neither", "without either"),
        )
        if (count := answer.places[key])
    ]
    sentences.append(f"Sensors located: {', '.join(where)}")
    if answer.clocks:
        sentences.append(f"Clocks: {joined(answer.clocks)}")
    if answer.lower_bounds:
        sentences.append(f"Lower bounds: {_number(answer.lower_bounds, 'row')}")
    return "\n".join(
        textwrap.fill(line, WIDTH, subsequent_indent="  ") for line in sentences
    )


def _item(line: str) -> str:
    return textwrap.fill(
        # names of files and options have hyphens; broken they cannot be copied
        line, WIDTH, initial_indent="  ", subsequent_indent="    ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _folded(faults: Sequence[InputError], source: str) -> list[str]:
    """Return each fault once, with its lines, and each list of valid names once.

    The file's name is removed, as it is in the title. Of the rejected values only the
    first is printed.
    """
    word = row_word(source)
    lines: dict[str, list[int]] = {}
    rejected: dict[str, list[str]] = {}
    lists: set[str] = set()
    for fault in sorted(faults, key=_line):
        message, got, text = str(fault).removeprefix(f"{source}: "), "", ""
        if fault.line is not None:
            message = message.removeprefix(f"{word} {fault.line}")
        known = KNOWN.search(message)
        # a list of valid names takes a line or two; printed again it adds nothing
        if known and known.group() in lists and message not in lines:
            message = message.removesuffix(known.group())
        elif known:
            lists.add(known.group())
        if fault.line is not None:
            message, got, text = message.partition("; got ")
        lines.setdefault(message, []).extend([fault.line] if fault.line else [])
        rejected.setdefault(message, []).extend([got + text] if got else [])
    return [
        # rejected values differ from row to row: the first is an example
        _lines(word, numbers)
        + message
        + "".join(rejected[message][:1])
        + (" and others" if len(set(rejected[message])) > 1 else "")
        for message, numbers in lines.items()
    ]


def _lines(word: str, numbers: Sequence[int]) -> str:
    """Return the line numbers of a fault or warning, for a sentence."""
    if len(numbers) < 2:
        return "".join(f"{word} {number}" for number in numbers)
    listed = [str(number) for number in numbers[:MAX_LINES]]
    if len(numbers) > MAX_LINES:
        listed.append(f"{len(numbers) - MAX_LINES} more")
    return f"{word}s {joined(listed)}"


def _number(count: int, word: str) -> str:
    return f"{count:,} {word}{'' if count == 1 else 's'}"


def check_answer(
    observations: Observations,
    faults: Sequence[InputError],
    doubts: Sequence[Doubt],
    understood: Sequence[str] = (),
    readings: Observations | None = None,
) -> CheckAnswer:
    """Return the answer of a check.

    Args:
        observations: The rows that could be read.
        faults: Reasons why a fit would reject the log.
        doubts: Warnings from `inference.sanity.doubts`.
        understood: Conversions of the file, as sentences.
        readings: The rows of the warnings, if records of samples were picked.
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
        # faults come check by check, but a file is corrected line by line
        faults=tuple(map(str, sorted(faults, key=_line))),
        warnings=tuple(
            Warned(
                kind=doubt.kind,
                lines=tuple(map(doubted.line_of, doubt.rows)),
                sensors=tuple(dict.fromkeys(doubted.sensor[row] for row in doubt.rows)),
                message=sentence(doubt, doubted),
            )
            for doubt in doubts
        ),
    )


def _line(fault: InputError) -> int:
    """Return the line of a fault; 0, which sorts first, without one."""
    return fault.line or 0


def _places(log: Observations) -> dict[str, int]:
    """Return the number of sensors with a position, with a range, and with neither."""
    known: dict[str, str] = {}
    positioned = np.asarray(~np.isnan(log.position).any(axis=1))
    ranged = ~np.isnan(log.slant_range)
    for row, sensor in enumerate(log.sensor):
        kind = "position" if positioned[row] else "range" if ranged[row] else ""
        # a sensor may have rows without a position: the first row with one counts
        known[sensor] = known.get(sensor, "") or kind
    counts = Counter(known.values())
    return {kind or "neither": counts[kind] for kind in ("position", "range", "")}


SENTENCES = {
    "sensor_copied": "{names[1]} and {names[0]} have the same position and the same "
    "values to the last digit: is it one sensor with two names?",
    "two_sensors_at_one_place": "{sensor} and {other_sensor} have the same position, "
    "but {quantity} {value} and {other_value}",
    "sensor_at_two_places": "{sensor} is {apart_m} from its position in an earlier row",
    "since_1970": "{sensor}: {quantity} looks like {names[0]} since 1970, here "
    "{names[1]}; without a date the value is read as seconds after an unknown time "
    "zero; write dates in the column value_utc, like this one",
    "shot_unheard": "{shot} has a flash but no reading of the blast: light "
    "constrains no mass",
    "clock_of_one_row": "clock {names[0]} has only this reading: with a free clock "
    "offset the reading constrains nothing else",
    "arrival_before_flash": "{reading} is {early_s} before the flash on the same clock",
    "sigma_too_fine": "{reading} has a sigma of {share} of its value, smaller than "
    "that of any gauge: sigma is in the unit of the value",
    "sigma_large": "{reading} has a sigma of {share} times its value: sigma is in the "
    "unit of the value",
    "lat_lon_swapped": "{sensor} is {apart_m} from the other sensors, at latitude "
    "{lat_deg:.6g}, longitude {lon_deg:.6g}; with the two swapped it would be among "
    "them",
    "no_mass_gives_it": "{reading}{at}: larger than any law gives{there}, {largest} at "
    "most",
    "mass_of_no_blast": "{reading}{at} corresponds to {mass_kg}, which is impossible",
    "in_the_fireball": "{reading}{at} corresponds to {mass_kg}, with a fireball radius "
    "of {fireball_m}: is the unit right?",
    "peak_rises": "{reading}{at} is larger than {other_value} at {nearer_m}: peaks "
    "decrease with distance; a factor of 2 to 8 suggests a reflected pressure",
    "radius_shrinks": "{reading} follows one of {other_value}: shock radii never "
    "decrease",
    "too_slow_between": "{sensor} and {other_sensor} are {apart_m} apart, and their "
    "arrivals {late_s}: {mean_m_s} m/s; no wave in air is slower than "
    "{slowest_m_s:.0f} m/s: a clock, a position or a unit is wrong",
    "slow_together": "the {n_rows} air arrivals together imply a speed of "
    "{speed_m_s:.0f} m/s from one position, slower than sound ({slowest_m_s:.0f} m/s "
    "or more): positions, a unit, or temperature and wind of the scene are wrong",
    "too_slow": "{reading}: {apart_m} in {late_s} is {mean_m_s} m/s; no wave in air is "
    "slower than {slowest_m_s:.0f} m/s",
    "too_fast": "{reading}: {apart_m} in {late_s}; no blast wave is faster than "
    "{fastest_m_s} m/s",
    "unit_slip": "{reading} {looks}, compared with the other rows",
    "units_of_a_quantity": "every {quantity} ({n_rows} rows) {looks}: with that "
    "corrected all rows agree",
    "clock_of_another_zone": "the clock of {sensor} looks {fast}: is it in another "
    "time zone, or in summer time?",
    "east_north_swapped": "{sensor} agrees with the position {place}: are east and "
    "north swapped?",
    "place_in_feet": "{sensor} agrees with the position {place}: is it in feet?",
    "place_in_km": "{sensor} agrees with the position {place}: is it in km?",
    "sign_of_east": "{sensor} agrees with the position {place}: is a sign wrong?",
    "sign_of_north": "{sensor} agrees with the position {place}: is a sign wrong?",
    "off_in_time": "{reading} is {too_late} for {mass_kg}, on which the other rows "
    "agree",
    "off_by_factor": "{reading} is {times} the prediction for {mass_kg}, on which the "
    "other rows agree",
    "of_no_one_blast": "one blast explains at most {agree:.0f} of {rows:.0f} rows, and "
    "not those of {sensors}",
    "not_at_the_origin": "the log does not agree with a charge at the origin at time "
    "0, but with one near {place}: set or free position and time in a scene, or use "
    "--free",
    "not_at_time_0": "the log does not agree with a charge at time 0, but with one at "
    "another time: set or free the origin time in a scene, or use --free origin_time_s",
}
"""Template of a warning, by its kind."""


def sentence(doubt: Doubt, observations: Observations) -> str:
    """Return a warning as a sentence, without its lines."""
    log, numbers, rows = observations, doubt.numbers, doubt.rows
    sensors = [log.sensor[row] for row in rows]
    quantity = log.quantity[rows[0]]
    values = [printed_number(log.quantity[row], log.value[row], 4) for row in rows[:2]]
    facts: dict[str, Any] = {
        "names": doubt.names,
        "n_rows": len(rows),
        "sensor": sensors[0],
        "sensors": joined(list(dict.fromkeys(sensors))[:5]),
        "other_sensor": sensors[-1],
        "shot": f"shot {log.shot[rows[0]]}" if log.shot[rows[0]] else "the shot",
        "quantity": quantity_words(quantity),
        "value": values[0],
        "other_value": values[-1],
        "reading": reading(log, rows[0]),
        "at": "",
        "there": "",
    }
    for key, number in numbers.items():
        # speeds keep their number: their templates round them to whole m/s
        suffix = split_name(key)[1]
        show = PRINTED.get(key) or PRINTED.get(suffix) or (lambda value: value)
        facts[key] = show(number)
    if "distance_m" in numbers:
        facts |= {"at": f" at {facts['distance_m']}", "there": " there"}
    if "largest" in numbers:
        facts["largest"] = printed_number(quantity, numbers["largest"], 3)
    if "late_s" in numbers:
        late, size = numbers["late_s"] > 0, seconds(abs(numbers["late_s"]))
        facts["too_late"] = f"{size} too {'late' if late else 'early'}"
        facts["fast"] = f"{size} {'fast' if late else 'slow'}"
    if "ratio" in numbers:
        ratio = numbers["ratio"]
        times, part = significant(ratio), significant(1 / ratio)
        facts["times"] = f"{times} times" if ratio > 1 else f"1/{part} of"
    if "factor" in numbers:
        unit = doubt.names[-1]
        facts["looks"] = f"looks {unit} the true value"
        if "written" in unit:
            facts["looks"] = f"looks like {unit}"
    if "east_m" in numbers:
        facts["place"] = place(numbers["east_m"], numbers["north_m"], log)
    return SENTENCES[doubt.kind].format_map(facts)


def seconds(number: float) -> str:
    """Return a time with its unit, from one hour on in hours."""
    if abs(number) >= 3600:
        return f"{number / 3600:.4g} h"
    return printed_number("_s", number, 3)


def metres(number: float) -> str:
    """Return a length with its unit."""
    return printed_number("_m", number, 3)


def kilograms(number: float) -> str:
    """Return a mass with its unit."""
    # two digits: the scatter of the laws leaves no more to a mass from one reading
    return printed_number("_kg", number, 2)


PRINTED: dict[str, Callable[[float], str]] = {
    "_s": seconds,
    "_m": metres,
    "_kg": kilograms,
    "share": significant,
    "mean_m_s": significant,
    "fastest_m_s": significant,
}
"""Functions that print the numbers of a warning, by name or by suffix."""


def reading(log: Observations, row: int) -> str:
    """Return sensor, quantity and value of a row."""
    quantity = log.quantity[row]
    if log.epoch is not None and quantity in CLOCK_TIMES:
        when = utc(log.epoch, float(log.value[row]))
        return f"{log.sensor[row]}: {quantity_words(quantity)} at {when}"
    value = printed_number(quantity, log.value[row], 4)
    return f"{log.sensor[row]}: {quantity_words(quantity)} of {value}"


def utc(epoch: datetime, seconds_since: float) -> str:
    """Return a clock time in UTC, to the millisecond."""
    when = (epoch + timedelta(seconds=seconds_since)).astimezone(UTC)
    return f"{when:%H:%M:%S}.{when.microsecond // 1000:03d} UTC"


def place(east: float, north: float, log: Observations) -> str:
    """Return a position, in degrees if the log is in degrees."""
    if log.frame is not None:
        from jblast.report.fit.place import degrees

        lat, lon, _ = log.frame.to_geodetic(np.array([east, north, 0.0])).tolist()
        return degrees(lat, lon)
    return f"east {east:.4g} m, north {north:.4g} m"
