"""Short-term over long-term average: a detector without a template.

The power of the samples after an instant over the power of those before it, as in
seismology (Allen 1978, Bull. Seism. Soc. Am. 68, 1521). It detects any sudden increase
of power, a door as well as a blast, and the time of a rise rather than of a form. Its
false-alarm rate in coloured noise or wind follows from no formula: the threshold has to
be measured at the site (`verification/sampling_cases.py`).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument
from jblast.signals.samples import checked_positive, checked_samples

SHORT_S = 0.005
"""Default, declared: of the order of the positive phase of 1 kg."""
LONG_S = 0.5
"""Default, declared: a hundred short windows, so that its own scatter is small beside
theirs."""
ON, OFF = 10.0, 2.0
"""Power ratios at which a trigger goes on, and off."""


class Trigger(NamedTuple):
    """A stretch that was louder than what came before.

    Attributes:
        time_s: When the ratio rose through the threshold: start of the short stretch,
            after which the rise begins within its length [s].
        end_s: When it was quiet again, or the recording over [s].
        ratio: Largest ratio of powers within it.
    """

    time_s: float
    end_s: float
    ratio: float


def sta_lta(
    recording: ArrayLike,
    rate_hz: float,
    *,
    short_s: float = SHORT_S,
    long_s: float = LONG_S,
) -> Float[np.ndarray, " sample"]:
    """Return the power just after each sample over the power before it.

    Zero where either stretch does not lie within the recording, or nothing but silence
    went before: of silence there is no ratio.

    Args:
        recording: Samples of one channel.
        rate_hz: Sampling rate [Hz].
        short_s: How much after each sample is averaged [s].
        long_s: How much before it [s].

    Raises:
        InputError: The recording is shorter than both, or not finite.
    """
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    short = round(checked_positive("short_s", short_s, "s") * rate_hz)
    long = round(checked_positive("long_s", long_s, "s") * rate_hz)
    if not 1 <= short <= long:
        raise InputError(
            f"{argument('short_s')}, {argument('long_s')}: expected a sample at least, "
            f"and the long time to be the longer, got {short_s:g} and {long_s:g} s"
        )
    samples = checked_samples("recording", recording, least=short + long)
    # running sums: the cost does not depend on the windows
    sums = np.concatenate([[0.0], np.cumsum((samples - np.median(samples)) ** 2)])
    after = (sums[long + short :] - sums[long:-short]) / short
    before = (sums[long:-short] - sums[: -long - short]) / long
    heard = before > 1e-15 * sums[-1]  # rounding of the sums
    ratio = np.where(heard, after / np.where(heard, before, 1.0), 0.0)
    return np.concatenate([np.zeros(long), ratio, np.zeros(short - 1)])


def triggers(
    ratio: Float[np.ndarray, " sample"],
    rate_hz: float,
    *,
    on: float = ON,
    off: float = OFF,
) -> tuple[Trigger, ...]:
    """Return the stretches between rising through `on` and falling below `off`.

    Args:
        ratio: Of powers, as `sta_lta` returns it.
        rate_hz: Sampling rate [Hz].
        on: Ratio at which one begins.
        off: Ratio at which it ends, at most as large.
    """
    if not 0 < off <= on:
        raise InputError(
            f"{argument('on')}, {argument('off')}: expected positive ratios, the first "
            f"at least as large, got {on:g} and {off:g}"
        )
    low = np.flatnonzero(ratio < off)
    found, at = [], 0
    above = np.flatnonzero(ratio > on)
    # from trigger to trigger, not from sample to sample: an hour has few of them
    while (nth := np.searchsorted(above, at)) < above.size:
        start = int(above[nth])
        after = np.searchsorted(low, start)
        stop = int(low[after]) if after < low.size else ratio.size
        found.append(
            Trigger(start / rate_hz, stop / rate_hz, float(ratio[start:stop].max()))
        )
        at = stop
    return tuple(found)
