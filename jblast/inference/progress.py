"""How far a sampler has come, in one line with the time left."""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TextIO

import numpy as np

from jblast.inference.convergence import Convergence

OFTEN = 0.2
"""A line on a terminal is renewed after so many seconds."""
BAR = 20


@dataclass(frozen=True)
class Progress:
    """How far a sampler has come.

    Attributes:
        steps: Done so far.
        steps_wanted: About how many it will take in all; NaN until that is known.
        ess: Effective sample size so far, of the worst coordinate; NaN likewise.
        ess_wanted: Likewise at the end.
        seconds_left: About how long it will take; NaN likewise.
        judgements: How often these numbers were estimated anew.
    """

    steps: int
    steps_wanted: float
    ess: float
    ess_wanted: float
    seconds_left: float
    judgements: int

    def line(self) -> str:
        """Return all this in words."""
        if not np.isfinite(self.steps_wanted):
            return f"{self.steps:,} steps"
        full = round(BAR * self.steps / max(self.steps_wanted, 1.0))
        return (
            f"[{'#' * full}{' ' * (BAR - full)}] "
            f"{self.steps:,} of about {self.steps_wanted:,.0f} steps, "
            f"{self.ess:,.0f} of {self.ess_wanted:,.0f} effective samples, "
            f"{_time(self.seconds_left)} left"
        )


Report = Callable[[Progress], None]


def nothing(_: Progress) -> None:
    """Report nothing."""


@dataclass
class Line:
    """A line on a terminal that is written over; else a line for each judgement."""

    file: TextIO = field(default_factory=lambda: sys.stderr)
    _last: float = 0.0
    _told: int = 0
    _width: int = 0

    def __call__(self, progress: Progress) -> None:
        """Write."""
        if self.file.isatty():
            now = time.monotonic()
            if now - self._last < OFTEN:
                return
            self._last = now
            line = progress.line()
            self.file.write("\r" + line.ljust(self._width))
            self._width = len(line)
        elif progress.judgements != self._told:
            self._told = progress.judgements
            self.file.write(progress.line() + "\n")
        self.file.flush()

    def close(self) -> None:
        """Clear the line."""
        if self._width:
            self.file.write("\r" + " " * self._width + "\r")
            self.file.flush()


@dataclass
class Pace:
    """Turns steps and judgements into progress.

    Attributes:
        done: Steps so far.
        most: Steps at which it ends whatever is reached.
        walkers: How many walk.
        precision: What is wanted.
        checks: After how many steps it is judged, rising.
        judged: The last judgement.
        judgements: How many there were.
    """

    done: int
    most: int
    walkers: int
    precision: float
    checks: Sequence[int]
    judged: Convergence | None = None
    judgements: int = 0
    _start: float = field(default_factory=time.monotonic)
    _first: int = -1

    def __post_init__(self):
        self._first = self.done

    def now(self) -> Progress:
        """Return how far it has come."""
        wanted = ess = ess_wanted = left = np.nan
        if self.judged is not None:
            tau = np.max(self.judged.tau)
            total = self.judged.warm_up + self.judged.steps_wanted(self.precision)
            later = [check for check in self.checks if check >= max(total, self.done)]
            wanted = float(min([self.most, *later]))
            ess = float((self.done - self.judged.warm_up) * self.walkers / tau)
            ess_wanted = float((wanted - self.judged.warm_up) * self.walkers / tau)
            pace = (time.monotonic() - self._start) / max(self.done - self._first, 1)
            left = float((wanted - self.done) * pace)
        return Progress(self.done, wanted, ess, ess_wanted, left, self.judgements)

    def judge(self, judged: Convergence) -> None:
        """Take a judgement in."""
        self.judged, self.judgements = judged, self.judgements + 1


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
