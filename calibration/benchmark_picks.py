"""Pressure records picked a second, on one core.

Records of 4,096 samples as `picks_records.py` makes them (drift, coloured noise,
rings). Beside an earlier commit: `benchmarks_before TREE --name picks`. Compiling is
the processor's time up to the first pick, nothing kept.
"""

import os
import time

import jax
import numpy as np

from calibration.picks_records import SAMPLES, drawn, noise_of, signal_of
from jblast.cli.jax_start import start_jax
from jblast.signals.picks import pick

MADE, SEED, REPEATS = 320, 21, 3


def picks_text() -> str:
    """Return the table."""
    os.environ["JBLAST_KEEP_PROGRAMS"] = "0"
    start_jax()
    jax.config.update("jax_enable_compilation_cache", False)
    rng = np.random.default_rng(SEED)
    made = drawn(MADE, rng)
    clock = np.arange(SAMPLES, dtype=float)
    kinds = {
        "as they come": made,
        "no sensor rings": [one for one in made if not one.resonance],
    }
    samples = {
        words: np.array([signal_of(one) + noise_of(one, rng) for one in some])
        for words, some in kinds.items()
    }
    begun = time.process_time()
    jax.block_until_ready(pick(clock, samples["as they come"][:1]))
    compiling = time.process_time() - begun
    lines = [f"{SAMPLES} samples a record; the best of {REPEATS}", ""]
    for words, some in samples.items():
        best = min(_seconds(clock, some) for _ in range(REPEATS))
        lines.append(f"{f'records/s, {words}':32s}{len(some) / best:10.1f}")
    lines.append(f"compiling: {compiling:.0f} s of processor")
    return "\n".join(lines) + "\n"


def _seconds(clock, samples) -> float:
    """Return how long picking takes [s]."""
    begun = time.perf_counter()
    jax.block_until_ready(pick(clock, samples))
    return time.perf_counter() - begun


if __name__ == "__main__":
    print(picks_text())
