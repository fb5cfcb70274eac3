"""The answer of `jblast pick`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, timedelta
from functools import partial
from typing import TYPE_CHECKING

from jblast.report.messages import listed, sentence, sentences_of
from jblast.report.numbers import capitalised, quantity_words, rounded, unit_for
from jblast.report.output import NOT_FOUND, RECORDS, Answer
from jblast.report.view import Block, Column, Lines, Picture, Table, Text, View
from jblast.results import Document, filled
from jblast.signals.picks import (
    NAMES,
    Gathered,
    LeftOut,
    PickedFiles,
    PickedValue,
    PickLog,
    Quality,
    Reason,
    RecordPick,
    picked_value,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jblast.report.provenance import Provenance

LOG = "picks.csv"
MAX_RECORDS = 24
"""Largest number of records in one figure: twelve rows are about three screens."""
FILES = ("picks.json", LOG, *RECORDS)
"""Files that a report may contain besides the page."""
TITLES = {"decay": "Decay", "rise_time_s": "Rise time"}
"""Column titles of values that are not quantities of a log."""
SHORT = {
    "air_arrival_s": "arrival",
    "peak_overpressure_pa": "peak",
    "positive_duration_s": "duration",
    "positive_impulse_pa_s": "impulse",
}
"""Columns of a terminal."""
ALT = "Records with their fitted pulses, and residuals."
CAPTION = (
    "Grey: samples, or their range if several fall on one point. Blue: fitted pulse. "
    "Red: its arrival and, dotted, the end of its positive phase. Orange: further "
    "fronts. Dashed: clipping level. Lower panels: samples minus pulse, averaged over "
    "each point. A recorder's high-pass is included if its corner was given; ringing "
    "and later fronts are not included."
)
Named = tuple[str, RecordPick]


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
    named = zip(found.named(), found.orders, found.picks, strict=True)
    return PicksAnswer(
        picks=tuple(
            _answer(one, n, order, shots.get(n, "")) for n, order, one in named
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
    return filled(
        PickAnswer,
        {quantity: picked_value(one, quantity) for quantity in NAMES},
        one.pick,
        record=name,
        sensor=one.record.name,
        file=one.record.source,
        bang=order,
        shot=shot,
        later_arrivals_s=() if math.isnan(later.value) else (later,),
        notes=tuple(sentences_of(one.findings)),
    )


def estimate_words(one: RecordPick, quantity: str) -> str:
    """Return a value and its standard deviation with its unit; "" if unknown.

    If the samples do not have the form of a blast pulse, the error is unknown.
    """
    found = picked_value(one, quantity)
    if found is None:
        return ""
    # an arrival is a clock reading: always in seconds, whatever its size
    unit = unit_for(quantity, 1.0 if quantity == "air_arrival_s" else found.value)
    value, sd = found.value / unit.size, found.sd / unit.size
    bound = "> " if quantity == "peak_overpressure_pa" and one.pick.lower_bound else ""
    error = "" if "misfit" in one.notes else f" ± {rounded(sd, sd)}"
    return f"{bound}{rounded(value, sd)}{error} {unit.symbol}".rstrip()


def _column(quantity: str, head: str) -> Column:
    return Column(head, lambda row: estimate_words(row[1], quantity), right=True)


RECORD = Column("record", lambda row: row[0])
QUALITY = Column("quality", lambda row: row[1].quality)
PICKS = [RECORD, *(_column(q, head) for q, head in SHORT.items())]
"""Columns of a terminal, a row for each pick with its name."""
ALL_VALUES = [
    RECORD,
    QUALITY,
    *(_column(q, TITLES.get(q) or capitalised(quantity_words(q))) for q in NAMES),
]
"""Columns of a page."""


def picks_blocks(of: PickedFiles, *, title: str = "") -> list[Block]:
    """Return table, notes and figures of picks.

    Args:
        of: Picks and their log; figures are drawn if the picks keep their samples.
        title: Title of the table.
    """
    found, log = of.found, of.log
    named: list[Named] = list(zip(found.named(), found.picks, strict=True))
    has_errors = any("misfit" not in one.notes for _, one in named)
    caption = "±: one standard deviation of the posterior" if has_errors else ""

    def is_marked(row: Named) -> bool:
        return row[1].quality != "good"

    table = partial(Table, rows=named, title=title, caption=caption, marked=is_marked)
    has_samples = any(one.record.samples.size for _, one in named)
    firsts = range(0, len(named), MAX_RECORDS) if has_samples else ()
    drawn = [named[first : first + MAX_RECORDS] for first in firsts]
    return [
        table(PICKS, where="terminal", note=lambda row: _faulty(row[1])),
        table(ALL_VALUES, where="page"),
        *(
            Picture(name, partial(_records, some), "", CAPTION, ALT)
            for name, some in zip(RECORDS, drawn, strict=False)
        ),
        Lines("Notes", _notes(named)),
        Lines(
            "Log",
            [
                *_of_log(log),
                f"nothing found in {listed(found.silent)}"
                if named and found.silent
                else "",
                *(
                    sentence("{name}: {n:quieter onset} ignored", name=name, n=n)
                    for name, n in found.quieter.items()
                ),
                *(
                    f"table of stations: {line}"
                    for line in sentences_of(log.observations.understood)
                ),
                f"ignored, not a record: {listed(path.name for path in of.left_out)}"
                if of.left_out
                else "",
            ],
        ),
        # a terminal has them as the error of the command
        Lines("Files that cannot be read", list(map(str, found.refused)), where="page"),
    ]


def _faulty(one: RecordPick) -> str:
    # a column of its own would not fit a terminal
    return "" if one.quality == "good" else f"quality: {one.quality}"


def _records(named: Sequence[Named]) -> "Figure":
    # imported here, so that an answer without figures does not load Matplotlib
    from jblast.report.pick_figures import records_figure

    names, picks = zip(*named, strict=True)
    return records_figure(names, picks, estimate_words)


def picks_title(found: Gathered) -> str:
    """Return the number of picks and of records."""
    count = len(found.picks)
    head = sentence("{n:pick}", n=count) if count else "Nothing found"
    return sentence("{head} in {n:record}", head=head, n=found.channels)


def picks_report(of: PickedFiles, made: "Provenance | None" = None) -> Answer:
    """Return the answer: document, view and figures.

    Args:
        of: Picks and their log.
        made: Provenance, for a page.
    """
    comments = "\n".join(of.log.observations.comments)
    view = View(
        picks_title(of.found),
        [*picks_blocks(of), Text("Comments of the log", comments)],
        subtitle=f"Times count from {utc(of.found)}" if of.found.epoch else "",
        made=made,
    )
    code = 0 if len(of.log.observations) else NOT_FOUND
    return Answer(picks_answer(of.found, of.log), view, code=code)


def utc(found: Gathered) -> str:
    """Return the time of day of time zero of the picks."""
    assert found.epoch is not None
    whole = found.epoch.replace(microsecond=0)
    rest = (found.epoch - whole) / timedelta(seconds=1)
    return f"{whole:%Y-%m-%d %H:%M:%S}" + (f"{rest:.6f}"[1:] if rest else "") + " UTC"


def _notes(named: Sequence[Named]) -> list[str]:
    """Return each note once, with the names of its records."""
    notes: dict[str, list[str]] = {}
    for name, one in named:
        for note in (*sentences_of(one.findings), *one.record.notes):
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
