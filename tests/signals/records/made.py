"""Picks that nothing was computed for: what is gathered and logged of them."""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import NAMES, Pick, RecordPick
from jblast.signals.picks.record_picks import notes_of, quality_of
from jblast.signals.picks.unknowns import Form

VALUES = (0.0, 1000.0, 0.01, 4.0, 1.0, 1e-4, 300.0, 0.03)
SD = 0.01


def pick(**changed) -> Pick:
    """A good pick, but for what is changed."""
    fields = dict(zip(NAMES, map(jnp.asarray, VALUES), strict=True))
    fields |= {
        "covariance": SD**2 * (0.5 * jnp.eye(4) + 0.5),
        "spread": jnp.full(8, SD),
        "found": jnp.asarray(True),
        "converged": jnp.asarray(True),
        "clipped_at_pa": jnp.asarray(np.nan),
        "resonance_hz": jnp.asarray(np.nan),
        "noise_known": jnp.asarray(True),
        "later_arrivals_s": jnp.full(1, np.nan),
        "later_sigmas_s": jnp.full(1, np.nan),
        "misfit": jnp.asarray(1.0),
        "noise_pa": jnp.asarray(2.0),
        "baseline_pa": jnp.asarray(5.0),
        "form": Form(jnp.asarray(0.0), jnp.asarray(0.0)),
    }
    flags = ("lower_bound", "under_sampled", "sharp", "high_passed", "resonating")
    flags = (*flags, "drifting", "curving", "cut_short", "shifted", "front_alone")
    for name in flags:
        fields[name] = jnp.asarray(False)
    return Pick(**(fields | jax.tree.map(jnp.asarray, changed)))


def record_pick(record: PressureRecord, **changed) -> RecordPick:
    """The pick of a record, with the notes that it deserves."""
    made = pick(**changed)
    return RecordPick(record, made, quality_of(made), notes_of(made))


def picked_at_its_peak(records: list[PressureRecord]) -> list[RecordPick]:
    """Stand in for the fit: an arrival at the largest sample, if it is above 1."""
    made = []
    for one in records:
        at = int(np.argmax(one.samples))
        told = {"air_arrival_s": one.time_s[at], "found": one.samples[at] > 1.0}
        told |= {"peak_overpressure_pa": one.samples[at]}
        made.append(record_pick(one, **told))
    return made
