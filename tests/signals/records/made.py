"""Picks that nothing was computed for: what is gathered and logged of them."""

from typing import Any

import numpy as np

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import NAMES, Pick, RecordPick

VALUES = (0.0, 1000.0, 0.01, 4.0, 1.0, 1e-4, 300.0, 0.03)
SD = 0.01


def pick(**changed) -> Pick:
    """A good pick, but for what is changed; its errors are one percent."""
    fields: dict[str, Any] = dict(zip(NAMES, VALUES, strict=True))
    fields |= {"covariance": SD**2 * (0.5 * np.eye(4) + 0.5), "notes": ()}
    fields |= {"misfit": 1.0, "noise_pa": 2.0, "baseline_pa": 5.0}
    fields |= changed
    sds = [SD * abs(fields[name]) for name in NAMES]
    # arrival and decay in their own units
    sds[0] = sds[4] = SD
    return Pick(**fields, sds=np.array(sds))


def record_pick(record: PressureRecord, **changed) -> RecordPick:
    """The made pick of a record."""
    return RecordPick(record, pick(**changed))


def picked_at_its_peak(records: list[PressureRecord]) -> list[RecordPick]:
    """Stand in for the fit: an arrival at the largest sample, if it is above 1."""
    made = []
    for one in records:
        at = int(np.argmax(one.samples))
        notes = () if one.samples[at] > 1.0 else ("nothing_found",)
        peak = float(one.samples[at])
        arrival = float(one.time_s[at])
        made.append(
            record_pick(
                one, air_arrival_s=arrival, peak_overpressure_pa=peak, notes=notes
            )
        )
    return made
