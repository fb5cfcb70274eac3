"""How many of discovery's 90 % intervals hold the truth, counted in many records?

    python -m calibration.discovery_intervals [--seeds 200] [--workers 2]

The equations of `discovery/noise_sweep.py`, normal noise of 1 %, seeds 0 to 199. Of the
records in which exactly the true terms came out, the share of all true coefficients
inside their intervals; beside it two standard errors of the share, the coefficients of
a record counted as one draw, and the same of each coefficient. Begun again, it goes on
where it was. Writes calibration/results/discovery_intervals.txt.
"""

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from jblast.discovery.noise_sweep import CASES, found_in, noisy_states
from jblast.errors import InputError
from jblast.files import write_text

RESULT = Path(__file__).parent / "results" / "discovery_intervals.txt"
NOISES = (0.01,)
Job = tuple[str, float, int]
Held = dict[str, dict[str, bool]]


def held(job: Job) -> Held:
    """Return which intervals hold the truth, by state of exact equations and term."""
    import jax

    jax.config.update("jax_enable_x64", True)
    name, noise, seed = job
    case = CASES[name]()
    try:
        found = found_in(case, noisy_states(case, noise, seed), seed)
    except InputError:  # noise so large that the radius shrinks somewhere
        return {}
    answer = {}
    for state, (label, true) in enumerate(case.truth.items()):
        if set(found.terms(state)) != set(true):
            continue
        places = [found.candidates.names.index(term) for term in true]
        low, high = found.low[state, places], found.high[state, places]
        value = np.array(list(true.values()))
        inside = (low <= value) & (value <= high)
        answer[label] = dict(zip(true, inside.tolist(), strict=True))
    return answer


def main() -> None:
    """Count, print the table and keep it."""
    parser = argparse.ArgumentParser(description="Count intervals that hold the truth.")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--kept", type=Path, default=Path("out/intervals.jsonl"))
    parser.add_argument("--out", type=Path, default=RESULT)
    asked = parser.parse_args()
    jobs = [
        (name, noise, seed)
        for name in CASES
        for noise in NOISES
        for seed in range(asked.seeds)
    ]
    found = read(asked.kept)
    left = [job for job in jobs if job not in found]
    with (
        ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool,
        asked.kept.open("a") as lines,
    ):
        for job, one in zip(left, pool.map(held, left), strict=True):
            found[job] = one
            lines.write(json.dumps([*job, one]) + "\n")
            lines.flush()
    text = table(found, asked.seeds)
    write_text(asked.out, text)
    sys.stdout.write(text)


def read(kept: Path) -> dict[Job, Held]:
    """Return what was counted before, so that it goes on there."""
    kept.parent.mkdir(parents=True, exist_ok=True)
    lines = kept.read_text().splitlines() if kept.exists() else []
    rows = map(json.loads, lines)
    return {(name, noise, seed): one for name, noise, seed, one in rows}


def table(found: dict[Job, Held], seeds: int) -> str:
    """Return a line for each equation and noise."""
    text = f"Intervals of 90 %: how many hold the truth, {seeds} records a line\n\n"
    text += f"{'of':24s}noise  exact  in 90 %   2 se  of each coefficient\n"
    for name in CASES:
        case = CASES[name]()
        for noise in NOISES:
            for label in case.truth:
                rows = [
                    one[label]
                    for job, one in found.items()
                    if job[:2] == (name, noise) and label in one
                ]
                if not rows:
                    continue
                inside = np.array([[*row.values()] for row in rows], float)
                each = inside.mean(axis=0)
                error = 2.0 * inside.mean(axis=1).std() / np.sqrt(len(rows))
                of_each = ", ".join(
                    f"{term} {share:.2f}"
                    for term, share in zip(rows[0], each, strict=True)
                )
                text += (
                    f"{f'{case.name}, {label}':24s}{100 * noise:4.1f} %{len(rows):7d}"
                )
                text += f"{inside.mean():9.3f}{error:7.3f}  {of_each}\n"
    return text


if __name__ == "__main__":
    main()
