"""The answer of `jblast pick`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, timedelta

from jblast.report.understood import understood_lines
from jblast.report.words import (
    aligned,
    joined,
    printed_number,
    quantity_words,
    rounded,
    unit_for,
)
from jblast.results import Document
from jblast.signals.picks import (
    NAMES,
    Gathered,
    LeftOut,
    NoteKind,
    PickLog,
    Quality,
    Reason,
    RecordPick,
    pick_estimate,
)

COLUMNS = {
    "air_arrival_s": "arrival",
    "peak_overpressure_pa": "peak",
    "positive_duration_s": "duration",
    "positive_impulse_pa_s": "impulse",
}
"""What the table shows, and its titles."""
MOST_NAMES = 6
"""Names in a sentence."""
NOTES: dict[NoteKind, str] = {
    "nothing_found": "nothing found",
    "onset_alone": "no blast pulse fits the samples: when they became loud is told",
    "not_converged": "the fit of the pulse did not converge",
    "clipped": "clipped at {clipped_at}",
    "misfit": "the samples are not of a blast pulse's form (misfit {misfit}, where "
    "chance gives 1)",
    "few_quiet_samples": "too few quiet samples before the front to know the noise by",
    "under_sampled": "fewer than eight samples make the positive phase",
    "sharp_front": "the front rises within a sample",
    "cut_short": "the record ends before the positive phase does",
    "drifting": "the baseline drifts",
    "curved_baseline": "the baseline bends: duration and impulse rest on its form",
    "resonating": "the sensor rings at {rings}",
    "high_passed": "what follows the pulse looks high-passed, and no corner was given; "
    "a Friedlander pulse that runs on below zero looks the same",
    "later_arrival": "further fronts at {later}",
    "zero_shift": "the zero of the gauge shifts at the front: duration and impulse "
    "depend on when it does",
    "reversed_polarity": "the polarity is reversed: picked upside down",
    "front_alone": "what follows the front is not of a blast pulse's form: arrival and "
    "peak are those of the front alone",
    "duration_unsure": "the duration is hardly told",
    "faint": "the pulse is faint",
}
"""Of what a pick's notes say."""
REASONS: dict[Reason, str] = {
    "poor": "a poor pick",
    "onset_alone": "no pulse fits the samples",
    "uncalibrated": "nobody said how many pascals a sample stands for",
    "high_passed": "a high-pass of unknown corner changes them",
    "curved_baseline": "the baseline bends, and they rest on its form",
    "cut_short": "the record ends too early",
    "zero_shift": "the zero of the gauge shifts at the front",
    "front_alone": "what follows the front is no blast pulse",
    "weaker": "weaker than another of the same bang there: an echo, perhaps",
}
"""Why something stands in no row of the log."""
RECORDS_ALT = "Records with their fitted pulses, and residuals."
RECORDS_CAPTION = (
    "Grey: samples, their range where several fall on one point. Blue: fitted pulse. "
    "Red: its arrival and, dotted, the end of its positive phase; orange: further "
    "fronts; dashed: where the record clips. Below each: samples less pulse, means of "
    "what falls on one point. A recorder's high-pass is drawn where its corner was "
    "given, what rings or comes later is not."
)


def picks_text(found: Gathered, log: PickLog, left_out: tuple[str, ...] = ()) -> str:
    """Return what was picked.

    Args:
        found: Picks.
        log: Their rows.
        left_out: Files of a folder that are no records.
    """
    count, channels = len(found.picks), found.channels
    head = f"{count} {'pick' if count == 1 else 'picks'}" if count else "Nothing found"
    lines = [f"{head} in {channels} {'record' if channels == 1 else 'records'}"]
    if found.epoch is not None and count:
        lines.append(f"times count from {utc(found)}")
    if count:
        lines += ["", *_table(found), ""]
    lines += _notes(found)
    lines += _of_log(log)
    if found.silent and count:
        lines.append(f"nothing found in {_listed(found.silent)}")
    for name, quieter in found.quieter.items():
        lines.append(
            f"{name}: {quieter} quieter {'onset' if quieter == 1 else 'onsets'} not "
            "looked at"
        )
    read_as = understood_lines(log.observations.understood)
    lines += [f"table of stations: {line}" for line in read_as]
    if left_out:
        lines.append(f"no records, left out: {_listed(left_out)}")
    return "\n".join(lines).rstrip() + "\n"


def utc(found: Gathered) -> str:
    """Return the time of day that picks count from."""
    assert found.epoch is not None
    whole = found.epoch.replace(microsecond=0)
    rest = (found.epoch - whole) / timedelta(seconds=1)
    return f"{whole:%Y-%m-%d %H:%M:%S}" + (f"{rest:.6f}"[1:] if rest else "") + " UTC"


def estimate_words(one: RecordPick, quantity: str) -> str:
    """Print a value and its standard deviation with its unit; "" where unknown.

    Where the samples are not of a blast pulse's form the error is not known.
    """
    found = pick_estimate(one, quantity)
    if found is None:
        return ""
    value, sd = found
    if quantity == "air_arrival_s":  # digits of the clock, not of a ladder of units
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
    """Say each note once, with the records that it is of."""
    notes: dict[str, list[str]] = {}
    for name, one in zip(found.named(), found.picks, strict=True):
        for note in (*note_words(one), *one.record.notes):
            notes.setdefault(note, []).append(name)
    return [f"{_listed(names)}: {note}" for note, names in notes.items()]


def _of_log(log: PickLog) -> list[str]:
    """Say what stands in no row."""
    same: dict[tuple[tuple[str, ...], Reason], list[str]] = {}
    for left in log.left_out:
        same.setdefault((left.quantities, left.reason), []).append(left.record)
    lines = [
        f"not in the log: {_left_out(quantities)} of {_listed(names)}: "
        f"{REASONS[reason]}"
        for (quantities, reason), names in same.items()
    ]
    if log.independent:
        lines.append(
            f"errors of {_listed(log.independent)} are taken as independent: their "
            "covariance is singular"
        )
    if log.bangs > 1:
        lines.append(f"{log.bangs} bangs, told apart in the log by the column shot")
    return lines


def _left_out(quantities: tuple[str, ...]) -> str:
    """Return which quantities were left out."""
    if "air_arrival_s" in quantities:
        return "all"
    return joined([quantity_words(quantity) for quantity in quantities])


def _listed(names: list[str] | tuple[str, ...]) -> str:
    """Return names for a sentence, the rest of many as a count."""
    if len(names) <= MOST_NAMES:
        return joined(list(names))
    return (
        f"{', '.join(names[: MOST_NAMES - 1])} and {len(names) - MOST_NAMES + 1} more"
    )


@dataclass(frozen=True)
class PickedValue:
    """A value and its standard deviation, in its unit.

    Attributes:
        value: The value.
        sd: Its standard deviation.
    """

    value: float
    sd: float


@dataclass(frozen=True)
class PickAnswer:
    """A pick; a value is null where samples are no pascals and it is in them.

    Attributes:
        record: Its name, name#bang where a channel has several.
        sensor: The channel.
        file: Its file.
        bang: Which of its channel it is, from 1.
        shot: Which event of the log it belongs to; "" where there is one.
        air_arrival_s: When the front came.
        peak_overpressure_pa: Peak overpressure.
        positive_duration_s: How long the positive phase lasts.
        positive_impulse_pa_s: Its impulse.
        decay: Decay parameter of the modified Friedlander pulse.
        rise_time_s: How long the front rises.
        negative_pressure_pa: Peak of the negative phase.
        negative_duration_s: How long that lasts.
        lower_bound: Whether the peak is a lower bound, as the record is clipped.
        later_arrivals_s: Further fronts.
        quality: How far it may be trusted.
        notes: Remarks, a sentence each.
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
    """What was picked from records of samples.

    Attributes:
        picks: By file, channel and time.
        epoch_utc: What arrivals count from, ISO 8601; null where no file tells the time
            of day.
        nothing_found: Channels without a pick.
        quieter_onsets: How many onsets were not looked at, by channel: 20 dB below its
            loudest.
        not_in_log: What stands in no row of the log, and why.
        bangs: How many bangs the rows of the log are of.
        refused: Why files could not be read, a message each.
    """

    picks: tuple[PickAnswer, ...]
    epoch_utc: str | None
    nothing_found: tuple[str, ...]
    quieter_onsets: Mapping[str, int]
    not_in_log: tuple[LeftOut, ...]
    bangs: int
    refused: tuple[str, ...]


def picks_answer(found: Gathered, log: PickLog) -> PicksAnswer:
    """Return what was picked.

    Args:
        found: Picks.
        log: Their rows.
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
    later = zip(one.pick.later_arrivals_s, one.pick.later_sigmas_s, strict=True)
    return PickAnswer(
        record=name,
        sensor=one.record.name,
        file=one.record.source,
        bang=order,
        shot=shot,
        **{quantity: _estimate(one, quantity) for quantity in NAMES},
        lower_bound=bool(one.pick.lower_bound),
        later_arrivals_s=tuple(
            PickedValue(float(time), float(sd))
            for time, sd in later
            if not math.isnan(float(time))
        ),
        quality=one.quality,
        notes=tuple(note_words(one)),
    )


def _estimate(one: RecordPick, quantity: str) -> PickedValue | None:
    """Return a value and its standard deviation; None where the pick has none."""
    found = pick_estimate(one, quantity)
    return None if found is None else PickedValue(*found)


def note_words(one: RecordPick) -> list[str]:
    """Return the remarks on a pick."""
    later = [float(time) for time in one.pick.later_arrivals_s if time == time]
    scale = float(one.pick.clipped_at_pa)
    level = f"{scale:.3g} of full scale"
    if one.record.calibrated and scale == scale:
        level = printed_number("clipped_at_pa", scale, 3)
    values = {
        "clipped_at": level,
        "rings": f"{float(one.pick.resonance_hz):.3g} Hz",
        "misfit": f"{float(one.pick.misfit):.3g}",
        "later": f"{joined([f'{time:.6g}' for time in later])} s",
    }
    return [NOTES[kind].format(**values) for kind in one.notes]
