"""Short-term over long-term average: a detector without a template.

The statistic is the power of the samples after an instant over the power of those
before it, as in seismology (Allen 1978, Bull. Seism. Soc. Am. 68, 1521). It detects any
sudden increase of power, by a door as well as by a blast, without regard to its form.
There is no formula for its false-alarm rate in coloured noise or wind: the threshold
has to be measured at the site.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument
from jblast.signals.noise import checked_positive, checked_samples

SHORT_S = 0.005
"""Default of the short window [s], a convention: the order of the positive phase of
1 kg. A longer one dilutes short blasts, a shorter one has more scatter."""
LONG_S = 0.5
"""Default of the long window [s], a convention: a hundred short ones, so that its
scatter is a tenth of theirs."""
ON, OFF = 10.0, 2.0
"""Power ratios at which a trigger begins and ends, conventions. Stationary noise rarely
reaches 10 dB; the lower end makes one trigger of a blast with several maxima."""


class Trigger(NamedTuple):
    """An interval that is louder than the time before it.

    Attributes:
        time_s: Time at which the ratio exceeds the threshold: start of the short window
            in which the rise begins [s].
        end_s: Time at which it is quiet again, or end of the recording [s].
        ratio: Largest ratio of powers in the interval.
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

    The ratio is zero if a window is not within the recording, or if the time before is
    digital silence.

    Args:
        recording: Samples of one channel.
        rate_hz: Sampling rate [Hz].
        short_s: Window after each sample [s].
        long_s: Window before it [s].

    Raises:
        InputError: The recording is shorter than both, or not finite.
    """
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    short = round(checked_positive("short_s", short_s, "s") * rate_hz)
    long = round(checked_positive("long_s", long_s, "s") * rate_hz)
    if not 1 <= short <= long:
        raise InputError(
            f"{argument('short_s')}, {argument('long_s')}: expected at least one "
            "sample and a short window no longer than the long one, got "
            f"{short_s:g} and {long_s:g} s"
        )
    samples = checked_samples("recording", recording, least=short + long)
    # running sums, so that the cost does not depend on the windows; about the median,
    # which a loud blast hardly moves
    sums = np.concatenate([[0.0], np.cumsum((samples - np.median(samples)) ** 2)])
    after = (sums[long + short :] - sums[long:-short]) / short
    before = (sums[long:-short] - sums[: -long - short]) / long
    # below the rounding error of the sums there is only silence
    audible = before > 1e-15 * sums[-1]
    ratio = np.where(audible, after / np.where(audible, before, 1.0), 0.0)
    return np.concatenate([np.zeros(long), ratio, np.zeros(short - 1)])


def triggers(
    ratio: Float[np.ndarray, " sample"],
    rate_hz: float,
    *,
    on: float = ON,
    off: float = OFF,
) -> tuple[Trigger, ...]:
    """Return the intervals between rising above `on` and falling below `off`.

    Args:
        ratio: Ratio of powers as from `sta_lta`.
        rate_hz: Sampling rate [Hz].
        on: Ratio at which an interval begins.
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
    # the loop is over triggers, not samples: an hour has few of them
    while (nth := np.searchsorted(above, at)) < above.size:
        start = int(above[nth])
        after = np.searchsorted(low, start)
        stop = int(low[after]) if after < low.size else ratio.size
        found.append(
            Trigger(start / rate_hz, stop / rate_hz, float(ratio[start:stop].max()))
        )
        at = stop
    return tuple(found)
