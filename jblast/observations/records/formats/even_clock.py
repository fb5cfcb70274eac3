"""Whether the times of samples step evenly, and by how much."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError

JITTER = 0.25
"""Share of a step by which a printed time may be off an even clock."""
GAP = 1.75
"""A step longer than so many others lacks samples."""
SAME = 0.01
"""Share of a step that rounding the rate may move the last sample by."""


def even_clock(
    times_s: Float[np.ndarray, " sample"], where: Callable[[int], str]
) -> tuple[float, float]:
    """Return the first time [s] and the rate [Hz] of samples.

    The rate is that of the straight line through all times, rounded as far as that
    moves none of them: what was printed with few digits is known better than a step.

    Args:
        times_s: When each sample was taken [s].
        where: Names the file and a sample, for messages.

    Raises:
        InputError: There are fewer than two; one is no number or not after the one
            before; some are missing; or one is off an even clock by `JITTER`.
    """
    if times_s.size < 2:
        raise InputError(
            f"{where(0)}: expected two samples at least, got {times_s.size}"
        )
    bad = np.flatnonzero(~np.isfinite(times_s))
    if bad.size:
        raise InputError(
            f"{where(int(bad[0]))}: expected a time, got {times_s[bad[0]]}"
        )
    steps = np.diff(times_s)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        at = int(back[0]) + 1
        twice = " (with too few digits?)" if steps[at - 1] == 0 else ""
        raise InputError(
            f"{where(at)}: expected a time after that of the sample before, "
            f"{times_s[at - 1]:.9g} s; got {times_s[at]:.9g} s{twice}"
        )
    step = float(np.median(steps))
    gap = int(np.argmax(steps))
    if steps[gap] > GAP * step:
        raise InputError(
            f"{where(gap + 1)}: expected a sample every {step:.6g} s, got a gap of "
            f"{steps[gap]:.6g} s after {times_s[gap]:.9g} s; cut the record there"
        )
    start, step = _line(times_s)
    off = np.abs(times_s - start - step * np.arange(times_s.size))
    worst = int(np.argmax(off))
    if off[worst] > JITTER * step:
        raise InputError(
            f"{where(worst)}: expected times {step:.6g} s apart, got "
            f"{times_s[worst]:.9g} s, {off[worst] / step:.2g} steps off; resample the "
            "record evenly"
        )
    if abs(times_s[0] - start) < SAME * step:
        start = float(times_s[0])
    return start, _round(1.0 / step, times_s.size)


def _line(times_s: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return intercept and slope of times against their number, by least squares."""
    number = np.arange(times_s.size) - 0.5 * (times_s.size - 1)
    first = float(times_s[0])
    since = times_s - first  # an epoch would lose digits
    slope = float(number @ since / (number @ number))
    return first + float(since.mean() + slope * number[0]), slope


def _round(rate_hz: float, samples: int) -> float:
    """Return the rate with as few digits as leave every sample where it is."""
    for digits in range(1, 16):
        rounded = float(f"{rate_hz:.{digits}g}")
        if abs(rounded / rate_hz - 1.0) * samples < SAME:
            return rounded
    return rate_hz
