r"""How high a threshold has to be: the tail of what a statistic does without a blast.

Of sequences without a blast the greatest value of each is kept. Above a level $u$ they
are taken to fall off exponentially, which is what a sum of many frames' evidence does
(a generalised Pareto tail of shape 0; Pickands 1975):

$$\nu(h) = \nu_u\, e^{-(h - u)/\sigma}$$

an hour, $\sigma$ the mean excess. Where the fitted shape is above 0 the tail is
heavier, and its own quantile is taken in place. As rare kinds may have tails of their
own, the greatest value seen is taken to be passed once in all of the film, and beyond
it the rate to fall off with the same scale: the greater of both thresholds counts.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.detect.samples import checked_positive
from jblast.detect.threshold import HOUR_S


class Tail(NamedTuple):
    r"""Tail of the greatest values of sequences without a blast.

    Attributes:
        level: From here on it is a tail, $u$.
        scale: Mean excess $\sigma$, or the Pareto scale.
        shape: Of the Pareto tail; 0 is exponential.
        per_hour: How often the level is passed, $\nu_u$ [1/h].
        trials: Sequences.
        hours: Of all of them [h].
        greatest: Value that was seen.
    """

    level: float
    scale: float
    shape: float
    per_hour: float
    trials: int
    hours: float
    greatest: float = -math.inf

    def threshold(self, false_alarms_per_hour: float) -> float:
        """Return the statistic that is passed so often without a blast [1/h].

        For fewer than one in all of the film it lies above the greatest value seen.
        """
        rarer = math.log(1.0 / (self.hours * false_alarms_per_hour))
        beyond = self.greatest + self.scale * rarer if rarer > 0.0 else -math.inf
        return max(self._by_tail(false_alarms_per_hour), beyond)

    def _by_tail(self, false_alarms_per_hour: float) -> float:
        ratio = math.log(self.per_hour / false_alarms_per_hour)
        if ratio <= 0.0:
            return self.level
        if self.shape == 0.0:
            return self.level + self.scale * ratio
        return self.level + self.scale * math.expm1(self.shape * ratio) / self.shape

    def false_alarms(self, threshold: float) -> float:
        """Return how often a threshold is passed without a blast [1/h]."""
        excess = max(threshold - self.level, 0.0) / self.scale
        if self.shape == 0.0:
            rate = self.per_hour * math.exp(-excess)
        else:
            rate = self.per_hour * (1.0 + self.shape * excess) ** (-1.0 / self.shape)
        over = threshold - self.greatest
        return max(rate, math.exp(-max(over, 0.0) / self.scale) / self.hours)


def fitted_tail(
    greatest: Float[np.ndarray, " trial"], seconds: float, share: float = 0.05
) -> Tail:
    """Return the tail of the greatest values of sequences without a blast.

    The Pareto shape is that of L-moments (Hosking and Wallis 1987, eq. 9); below 0 it
    is set to 0, so that no end of the tail is believed in.

    Args:
        greatest: Of each sequence.
        seconds: How long each lasts [s].
        share: Of the sequences that are taken for the tail.
    """
    ordered = np.sort(greatest)
    count = max(round(share * len(ordered)), 8)
    level = float(ordered[-count - 1])
    excess = ordered[-count:] - level
    if excess.max() > 0.0:  # the rest are as the level is: most say nothing at all
        excess = excess[excess > 0.0]
        count = len(excess)
    mean = float(excess.mean())
    weights = (np.arange(count) + 0.65) / count  # plotting positions
    second = float((excess * (1.0 - weights)).mean())
    shape = -(mean / (mean - 2.0 * second) - 2.0) if mean > 2.0 * second else 0.0
    shape = max(shape, 0.0)
    scale = mean * (1.0 - shape) if shape < 1.0 else mean
    hours = len(ordered) * seconds / HOUR_S
    rate, largest = count / hours, float(ordered[-1])
    return Tail(level, scale, shape, rate, len(ordered), hours, largest)


MEASURED = Tail(
    level=0.8988,
    scale=0.7115,
    shape=0.097,
    per_hour=600,
    trials=2000,
    hours=2000 * 0.3 / HOUR_S,
    greatest=6.288,
)
"""Of the test's greatest statistic, by `calibration/visual_detector.py`.

Its hour is one of what looks like a flash, not of an empty street: lamps, cars, glints,
shots, lightning, a moving camera and a noisy one in turn, one in every 0.3 s.
"""


def flash_threshold(false_alarms_per_hour: float = 1.0) -> float:
    """Return the statistic from which on something is a blast.

    Args:
        false_alarms_per_hour: How many on average [1/h].

    Raises:
        InputError: The rate is not positive.
    """
    rate = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    return MEASURED.threshold(rate)
