r"""When a record becomes loud that holds no pulse we know: its onset alone.

Walls, trees, a microphone's own filter and its gain control make of a blast what no
pulse fits; when it began can be told even so. The samples up to the largest are split
in two stretches of noise, each with a variance of its own; the most probable split is
the onset (Maeda 1985, the picker of Akaike's criterion):

$$\mathrm{AIC}(k) = k \ln s^2_{[0, k)} + (n - k) \ln s^2_{[k, n)}$$

and $e^{-\mathrm{AIC}/2}$ is the probability of a split there. That holds for samples
that know nothing of each other; those of a record do, so the error is no less than half
of the time from the onset to where half of the largest size is reached.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

QUIET = 32
"""Samples that must come before an onset, to know what quiet is."""

LOUD = 10.0
"""The largest sample is as many standard deviations of the quiet ones."""

SUDDEN = 3.0
"""So is the root mean square of what samples change by, from before to behind: a drift
becomes large, and no rougher."""


class Onset(NamedTuple):
    """When a record becomes loud, in samples.

    Attributes:
        sample: The first loud one.
        sigma: Its standard deviation.
    """

    sample: float
    sigma: float


def onset_of(samples: Float[np.ndarray, " sample"]) -> Onset | None:
    """Return when a record becomes loud; None if it does not.

    Args:
        samples: In any unit, finite.
    """
    apart = np.abs(samples - np.median(samples))
    largest = int(np.argmax(apart))
    if largest < 2 * QUIET or apart[largest] == 0.0:
        return None
    split, sigma = _most_probable_split(samples[: largest + 1] / apart[largest])
    before = samples[:split]
    half = split + int(np.argmax(apart[split : largest + 1] >= 0.5 * apart[largest]))
    rough = np.sqrt(np.mean(np.square(np.diff(before))))
    rougher = np.sqrt(
        np.mean(np.square(np.diff(samples[split - 1 : 2 * half - split + 2])))
    )
    size = np.max(np.abs(samples[split : largest + 1] - before.mean()))
    if size < LOUD * before.std() or rougher < SUDDEN * rough:
        return None
    return Onset(float(split), float(np.hypot(sigma, max(0.5 * (half - split), 0.3))))


def _most_probable_split(x: Float[np.ndarray, " sample"]) -> tuple[int, float]:
    """Return the most probable first sample of the second stretch, and its error."""
    n = x.size
    k = np.arange(QUIET, n - 1)
    sums, squares = np.cumsum(x), np.cumsum(np.square(x))
    least = np.finfo(x.dtype).eps
    first = squares[k - 1] / k - np.square(sums[k - 1] / k)
    rest = n - k
    second = (squares[-1] - squares[k - 1]) / rest - np.square(
        (sums[-1] - sums[k - 1]) / rest
    )
    aic = k * np.log(np.maximum(first, least)) + rest * np.log(
        np.maximum(second, least)
    )
    weight = np.exp(-0.5 * (aic - aic.min()))
    mean = np.average(k, weights=weight)
    spread = np.sqrt(np.average(np.square(k - mean), weights=weight))
    return int(k[np.argmin(aic)]), float(spread)
