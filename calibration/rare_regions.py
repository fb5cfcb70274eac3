"""How many 90 % intervals of rare events contain the truth, at how many model calls?

    python -m calibration.rare_regions [--runs 50]

Events of known probability (`verification/sampling_cases.py`), 4096 samples, seeds
that no two runs share. For each: the share of intervals that contain the truth, the
share of answers that report a complete search, mean and standard deviation of the
estimate over the truth, the mean width of the interval over the truth, design points,
and calls of the margin with those of search and check. Writes
calibration/results/rare_regions.txt.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from jblast.files import write_text
from jblast.report.words import aligned
from jblast.study.rare import rare_probability
from jblast.verification.sampling_cases import RareRegion, rare_regions

RESULT = Path(__file__).parent / "results" / "rare_regions.txt"
HEAD = (
    "event",
    "dim",
    "truth",
    "in 90 %",
    "complete",
    "estimate",
    "sd",
    "width",
    "points",
    "calls",
)


def row(case: RareRegion, seeds: range) -> list[str]:
    """Return the line of one event."""
    truth = case.probability
    found = [
        rare_probability(case.margin, case.dimensions, seed=seed) for seed in seeds
    ]
    inside = np.array([one.low <= truth <= one.high for one in found])
    complete = np.array([one.complete for one in found])
    ratio = np.array([one.probability for one in found]) / truth
    width = np.mean([one.high - one.low for one in found]) / truth
    points = np.mean([len(one.design.points) for one in found])
    calls = np.mean([one.samples + one.design.evaluations for one in found])
    return [
        case.name,
        f"{case.dimensions}",
        f"{truth:.3g}",
        f"{inside.mean():.2f}",
        f"{complete.mean():.2f}",
        f"{ratio.mean():.3f}",
        f"{ratio.std(ddof=1):.3f}",
        f"{width:.3f}",
        f"{points:.1f}",
        f"{calls:.0f}",
    ]


def main() -> None:
    """Count, print the table and keep it."""
    import jax

    jax.config.update("jax_enable_x64", True)
    parser = argparse.ArgumentParser(description="Count intervals with the truth.")
    parser.add_argument("--runs", type=int, default=50)
    runs = parser.parse_args().runs
    rows = [
        row(case, range(number * runs, (number + 1) * runs))
        for number, case in enumerate(rare_regions())
    ]
    text = f"Rare events of known probability, {runs} runs a line\n\n"
    text += "\n".join(aligned([list(HEAD), *rows])) + "\n"
    sys.stdout.write(text)
    write_text(RESULT, text)


if __name__ == "__main__":
    main()
