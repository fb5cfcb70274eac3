r"""How loud is loud enough: a threshold from the false alarms that are borne with.

A false alarm is the statistic of noise alone rising through the threshold $u$ from one
sample to the next. For Gaussian noise of variance 1 whose neighbouring outputs have the
correlation $\cos\varphi_1$ that happens, exactly, at a rate of

$$\nu(u) = \frac{f_s}{2\pi} \int_0^{\varphi_1}
  \exp\!\left(-\frac{u^2}{1 + \cos\varphi}\right) d\varphi$$

(the bivariate normal distribution as an integral over its correlation, Drezner and
Wesolowsky 1990). For outputs much alike it is Rice's $\nu_0 e^{-u^2/2}$ (1945, Bell
System Technical Journal 24, eq. 3.3-11), with $\nu_0 = f_s \varphi_1/2\pi$ upcrossings
of zero; with all of a sampled band in use, half as many at $u = 6$: what lies between
two samples is not seen.
"""

import math

import numpy as np

from jblast.detect.kernel import MatchedKernel
from jblast.detect.samples import checked_positive
from jblast.errors import InputError, argument

HOUR_S = 3600.0
FALSE_ALARMS_PER_HOUR = 1.0
ACCURACY = 1e-9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


def threshold_for(
    kernel: MatchedKernel, false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR
) -> float:
    """Return the threshold of a statistic, in standard deviations.

    Args:
        kernel: The filter it comes from.
        false_alarms_per_hour: How many of them on average [1/h].

    Raises:
        InputError: The rate is not positive, or as high as that of the noise itself.
    """
    rate = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    most = false_alarms_at(kernel, 0.0)
    if rate >= most:
        raise InputError(
            f"{argument('false_alarms_per_hour')}: expected less than the noise rises "
            f"through 0, {most:.3g} an hour, got {rate:g}"
        )
    low, high = 0.0, math.sqrt(2 * math.log(most / rate))  # Rice's is never below
    while high - low > ACCURACY:
        middle = 0.5 * (low + high)
        if false_alarms_at(kernel, middle) > rate:
            low = middle
        else:
            high = middle
    return high


def false_alarms_at(kernel: MatchedKernel, threshold: float) -> float:
    """Return how often noise alone rises through a threshold [1/h].

    Args:
        kernel: The filter.
        threshold: In standard deviations, from 0 up.
    """
    # exp(-u^2 / (1 + cos p)) without its value at 0, which may be too small to be told
    phase = 0.5 * kernel.phase_step_rad * (1 + _NODES)
    fall = np.exp(-0.5 * threshold**2 * np.tan(phase / 2) ** 2)
    mean = 0.5 * float(_WEIGHTS @ fall)
    rate_hz = kernel.rate_hz * kernel.phase_step_rad / (2 * math.pi)
    return HOUR_S * rate_hz * mean * math.exp(-0.5 * threshold**2)


def in_decibels(statistic: float) -> float:
    """Return the signal-to-noise ratio 2E/N0 of a statistic in sigmas [dB]."""
    return 20 * math.log10(statistic)
