"""What was picked, as JSON."""

import math
from dataclasses import asdict
from datetime import UTC
from typing import Any

from jblast.inference.picks import NAMES, RecordPick
from jblast.inference.records import Gathered, PickLog, pick_estimate
from jblast.json_values import plain
from jblast.report.picks.answer import PickAnswer, PickedValue, PicksAnswer
from jblast.report.picks.words import note_words


def picks_document(found: Gathered, log: PickLog) -> dict[str, Any]:
    """Return the document of what was picked.

    Args:
        found: Picks.
        log: Their rows.
    """
    return plain({"schema": 1, **asdict(picks_answer(found, log))})


def picks_answer(found: Gathered, log: PickLog) -> PicksAnswer:
    """Return what was picked, as data."""
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
