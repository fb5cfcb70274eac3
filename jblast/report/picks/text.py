"""What was picked, in words for a terminal."""

from datetime import timedelta

from jblast.inference.picks import RecordPick
from jblast.inference.records import Gathered, PickLog, Reason, pick_estimate
from jblast.report.numbers import rounded, unit_for
from jblast.report.picks.words import REASONS, note_words
from jblast.report.tables import aligned
from jblast.report.understood import understood_lines
from jblast.report.words import joined, quantity_words

COLUMNS = {
    "air_arrival_s": "arrival",
    "peak_overpressure_pa": "peak",
    "positive_duration_s": "duration",
    "positive_impulse_pa_s": "impulse",
}
"""What the table shows, and its titles."""
MOST_NAMES = 6
"""Names in a sentence."""


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
