r"""Effects that a record may contain next to one pulse: one row each of `EFFECTS`.

| effect | columns of the model |
|---|---|
| resonating | pulse through a damped oscillator, the sensor |
| later_arrival | a second pulse of the same form, a reflection |
| zero_shift | a step of the baseline at the front, or a relaxation (heat) |
| high_passed | pulse behind a first-order high-pass that nobody stated |

A row has prior odds, further searched unknowns with their priors, and columns. A linear
scan of the residuals of the best fit without the effect decides whether a search
begins, and where; the evidence decides the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jblast.signals.picks.preparation import BANK, Window
from jblast.signals.picks.pulse import (
    CONTINUED,
    CUBIC,
    PEAK,
    SUCTION,
    natural,
    primitive,
)

PER_SAMPLE = 4
"""Instants a sample at which the response of an oscillator is computed."""
LONGEST_RING = 512
"""Longest computed response behind the front [samples]."""
FAST_LENGTHS = sorted(k * 2**n for k in (4, 5, 6, 7) for n in range(5, 13))
"""Lengths of fast Fourier transforms."""
RING_FREQUENCIES = np.exp(np.linspace(np.log(0.09), np.log(2.8), 28))
"""Scanned angular frequencies [1/sample]: a sensor rings over 2 to 70 samples."""
RING_DECAY = 0.04
"""Decay of the scanned waves, over their angular frequency."""
LAGS = 48
"""Scanned lags of a later arrival."""
HIGH_PASS_REACH = 24.0
"""End of the window in which a high-pass is searched, in durations. A corner at the
inverse of the duration shortens the positive phase fivefold, so these are about 4.5
true durations."""
CORNERS = ((0.3, 1.0), (0.3, 1.3), (1.0, 2.0), (1.0, 4.0), (2.0, 3.0))
"""Starts of a high-pass: corner times duration, and factor on the duration."""
SHIFT_LENGTHS = (1.0, 0.2, 0.35, 0.6, 1.6)
"""Factors on the duration, from which a shift is searched: the drift may have taken the
step, and the length with it."""
INSTANT = 1e-3
"""Time of a step [samples]."""
HEAT_TIMES = np.array([0.2, 0.5, 1.2])
"""Scanned times in which the zero of a heated gauge shifts, over the duration."""
DRIFTING = 0.02
"""Drift that is a sign of a shift [share of the peak]: a smaller one changes duration
and impulse by less than the scatter of laws."""


@dataclass(frozen=True)
class Effect:
    """One row of the table.

    Attributes:
        name: Note of the pick.
        ln_odds: Prior odds against none.
        centre, spread: Prior means and standard deviations of its searched unknowns.
        heights: Those of its further columns [peaks].
        columns: Columns of the pulses with the effect.
        scan: Columns that it adds to first order: [trial, column, bin].
        starts: Unknowns from which a search begins, given the best trial of the scan.
        suspected: True for a sign that no scan shows.
        all_forms: True if all forms are tried with it; a ring hides the form, and the
            best form without it imitates the ring.
    """

    name: str
    ln_odds: float
    centre: tuple[float, ...] = ()
    spread: tuple[float, ...] = ()
    heights: tuple[float, ...] = ()
    columns: Callable = lambda window, columns, unknowns, rise, negative: columns
    scan: Callable = lambda window, best: None
    starts: Callable = lambda window, best, trial: None
    suspected: Callable = lambda best: False
    all_forms: bool = True

    @property
    def ln_width(self) -> float:
        """Ln of the prior density at the centre, up to powers of 2 pi."""
        return -float(np.sum(np.log(self.spread)))


def _ringing(window: Window, columns, unknowns, rise, negative):
    """Add the response of the oscillator to peak and suction, less the pulse itself."""
    before, behind = 24, int(min(window.ends[-1] + 0.5, LONGEST_RING))
    last = (before + behind) * PER_SAMPLE
    size = next(n for n in FAST_LENGTHS if n > 1.15 * last)
    instants = -before - 0.5 + np.arange(size + 1) / PER_SAMPLE
    fine = np.diff(primitive(unknowns, rise, negative, instants)[:, :2]) * PER_SAMPLE
    # the transform is periodic: fade to zero behind the last instant
    fine[..., last:] *= 0.5 + 0.5 * np.cos(np.pi * np.linspace(0, 1, size - last))
    omega = np.exp(unknowns[:, 5, None])
    damping = 1 / (1 + np.exp(-unknowns[:, 6, None]))
    w = 2 * np.pi * np.fft.rfftfreq(size, 1 / PER_SAMPLE)
    response = omega**2 / (omega**2 - w**2 + 2j * damping * omega * w) - 1
    added = np.fft.irfft(np.fft.rfft(fine) * response[:, None, :], size)
    sums = np.cumsum(added[..., :last], axis=-1) / PER_SAMPLE
    sums = np.concatenate([np.zeros((*sums.shape[:2], 1)), sums], axis=-1)
    at = np.round((window.ends + before + 0.5) * PER_SAMPLE).astype(int)
    columns[:, [PEAK, SUCTION]] += (
        np.diff(sums[..., np.clip(at, 0, last)]) / window.widths
    )
    return columns


def _ring_scan(window: Window, best):
    """Return damped sines and cosines from the front on."""
    since = window.middle - best.unknowns[0, 0]
    w = RING_FREQUENCIES[:, None]
    size = np.where(since >= -0.5, np.exp(-RING_DECAY * w * np.maximum(since, 0)), 0.0)
    size = size * np.sinc(w * window.widths / (2 * np.pi))
    return np.stack([size * np.cos(w * since), size * np.sin(w * since)], axis=1)


def _ring_starts(window: Window, best, trial):
    """Return starts at the scanned frequency: the visible front is late and steep."""
    omega, mine = RING_FREQUENCIES[trial], best.unknowns[0]
    gains = np.where(BANK.negative == CUBIC, window.record.gains, -1.0)
    return np.array(
        [
            [
                mine[0] - late / omega,
                *base[1:3],
                np.log(min(tau, 0.4 * np.exp(base[1]))),
                base[4],
                np.log(omega),
                -3.0,
            ]
            # lengths as fitted, or of the bank
            for base in (mine, BANK.unknowns[int(np.argmax(gains))])
            for late in (0.0, 0.8, 1.6)
            for tau in (0.7, 2.5, 6.0)
        ]
    )


def _second(window: Window, columns, unknowns, rise, negative):
    """Append peak and suction of a later pulse."""
    later = unknowns[:, :5].copy()
    later[:, 0] += np.exp(unknowns[:, 5])
    later[:, 1] += unknowns[:, 6]
    later[:, 3] += unknowns[:, 7]
    more = window.means(later, rise, negative)[:, [PEAK, SUCTION]]
    return np.concatenate([columns, more], axis=1)


def _lags(window: Window, best):
    tau = natural(best.unknowns[:1], best.rise[:1])[3][0]
    first = 1 + 0.4 * tau
    last = max(window.ends[-1] - 4, 2 * first)
    return np.exp(np.linspace(np.log(first), np.log(last), LAGS))


def _second_scan(window: Window, best):
    unknowns = np.repeat(best.unknowns[:1], LAGS, axis=0)
    unknowns[:, 0] += _lags(window, best)
    rise, negative = np.repeat(best.rise[:1], LAGS), np.repeat(best.negative[:1], LAGS)
    made = window.means(unknowns, rise, negative)
    return made[:, [PEAK]] + 0.3 * made[:, [SUCTION]]


def _second_starts(window: Window, best, trial):
    """Return starts near the scanned lag; the fitted rise may contain the wave."""
    mine, lag = best.unknowns[0], np.log(_lags(window, best)[trial])
    return np.array(
        [
            [*mine[:3], mine[3] + steeper, mine[4], lag + later, 0.0, slower]
            for steeper in (0.0, -0.8, -1.6)
            for later in (0.0, -0.4, 0.4)
            for slower in (0.0, 0.7)
        ]
    )


def _shift(window: Window, arrival, relaxation):
    """Return means of 1 - exp(-t/T), a shift of the zero within a time T."""
    since = np.maximum(window.ends - arrival[:, None], 0)
    late = relaxation[:, None]
    return (np.diff(since + late * np.expm1(-since / late)) / window.widths)[:, None]


def _heated(window: Window, columns, unknowns, rise, negative):
    relaxation = np.exp(unknowns[:, 5] + unknowns[:, 1])
    return np.concatenate([columns, _shift(window, unknowns[:, 0], relaxation)], axis=1)


def _step(window: Window, unknowns):
    return _shift(window, unknowns[:, 0], np.full(len(unknowns), INSTANT))


def _shift_starts(window: Window, best, trial):
    out = np.repeat(best.unknowns[:1, :5], 2 * len(SHIFT_LENGTHS), axis=0)
    out[:, 1] += np.log(np.tile(SHIFT_LENGTHS, 2))
    out[len(SHIFT_LENGTHS) :, 2] = 0.7
    out[:, 3] = np.minimum(out[:, 3], out[:, 1] + np.log(0.4))
    return out


def _heat_scan(window: Window, best):
    arrival = np.repeat(best.unknowns[0, 0], len(HEAT_TIMES))
    return _shift(window, arrival, np.exp(best.unknowns[0, 1]) * HEAT_TIMES)


def _heat_starts(window: Window, best, trial):
    starts = _shift_starts(window, best, trial)
    return np.column_stack([starts, np.full(len(starts), np.log(HEAT_TIMES[trial]))])


def _drifts(best):
    return 2 * abs(best.linear[0, -3] + best.linear[0, -1]) > (
        DRIFTING * best.linear[0, PEAK]
    )


def through_high_pass(ends, columns, corner):
    """Return columns behind a first-order high-pass, exact for steps over bins.

    Args:
        ends: Ends of the bins [sample].
        columns: Means over them, [trial, column, bin].
        corner: Angular frequency of the corner of each trial [1/sample].
    """
    corner = corner[:, None, None]
    far = 300 / corner
    start, stop = (np.clip(of, -far, far) for of in (ends[:-1], ends[1:]))
    steps = columns * (np.exp(corner * stop) - np.exp(corner * start))
    before = (np.cumsum(steps, axis=-1) - steps) * np.exp(-corner * start)
    angle = corner * np.diff(ends)
    left = -np.expm1(-angle) / angle
    return columns * left - before * left


def _passed(window: Window, columns, unknowns, rise, negative):
    corner = np.exp(unknowns[:, 5] - unknowns[:, 1])
    return through_high_pass(window.ends, columns, corner)


def _passed_scan(window: Window, best):
    """Return what corners remove from the pulse."""
    unknowns, rise, negative = best.unknowns[:1], best.rise[:1], best.negative[:1]
    pulse = window.means(unknowns, rise, negative)
    pulse = np.einsum("kc,kcn->kn", best.linear[:1, : pulse.shape[1]], pulse)[:, None]
    corners = np.exp(-unknowns[0, 1]) * np.array([0.1, 0.3, 1.0])
    return np.concatenate(
        [through_high_pass(window.ends, pulse, np.array([c])) - pulse for c in corners]
    )


def _passed_starts(window: Window, best, trial):
    mine, out = best.unknowns[0, :5], []
    b = np.expm1(mine[2])
    for corner, longer in CORNERS:
        ln_b = np.log(max(longer * (1 + b - corner), 1.1))
        ln_corner = np.log(corner * longer)
        out.append([mine[0], mine[1] + np.log(longer), ln_b, *mine[3:], ln_corner])
    return np.array(out)


NOTHING = Effect("", 0.0)
EFFECTS = (
    Effect(
        "resonating",
        ln_odds=np.log(1 / 20),
        centre=(np.log(0.7), -3.0),  # ln angular frequency, logit of the damping
        spread=(1.0, 1.0),
        columns=_ringing,
        scan=_ring_scan,
        starts=_ring_starts,
        all_forms=False,
    ),
    Effect(
        "later_arrival",
        ln_odds=np.log(1 / 300),
        centre=(3.5, 0.0, 0.0),  # ln lag, ln factors on duration and rise
        spread=(1.5, 0.3, 0.7),
        heights=(0.7, 0.2),
        columns=_second,
        scan=_second_scan,
        starts=_second_starts,
    ),
    Effect(
        "zero_shift",
        ln_odds=np.log(1 / 20),
        heights=(0.1,),
        columns=lambda window, columns, unknowns, rise, negative: np.concatenate(
            [columns, _step(window, unknowns)], axis=1
        ),
        scan=lambda window, best: _step(window, best.unknowns[:1]),
        starts=_shift_starts,
        suspected=_drifts,
    ),
    # the zero of a heated gauge: the same note
    Effect(
        "zero_shift",
        ln_odds=np.log(1 / 300),
        centre=(np.log(0.5),),  # ln of the time of the shift over the duration
        spread=(0.7,),
        heights=(0.3,),
        columns=_heated,
        scan=_heat_scan,
        starts=_heat_starts,
    ),
)
HIGH_PASSED = Effect(
    "high_passed",
    ln_odds=np.log(1 / 10),
    centre=(np.log(0.3),),  # ln of corner times duration
    spread=(1.5,),
    columns=_passed,
    scan=_passed_scan,
    starts=_passed_starts,
    # the formula that continues below zero looks like any other pulse behind one
    suspected=lambda best: best.negative[0] == CONTINUED,
)
