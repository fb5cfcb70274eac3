"""How often the visual detector sees a blast, how soon, and how often something else.

    python -m calibration.visual_detector [table|fresh] [WITHOUT [WITH]] [--workers N]

Sequences of 160 x 120 pixels at 1,000 frames a second (`calibration.films`): eight
kinds of scenes without a blast in turn, and the renderer's fireballs, half of them
smooth balls, half the explosion that comes with jblast; a thousand of each.

visual_detector table: thresholds for so many false alarms an hour of such scenes, by
the tail of the greatest value of each sequence (`jblast.signals.flash.search`), and
what is seen at these.

visual_detector fresh: the detector as it is shipped, on seeds that it was not set by.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from calibration.films import KINDS, SECONDS, blast, negative
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.view import aligned
from jblast.sensors.camera import explosion_views
from jblast.signals.flash.search import Tail, flash_threshold
from jblast.signals.flash.watch import Watch
from jblast.signals.matched_filter import HOUR_S
from jblast.study.statistics import wilson_interval

RESULTS = Path(__file__).parent / "results"
RATES = (0.1, 1.0, 10.0, 100.0)
"""False alarms an hour."""
SOON_S = 0.02
"""A blast is to be seen within this of its first light [s]."""
FIRST = 2_000_000
"""Seed from which on none was looked at before."""
PICTURES, BALL = "pictures", "smooth ball"
EDGES = {
    "charge [kg]": (1, 3, 10, 100, 1000),
    "range [m]": (0, 25, 50, 100, 200, 500),
    "radius [px]": (10, 15, 25, 50),
}


class Told(NamedTuple):
    """What was said of a blast.

    Attributes:
        statistic: Of each frame, from the first with the blast.
        since: Of these frames, since the burst [s].
        of: Charge, range and final radius, by the names of `EDGES`.
        shown: `PICTURES` or `BALL`.
    """

    statistic: np.ndarray
    since: np.ndarray
    of: dict[str, float]
    shown: str

    def latency(self, threshold: float) -> float:
        """Return how long after the burst the threshold is passed [s], or infinity."""
        over = np.flatnonzero(self.statistic > threshold)
        return float(self.since[over[0]]) if len(over) else np.inf


def statistics(frames: np.ndarray) -> np.ndarray:
    """Return the statistic of each frame."""
    watch = Watch(frames.shape[1:])
    return np.array([watch.frame(f * np.float32(1 / 255)).statistic for f in frames])


@cache
def shipped() -> Any:
    """Return the views that come with jblast."""
    return explosion_views()


def of_a_blast(seed: int) -> Told:
    """Return what was said of a blast."""
    film = blast(seed, radius_px=None, pictures=shipped() if seed % 2 else None)
    numbers = film.charge_kg, film.range_m, film.radius_px
    return Told(
        statistics(film.frames)[film.first :],
        film.times[film.first :] - film.burst_s,
        dict(zip(EDGES, numbers, strict=True)),
        PICTURES if seed % 2 else BALL,
    )


def of_none(trial: tuple[str, int]) -> float:
    """Return the greatest value of a sequence without a blast."""
    return float(statistics(negative(*trial)[1]).max())


def fitted_tail(
    greatest: Float[np.ndarray, " trial"], seconds: float, share: float = 0.05
) -> Tail:
    """Return the tail of the largest statistics of sequences without a blast.

    The Pareto shape is that of L-moments (Hosking and Wallis 1987, eq. 9). A shape
    below 0 is set to 0, since it would give the tail an upper bound.

    Args:
        greatest: Largest statistic of each sequence.
        seconds: Length of each [s].
        share: Share of the sequences in the tail.
    """
    ordered = np.sort(greatest)
    count = min(max(round(share * len(ordered)), 8), len(ordered) - 1)
    level = float(ordered[-count - 1])
    excess = ordered[-count:] - level
    # most sequences have no evidence at all: values equal to the level are no excess
    if excess.max() > 0.0:
        excess = excess[excess > 0.0]
        count = len(excess)
    mean = float(excess.mean())
    # plotting positions of Hosking and Wallis, (i - 0.35) / n
    weights = (np.arange(count) + 0.65) / count
    second = float((excess * (1.0 - weights)).mean())
    shape = -(mean / (mean - 2.0 * second) - 2.0) if mean > 2.0 * second else 0.0
    shape = max(shape, 0.0)
    scale = mean * (1.0 - shape) if shape < 1.0 else mean
    hours = len(ordered) * seconds / HOUR_S
    rate, largest = count / hours, float(ordered[-1])
    return Tail(level, scale, shape, rate, len(ordered), hours, largest)


def seen_row(some: Sequence[Told], threshold: float) -> tuple[str, ...]:
    """Return how many are seen soon, of how many, with a 95 % interval, and when."""
    if not some:
        return "0", "-", "", "-"
    latency = np.array([one.latency(threshold) for one in some])
    count, of = int((latency <= SOON_S).sum()), len(some)
    low, high = wilson_interval(count / of, of, 0.95)
    middle = np.quantile(latency, 0.5, method="higher")
    when = f"{1e3 * middle:.1f}" if np.isfinite(middle) else "never"
    return f"{of}", f"{count / of:.3f}", f"{low:.4f} to {high:.4f}", when


def seen_table(told: Sequence[Told], threshold: float) -> list[str]:
    """Return what is seen at a threshold, of all and by charge, range and radius."""
    rows: list[tuple[str, ...]] = [
        ("of", "from", "to", "blasts", "seen", "95 %", "median [ms]")
    ]
    rows.append(("all", "", "", *seen_row(told, threshold)))
    for shown in (BALL, PICTURES):
        some = [one for one in told if one.shown == shown]
        rows.append((shown, "", "", *seen_row(some, threshold)))
    for name, edges in EDGES.items():
        for low, high in pairwise(edges):
            some = [one for one in told if low <= one.of[name] < high]
            rows.append((name, f"{low}", f"{high}", *seen_row(some, threshold)))
    return aligned(rows, right=range(1, 7))


def table(greatest: dict[str, np.ndarray], told: Sequence[Told]) -> list[str]:
    """Return thresholds, and what is seen at these."""
    tail = fitted_tail(np.concatenate(list(greatest.values())), SECONDS)
    rows: list[tuple[str, ...]] = [
        ("false alarms an hour", "threshold", "blasts", "seen", "95 %", "median")
    ]
    for rate in RATES:
        height = tail.threshold(rate)
        rows.append((f"{rate:g}", f"{height:.4g}", *seen_row(told, height)))
    return [
        f"Tail: u {tail.level:.4g}, scale {tail.scale:.4g}, shape {tail.shape:.3f}, "
        f"nu_u {tail.per_hour:.4g} an hour",
        "Greatest value by kind: "
        + ", ".join(f"{kind} {v.max():.4g}" for kind, v in greatest.items()),
        "",
        f"Seen within {1e3 * SOON_S:g} ms of the burst; medians [ms]",
        *aligned(rows, right=range(6)),
        "",
        "At one false alarm an hour, by charge, range and radius",
        *seen_table(told, tail.threshold(1.0)),
    ]


def fresh(greatest: dict[str, np.ndarray], told: Sequence[Told]) -> list[str]:
    """Return what is seen at the threshold that is shipped, and the false alarms."""
    height = flash_threshold(1.0)
    alarms = {kind: int((values > height).sum()) for kind, values in greatest.items()}
    minutes = sum(map(len, greatest.values())) * SECONDS / 60
    return [
        f"Threshold {height:.3f}, one false alarm an hour; seeds from {FIRST:,} on",
        f"False alarms: {sum(alarms.values())} in {minutes:.3g} minutes",
        *(f"  {kind}: {count}" for kind, count in alarms.items() if count),
        "",
        *seen_table(told, height),
    ]


PARTS: dict[str, tuple[Callable[..., list[str]], int, str]] = {
    "table": (table, 0, "visual_detector.txt"),
    "fresh": (fresh, FIRST, "visual_detector_fresh.txt"),
}


def main() -> None:
    """Film, watch, print the table, and keep it if it is of a thousand of each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("part", nargs="?", choices=PARTS, default="table")
    parser.add_argument("without", nargs="?", type=int, default=1000)
    parser.add_argument("blasts", nargs="?", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=1, metavar="N")
    how = parser.parse_args()
    shown, first, result = PARTS[how.part]
    kinds = [
        (KINDS[k % len(KINDS)], first + k // len(KINDS)) for k in range(how.without)
    ]
    seeds = range(first, first + how.blasts)
    spawn = get_context("spawn")
    with ProcessPoolExecutor(how.workers, spawn, start_jax) as pool:
        told = list(pool.map(of_a_blast, seeds))
        values = list(pool.map(of_none, kinds))
    greatest = {
        kind: np.array(
            [v for (k, _), v in zip(kinds, values, strict=True) if k == kind]
        )
        for kind in KINDS
    }
    text = "\n".join(
        [
            f"{how.without:,} sequences of {SECONDS:g} s without a blast, "
            f"{how.blasts:,} blasts of 1 to 1,000 kg, 10 to 50 px",
            *shown(greatest, told),
            "",
        ]
    )
    sys.stdout.write(text)
    if min(how.without, how.blasts) >= 1000:
        write_text(RESULTS / result, text)


if __name__ == "__main__":
    main()
