"""What became of a run of a study, and what is told of it meanwhile."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from jblast.progress import Level, Task
from jblast.study.engine.estimates import Estimates
from jblast.study.engine.numbering import Numbering
from jblast.study.engine.store import Store
from jblast.study.engine.tiles import Columns

SHOWN = 3
"""Outcomes whose running estimates a progress line tells."""


Tiles = Callable[..., Iterable[tuple[int, Columns | None]]]
"""Calculates tiles by their numbers, in any order; None: whoever calculated one has
written it. With `summary=True` they are tiles of the statistics, not of samples."""


@dataclass
class Ran:
    """What became of a run.

    Attributes:
        store: The store.
        estimates: What is known of each outcome.
        samples: How many there are now.
        new: How many were calculated by this run.
        seconds: How long that took, but for getting ready.
        complete: Whether the study is complete.
        reached: Whether it ended by its targets.
        notes: What there is to say of how it was calculated.
    """

    store: Store
    estimates: Estimates
    samples: int
    new: int
    seconds: float
    complete: bool
    reached: bool
    notes: tuple[str, ...] = field(default_factory=tuple)


def telling(numbering: Numbering) -> Callable[[int, Estimates], None]:
    """Return what tells how far a run is, how fast, and what is known by now."""
    teller, total, begun = Task(), numbering.samples, time.monotonic()
    first: list[int] = []

    def heard(samples: int, estimates: Estimates) -> None:
        if not first:
            first.append(samples)
        gone = time.monotonic() - begun
        rate = (samples - first[0]) / gone if gone > 0 else 0.0
        known = "; ".join(
            _known(name, estimates) for name in [*estimates.moments][:SHOWN]
        )
        words = f"{samples:,} of {total:,} samples, {rate:.3g}/s; {known}"
        through = samples / total
        teller(Level("", words, through, min(1.0 - through, numbering.tile / total)))

    return heard


def _known(name: str, estimates: Estimates) -> str:
    """Return an outcome's mean and its standard error in words."""
    whole = estimates.moments[name].whole()
    mean, error = float(whole.mean.flat[0]), float(whole.standard_error().flat[0])
    if not math.isfinite(error):
        return f"{name} {mean:.3g}"
    digits = max(0, 1 - math.floor(math.log10(error))) if error > 0 else 6
    return f"{name} {mean:.{min(digits, 9)}f} ± {error:.2g}"
