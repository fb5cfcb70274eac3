"""What `jblast listen` tells of the records: as JSON, and a row a sensor and blast."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jblast.json_values import plain
from jblast.report.listen.track import Track
from jblast.report.tables import comma_separated
from jblast.report.words import law_words
from jblast.sensors.listening.plan import Listening

CLOCK = "times are by each sensor's own clock; its file begins there at 0"


def listening_document(
    listening: Listening, tracks: Sequence[Track], notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return what `--json` prints; what never comes is null.

    Where there are several blasts, a sensor's own arrivals and peak are those of the
    first that comes to it.

    Args:
        listening: What was to be recorded.
        tracks: What was.
        notes: What else there is to know.
    """
    return plain(
        {
            "seconds": listening.seconds,
            "laws": listening.truth.laws,
            "sensors": {
                track.sensor.name: _sensor(listening, number, track)
                for number, track in enumerate(tracks)
            },
            "skipped": listening.skipped,
            "warnings": [*notes, *listening.notes, *warnings_of(listening, tracks)],
        }
    )


def _sensor(listening: Listening, number: int, track: Track) -> dict[str, Any]:
    truth = listening.truth
    values = {name: rows[number] for name, rows in truth.values.items()}
    shot = int(np.nan_to_num(values["air_arrival_s"], nan=np.inf).argmin())
    told = {
        "kind": track.sensor.kind,
        "file": track.file,
        "rate_hz": track.rate_hz,
        "samples": track.samples,
        **{name: row[shot] for name, row in values.items()},
        "clipped": track.clipped_samples > 0,
        "clipped_samples": track.clipped_samples,
        f"largest_{track.column}": track.largest,
    }
    if track.sensor.kind == "microphone":
        told["full_scale_pa"] = track.full_scale
    if len(truth.shots) > 1:
        told["blasts"] = {
            name: {quantity: row[n] for quantity, row in values.items()}
            | {"clipped": track.clipped[n]}
            for n, name in enumerate(truth.shots)
        }
    return told


def warnings_of(listening: Listening, tracks: Sequence[Track]) -> list[str]:
    """Return what somebody should know who uses the records."""
    truth = listening.truth
    told = [f"sensor {name!r}: {why}" for name, why in listening.skipped.items()]
    for name, valid in truth.valid.items():
        held = zip(tracks, valid, strict=True)
        wrong = [track.sensor.name for track, row in held if not row.all()]
        if wrong:
            told.append(
                f"{name} by {law_words(truth.laws[name])}, which was not made for "
                f"where these stand: {', '.join(wrong)}"
            )
    for track, arrivals in zip(tracks, truth.values["air_arrival_s"], strict=True):
        who = f"sensor {track.sensor.name!r}"
        if track.clipped_samples:
            told.append(
                f"{who}: {track.clipped_samples:,} of {track.samples:,} samples are at "
                "the instrument's limit; a peak read from them is a lower bound"
            )
        end = track.samples / track.rate_hz
        told += [
            f"{who}: the blast{f' {shot!r}' if shot else ''} comes at {arrival:.6g} s, "
            f"outside the record of {end:g} s"
            for shot, arrival in zip(truth.shots, arrivals, strict=True)
            if np.isfinite(arrival) and not 0.0 <= arrival < end
        ]
    return told


def truth_csv(
    listening: Listening, tracks: Sequence[Track], comments: Sequence[str]
) -> str:
    """Return a row for each sensor and blast: what the laws say, and what clipped."""
    truth = listening.truth
    head = ["sensor", "kind", "shot", "east_m", "north_m", "up_m", *truth.values]
    head += ["law_valid", "clipped", "file", "rate_hz", "samples", "full_scale_pa"]
    rows: list[list[str]] = [head]
    for number, track in enumerate(tracks):
        place = [f"{x:.12g}" for x in np.asarray(track.sensor.position_m).tolist()]
        sound = track.sensor.kind == "microphone"
        for n, shot in enumerate(truth.shots):
            values = [f"{told[number, n]:.12g}" for told in truth.values.values()]
            valid = all(held[number, n] for held in truth.valid.values())
            row = [track.sensor.name, track.sensor.kind, shot, *place, *values]
            row += [_word(valid), _word(track.clipped[n]), track.file]
            row += [f"{track.rate_hz:g}", str(track.samples)]
            rows.append([*row, f"{track.full_scale:.12g}" if sound else ""])
    lines = [f"# {' '.join(line.split())}\n" for line in comments]
    return "".join(lines) + comma_separated(rows)


def _word(flag: Any) -> str:
    return "true" if flag else "false"
