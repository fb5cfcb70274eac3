r"""Preparation of a record for the fit: front, noise, bins, clipped samples, start.

**Front.** The largest step between the means of $w$ samples behind and before an
instant is the front, for $w = 1, 2, 4 \ldots$ Steps of each width are divided by their
own size in the record, since long means of coloured noise step more than those of white
noise. (It is the energy ratio of STA/LTA, Allen 1978, with a sign.) An earlier step is
the front if it is clear, too, because a reflection may be larger. Means of half the
width place the front within the step: a mean that is longer than the pulse contains all
of it from several instants on.

**Bins.** The record is averaged over bins: single samples near the front and wider ones
away from it, the same for all records. A pulse changes at a time $x$ behind its front
over about $x$, so thousands of samples become two hundred numbers that contain nearly
as much. Means of the model over a bin are exact. Sample $i$ covers $i - 1/2$ to $i +
1/2$.

**Noise** is a Gaussian process: white noise plus relaxations $v_k e^{-|t|/T_k}$ of time
constants $T_k = 1, 3, 9 \ldots$ samples, whose sum describes any smooth spectrum
(flicker noise is a sum of relaxations). Its covariance over the bins is therefore a sum
of constant matrices. The powers $v_k$ are the most probable ones given the variances of
second differences of means of $s = 1, 2, 4 \ldots$ quiet samples, which a linear drift
does not enter.
"""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from jaxtyping import Float, Int

from jblast.signals.picks.pulse import (
    CENTRE,
    CONTINUED,
    CUBIC,
    NONE,
    SMOOTH,
    SUCTION,
    primitive,
)

LONGEST = 65536
"""Longest record [samples]."""
SINGLE_BEFORE, SINGLE_BEHIND = 24, 96
GROWTH_BEFORE, GROWTH_BEHIND = 0.2, 0.05
"""Number of single samples next to the front, and the width of farther bins over their
distance from it. A pulse changes over its own age, of which a twentieth is a small
part; before the front only the drift changes."""
RELAXATIONS = 3.0 ** np.arange(8)
"""Time constants of the noise [samples]."""
SMOOTHNESS = 0.5
"""Weight of the prior that neighbouring relaxations are equally strong [degrees of
freedom]. The slowest rest on two degrees of freedom, so that chance alone would leave a
quarter of the slow noise in one record of five."""
NOISE_STEPS = 80
"""Steps of the iteration for the powers, far beyond convergence of the sum."""
LEAST_QUIET = 24
"""Smallest number of samples before the front that identify the colour of the noise.
With fewer it is taken as white, and the pick has a note."""
LEAST_SIGMA = 1e-9
"""Smallest noise [share of the largest sample]: well above rounding, so that records
without noise have finite weights, and far below any recorder's."""
FREE_SHARE = 0.35
"""Share of a record that is taken as free of the pulse: the quantile of the steps that
states their size in the noise."""
LARGEST_WIDTH = 2048
LEVEL_PARTS = 64
"""Longest mean on either side of a step [samples]; parts of a record, the first of
which states the initial level."""
EARLIER_STEP_SD, STEP_SHARE = 12.0, 0.3
"""Size of an earlier step that is the front, over the rms of the steps before it (of
thousands of steps of noise the largest is 5, more in coloured noise) and over the
largest step (a reflection is at most several times larger than its incident front)."""
BEFORE_DURATIONS, LEAST_BEFORE = 1.5, 64
BEHIND_DURATIONS, LEAST_BEHIND = 4.5, 48
"""Fitted interval before and behind the front: in durations, and at least in samples.
The positive phase and the negative phase of the prior (2.4 durations) end at 3.4, one
standard deviation longer at 5; a longer interval has more drift than pulse."""
INSTANT = 0.1
"""Interval over which a sample at an instant is averaged [samples]: short, and
differences of antiderivatives stay exact."""
CLIPPED_FROM = 0.999
"""Share of the full scale from which on a sample is clipped: the largest code of a
converter is slightly below the scale, by 2^-15 for 16 bits."""
IN_A_ROW = 3
"""Equal samples in a row at the extreme that are clipped without a stated full scale.
Two are equal by chance in records of few bits."""
FLAT_SAMPLES, FLAT_RATIO = 8, 4.0
"""Equal samples in a row at the maximum that are clipped below the full scale, as by an
amplifier, and smallest ratio of their number to that at the next lower value. Noise of
a few codes makes three or four; in a pulse of 8 bits both values are about as
frequent."""
LEAST_SUCTION = 0.03
"""Smallest depth of a floor of clipped samples, over the height of the record: a
shallower one is the quiet part in few bits."""
LOST = 1e4
"""Variance of a bin with clipped samples, whose mean is no value [share squared]."""


def _ends(single, growth):
    ends = list(range(single + 1))
    while ends[-1] < LONGEST:
        ends.append(ends[-1] + max(1, round(growth * ends[-1])))
    return np.array(ends)


EDGES = np.concatenate(
    [
        -_ends(SINGLE_BEFORE, GROWTH_BEFORE)[:0:-1],
        _ends(SINGLE_BEHIND, GROWTH_BEHIND),
    ]
)
FIRST, WIDTH = EDGES[:-1], np.diff(EDGES)
ENDS, MIDDLE = EDGES - 0.5, FIRST + 0.5 * (WIDTH - 1)


def _mean_covariance(rho, first, width):
    """Return the covariance of means over bins of a relaxation of unit power."""
    inner = -np.expm1(width * np.log(rho)) / (1 - rho) / width
    gap = np.maximum(first[None, :] - (first + width - 1)[:, None], 0)
    upper = np.triu(rho**gap * np.outer(inner, inner), 1)
    own = ((1 + rho) / (1 - rho) - 2 * rho * inner / (1 - rho)) / width
    return upper + upper.T + np.diag(own)


RHO = np.exp(-1 / RELAXATIONS)
KERNELS = np.array(
    [np.diag(1 / WIDTH), *(_mean_covariance(rho, FIRST, WIDTH) for rho in RHO)]
)
"""Covariance over bins of white noise and of each relaxation."""
SCALES = 2 ** np.arange(14)


def _difference_variances(size):
    """Return the variance of a second difference of means by each process."""
    triples = (
        _mean_covariance(rho, np.arange(3) * size, np.full(3, size)) for rho in RHO
    )
    return [6 / size, *(6 * c[0, 0] - 8 * c[0, 1] + 2 * c[0, 2] for c in triples)]


DIFFERENCES = np.array([_difference_variances(size) for size in SCALES])
# differences at neighbouring instants overlap; 1.7 sizes count as one, by simulation
_OVERLAP = 1.7


def noise_powers(quiet: Float[np.ndarray, " sample"]) -> Float[np.ndarray, " process"]:
    """Return the powers of white noise and of each relaxation in quiet samples."""
    n = quiet.size
    sums = np.append(0.0, np.cumsum(quiet - quiet.mean()))
    seen, freedom = [], []
    for size in SCALES[n // 4 >= SCALES]:
        mean = (sums[size:] - sums[:-size]) / size
        second = mean[: -2 * size] - 2 * mean[size:-size] + mean[2 * size :]
        seen.append(np.mean(second * second) + 6 / size * LEAST_SIGMA**2)
        freedom.append(max(second.size / (_OVERLAP * size), 1.0))
    seen, freedom = np.array(seen), np.array(freedom)
    by_process = DIFFERENCES[: seen.size]
    powers = np.full(by_process.shape[1], seen[0] / 6 / by_process.shape[1])
    weak = SMOOTHNESS / (SMOOTHNESS + n / (_OVERLAP * RELAXATIONS))
    # maximum likelihood of Gamma variances by multiplicative steps
    for _ in range(NOISE_STEPS):
        expected = by_process @ powers
        up = (freedom * seen / expected**2) @ by_process
        powers = powers * np.sqrt(up / ((freedom / expected) @ by_process))
        above, below = np.append(powers[2:], powers[-1]), powers[[1, *range(1, 8)]]
        powers[1:] += weak * (0.5 * (above + below) - powers[1:])
    return powers


def first_front(x: Float[np.ndarray, " sample"]) -> int:
    """Return the first sample behind the first clear step."""
    n = x.size
    widest = np.log2(min(max(n // 8, 1), LARGEST_WIDTH))
    widths = 2 ** np.arange(int(widest) + 1)
    pad, many = widths[-1], max(n // LEVEL_PARTS, 1)
    sums = np.pad(np.append(0.0, np.cumsum(x - x[0])), pad, mode="edge")
    level, here = sums[pad + many] / many, sums[pad : pad + n]
    normal = NormalDist().inv_cdf(0.5 + FREE_SHARE / 2)
    steps, sizes = np.zeros((widths.size, n)), []
    for row, w in zip(steps, widths, strict=True):
        ahead = sums[pad + w : pad + w + n] - here
        back = here - sums[pad - w : pad - w + n]
        inside, scale = slice(w, n - w + 1), np.sqrt(2 * w)
        row[inside] = (ahead - np.maximum(back, w * level))[inside] / scale
        free = np.quantile(np.abs(ahead - back)[inside], FREE_SHARE)
        sizes.append(free / normal / scale)
    least = max(min(sizes), 1e-9 * np.abs(x).max() + 1e-300)
    steps /= np.maximum(sizes, least)[:, None]
    row, at = np.unravel_index(np.argmax(steps), steps.shape)
    wide = widths[:, None]
    for _ in range(2):
        before = (np.arange(n) < at - 2 * wide) & (wide <= widths[row])
        early = np.where(before, steps, 0.0)
        k, i = np.unravel_index(np.argmax(early), steps.shape)
        quiet = steps[k, : max(i - 2 * widths[k], 0)]
        rms = np.sqrt(np.mean(quiet**2)) if quiet.size >= 16 else 0.0
        least = max(EARLIER_STEP_SD * rms, STEP_SHARE * steps[row, at])
        if rms and early[k, i] > least:
            row, at = k, i
    # a mean longer than the pulse holds it all from several instants on
    first, narrower = max(at - widths[row], 0), max(row - 1, 0)
    return int(first + np.argmax(steps[narrower, first : at + widths[row]]))


def clipped_samples(
    x: Float[np.ndarray, " sample"], full_scale: float | None
) -> Float[np.ndarray, " sample"]:
    """Return +1 where a sample is a lower bound, -1 where an upper one, else 0."""
    if full_scale:
        level = CLIPPED_FROM * _clipping_level(x, full_scale)
        return (x >= level) * 1.0 - (x <= -level) * 1.0
    out, top, low = np.zeros(x.size), x.max(), x.min()
    deep = x[0] - low > LEAST_SUCTION * (top - x[0])
    for sign, extreme, counts in ((1, top, top > x[0]), (-1, low, deep)):
        equal = (x == extreme) & counts
        out += sign * equal * (_longest_run(equal) >= IN_A_ROW)
    return out


def _longest_run(flags) -> int:
    """Return the largest number of true values in a row."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _clipping_level(x, full_scale: float) -> float:
    """Return the level at which an amplifier clips, or the full scale."""
    top = x.max()
    flat = x == top
    if not 0 < top < full_scale or flat.all():
        return full_scale
    often = flat.sum() > FLAT_RATIO * (x == x[~flat].max()).sum()
    return top if _longest_run(flat) >= FLAT_SAMPLES and often else full_scale


# durations, ln(1 + b), rises over the duration and negative phases of the bank
_DURATIONS = 3 * 1.3 ** np.arange(40)
_MEMBERS = [
    *(
        (duration, ln_b, rise * duration, negative)
        for duration in _DURATIONS
        for ln_b in (0.3, 1.25)
        for rise in (0.0, 0.25)
        for negative in (CUBIC, NONE)
    ),
    # the smaller the decay, the deeper and longer these stay below zero
    *(
        (duration, np.log1p(b), 0.0, CONTINUED)
        for duration in _DURATIONS
        for b in (0.2, 0.5, 1.2, 3.0)
    ),
]


@dataclass(frozen=True)
class Bank:
    """Pulses over all bins with their matched filters.

    Attributes:
        unknowns: Searched unknowns of each.
        negative: Negative phase of each.
        filters: Filters that return the peak of each, free of a linear drift.
        energy: Sum of squares of each for a peak of 1.
    """

    unknowns: Float[np.ndarray, "member 5"]
    negative: Int[np.ndarray, " member"]
    filters: Float[np.ndarray, "member bin"]
    energy: Float[np.ndarray, " member"]


def _bank() -> Bank:
    duration, ln_b, rise, negative = np.array(_MEMBERS).T
    zero, negative = np.zeros_like(duration), negative.astype(int)
    unknowns = np.stack(
        [
            zero - 0.5,
            np.log(duration),
            ln_b,
            np.log(np.maximum(rise, 0.7)),
            zero + CENTRE[4],
        ],
        axis=1,
    )
    made = primitive(unknowns, np.full(zero.size, SMOOTH), negative, ENDS)
    shapes = np.diff(made[:, 0] + 0.3 * made[:, SUCTION]) / WIDTH
    filters, energy = np.zeros_like(shapes), zero.copy()
    for k, (shape, long) in enumerate(zip(shapes, duration, strict=True)):
        weight = WIDTH * ((-max(1.5 * long, 16) < MIDDLE) & (4 * long > MIDDLE))
        line = np.stack([np.ones_like(MIDDLE), MIDDLE / long])
        fitted = np.linalg.solve((line * weight) @ line.T, (line * weight) @ shape)
        left = shape - fitted @ line
        energy[k] = np.sum(weight * left * left)
        filters[k] = weight * left / energy[k]
    return Bank(unknowns, negative, filters, energy)


BANK = _bank()


class Prepared:
    """Samples as shares of the largest, in bins about the front, with their noise.

    Attributes:
        samples: The shares.
        clipped: As by `clipped_samples`.
        high_pass: Corner of the recorder's first-order high-pass [1/sample], or None.
        front: First sample behind the front.
        offset, scale: Zero and one of the shares, in the record's unit.
        quiet: Number of quiet samples.
        known: True if they identify the colour of the noise.
        powers: Powers of the noise.
        sigma: Standard deviation of a sample.
        gains: Reduction of the sum of squares by each member of the bank.
    """

    def __init__(self, samples, full_scale=None, clipped=None, high_pass=None):
        x = np.asarray(samples, float)
        given = clipped is None
        self.clipped = clipped_samples(x, full_scale) if given else clipped
        self.high_pass = high_pass
        self.front = first_front(x)
        self.offset = x[: max(self.front - 2, 1)].mean()
        self.scale = np.abs(x - self.offset).max() or 1.0
        self.samples = (x - self.offset) / self.scale
        self.binned = self._means(self.samples)
        held, some = self._means(self.clipped), self._means(np.abs(self.clipped))
        # bins of clipped samples alone are bounds; mixed ones are lost
        self.bound = np.where(np.abs(held) > 1 - 1e-6, np.sign(held), 0.0)
        self.lost = some > 0
        peak = BANK.filters @ self.binned
        fits = (peak > 0) & (np.exp(BANK.unknowns[:, 1]) < x.size)
        self.gains = np.where(fits, peak**2 * BANK.energy, 0.0)
        start = BANK.unknowns[int(np.argmax(self.gains))]
        before = 3 + 1.5 * np.exp(start[3]) + 0.02 * np.exp(start[1])
        self.quiet = max(self.front - int(before), self.front // 2)
        self._measure_noise(self.samples[: self.quiet])

    def _means(self, x):
        """Return the means over bins, beyond the record those of its first or last."""
        ends = self.front + EDGES
        at = np.clip(ends, 0, x.size)
        means = np.diff(np.append(0.0, np.cumsum(x))[at]) / WIDTH
        # a single sample is exact, the difference of two sums is not
        means = np.where(WIDTH == 1, x[np.minimum(at[:-1], x.size - 1)], means)
        within = np.flatnonzero((ends[:-1] >= 0) & (ends[1:] <= x.size))
        return means[np.clip(np.arange(WIDTH.size), within[0], within[-1])]

    def _measure_noise(self, quiet):
        self.known = quiet.size >= LEAST_QUIET
        if self.known:
            self.powers = noise_powers(quiet)
        else:
            # white, by differences of neighbours without those of the pulse itself
            squares = np.square(np.diff(self.samples))
            for _ in range(3):
                squares = squares[squares <= 9 * squares.mean()]
            self.powers = np.append(0.5 * squares.mean(), np.zeros(RHO.size))
        steps = np.abs(np.diff(self.samples))
        bit = steps[steps > 0].min() if steps.any() else 0.0
        self.powers[0] += bit**2 / 12 + LEAST_SIGMA**2
        self.sigma = float(np.sqrt(self.powers.sum()))

    def best_member(self, longest=np.inf) -> int:
        """Return the best pulse of the bank up to a duration."""
        short = np.exp(BANK.unknowns[:, 1]) <= longest
        return int(np.argmax(np.where(short, self.gains, -1.0)))

    def start_duration(self, longest=np.inf) -> float:
        """Return its duration [samples]."""
        return float(np.exp(BANK.unknowns[self.best_member(longest), 1]))

    def slow_variance(self, samples) -> float:
        """Return the variance of a sum of samples, less the mean of the quiet ones."""
        power = self.powers[0]
        power += np.sum(self.powers[1:] * (1 + RHO) / (1 - RHO))
        return float(power * (samples + samples**2 / max(self.quiet, 1)))

    def window(self, duration, reach=BEHIND_DURATIONS) -> "Window":
        """Return the whitened bins about a pulse of a duration.

        Args:
            duration: The duration [samples].
            reach: End of the window behind the front, in durations.
        """
        last = self.front + max(reach * duration, LEAST_BEHIND)
        last = min(last, self.samples.size)
        first = self.front - max(BEFORE_DURATIONS * duration, LEAST_BEFORE)
        inside = (self.front + FIRST >= max(first, 0)) & (
            self.front + FIRST + WIDTH <= last
        )
        start, stop = np.flatnonzero(inside)[[0, -1]] + [0, 1]
        return Window(self, duration, slice(start, stop))


class Window:
    """Bins of a record, whitened.

    Attributes:
        record: The record.
        duration: Duration of the pulses that it is for [samples].
        ends, widths, middle: The bins, in samples from the front.
        values: Their means.
        held: +1 where all samples of a bin are lower bounds, -1 upper bounds, else 0.
        whitener: Inverse of the Cholesky factor of the covariance of the noise.
        data: Whitened values.
        line: Powers 0 to 3 of the time, scaled to -1 to 1: the drift.
        drift: Whitened drift.
        count: Number of bins with a value.
        peak: About the peak of the pulse, for priors in peaks.
    """

    def __init__(self, record: Prepared, duration: float, use: slice):
        self.record, self.duration, self.peak = record, duration, 1.0
        self.ends = ENDS[use.start : use.stop + 1]
        self.widths, self.middle = WIDTH[use], MIDDLE[use]
        self.values, self.held = record.binned[use], record.bound[use]
        lost = record.lost[use]
        covariance = np.tensordot(record.powers, KERNELS[:, use, use], 1)
        covariance[np.diag_indices_from(covariance)] += LOST * lost
        self.whitener = np.linalg.inv(np.linalg.cholesky(covariance))
        half = 0.5 * (self.ends[-1] - self.ends[0])
        z = (self.middle - self.ends[0]) / half - 1
        self.line = np.stack([z**k for k in range(4)])
        self.data = self.whitener @ self.values
        self.drift = self.line @ self.whitener.T
        self.count = int(np.sum(~lost))
        near = np.abs(self.middle) <= 2
        self.front_held = bool(np.any(self.held[near]))

    def means(self, unknowns, rise, negative, instants=False):
        """Return the columns of pulses over the bins; samples may be instants."""
        if not instants:
            return np.diff(primitive(unknowns, rise, negative, self.ends)) / self.widths
        widths = np.where(self.widths == 1, INSTANT, self.widths)
        ends = (self.middle + np.array([[-0.5], [0.5]]) * widths).T
        made = np.diff(primitive(unknowns, rise, negative, ends.ravel()))
        return made[..., ::2] / widths
