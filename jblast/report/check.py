"""The answer of `jblast check`: faults of a log, and values that no law explains."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.scenes import for_log
from jblast.observations.table import row_word
from jblast.report.messages import listed, sentence
from jblast.report.numbers import joined, printed_number, quantity_words
from jblast.report.output import Answer
from jblast.report.view import Facts, Lines, View
from jblast.results import Document, Note
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

MAX_WARNINGS = 40
"""Largest number of printed warnings, about one screen; the JSON has all of them."""
REFUSED = 2
"""Exit code for a log that a fit would reject."""


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


def check_answer(
    observations: Observations,
    faults: Sequence[InputError],
    doubts: Sequence[Note],
    understood: Sequence[str] = (),
    readings: Observations | None = None,
) -> Answer:
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
    # faults come check by check, but a file is corrected line by line
    faults = sorted(faults, key=lambda fault: fault.line or 0)
    document = CheckAnswer(
        source=log.source,
        rows=len(log),
        sensors=len(set(log.sensor)),
        quantities=dict(Counter(log.quantity)),
        shots=tuple(dict.fromkeys(shot for shot in log.shot if shot)),
        clocks=tuple(dict.fromkeys(clock for clock in log.clock if clock)),
        places=_places(log),
        lower_bounds=int(log.bounds().sum()),
        understood=tuple(understood),
        faults=tuple(map(str, faults)),
        warnings=tuple(
            Warned(
                kind=note.kind,
                lines=tuple(map(doubted.line_of, note["rows"])),
                sensors=tuple(dict.fromkeys(doubted.sensor[r] for r in note["rows"])),
                message=row_sentence(note, doubted),
            )
            for note in doubts
        ),
    )
    return Answer(document, _view(document, faults), code=REFUSED if faults else 0)


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


def _view(found: CheckAnswer, faults: Sequence[InputError]) -> View:
    word, bad, odd = row_word(found.source), len(faults), len(found.warnings)
    warnings = sentence("{n:warning}", n=odd)
    verdict = "The log can be fitted: no faults or warnings"
    if bad:
        verdict = sentence("A fit would reject this log: {n:fault}", n=bad)
    elif odd:
        verdict = f"The log can be fitted: no faults, {warnings}"
    words = {
        "position": "by position",
        "range": "by range",
        "neither": "without either",
    }
    located = [f"{n} {words[kind]}" for kind, n in found.places.items() if n]
    rows = sentence("{rows:row} of {sensors:sensor}", found)
    shots = sentence(", {n:shot}", n=len(found.shots)) if len(found.shots) > 1 else ""
    quantities = [f"{quantity_words(q)} {n}" for q, n in found.quantities.items()]
    bounds = sentence("{n:row}", n=found.lower_bounds) if found.lower_bounds else ""
    read = rows + shots if found.rows else "no row could be read"
    facts = [
        ("Quantities", ", ".join(quantities)),
        ("Sensors located", ", ".join(located)),
        ("Clocks", joined(found.clocks)),
        (
            "Lower bounds",
            bounds,
        ),
    ]
    return View(
        verdict,
        [
            Facts(facts if found.rows else []),
            Lines("Faults", _folded(faults, found.source)),
            Lines(
                f"Suspicious values, which do not prevent a fit: {warnings}",
                [f"{_lines(word, w.lines)}: {w.message}" for w in found.warnings],
                most=MAX_WARNINGS,
            ),
            Lines("Conversions", found.understood),
        ],
        subtitle=f"{found.source}: {read}",
    )


def _folded(faults: Sequence[InputError], source: str) -> list[str]:
    """Return each fault once, with its lines.

    The file's name is removed, as it is in the title. Of the rejected values only the
    first is printed.
    """
    word = row_word(source)
    lines: dict[str, list[int]] = {}
    rejected: dict[str, list[str]] = {}
    for fault in faults:
        message, got, text = str(fault).removeprefix(f"{source}: "), "", ""
        if fault.line is not None:
            message = message.removeprefix(f"{word} {fault.line}")
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
    if not numbers:
        return ""
    return f"{word}{'s' * (len(numbers) > 1)} {listed(map(str, numbers))}"


def setting_lines(log: Observations, uncertain: UncertainScene) -> list[str]:
    """Return sentences on geodetic datum, time zero and free parameters.

    Args:
        log: The log.
        uncertain: The scene of the check.
    """
    lines = []
    if log.frame is not None:
        middle = uncertain.place is None
        whose = "the centre of the sensors" if middle else "from the scene"
        at = place(0.0, 0.0, log)
        lines.append(sentence("degrees", alt_m=log.frame.alt_m, place=at, whose=whose))
    if log.epoch is not None:
        lines.append(sentence("time_zero", start=log.epoch.astimezone(UTC)))
    if not len(log) or len(set(log.shot)) > 1:
        return lines
    free = list(for_log(uncertain, log).beliefs)
    if uncertain.source == NO_SCENE and len(free) > 1:
        lines.append(sentence("freed", names=free))
    return lines


def row_sentence(note: Note, observations: Observations) -> str:
    """Return a warning about rows of a log as a sentence, without its lines."""
    log, rows = observations, note["rows"]
    sensors = tuple(dict.fromkeys(log.sensor[row] for row in rows))
    quantity = log.quantity[rows[0]]
    printed = ((log.quantity[row], float(log.value[row])) for row in rows[:2])
    values = [printed_number(*one, 4) for one in printed]
    facts: dict[str, Any] = {
        "n_rows": len(rows),
        "sensor": log.sensor[rows[0]],
        "other_sensor": log.sensor[rows[-1]],
        "sensors": sensors,
        "quantity": quantity_words(quantity),
        "value": values[0],
        "other_value": values[-1],
        "reading": reading(log, rows[0]),
    }
    if "largest" in note.numbers:
        facts["largest"] = printed_number(quantity, note["largest"], 3)
    if "east_m" in note.numbers:
        facts["place"] = place(note["east_m"], note["north_m"], log)
    return sentence(note.kind, note.numbers, **facts)


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
        from jblast.report.maps import degrees

        lat, lon, _ = log.frame.to_geodetic(np.array([east, north, 0.0])).tolist()
        return degrees(lat, lon)
    # coordinates of a map are millions of metres: printed in full
    written = (f"{x:.0f}" if abs(x) >= 1e3 else f"{x:.4g}" for x in (east, north))
    return "east {} m, north {} m".format(*written)
