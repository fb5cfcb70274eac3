"""Pressure records past what a pick can tell: noise, rates, drift, echoes, clipping.

Six gauges about 15 kg, five times. A pick *fails* where arrival, peak, duration or
impulse is off by more than `FAR` of the standard deviations that it tells itself, or
where it finds nothing; it is *marked* where it is not called good.
"""

import functools
from collections.abc import Callable, Sequence

import numpy as np

from jblast.verification.cases.far_off_picks import FAR, Shares, shares_of
from jblast.verification.cases.pressure_records import (
    BEHIND,
    Recorder,
)
from jblast.verification.stability.failure import FailureMode, verified

AREA = "records"
SHARE = 0.05
"""Where more picks fail, the method does."""
CLEAR = 100.0
"""Peak over noise of the rows that are not about noise."""

SNRS = (1000.0, 100.0, 30.0, 10.0, 7.0, 5.0, 4.0, 3.0, 2.0)
COLOUR = 0.7
RISES = (30.0, 10.0, 3.0, 0.3, 0.03)
PER_PHASE = (80.0, 20.0, 12.0, 8.0, 6.0, 4.0, 2.0)
"""Samples of a positive phase."""
FEW = 600
"""Samples of these records, quiet before the front for the rest."""
PERIODS = (20.0, 10.0, 7.0, 4.0, 2.0)
"""Of a baseline that moves to and fro [durations]."""
WANDER = 0.1
DELAYS = (0.7, 0.4, 0.1, 0.05, 0.02, 0.01)
"""Of an echo [durations]."""
ECHO, ECHO_RISE = 0.3, 4.0
LEFT = (1.0, 0.9, 0.7, 0.5, 0.2, 0.05)
"""Where records are clipped, shares of the peak."""
SAMPLES_PER_PHASE = 146
"""Of records of 1,024 samples."""


def record_failures() -> list[FailureMode]:
    """Measure every failure mode."""
    return [
        _noise(),
        _coloured(),
        _rise(),
        _rate(),
        _wander(),
        _echo_delay(),
        _clipping(),
    ]


@functools.cache
def noise_shares(colour: float = 0.0) -> Shares:
    """Return how many picks fail, by `SNRS`.

    Args:
        colour: Share of the noise of a sample that the next one has.
    """
    return shares_of([Recorder(snr=snr, colour=colour) for snr in SNRS])


def _row(
    method: str,
    levels: Sequence[float],
    shares: Shares,
    unit: str,
    *,
    words: Callable[[float], str],
    most_unmarked: float = SHARE,
    message: str = "",
) -> FailureMode:
    """Return the mode of picks that fail from a level on.

    Args:
        method: What is measured.
        levels: From harmless to hopeless.
        shares: By level.
        unit: Of the levels.
        words: A level in words.
        most_unmarked: Share that may be far off and called good.
        message: What is said where picks fail.
    """
    bad = shares.failed > SHARE
    first = int(np.argmax(bad)) if bad.any() else len(levels) - 1
    worst = int(np.argmax(shares.failed))
    unmarked = int(np.argmax(shares.unmarked))
    seen = bool(shares.unmarked.max() <= most_unmarked)
    ends = (
        f"{shares.failed[worst]:.0%} at {words(levels[worst])}"
        if bad.any()
        else f"nothing fails: {shares.failed.max():.0%} at most"
    )
    return FailureMode(
        area=AREA,
        method=method,
        failure=f"over {SHARE:.0%} of picks are lost, or off by {FAR:g} of their sd",
        boundary=float(levels[first]),
        unit=unit,
        beyond=ends,
        response=verified("marks" if bad.any() else "holds", seen, method),
        message=f"{message}far off and called good: {shares.unmarked[unmarked]:.0%} at "
        f"most, at {words(levels[unmarked])}",
    )


def _noise() -> FailureMode:
    return _row(
        "pick, white noise",
        SNRS,
        noise_shares(),
        "peak over noise, and less",
        words=lambda snr: f"{snr:g}",
    )


def _coloured() -> FailureMode:
    return _row(
        f"pick, noise of which each sample has {COLOUR:g} of the last",
        SNRS,
        noise_shares(COLOUR),
        "peak over noise, and less",
        words=lambda snr: f"{snr:g}",
    )


def _rise() -> FailureMode:
    shares = shares_of([Recorder(snr=CLEAR, rise=rise) for rise in RISES])
    return _row(
        f"pick, front that rises in {RISES[-1]:g} to {RISES[0]:g} samples",
        RISES,
        shares,
        "samples",
        words=lambda rise: f"{rise:g} samples",
    )


def _rate() -> FailureMode:
    recorders = []
    for count in PER_PHASE:
        rise, before = min(1.0, count / 10.0), FEW / count - BEHIND
        recorders.append(Recorder(snr=CLEAR, rise=rise, samples=FEW, before=before))
    return _row(
        "pick, ever fewer samples",
        PER_PHASE,
        shares_of(recorders),
        "samples a positive phase",
        words=lambda count: f"{count:g}",
        message="under-sampled is said of fewer than 8, and the onset told where no "
        "pulse fits; ",
    )


def _wander() -> FailureMode:
    recorders = [
        Recorder(snr=CLEAR, wander=WANDER, wander_period=period) for period in PERIODS
    ]
    return _row(
        f"pick, a baseline to and fro by {WANDER:.0%} of the peak",
        PERIODS,
        shares_of(recorders),
        "durations a period, and less",
        words=lambda period: f"{period:g} durations",
    )


def _echo_delay() -> FailureMode:
    recorders = [
        Recorder(snr=CLEAR, echo=delay, echo_size=ECHO, echo_rise=ECHO_RISE)
        for delay in DELAYS
    ]
    return _row(
        f"pick, an echo of {ECHO:g} within the positive phase",
        DELAYS,
        shares_of(recorders),
        "durations behind the front, and less",
        words=lambda delay: f"{delay * SAMPLES_PER_PHASE:.0f} samples behind",
    )


def _clipping() -> FailureMode:
    recorders = [
        Recorder(snr=CLEAR, full_scale=left if left < 1.0 else None) for left in LEFT
    ]
    return _row(
        "pick of a clipped record",
        LEFT,
        shares_of(recorders),
        "of the peak is left",
        words=lambda left: f"{left:g}",
        message="clipped samples are bounds; ",
    )
