"""Films with and without a blast, watched by several processes at a time.

All are sequences of 160 x 120 pixels at 1,000 frames a second
(`calibration.films`). Every other blast is the explosion that comes with
jblast, the rest are the law's smooth balls.
"""

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from typing import NamedTuple, TypeVar

import jax
import numpy as np

from calibration.films import KINDS, blast, negative
from calibration.vertical_events import VerticalEvents
from jblast.progress import counted
from jblast.sensors.camera import ExplosionViews, explosion_views
from jblast.signals.flash.watch import Watch

SOON_S = 0.02
"""A blast is to be seen within this of its first light [s]."""
OURS, EDGES, ROWS = "growth (CUSUM)", "algorithm 5, edges", "algorithm 5, rows"
METHODS = (OURS, EDGES, ROWS)
PICTURES, BALL = "pictures", "smooth ball"

Item = TypeVar("Item")
Value = TypeVar("Value")


class Told(NamedTuple):
    """What each method said of a blast.

    Attributes:
        statistic: Of each method (method, frame), from the first frame with the blast.
        since: Of these frames, since the burst [s].
        charge_kg: TNT.
        range_m: From the camera.
        radius_px: Of the fireball when it has grown.
        shown: `PICTURES` or `BALL`.
    """

    statistic: np.ndarray
    since: np.ndarray
    charge_kg: float
    range_m: float
    radius_px: float
    shown: str

    def latency(self, method: int, threshold: float) -> float:
        """Return how long after the burst the threshold is passed [s], or infinity."""
        over = np.flatnonzero(self.statistic[method] > threshold)
        return float(self.since[over[0]]) if len(over) else np.inf

    def is_seen(self, method: int, threshold: float) -> bool:
        """Return whether the threshold is passed soon enough."""
        return self.latency(method, threshold) <= SOON_S


def statistics(frames: np.ndarray) -> np.ndarray:
    """Return the statistic of each method (method, frame)."""
    watch = Watch(frames.shape[1:])
    others = VerticalEvents(np.inf, "edges"), VerticalEvents(np.inf, "rows")
    told = [
        (
            watch.frame(f * np.float32(1 / 255)).statistic,
            *(o.increase(f) for o in others),
        )
        for f in frames
    ]
    return np.array(told, float).T


def of_a_blast(trial: tuple[int, float | None]) -> Told:
    """Return what was said of a blast, by its seed and radius [px]."""
    seed, radius_px = trial
    shown = PICTURES if seed % 2 else BALL
    seen = blast(seed, radius_px=radius_px, pictures=_pictures() if seed % 2 else None)
    statistic = statistics(seen.frames)[:, seen.first :]
    since = seen.times[seen.first :] - seen.burst_s
    of_film = seen.charge_kg, seen.range_m, seen.radius_px
    return Told(statistic, since, *of_film, shown)


def of_none(trial: tuple[str, int]) -> np.ndarray:
    """Return the greatest values of a sequence (method), by its kind and seed."""
    return statistics(negative(*trial)[1]).max(axis=1)


def with_a_blast(
    trials: Sequence[tuple[int, float | None]], workers: int
) -> list[Told]:
    """Return what was said of blasts, by their seeds and radii [px]."""
    return list(_spread(of_a_blast, trials, workers, "blasts"))


def without_a_blast(count: int, workers: int, first: int = 0) -> dict[str, np.ndarray]:
    """Return the greatest values of sequences (method, trial) by kind.

    Args:
        count: Of sequences of all kinds in turn.
        workers: Processes.
        first: Seed of the first of each kind.
    """
    trials = [(KINDS[k % len(KINDS)], first + k // len(KINDS)) for k in range(count)]
    greatest: dict[str, list] = {kind: [] for kind in KINDS}
    said = _spread(of_none, trials, workers, "sequences without a blast")
    for (kind, _), values in zip(trials, said, strict=True):
        greatest[kind].append(values)
    return {kind: np.array(values).T for kind, values in greatest.items()}


def asked(about: str | None) -> argparse.Namespace:
    """Return how many sequences are asked for, and by how many processes."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name in ("without", "blasts"):
        parser.add_argument(
            name, nargs="?", type=int, default=1000, help="sequences (default: 1000)"
        )
    parser.add_argument(
        "--workers", type=int, default=1, metavar="N", help="processes (default: 1)"
    )
    how = parser.parse_args()
    if how.without < len(KINDS) or how.blasts < 2:
        parser.error(f"expected at least {len(KINDS)} without and 2 with a blast")
    return how


def _spread(
    function: Callable[[Item], Value], items: Sequence[Item], workers: int, what: str
) -> Iterator[Value]:
    """Call a function with each item, in so many processes; results come in order."""
    through = counted(len(items), what)
    if workers == 1:
        _begin()
        for done, item in enumerate(items, 1):
            yield function(item)
            through(done)
        return
    # each process has a core to itself
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    with ProcessPoolExecutor(workers, get_context("spawn"), _begin) as pool:
        for done, value in enumerate(pool.map(function, items), 1):
            yield value
            through(done)


def _begin() -> None:
    jax.config.update("jax_enable_x64", True)


@cache
def _pictures() -> ExplosionViews:
    return explosion_views()
