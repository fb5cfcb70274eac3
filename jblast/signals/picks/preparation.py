r"""Preparation of a record for the fit: front, noise, bins, start, clipped samples.

The front is the largest step between the means of $w$ samples behind and before an
instant, in standard deviations of white noise,
$D_w = \sqrt{w/2}\,(\bar p_{[k, k+w)} - \bar p_{[k-w, k)})$. It is the energy ratio of
STA/LTA (Allen 1978) with a sign, which drift and hum hardly change, for many $w$: short
widths detect short pulses, long ones faint long pulses. An earlier step is the front if
it is clear, too, because a reflection from a wall may be larger.

The samples before the front, less a parabola, are modelled by an autoregression,
$n_i + \sum_k f_k n_{i-k} = e_i$ with $e$ white, by Burg's recursion (1975, "Maximum
entropy spectral analysis", Stanford), which is stable and suits few samples. Reflection
coefficients below $2.5/\sqrt{n}$, which white noise has as easily, are zero: white
noise stays exactly white. With fewer than `LEAST_QUIET` samples before the front the
noise is taken as white, with the size of the differences of neighbouring samples, and
the pick is marked.

The record is averaged in bins: single samples at the front, wider ones away from it.
A pulse changes a time $x$ behind its front over about $x$, so means over a share of $x$
keep nearly all information of single samples, and thousands of samples become two
hundred numbers. This is no approximation, since the model's means over a bin are exact
(`waves/pulse.py`). Bins are the same for all records, counted in samples from
the front; sample $i$ covers $i - 1/2$ to $i + 1/2$.

The fit begins at the best of a bank of pulses. Each has unit peak and the suction of
the prior means, minus the line that fits it best over its own interval, so that one
matrix product with the record gives the peak of each member and its reduction of the
sum of squares.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jblast.signals.picks.unknowns import CENTRE, Form

FITTED_DURATIONS = 4.5
"""Length of the fitted interval behind the front, in positive phase durations. The
positive and the prior's negative phase (2.4 durations) end at 3.4, one standard
deviation longer at 5; a longer interval has more drift than pulse."""
LONGER_FACTOR = 24.0 / FITTED_DURATIONS
"""Ratio of the interval in which a high-pass is searched to the fitted one. A corner at
the inverse of the duration shortens the positive phase fivefold, so 24 apparent
durations are about 4.5 true ones."""
LEAST_REACH = 48
"""Shortest fitted interval behind the front [samples]: four for each of eleven
unknowns."""
SHORTER_SHARE = 0.5
"""Largest duration of a second start, over that of the first. A drift may be fitted as
a suction, and a pulse and its suction as one pulse three times as long."""
EARLIER_STEP_SD = 12.0
"""Size of an earlier step that counts as the front, over the rms of the steps before.
Steps of many widths at thousands of arrivals reach 5 by noise, more if it is coloured;
fronts of weaker pulses are found by the largest step."""
STEP_SHARE = 0.3
"""Smallest size of an earlier step that counts as the front, over the largest step.
A reflection is at most several times larger than its incident front."""
LARGEST_WIDTH = 2048
"""Longest mean on either side of a step [samples]: twelve widths in all."""
LEVEL_PARTS = 64
"""Number of parts of a record, the first of which gives the initial level."""
ORDER = 4
"""Order of the autoregression of the noise. Recorder noise (flicker, mains hum, one
resonance) needs two to four coefficients; more would not be significant in some tens of
quiet samples."""
LEAST_QUIET = 24
"""Smallest number of samples before the front that identify the colour of the noise:
six for each coefficient. With fewer the noise is taken as white, and a note is made."""
REFLECTION_SD = 2.5
"""Significance of a reflection coefficient [standard deviations for white noise].
White noise exceeds it in one coefficient of eighty."""
LEAST_SIGMA = 1e-9
"""Smallest noise [share of the largest sample]: well above rounding, so that records
without noise have finite weights, and far below any recorder's."""
SINGLE_BEFORE, SINGLE_BEHIND = 24, 96
"""Number of samples before and behind the front that are bins of their own: the trial
arrivals (`searches.ARRIVALS`) lie within them."""
GROWTH_BEFORE, GROWTH_BEHIND = 0.2, 0.05
"""Width of a bin over its distance from the front [-]. A pulse changes over its own
age, of which a twentieth is a small part; before the front only the drift changes."""
SHORTEST = 3.0
"""Duration of the shortest pulse of the bank [samples]."""
DURATION_RATIO = 1.3
"""Ratio of neighbouring durations of the bank: the best one is within 14 %, and the
search does the rest."""
BANK_DECAYS = (0.3, 2.5)
"""Decay coefficients of the bank, near the bounds 0.4 and 2.9 of laws (`unknowns`)."""
BANK_RISES = (0.0, 0.25)
"""Rises of the bank over the duration."""
CONTINUED_DECAYS = (0.2, 0.5, 1.2, 3.0)
"""Decay coefficients of members that continue below zero. These have no prior of the
suction: the smaller the decay, the deeper and longer they stay below zero."""
MEMBER_BEFORE, MEMBER_BEHIND = 1.5, 4.0
"""Extent of a member before and behind the front, in durations."""
CLIPPED_FROM = 0.999
"""Share of the full scale from which on a sample is clipped: the largest code of a
converter is slightly below the scale, by 2^-15 for 16 bits."""
IN_A_ROW = 3
"""Equal samples in a row at the extreme that count as clipped without a full scale.
Two are equal by chance in records of few bits; a recorder that clips for less than
three samples loses little."""
LEAST_SUCTION = 0.03
"""Smallest depth of a floor of clipped samples, over the height of the record: a
shallower one is the quiet part in few bits."""


class Noise(NamedTuple):
    r"""Noise of a record.

    Attributes:
        taps: Whitening filter $1, f_1, \ldots$.
        sigma: Standard deviation of the whitened noise $e$.
        marginal: Standard deviation of the noise itself.
        known: True if the quiet part was long enough.
        slope: Slope of the drift at the end of the quiet part, per sample.
    """

    taps: Float[Array, " tap"]
    sigma: Float[Array, ""]
    marginal: Float[Array, ""]
    known: Bool[Array, ""]
    slope: Float[Array, ""]


class Case(NamedTuple):
    """One record for the fit. Integers are stored as floats, which have a zero slope.

    Attributes:
        white: Whitened means, in standard deviations.
        weight: Square root of the number of samples over sigma; zero for unused bins.
        noise: Noise by which they were whitened.
        level: Absolute value of clipped bins [share of the largest].
        clipped: +1 where the pressure was at least the level, -1 at most minus it.
        span: Half length of the interval, for the drift [samples].
        middle: Its middle [samples].
        centre: Prior means of the unknowns.
        rings: 1 for a resonant sensor, else 0.
        follows: 1 for a further front, else 0.
        passed: 1 for a high-pass that was not specified, else 0.
        shifted: 1 for a step of the baseline at the front, else 0.
        form: Formulas of the pulse.
        high_pass: Specified corner of a high-pass [1/sample]; None without one.
        hold: Factor, minus 1, on the prior's residual of ln duration.
    """

    white: Float[Array, " bin"]
    weight: Float[Array, " bin"]
    noise: Noise
    level: Float[Array, " bin"]
    clipped: Float[Array, " bin"]
    span: Float[Array, ""]
    middle: Float[Array, ""]
    centre: Float[Array, " unknown"]
    rings: Float[Array, ""]
    follows: Float[Array, ""]
    passed: Float[Array, ""]
    shifted: Float[Array, ""]
    form: Form
    high_pass: Float[Array, ""] | None
    hold: Float[Array, ""]


class Front(NamedTuple):
    """A front as detected before the fit.

    Attributes:
        sample: The first sample behind it.
        width: Width $w$ of the largest step [samples].
        step: Step $D_w$ there, in the unit of the samples.
    """

    sample: Int[Array, ""]
    width: Int[Array, ""]
    step: Float[Array, ""]


class Prepared(NamedTuple):
    """A prepared record: the case, and the values used to make it.

    Attributes:
        case: The case over the fitted interval.
        whole: The same over an interval longer by `LONGER_FACTOR`.
        net: Net impulse over the longer one [share of the largest, samples].
        net_sd: Its standard deviation; infinite if the record ends within the fitted
            interval, which may contain too little of the tail.
        start: Starting point of the unknowns.
        shorter: That of a pulse shorter by `SHORTER_SHARE` or more.
        continued: That of a pulse that continues below zero.
        front: Detected front.
        offset: Offset subtracted from the samples.
        scale: Divisor of the samples after that.
        clipped_at: Largest size of a clipped sample [share of the largest].
    """

    case: Case
    whole: Case
    net: Float[Array, ""]
    net_sd: Float[Array, ""]
    start: Float[Array, " unknown"]
    shorter: Float[Array, " unknown"]
    continued: Float[Array, " unknown"]
    front: Front
    offset: Float[Array, ""]
    scale: Float[Array, ""]
    clipped_at: Float[Array, ""]


class Bank(NamedTuple):
    """Pulses among which a start is selected.

    Attributes:
        duration: Duration of each [samples].
        decay: Decay coefficient of each.
        rise: Rise of each [samples].
        continued: 1 for those whose decay continues below zero, 0 for the others.
        filters: Matrix that gives the peak of each from the means over bins.
        energy: Reduction of the weighted sum of squares by each, over peak squared.
    """

    duration: Float[np.ndarray, " member"]
    decay: Float[np.ndarray, " member"]
    rise: Float[np.ndarray, " member"]
    continued: Float[np.ndarray, " member"]
    filters: Float[np.ndarray, "member bin"]
    energy: Float[np.ndarray, " member"]


class Bins(NamedTuple):
    """Bins of samples, counted from the sample of the front.

    Attributes:
        first: First sample of each.
        width: Number of samples of each.
    """

    first: Int[np.ndarray, " bin"]
    width: Int[np.ndarray, " bin"]

    @property
    def start(self) -> Float[np.ndarray, " bin"]:
        """Start of each [samples]."""
        return self.first - 0.5

    @property
    def stop(self) -> Float[np.ndarray, " bin"]:
        """End of each [samples]."""
        return self.first + self.width - 0.5

    @property
    def ends(self) -> Float[np.ndarray, " end"]:
        """Starts of all, then the end of the last one [samples]."""
        return np.append(self.start, self.stop[-1])

    @property
    def middle(self) -> Float[np.ndarray, " bin"]:
        """Middle of each [samples]."""
        return self.first + 0.5 * (self.width - 1)

    @property
    def single(self) -> slice:
        """Slice of the bins of one sample, which are contiguous about the front."""
        ones = np.flatnonzero(self.width == 1)
        return slice(int(ones[0]), int(ones[-1]) + 1)

    def means_by(self, at_ends: Float[Array, "row end"]) -> Float[Array, "row bin"]:
        """Return means over contiguous bins by antiderivatives at `ends`."""
        width = self.width.astype(at_ends.dtype)
        return (at_ends[:, 1:] - at_ends[:, :-1]) / width[None, :]


def prepared(
    bins: Bins,
    bank: Bank,
    samples: Float[Array, " sample"],
    clipped: Float[Array, " sample"],
    count: Int[Array, ""],
    high_pass: Float[Array, ""] | None,
    longest: Float[ArrayLike, ""] = np.inf,
) -> Prepared:
    """Prepare a record for the fit.

    Args:
        bins: Bins about the front.
        bank: Pulses among which the start is selected.
        samples: Overpressure, finite.
        clipped: +1 where a sample is a lower bound, -1 an upper one, else 0.
        count: Number of samples of the record, whose last one is repeated behind it.
        high_pass: Corner of a first-order high-pass [1/sample].
        longest: Duration of the longest pulse of a start [samples].
    """
    front = first_front(lax.stop_gradient(samples - samples[0]))
    offset = _mean_of_first(samples, jnp.maximum(front.sample - 2, 1))
    moved = samples - offset
    scale = jnp.max(jnp.abs(moved))
    scale = jnp.where(scale > 0, scale, 1.0)
    share = moved / scale
    means = means_in_bins(bins, share, front.sample)
    start, duration = start_of(bank, lax.stop_gradient(means), longest)
    shorter, _ = start_of(bank, lax.stop_gradient(means), SHORTER_SHARE * duration)
    continued, _ = start_of(bank, lax.stop_gradient(means), longest, continued=True)
    # a rise begins before the detected front, so the noise is not measured up to it
    toe = 3.0 + 1.5 * jnp.exp(start[4]) + 0.02 * duration
    kept = jnp.maximum(front.sample - toe.astype(front.sample.dtype), front.sample // 2)
    noise = noise_before(share, kept)
    before = jnp.maximum(MEMBER_BEFORE * duration, 64.0).astype(front.sample.dtype)
    reach = jnp.maximum(FITTED_DURATIONS * duration, LEAST_REACH)
    first = jnp.maximum(front.sample - before, ORDER)
    bound, unusable = _clipped_bins(bins, clipped, front.sample)
    white = means_in_bins(bins, whitened(noise, share), front.sample)
    root = np.sqrt(bins.width).astype(samples.dtype)

    def until(reach):
        """Return the case of an interval, and its end."""
        last = jnp.minimum(front.sample + reach.astype(front.sample.dtype), count)
        edge = front.sample + bins.first
        used = (edge >= first) & (edge + bins.width <= last)
        weight = jnp.where(used & ~unusable, root / noise.sigma, 0.0)
        case = Case(
            white=weight * white,
            weight=weight,
            noise=noise,
            level=jnp.abs(means),
            clipped=jnp.where(used, bound, 0.0),
            span=0.5 * (last - first).astype(samples.dtype),
            middle=0.5 * (last + first).astype(samples.dtype)
            - front.sample.astype(samples.dtype),
            centre=jnp.asarray(CENTRE, samples.dtype),
            rings=jnp.zeros_like(scale),
            follows=jnp.zeros_like(scale),
            passed=jnp.zeros_like(scale),
            shifted=jnp.zeros_like(scale),
            form=Form(jnp.zeros_like(scale), jnp.zeros_like(scale)),
            high_pass=high_pass,
            hold=jnp.zeros_like(scale),
        )
        return case, last

    (case, last), (whole, end) = until(reach), until(LONGER_FACTOR * reach)
    index = jnp.arange(samples.shape[0])
    behind = (index >= kept) & (index < end)
    net = jnp.sum(jnp.where(behind, lax.stop_gradient(share), 0.0))
    length, quiet = ((end - kept).astype(scale.dtype), kept.astype(scale.dtype))
    # spectral density at zero frequency; the error of the zero, a mean over the quiet
    # part, is common to all samples and so grows with the length squared
    slow = noise.sigma / jnp.abs(jnp.sum(noise.taps))
    net_sd = slow * jnp.sqrt(length + length * length / jnp.maximum(quiet, 1.0))
    net_sd = jnp.where(last < count, lax.stop_gradient(net_sd), jnp.inf)
    clipped_at = jnp.max(jnp.abs(share * clipped))
    starts = start, shorter, continued
    return Prepared(case, whole, net, net_sd, *starts, front, offset, scale, clipped_at)


def _mean_of_first(samples, count):
    """Return the mean of the first samples."""
    inside = (jnp.arange(samples.shape[0]) < count).astype(samples.dtype)
    # relative to the first sample: a sum of absolute pressures would lose digits
    first = samples[0]
    return first + jnp.sum((samples - first) * inside) / count.astype(samples.dtype)


def _clipped_bins(
    bins: Bins, clipped: Float[Array, " sample"], front: Int[Array, ""]
) -> tuple[Float[Array, " bin"], Bool[Array, " bin"]]:
    """Return the bins that bound the pressure, and those that cannot be whitened."""
    whole = means_in_bins(bins, clipped, front)
    bound = jnp.where(jnp.abs(whole) > 1.0 - 1e-6, jnp.sign(whole), 0.0)
    size = jnp.abs(clipped)
    # the filter combines a sample with `ORDER` earlier ones: none may be clipped
    near = size
    for k in range(1, ORDER + 1):
        near = jnp.maximum(near, jnp.concatenate([jnp.zeros(k, size.dtype), size[:-k]]))
    return bound, means_in_bins(bins, near, front) > 1e-9


def first_front(samples: Float[Array, " sample"]) -> Front:
    """Return the first front of a record.

    Args:
        samples: Overpressure in any unit.
    """
    n = samples.shape[0]
    widths = [1]
    while 2 * widths[-1] <= min(max(n // 8, 1), LARGEST_WIDTH):
        widths.append(2 * widths[-1])
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    many = max(n // LEVEL_PARTS, 1)
    steps = _Steps(
        sums=jnp.pad(sums, widths[-1], mode="edge"),
        level=sums[many] / float(many),
        widths=jnp.asarray(widths),
    )
    found = _largest(steps, jnp.full(len(widths), n))
    for _ in range(2):
        found = _earlier(steps, found)
    return found


class _Steps(NamedTuple):
    """Running sums of a record, from which steps are computed one width at a time.

    The steps of all widths at once would exceed the cache of a core. They are needed
    three times, mostly for the largest of them alone.

    Attributes:
        sums: Running sums of the samples, with the first and the last repeated on
            either side as often as the largest width.
        level: Mean at the beginning of the record.
        widths: Step widths, powers of two [samples].
    """

    sums: Float[Array, " padded"]
    level: Float[Array, ""]
    widths: Int[Array, " width"]

    def over(self, width: Int[Array, ""]) -> Float[Array, " sample"]:
        """Return the steps over a width; zero where the record is too short for one.

        The mean behind a front must also be above the initial level: the return from
        the suction to zero is a step, but no front.
        """
        margin = 1 << (self.widths.shape[0] - 1)
        n = self.sums.shape[0] - 1 - 2 * margin
        here = self.sums[margin : margin + n]
        ahead = lax.dynamic_slice_in_dim(self.sums, margin + width, n)
        back = lax.dynamic_slice_in_dim(self.sums, margin - width, n)
        wide = width.astype(here.dtype)
        step = ahead - here - jnp.maximum(here - back, wide * self.level)
        index = jnp.arange(n)
        room = (index >= width) & (index <= n - width)
        return jnp.where(room, step * jnp.sqrt(0.5 / wide), 0.0)


def _largest(steps: _Steps, ends: Int[Array, " width"]) -> Front:
    """Return the largest step before the end that is given for each width."""

    def before(width, end):
        step = steps.over(width)
        return jnp.where(jnp.arange(step.shape[0]) < end, step, 0.0)

    heights = lax.map(lambda one: jnp.max(before(*one)), (steps.widths, ends))
    row = jnp.argmax(heights)
    width = steps.widths[row]
    return Front(jnp.argmax(before(width, ends[row])), width, heights[row])


def _earlier(steps: _Steps, found: Front) -> Front:
    """Return a clear front before a given one, else the given one."""
    ends = found.sample - jnp.maximum(2 * steps.widths, 2 * found.width)
    other = _largest(steps, jnp.where(steps.widths <= found.width, ends, 0))
    # the earlier step is compared with steps of its own width before it
    before = steps.over(other.width)
    quiet = jnp.arange(before.shape[0]) < other.sample - 2 * other.width
    many = jnp.sum(quiet)
    squares = jnp.sum(jnp.where(quiet, jnp.square(before), 0.0))
    noise = jnp.sqrt(squares / jnp.maximum(many, 1).astype(before.dtype))
    clear = (
        (other.step > EARLIER_STEP_SD * noise)
        & (other.step > STEP_SHARE * found.step)
        & (many >= 16)
        & (noise > 0)
    )
    chosen = [jnp.where(clear, a, b) for a, b in zip(other, found, strict=True)]
    return Front(*(lax.stop_gradient(x) for x in chosen))


def noise_before(samples: Float[Array, " sample"], quiet: Int[Array, ""]) -> Noise:
    """Return the noise of the first samples.

    Args:
        samples: Samples of a record, as shares of its largest.
        quiet: Number of samples before any signal.
    """
    n = samples.shape[0]
    index = jnp.arange(n)
    inside = (index < quiet).astype(samples.dtype)
    count = jnp.maximum(jnp.sum(inside), 1.0)
    left, slope = _less_parabola(samples, inside, count)
    taps, power = _burg(left, index, quiet, count)
    tiny = jnp.finfo(samples.dtype).tiny
    used = jnp.sum((taps[1:] != 0).astype(samples.dtype))
    # a parabola removes three degrees of freedom from white noise, and more of the
    # variance of slow noise, by its spectral density at zero frequency
    slow = power / jnp.maximum(jnp.sum(left * left) / count, tiny)
    slow = jnp.maximum(slow / jnp.square(jnp.sum(taps)), 1.0)
    freedom = jnp.maximum(count - 3.0 * slow - used, 0.3 * count)
    known = quiet >= LEAST_QUIET
    # a digitizer's rounding error is uniform over one bit
    step = _least_step(samples)
    bits = step * step / 12.0
    marginal = jnp.sum(left * left) / freedom
    sigma2 = jnp.where(known, power * count / freedom, _of_differences(samples))
    taps = jnp.where(known, taps, jnp.zeros_like(taps).at[0].set(1.0))
    floor = LEAST_SIGMA**2
    sigma = jnp.sqrt(sigma2 + bits + floor)
    marginal = jnp.sqrt(jnp.where(known, marginal, sigma2) + bits + floor)
    return Noise(taps, sigma, marginal, known, slope)


def whitened(noise: Noise, samples: Float[Array, " sample"]) -> Float[Array, " sample"]:
    """Return samples filtered by the taps; the first `ORDER` of them are invalid."""
    n = samples.shape[0]
    padded = jnp.concatenate([jnp.zeros(ORDER, samples.dtype), samples])
    total = jnp.zeros_like(samples)
    for k in range(ORDER + 1):
        total = total + noise.taps[k] * padded[ORDER - k : ORDER - k + n]
    return total


def whitened_means(
    noise: Noise,
    bins: Bins,
    means: Float[Array, " bin"],
    rings: Float[Array, " bin"] | float = 0.0,
    passed: Float[Array, " bin"] | float = 0.0,
) -> Float[Array, " bin"]:
    r"""Return means over bins filtered by the taps.

    The result is exact for bins of one sample. In wider bins a smooth signal becomes
    $\sum_k f_k\,m(t - k) = G\,m - D\,m'$, with $G = \sum f_k$ and $D = \sum k f_k$.

    Args:
        noise: Noise with the taps.
        bins: Bins of the means.
        means: Means over bins.
        rings: Part of them that is not smooth.
        passed: The same part, filtered by the taps.
    """
    lags = np.arange(ORDER + 1).astype(means.dtype)
    gain, lag = jnp.sum(noise.taps), jnp.sum(noise.taps * lags)
    middle = bins.middle.astype(means.dtype)
    smooth = means - rings
    padded = jnp.concatenate([smooth[:1], smooth, smooth[-1:]])
    distance = np.diff(middle)
    about = np.concatenate([[distance[0]], distance, [distance[-1]]])
    slope = (padded[2:] - padded[:-2]) / (about[1:] + about[:-1]).astype(means.dtype)
    wide = gain * smooth - lag * slope + passed
    first, last = bins.single.start + ORDER, bins.single.stop
    fine = noise.taps[0] * means[first:last]
    for k in range(1, ORDER + 1):
        fine = fine + noise.taps[k] * means[first - k : last - k]
    return jnp.concatenate([wide[:first], fine, wide[last:]])


def _less_parabola(samples, inside, count):
    """Return the quiet part minus a parabola, else zero; and its slope at the end."""
    n = samples.shape[0]
    # near-orthogonal polynomials over the quiet part, as powers would cost digits
    x = jnp.arange(n).astype(samples.dtype) / count
    basis = jnp.stack([jnp.ones_like(x), x - 0.5, jnp.square(x - 0.5) - 1.0 / 12.0])
    masked = basis * inside[None, :]
    matrix = masked @ basis.T / count + 1e-12 * jnp.eye(3, dtype=samples.dtype)
    level = jnp.sum(samples * inside) / count
    moved = samples - level
    weights = jnp.linalg.solve(matrix, (masked @ moved)[:, None] / count)[:, 0]
    return (moved - weights @ basis) * inside, (weights[1] + weights[2]) / count


def _burg(left, index, quiet, count):
    """Return taps and residual power by Burg's recursion."""
    forward, backward = left, left
    taps = jnp.zeros(ORDER + 1, left.dtype).at[0].set(1.0)
    power = jnp.sum(left * left) / count
    tiny = jnp.finfo(left.dtype).tiny
    for k in range(1, ORDER + 1):
        ahead = forward
        behind = jnp.concatenate([jnp.zeros(1, left.dtype), backward[:-1]])
        here = ((index >= k) & (index < quiet)).astype(left.dtype)
        both = jnp.sum(here * (ahead * ahead + behind * behind))
        found = -2.0 * jnp.sum(here * ahead * behind) / jnp.maximum(both, tiny)
        least = REFLECTION_SD / jnp.sqrt(count)
        reflection = jnp.where(jnp.abs(found) > least, found, 0.0)
        # Levinson's step: the taps plus the reflected taps in reverse order
        turned = jnp.concatenate([taps[k::-1], taps[k + 1 :]])
        taps = taps + reflection * turned
        forward = (ahead + reflection * behind) * here
        backward = (behind + reflection * ahead) * here
        power = power * (1.0 - reflection * reflection)
    return taps, power


def _of_differences(samples):
    """Return the variance of white noise by neighbours, without large differences."""
    size = jnp.square(samples[1:] - samples[:-1])
    mean = jnp.mean(size)
    # differences beyond three standard deviations belong to the pulse; three passes
    # suffice, as each lowers the limit
    for _ in range(3):
        near = (size <= 9.0 * mean).astype(size.dtype)
        mean = jnp.sum(near * size) / jnp.maximum(jnp.sum(near), 1.0)
    return 0.5 * mean


def _least_step(samples):
    """Return the smallest difference of neighbours, one bit of a digitized record."""
    size = jax.lax.stop_gradient(jnp.abs(samples[1:] - samples[:-1]))
    some = jnp.min(jnp.where(size > 0, size, jnp.inf))
    return jnp.where(jnp.isfinite(some), some, 0.0)


def bins_about_front(samples: int) -> Bins:
    """Return bins that cover a record for any position of its front.

    Args:
        samples: Length of the record.
    """
    behind = [
        *range(SINGLE_BEHIND + 1),
        *_growing(SINGLE_BEHIND, GROWTH_BEHIND, samples),
    ]
    before = [
        *range(SINGLE_BEFORE + 1),
        *_growing(SINGLE_BEFORE, GROWTH_BEFORE, samples),
    ]
    ends = np.array([-end for end in reversed(before)][:-1] + behind)
    return Bins(ends[:-1], np.diff(ends))


def _growing(start: int, growth: float, last: int) -> list[int]:
    """Return bounds of bins whose width grows with their distance."""
    ends = [start]
    while ends[-1] < last:
        ends.append(ends[-1] + max(1, round(growth * ends[-1])))
    return ends[1:]


def means_in_bins(
    bins: Bins, samples: Float[Array, " sample"], front: Int[Array, ""]
) -> Float[Array, " bin"]:
    """Return the mean over each bin; bins beyond the record have its outermost samples.

    Args:
        bins: The bins.
        samples: Samples of a record.
        front: Sample from which bins are counted.
    """
    n = samples.shape[0]
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    first = jnp.clip(front + bins.first, 0, n - 1)
    last = jnp.clip(front + bins.first + bins.width, first + 1, n)
    wide = (sums[last] - sums[first]) / (last - first).astype(samples.dtype)
    # bins of one sample have its value: a difference of running sums loses digits
    single = bins.single
    return wide.at[single].set(samples[first[single]])


def bank_of(bins: Bins, samples: int) -> Bank:
    """Return pulses of all durations that a record may contain.

    Args:
        bins: Bins of the record.
        samples: Length of the record.
    """
    count = int(np.ceil(np.log(max(samples, 8) / SHORTEST) / np.log(DURATION_RATIO)))
    durations = SHORTEST * DURATION_RATIO ** np.arange(count)
    members = [
        (d, b, r * d, 0.0) for d in durations for b in BANK_DECAYS for r in BANK_RISES
    ]
    members += [(d, b, 0.0, 1.0) for d in durations for b in CONTINUED_DECAYS]
    x, weight = bins.middle.astype(float), bins.width.astype(float)
    filters, energy = [], []
    for duration, decay, rise, continued in members:
        shape = _shape(x, duration, decay, rise, continued=continued > 0)
        inside = (x > -max(MEMBER_BEFORE * duration, 16.0)) & (
            x < MEMBER_BEHIND * duration
        )
        w = weight * inside
        # without the best line, so that a drift of the record selects no member
        basis = np.stack([np.ones_like(x), x / duration])
        line = np.linalg.solve((basis * w) @ basis.T, (basis * w) @ shape)
        left = shape - line @ basis
        size = float(np.sum(w * left * left))
        filters.append(w * left / size)
        energy.append(size)
    columns = np.array(members).T
    duration, decay, rise, continued = columns
    return Bank(duration, decay, rise, continued, np.array(filters), np.array(energy))


def start_of(
    bank: Bank,
    means: Float[Array, " bin"],
    longest: Float[ArrayLike, ""] = np.inf,
    *,
    continued: bool = False,
) -> tuple[Float[Array, " unknown"], Float[Array, ""]]:
    """Return the starting point of the unknowns, and its duration [samples].

    Args:
        bank: The bank of pulses.
        means: Means over the bins, as shares of the largest sample.
        longest: Longest member [samples]; the shortest one is always allowed.
        continued: True for a pulse that continues below zero.
    """
    kind = means.dtype
    peak = jnp.asarray(bank.filters, kind) @ means
    lowered = jnp.square(jnp.maximum(peak, 0.0)) * jnp.asarray(bank.energy, kind)
    short = jnp.asarray(bank.duration, kind) <= jnp.maximum(longest, SHORTEST)
    some = short & (bank.continued == float(continued))
    best = jnp.argmax(jnp.where(some, lowered, -1.0))
    duration = jnp.asarray(bank.duration, kind)[best]
    rise = jnp.asarray(bank.rise, kind)[best]
    y = jnp.asarray(CENTRE, kind)
    y = y.at[0].set(-0.5 - 0.5 * rise)
    y = y.at[1].set(jnp.log(jnp.maximum(peak[best], 0.05)))
    y = y.at[2].set(jnp.log(duration))
    y = y.at[3].set(jnp.log1p(jnp.asarray(bank.decay, kind)[best]))
    return y.at[4].set(jnp.log(jnp.maximum(rise, 1.0))), duration


def _shape(x, duration, decay, rise, *, continued):
    """Return a pulse of unit peak with suction and a linear rise about time zero."""
    middle = x + 0.5 + 0.5 * rise
    up = np.clip((x + 0.5) / max(rise, 1e-9) + 0.5, 0.0, 1.0)
    s = middle / duration
    last = np.inf if continued else 1.0
    inside = np.clip(s, 0.0, last)
    shape = (1.0 - inside) * np.exp(-decay * inside)
    depth, length = CENTRE[5], np.exp(CENTRE[6])
    q = 1.0 if continued else np.clip((s - 1.0) / length, 0.0, 1.0)
    return np.where(s >= 0, up * shape - 6.75 * depth * q * (1.0 - q) ** 2, 0.0)


def clipped_samples(
    samples: Float[Array, "*batch sample"],
    count: Int[Array, "*batch"],
    full_scale: Float[Array, "..."] | None,
) -> Float[Array, "*batch sample"]:
    """Return +1 where a sample is only a lower bound, -1 where an upper one, else 0.

    Args:
        samples: Overpressure.
        count: Number of samples of the record; the repeated last one does not count.
        full_scale: Largest absolute value of a sample, for all or [*batch, 1]; None if
            not specified.
    """
    index = jnp.arange(samples.shape[-1])
    inside = jnp.expand_dims(index, range(count.ndim)) < count[..., None]
    if full_scale is not None:
        high = inside & (samples >= CLIPPED_FROM * full_scale)
        low = inside & (samples <= -CLIPPED_FROM * full_scale)
    else:
        top = jnp.max(samples, axis=-1, keepdims=True)
        bottom = jnp.min(samples, axis=-1, keepdims=True)
        begin = samples[..., :1]
        deep = begin - bottom > LEAST_SUCTION * (top - begin)
        # a constant record, or one that begins at its maximum, is not clipped there: a
        # front lies above the first sample
        high = _in_a_row(inside & (samples == top) & (top > begin))
        low = _in_a_row(inside & (samples == bottom) & deep & (bottom < begin))
    kind = samples.dtype
    return high.astype(kind) - low.astype(kind)


def _in_a_row(equal):
    """Return True for samples in a run of `IN_A_ROW` or more."""
    n = equal.shape[-1]
    many = IN_A_ROW - 1
    edge = [(0, 0)] * (equal.ndim - 1)
    padded = jnp.pad(equal, [*edge, (many, many)])
    # True where a full run begins, then spread over its samples
    runs = padded[..., : n + many]
    for k in range(1, IN_A_ROW):
        runs = runs & padded[..., k : k + n + many]
    found = runs[..., :n]
    for k in range(1, IN_A_ROW):
        found = found | runs[..., k : k + n]
    return found
