"""What was picked, as JSON."""

from datetime import UTC
from typing import Any

from jblast.inference.picks import NAMES, RecordPick
from jblast.inference.records import Gathered, PickLog, told
from jblast.json_values import plain
from jblast.report.picks.words import note_words


def picks_document(found: Gathered, log: PickLog) -> dict[str, Any]:
    """Return the document of what was picked.

    Args:
        found: Picks.
        log: Their rows.
    """
    names = found.named()
    rows = log.observations
    shots = dict(zip(rows.record, rows.shot, strict=False))
    picks = []
    for name, order, one in zip(names, found.orders, found.picks, strict=True):
        entry = {"record": name, "sensor": one.record.name, "file": one.record.source}
        entry |= {"bang": order, "shot": shots.get(name, "")}
        entry |= {quantity: estimate(one, quantity) for quantity in NAMES}
        entry |= {
            "lower_bound": bool(one.pick.lower_bound),
            "later_arrivals_s": [
                {"value": float(time), "sd": float(sd)}
                for time, sd in zip(
                    one.pick.later_arrivals_s, one.pick.later_sigmas_s, strict=True
                )
                if float(time) == float(time)
            ],
            "quality": one.quality,
            "notes": note_words(one),
        }
        picks.append(entry)
    epoch = found.epoch.astimezone(UTC).isoformat() if found.epoch else None
    return plain(
        {
            "schema": 1,
            "picks": picks,
            "epoch_utc": epoch,
            "nothing_found": list(found.silent),
            "quieter_onsets": found.quieter,
            "not_in_log": [left._asdict() for left in log.left_out],
            "bangs": log.bangs,
            "refused": [str(error) for error in found.refused],
        }
    )


def estimate(one: RecordPick, quantity: str) -> dict[str, float] | None:
    """Return a value and its standard deviation; None where the pick has none."""
    found = told(one, quantity)
    return found._asdict() if found else None
