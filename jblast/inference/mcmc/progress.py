"""How far a sampler has come: steps, and effective samples, of about how many."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from jblast.inference.mcmc.convergence import Convergence
from jblast.progress import Level, Task


@dataclass(frozen=True)
class Progress:
    """How far a sampler has come.

    Attributes:
        steps: Done so far.
        steps_wanted: About how many it will take in all; NaN until that is known.
        ess: Effective sample size so far, of the worst coordinate; NaN likewise.
        ess_wanted: Likewise at the end.
    """

    steps: int
    steps_wanted: float
    ess: float
    ess_wanted: float

    def words(self) -> str:
        """Return all this in words."""
        if not np.isfinite(self.steps_wanted):
            return f"{self.steps:,} steps"
        return (
            f"{self.steps:,} of about {self.steps_wanted:,.0f} steps, "
            f"{self.ess:,.0f} of {self.ess_wanted:,.0f} effective samples"
        )

    def share(self) -> float:
        """Return how much of the walk is done; zero as long as that is not known."""
        if not np.isfinite(self.steps_wanted):
            return 0.0
        return min(1.0, self.steps / max(self.steps_wanted, 1.0))


Report = Callable[[Progress], None]


def nothing(_: Progress) -> None:
    """Report nothing."""


def to_listener() -> Report:
    """Return a report to whoever listens."""
    tell = Task()
    return lambda progress: tell(Level("", progress.words(), progress.share(), 0.0))


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
    """

    done: int
    most: int
    walkers: int
    precision: float
    checks: Sequence[int]
    judged: Convergence | None = None

    def now(self) -> Progress:
        """Return how far it has come."""
        wanted = ess = ess_wanted = np.nan
        if self.judged is not None:
            tau = np.max(self.judged.tau)
            total = self.judged.warm_up + self.judged.steps_wanted(self.precision)
            later = [check for check in self.checks if check >= max(total, self.done)]
            wanted = float(min([self.most, *later]))
            ess = float((self.done - self.judged.warm_up) * self.walkers / tau)
            ess_wanted = float((wanted - self.judged.warm_up) * self.walkers / tau)
        return Progress(self.done, wanted, ess, ess_wanted)
