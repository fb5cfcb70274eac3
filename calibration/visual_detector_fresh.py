"""The visual detector on scenes that it was not set by.

    python -m calibration.visual_detector_fresh [without a blast] [with one]
        [--workers N]

The threshold of one false alarm an hour was chosen with `calibration.visual_detector`
in sight. Here are other seeds, and the detector as it is shipped. Written to
`results/visual_detector_fresh.txt`.
"""

from itertools import pairwise
from pathlib import Path

from calibration.films import SECONDS
from calibration.flash_trials import (
    BALL,
    PICTURES,
    Told,
    asked,
    with_a_blast,
    without_a_blast,
)
from jblast.files import write_text
from jblast.report.view import aligned
from jblast.signals.flash.search import flash_threshold
from jblast.study.statistics import wilson_interval

RESULTS = Path(__file__).parent / "results"
FIRST = 2_000_000
"""Seed from which on none was looked at before."""
CHARGES_KG = (1, 10, 100, 1000)
RANGES_M = (0, 25, 50, 100, 200, 500)
"""Edges of the table of charge and range."""


def share(count: int, of: int) -> str:
    """Return a share with its 95 % interval (Wilson)."""
    low, high = wilson_interval(count / of, of, 0.95)
    return f"{count / of:.4f} ({low:.4f} to {high:.4f})"


def by_range(told: list[Told], threshold: float) -> list[tuple[str, ...]]:
    """Return how many were seen, a row each stretch of charges, a column of ranges."""
    ranges = list(pairwise(RANGES_M))
    rows: list[tuple[str, ...]] = [
        ("charge [kg]", *(f"{low}-{high} m" for low, high in ranges))
    ]
    for least, most in pairwise(CHARGES_KG):
        row = [f"{least}-{most}"]
        for low, high in ranges:
            some = [
                one.is_seen(0, threshold)
                for one in told
                if least <= one.charge_kg < most and low <= one.range_m < high
            ]
            row.append(f"{sum(some)} of {len(some)}" if some else "-")
        rows.append(tuple(row))
    return rows


def main() -> None:
    """Measure, write the table and print it."""
    how = asked(__doc__)
    threshold = flash_threshold(1.0)
    trials = [(FIRST + k, None) for k in range(how.blasts)]
    told = with_a_blast(trials, how.workers)
    greatest = without_a_blast(how.without, how.workers, FIRST)
    rows: list[tuple[str, ...]] = [("kind", "sequences", "greatest", "above")]
    alarms = 0
    for kind, values in greatest.items():
        above = int((values[0] > threshold).sum())
        rows.append((kind, f"{values[0].size}", f"{values[0].max():.3f}", f"{above}"))
        alarms += above
    lines = [
        f"Threshold {threshold:.3f}, one false alarm an hour; seeds from {FIRST:,} on"
    ]
    for name, some in (
        ("blasts", told),
        *((shown, [t for t in told if t.shown == shown]) for shown in (BALL, PICTURES)),
    ):
        seen = sum(one.is_seen(0, threshold) for one in some)
        lines.append(
            f"Seen within 20 ms: {seen} of {len(some)} {name}, {share(seen, len(some))}"
        )
    lines += [
        f"False alarms: {alarms} in {how.without:,} sequences, "
        f"{how.without * SECONDS / 60:.3g} minutes",
        "",
        *aligned(rows, right={1, 2, 3}),
        "",
        "Seen within 20 ms, of how many, by charge and range",
        *aligned(by_range(told, threshold), right=set(range(1, len(RANGES_M)))),
    ]
    text = "\n".join(lines) + "\n"
    write_text(RESULTS / "visual_detector_fresh.txt", text)
    print(text, end="")


if __name__ == "__main__":
    main()
