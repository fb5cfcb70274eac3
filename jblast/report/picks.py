"""The answer of `jblast pick`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, timedelta

from jblast.report.messages import listed, sentence, sentences_of
from jblast.report.words import (
    aligned,
    quantity_words,
    rounded,
    unit_for,
)
from jblast.results import Document
from jblast.signals.picks import (
    NAMES,
    Gathered,
    LeftOut,
    PickedValue,
    PickLog,
    Quality,
    Reason,
    RecordPick,
    picked_value,
)

COLUMNS = {
    "air_arrival_s": "arrival",
    "peak_overpressure_pa": "peak",
    "positive_duration_s": "duration",
    "positive_impulse_pa_s": "impulse",
}
"""Quantities of the table, with the titles of their columns."""
RECORDS_ALT = "Records with their fitted pulses, and residuals."
RECORDS_CAPTION = (
    "Grey: samples, or their range if several fall on one point. Blue: fitted pulse. "
    "Red: its arrival and, dotted, the end of its positive phase. Orange: further "
    "fronts. Dashed: clipping level. Lower panels: samples minus pulse, averaged over "
    "each point. A recorder's high-pass is included if its corner was given; ringing "
    "and later fronts are not included."
)


def picks_text(found: Gathered, log: PickLog, left_out: tuple[str, ...] = ()) -> str:
    """Return the picks as a table with notes, for the terminal.

    Args:
        found: Picks.
        log: Rows of the picks.
        left_out: Files of a folder that are not records.
    """
    count, channels = len(found.picks), found.channels
    head = f"{count} {'pick' if count == 1 else 'picks'}" if count else "Nothing found"
    lines = [f"{head} in {channels} {'record' if channels == 1 else 'records'}"]
    if found.epoch is not None and count:
        lines.append(f"times count from {utc(found)}")
    if any("misfit" not in one.notes for one in found.picks):
        lines.append("±: one standard deviation")
    if count:
        lines += ["", *_table(found), ""]
    lines += _notes(found)
    lines += _of_log(log)
    if found.silent and count:
        lines.append(f"nothing found in {listed(found.silent)}")
    for name, quieter in found.quieter.items():
        lines.append(
            f"{name}: {quieter} quieter {'onset' if quieter == 1 else 'onsets'} ignored"
        )
    read_as = sentences_of(log.observations.understood)
    lines += [f"table of stations: {line}" for line in read_as]
    if left_out:
        lines.append(f"ignored, not a record: {listed(left_out)}")
    return "\n".join(lines).rstrip() + "\n"


def utc(found: Gathered) -> str:
    """Return the time of day of time zero of the picks."""
    assert found.epoch is not None
    whole = found.epoch.replace(microsecond=0)
    rest = (found.epoch - whole) / timedelta(seconds=1)
    return f"{whole:%Y-%m-%d %H:%M:%S}" + (f"{rest:.6f}"[1:] if rest else "") + " UTC"


def estimate_words(one: RecordPick, quantity: str) -> str:
    """Return a value and its standard deviation with its unit; "" if unknown.

    If the samples do not have the form of a blast pulse, the error is unknown.
    """
    found = picked_value(one, quantity)
    if found is None:
        return ""
    value, sd = found.value, found.sd
    # an arrival is a clock reading: always in seconds, whatever its size
    if quantity == "air_arrival_s":
        error = "" if "misfit" in one.notes else f" ± {rounded(sd, sd)}"
        return f"{rounded(value, sd)}{error} s"
    unit = unit_for(quantity, value)
    bound = "> " if quantity == "peak_overpressure_pa" and one.pick.lower_bound else ""
    size = unit.size
    error = "" if "misfit" in one.notes else f" ± {rounded(sd / size, sd / size)}"
    text = f"{bound}{rounded(value / size, sd / size)}{error} {unit.symbol}"
    return text.rstrip()


def _table(found: Gathered) -> list[str]:
    head = ("record", *COLUMNS.values(), "quality")
    rows = [
        (name, *(estimate_words(one, quantity) for quantity in COLUMNS), one.quality)
        for name, one in zip(found.named(), found.picks, strict=True)
    ]
    return aligned([head, *rows], right={1, 2, 3, 4})


def _notes(found: Gathered) -> list[str]:
    """Return each note once, with the names of its records."""
    notes: dict[str, list[str]] = {}
    for name, one in zip(found.named(), found.picks, strict=True):
        for note in (*note_words(one), *one.record.notes):
            notes.setdefault(note, []).append(name)
    return [f"{listed(names)}: {note}" for note, names in notes.items()]


def _of_log(log: PickLog) -> list[str]:
    """Return sentences on quantities, covariances and shots of the log."""
    same: dict[tuple[tuple[str, ...], Reason], list[str]] = {}
    for left in log.left_out:
        same.setdefault((left.quantities, left.reason), []).append(left.record)
    lines = []
    for (of, reason), names in same.items():
        what = "all" if "air_arrival_s" in of else listed(map(quantity_words, of))
        why = sentence(f"no_row.{reason}")
        lines.append(f"not in the log: {what} of {listed(names)}: {why}")
    if log.independent:
        lines.append(sentence("independent", names=log.independent))
    if log.bangs > 1:
        lines.append(sentence("bangs", bangs=log.bangs))
    return lines


@dataclass(frozen=True)
class PickAnswer:
    """A pick; values in pascals are null if the samples are not calibrated.

    Attributes:
        record: Name of the record; name#bang if a channel has several.
        sensor: The channel.
        file: The file.
        bang: Number of the pick in its channel, from 1.
        shot: Event of the log to which it belongs; "" if there is only one.
        air_arrival_s: Arrival of the front.
        peak_overpressure_pa: Peak overpressure.
        positive_duration_s: Duration of the positive phase.
        positive_impulse_pa_s: Impulse of the positive phase.
        decay: Decay coefficient of the modified Friedlander pulse.
        rise_time_s: Rise time of the front.
        negative_pressure_pa: Peak of the negative phase.
        negative_duration_s: Duration of the negative phase.
        lower_bound: Whether the peak is a lower bound, as the record is clipped.
        later_arrivals_s: Arrivals of further fronts.
        quality: Quality of the pick.
        notes: Notes, as sentences.
    """

    record: str
    sensor: str
    file: str
    bang: int
    shot: str
    air_arrival_s: PickedValue | None
    peak_overpressure_pa: PickedValue | None
    positive_duration_s: PickedValue | None
    positive_impulse_pa_s: PickedValue | None
    decay: PickedValue | None
    rise_time_s: PickedValue | None
    negative_pressure_pa: PickedValue | None
    negative_duration_s: PickedValue | None
    lower_bound: bool
    later_arrivals_s: tuple[PickedValue, ...]
    quality: Quality
    notes: tuple[str, ...]


@dataclass(frozen=True)
class PicksAnswer(Document):
    """Picks from records of samples.

    Attributes:
        picks: Picks, ordered by file, channel and time.
        epoch_utc: Time zero of arrivals, ISO 8601; null if no file has a time of day.
        nothing_found: Channels without a pick.
        quieter_onsets: Number of ignored onsets by channel: 20 dB below its loudest.
        not_in_log: Quantities that the log does not contain, with the reason.
        bangs: Number of bangs in the log.
        refused: Messages on files that could not be read.
    """

    picks: tuple[PickAnswer, ...]
    epoch_utc: str | None
    nothing_found: tuple[str, ...]
    quieter_onsets: Mapping[str, int]
    not_in_log: tuple[LeftOut, ...]
    bangs: int
    refused: tuple[str, ...]


def picks_answer(found: Gathered, log: PickLog) -> PicksAnswer:
    """Return the picks as a document.

    Args:
        found: Picks.
        log: Rows of the picks.
    """
    rows = log.observations
    shots = dict(zip(rows.record, rows.shot, strict=False))
    return PicksAnswer(
        picks=tuple(
            _answer(one, name, order, shots.get(name, ""))
            for name, order, one in zip(
                found.named(), found.orders, found.picks, strict=True
            )
        ),
        epoch_utc=found.epoch.astimezone(UTC).isoformat() if found.epoch else None,
        nothing_found=found.silent,
        quieter_onsets=found.quieter,
        not_in_log=log.left_out,
        bangs=log.bangs,
        refused=tuple(str(error) for error in found.refused),
    )


def _answer(one: RecordPick, name: str, order: int, shot: str) -> PickAnswer:
    later = PickedValue(one.pick.later_arrival_s, one.pick.later_sigma_s)
    return PickAnswer(
        record=name,
        sensor=one.record.name,
        file=one.record.source,
        bang=order,
        shot=shot,
        **{quantity: picked_value(one, quantity) for quantity in NAMES},
        lower_bound=one.pick.lower_bound,
        later_arrivals_s=() if math.isnan(later.value) else (later,),
        quality=one.quality,
        notes=tuple(note_words(one)),
    )


def note_words(one: RecordPick) -> list[str]:
    """Return the notes on a pick, as sentences."""
    return sentences_of(one.findings)
