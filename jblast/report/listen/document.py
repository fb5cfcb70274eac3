"""What `jblast listen` tells of the records: as JSON, and a row a sensor and blast."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jblast.json_values import plain
from jblast.report.listen.sensor_record import SensorRecord
from jblast.report.tables import comma_separated, commented
from jblast.report.words import law_words
from jblast.sensors.listening.plan import Listening

CLOCK = "times are by each sensor's own clock; its file begins there at 0"


def listening_document(
    listening: Listening, records: Sequence[SensorRecord], notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return what `--json` prints; what never comes is null.

    Where there are several blasts, a sensor's own arrivals and peak are those of the
    first that comes to it.

    Args:
        listening: What was to be recorded.
        records: What was.
        notes: What else there is to know.
    """
    return plain(
        {
            "seconds": listening.seconds,
            "laws": listening.truth.laws,
            "sensors": {
                record.sensor.name: _sensor(listening, number, record)
                for number, record in enumerate(records)
            },
            "skipped": listening.skipped,
            "warnings": [*notes, *listening.notes, *warnings_of(listening, records)],
        }
    )


def _sensor(listening: Listening, number: int, record: SensorRecord) -> dict[str, Any]:
    truth = listening.truth
    values = {name: rows[number] for name, rows in truth.values.items()}
    shot = int(np.nan_to_num(values["air_arrival_s"], nan=np.inf).argmin())
    document = {
        "kind": record.sensor.kind,
        "file": record.file,
        "rate_hz": record.rate_hz,
        "samples": record.samples,
        **{name: row[shot] for name, row in values.items()},
        "clipped": record.clipped_samples > 0,
        "clipped_samples": record.clipped_samples,
        f"largest_{record.column}": record.largest,
    }
    if record.sensor.kind == "microphone":
        document["full_scale_pa"] = record.full_scale
    if len(truth.shots) > 1:
        document["blasts"] = {
            name: {quantity: row[n] for quantity, row in values.items()}
            | {"clipped": record.clipped[n]}
            for n, name in enumerate(truth.shots)
        }
    return document


def warnings_of(listening: Listening, records: Sequence[SensorRecord]) -> list[str]:
    """Return what somebody should know who uses the records."""
    truth = listening.truth
    notes = [f"sensor {name!r}: {why}" for name, why in listening.skipped.items()]
    for name, valid in truth.valid.items():
        held = zip(records, valid, strict=True)
        wrong = [record.sensor.name for record, row in held if not row.all()]
        if wrong:
            notes.append(
                f"{name} by {law_words(truth.laws[name])}, which was not made for "
                f"where these stand: {', '.join(wrong)}"
            )
    for record, arrivals in zip(records, truth.values["air_arrival_s"], strict=True):
        who = f"sensor {record.sensor.name!r}"
        if record.clipped_samples:
            notes.append(
                f"{who}: {record.clipped_samples:,} of {record.samples:,} samples are "
                "at the instrument's limit; a peak read from them is a lower bound"
            )
        end = record.samples / record.rate_hz
        notes += [
            f"{who}: the blast{f' {shot!r}' if shot else ''} comes at {arrival:.6g} s, "
            f"outside the record of {end:g} s"
            for shot, arrival in zip(truth.shots, arrivals, strict=True)
            if np.isfinite(arrival) and not 0.0 <= arrival < end
        ]
    return notes


def truth_csv(
    listening: Listening, records: Sequence[SensorRecord], comments: Sequence[str]
) -> str:
    """Return a row for each sensor and blast: what the laws say, and what clipped."""
    truth = listening.truth
    head = ["sensor", "kind", "shot", "east_m", "north_m", "up_m", *truth.values]
    head += ["law_valid", "clipped", "file", "rate_hz", "samples", "full_scale_pa"]
    rows: list[list[str]] = [head]
    for number, record in enumerate(records):
        sound = record.sensor.kind == "microphone"
        for n, shot in enumerate(truth.shots):
            values = [f"{column[number, n]:.12g}" for column in truth.values.values()]
            valid = all(held[number, n] for held in truth.valid.values())
            place = [
                f"{x:.12g}" for x in truth.places["air_arrival_s"][number, n].tolist()
            ]
            row = [record.sensor.name, record.sensor.kind, shot, *place, *values]
            row += [_word(valid), _word(record.clipped[n]), record.file]
            row += [f"{record.rate_hz:g}", str(record.samples)]
            rows.append([*row, f"{record.full_scale:.12g}" if sound else ""])
    return commented(comments) + comma_separated(rows)


def _word(flag: Any) -> str:
    return "true" if flag else "false"
