"""Pressure records picked a second, on one core.

Records of 4,096 samples as `picks_records.py` makes them (drift, coloured noise,
rings). Nothing is
compiled.
"""

import time

import numpy as np

from calibration.picks_records import SAMPLES, drawn, noise_of, signal_of
from jblast.signals.picks import pick

MADE, SEED, REPEATS = 80, 21, 3


def picks_text() -> str:
    """Return the table."""
    rng = np.random.default_rng(SEED)
    made = drawn(MADE, rng)
    kinds = {
        "as they come": made,
        "no sensor rings": [one for one in made if not one.resonance],
    }
    lines = [f"{SAMPLES} samples a record; the best of {REPEATS}", ""]
    for words, some in kinds.items():
        samples = np.array([signal_of(one) + noise_of(one, rng) for one in some])
        best = min(_seconds(samples) for _ in range(REPEATS))
        lines.append(f"{f'records/s, {words}':32s}{len(some) / best:10.1f}")
    return "\n".join(lines) + "\n"


def _seconds(samples) -> float:
    """Return how long picking takes [s]."""
    clock = np.arange(SAMPLES, dtype=float)
    begun = time.perf_counter()
    for one in samples:
        pick(clock, one)
    return time.perf_counter() - begun


if __name__ == "__main__":
    print(picks_text())
