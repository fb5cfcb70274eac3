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
the prior means, less the line that fits it best over its own stretch, so that one
product of a matrix with the record gives the peak of each member and its reduction of
the sum of squares.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jblast.signals.picks.unknowns import CENTRE, Form

FITTED_DURATIONS = 4.5
"""Length of the fitted interval behind the front, in durations: past the negative phase
of the priors."""
LONGER = 24.0 / FITTED_DURATIONS
"""And of the stretch over which a high-pass is looked for: one with its corner at the
inverse of the duration shortens the positive phase fivefold, and this is 4.5 of the
durations before it."""
LEAST_REACH = 48
"""And at least as many samples."""
SHORTER = 0.5
"""A drift may pass for a suction, and a pulse and its suction for a longer pulse: a
second search begins from one of this share of the duration at most."""
CLEAR = 12.0
"""An earlier step is another front when it is as many times the rms of those before."""
STEP_SHARE = 0.3
"""And this share of the largest step."""
LARGEST_WIDTH = 2048
"""Longest mean on either side of a step [samples]: twelve widths in all."""
FIRST = 64
"""One of so many parts of a record, the first, gives the level at its beginning."""
ORDER = 4
"""Of the autoregression."""
LEAST_QUIET = 24
"""Fewer samples before the front do not identify the colour of the noise."""
SIGNIFICANT = 2.5
"""Standard deviations of a reflection coefficient of white noise."""
LEAST_SIGMA = 1e-9
"""Noise is no less than this share of the largest sample."""
SINGLE_BEFORE, SINGLE_BEHIND = 24, 96
"""Samples that are bins of their own."""
GROWTH_BEFORE, GROWTH_BEHIND = 0.2, 0.05
"""Width of a bin over its distance from the front [-]."""
SHORTEST = 3.0
"""Duration of the shortest pulse of the bank [samples]."""
STEP = 1.3
"""From one duration of the bank to the next."""
DECAYS = (0.3, 2.5)
"""Decay coefficients of the bank: the laws have 0.4 to 2.9 (`unknowns`)."""
RISES = (0.0, 0.25)
"""Shares of the duration."""
CONTINUED_DECAYS = (0.2, 0.5, 1.2, 3.0)
"""Of members that continue below zero: the smaller, the more of them is there."""
BEFORE, BEHIND = 1.5, 4.0
"""Extent of a member before and behind the front, in durations."""
CLIPPED_FROM = 0.999
"""A sample above this share of the full scale is clipped: codes end slightly below
it."""
IN_A_ROW = 3
"""Without a full scale, as many equal samples that no other exceeds are."""
LEAST_SUCTION = 0.03
"""A floor is the scale's end only if as deep a share of the record's height: else it is
the quiet, in few bits."""


class Noise(NamedTuple):
    r"""Noise of a record.

    Attributes:
        taps: $1, f_1, \ldots$: what makes it white.
        sigma: Standard deviation of what is left then, $e$.
        marginal: Standard deviation of the noise itself.
        known: Whether there was a quiet part long enough.
        slope: Of the quiet part's drift, per sample.
    """

    taps: Float[Array, " tap"]
    sigma: Float[Array, ""]
    marginal: Float[Array, ""]
    known: Bool[Array, ""]
    slope: Float[Array, ""]


class Case(NamedTuple):
    """One record for the fit. Integers are kept as floats, which have a zero slope.

    Attributes:
        white: Whitened means, in standard deviations.
        weight: Bins' weights: square root of their samples over sigma, zero: unused.
        noise: What made them white.
        level: Size that clipped bins have [share of the largest].
        clipped: +1 where the pressure was at least the level, -1 at most minus it.
        span: Half of the stretch, for the drift [samples].
        middle: Its middle [samples].
        centre: Where the unknowns are believed to be.
        rings: 1 where the sensor rings, else 0.
        follows: 1 where a further front does, else 0.
        passed: 1 where an unstated high-pass is searched, else 0.
        shifted: 1 where the baseline steps at the front, else 0.
        form: Formulas of the pulse.
        high_pass: Corner of a high-pass [1/sample]; None: there is none.
        hold: How much more firmly than believed ln duration stands at its centre.
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
    """A front as seen at first.

    Attributes:
        sample: The first sample behind it.
        width: Over how many samples it is clearest.
        step: $D_w$ there, in the unit of the samples.
    """

    sample: Int[Array, ""]
    width: Int[Array, ""]
    step: Float[Array, ""]


class Prepared(NamedTuple):
    """A case, and what it was made of.

    Attributes:
        case: For the fit.
        whole: The same over a stretch longer by `LONGER`.
        net: Net impulse over that [share of the largest, samples].
        net_sd: Its standard deviation; infinite where the record ends within the usual
            stretch, which may hold too little of the tail.
        start: Unknowns to begin with.
        shorter: Those of a pulse shorter by `SHORTER` or more.
        continued: Those of a pulse that continues below zero.
        front: As seen at first.
        offset: What was taken off the samples.
        scale: And what they were then divided by.
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
    """Pulses to begin with.

    Attributes:
        duration: Of each [samples].
        decay: Of each.
        rise: Of each [samples].
        continued: 1 of those whose decay continues below zero, 0 of the others.
        filters: Times the record's means over bins: the peak of each.
        energy: By peak squared: how much it lowers the weighted sum of squares.
    """

    duration: Float[np.ndarray, " member"]
    decay: Float[np.ndarray, " member"]
    rise: Float[np.ndarray, " member"]
    continued: Float[np.ndarray, " member"]
    filters: Float[np.ndarray, "member bin"]
    energy: Float[np.ndarray, " member"]


class Bins(NamedTuple):
    """Where bins lie, in samples from the front's.

    Attributes:
        first: First sample of each.
        width: How many samples it has.
    """

    first: Int[np.ndarray, " bin"]
    width: Int[np.ndarray, " bin"]

    @property
    def start(self) -> Float[np.ndarray, " bin"]:
        """Where each begins [samples]."""
        return self.first - 0.5

    @property
    def stop(self) -> Float[np.ndarray, " bin"]:
        """Where each ends [samples]."""
        return self.first + self.width - 0.5

    @property
    def ends(self) -> Float[np.ndarray, " end"]:
        """Where each begins, and where the last one ends [samples]."""
        return np.append(self.start, self.stop[-1])

    @property
    def middle(self) -> Float[np.ndarray, " bin"]:
        """The middle of each [samples]."""
        return self.first + 0.5 * (self.width - 1)

    @property
    def single(self) -> slice:
        """Which bins are samples of their own: those in a row about the front."""
        ones = np.flatnonzero(self.width == 1)
        return slice(int(ones[0]), int(ones[-1]) + 1)

    def means_by(self, at_ends: Float[Array, "row end"]) -> Float[Array, "row bin"]:
        """Return means over each, where they meet, by antiderivatives at `ends`."""
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
    """Make a record ready.

    Args:
        bins: About the front.
        bank: To begin with.
        samples: Overpressure, finite.
        clipped: +1 where a sample is a lower bound, -1 an upper one, else 0.
        count: How many samples are the record's: the last of those repeats behind it.
        high_pass: Corner of a first-order high-pass [1/sample].
        longest: Duration of the longest pulse to begin with [samples].
    """
    front = first_front(lax.stop_gradient(samples - samples[0]))
    offset = _mean_of_first(samples, jnp.maximum(front.sample - 2, 1))
    moved = samples - offset
    scale = jnp.max(jnp.abs(moved))
    scale = jnp.where(scale > 0, scale, 1.0)
    share = moved / scale
    means = means_in_bins(bins, share, front.sample)
    start, duration = start_of(bank, lax.stop_gradient(means), longest)
    shorter, _ = start_of(bank, lax.stop_gradient(means), SHORTER * duration)
    continued, _ = start_of(bank, lax.stop_gradient(means), longest, continued=True)
    toe = 3.0 + 1.5 * jnp.exp(start[4]) + 0.02 * duration
    kept = jnp.maximum(front.sample - toe.astype(front.sample.dtype), front.sample // 2)
    noise = noise_before(share, kept)
    before = jnp.maximum(BEFORE * duration, 64.0).astype(front.sample.dtype)
    reach = jnp.maximum(FITTED_DURATIONS * duration, LEAST_REACH)
    first = jnp.maximum(front.sample - before, ORDER)
    bound, unusable = _clipped_bins(bins, clipped, front.sample)
    white = means_in_bins(bins, whitened(noise, share), front.sample)
    root = np.sqrt(bins.width).astype(samples.dtype)

    def until(reach):
        """Return the case of a stretch, and where that ends."""
        last = jnp.minimum(front.sample + reach.astype(front.sample.dtype), count)
        used = bins_within(bins, front.sample, first, last)
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

    (case, last), (whole, end) = until(reach), until(LONGER * reach)
    index = jnp.arange(samples.shape[0])
    behind = (index >= kept) & (index < end)
    net = jnp.sum(jnp.where(behind, lax.stop_gradient(share), 0.0))
    length, quiet = ((end - kept).astype(scale.dtype), kept.astype(scale.dtype))
    # noise of zero frequency, over the stretch and of the zero before it
    slow = noise.sigma / jnp.abs(jnp.sum(noise.taps))
    net_sd = slow * jnp.sqrt(length + length * length / jnp.maximum(quiet, 1.0))
    net_sd = jnp.where(last < count, lax.stop_gradient(net_sd), jnp.inf)
    held = jnp.max(jnp.abs(share * clipped))
    starts = start, shorter, continued
    return Prepared(case, whole, net, net_sd, *starts, front, offset, scale, held)


def _mean_of_first(samples, count):
    """Return the mean of the first samples."""
    inside = (jnp.arange(samples.shape[0]) < count).astype(samples.dtype)
    first = samples[0]
    return first + jnp.sum((samples - first) * inside) / count.astype(samples.dtype)


def _clipped_bins(
    bins: Bins, clipped: Float[Array, " sample"], front: Int[Array, ""]
) -> tuple[Float[Array, " bin"], Bool[Array, " bin"]]:
    """Return which bins bound the pressure, and which cannot be whitened."""
    whole = means_in_bins(bins, clipped, front)
    bound = jnp.where(jnp.abs(whole) > 1.0 - 1e-6, jnp.sign(whole), 0.0)
    size = jnp.abs(clipped)
    near = size
    for k in range(1, ORDER + 1):
        near = jnp.maximum(near, jnp.concatenate([jnp.zeros(k, size.dtype), size[:-k]]))
    return bound, means_in_bins(bins, near, front) > 1e-9


def widths_of(samples: int) -> list[int]:
    """Return the widths that a record of some length is looked at over."""
    widths, width = [], 1
    while width <= min(max(samples // 8, 1), LARGEST_WIDTH):
        widths.append(width)
        width *= 2
    return widths


def first_front(samples: Float[Array, " sample"]) -> Front:
    """Return the first front of a record.

    Args:
        samples: Overpressure in any unit.
    """
    n = samples.shape[0]
    widths = widths_of(n)
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    many = max(n // FIRST, 1)
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
    """What the steps of a record are computed from, one width at a time.

    All of them at once would leave the cache of a core, and be kept for little: they
    are asked for three times, mostly for the largest of them alone.

    Attributes:
        sums: Running ones of the samples; the ends again on either side, as often as
            the largest width.
        level: Mean that the record began with.
        widths: That it is looked at over, powers of two.
    """

    sums: Float[Array, " padded"]
    level: Float[Array, ""]
    widths: Int[Array, " width"]

    def over(self, width: Int[Array, ""]) -> Float[Array, " sample"]:
        """Return the steps over a width; zero where they have no room.

        What is behind a front is above what the record began with, too: the way back
        from the suction is a step, but no front.
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
    """Return the largest step; of each width those before an end count."""

    def before(width, end):
        step = steps.over(width)
        return jnp.where(jnp.arange(step.shape[0]) < end, step, 0.0)

    heights = lax.map(lambda one: jnp.max(before(*one)), (steps.widths, ends))
    row = jnp.argmax(heights)
    width = steps.widths[row]
    return Front(jnp.argmax(before(width, ends[row])), width, heights[row])


def _earlier(steps: _Steps, found: Front) -> Front:
    """Return a clear front that comes before one, or that one."""
    ends = found.sample - jnp.maximum(2 * steps.widths, 2 * found.width)
    other = _largest(steps, jnp.where(steps.widths <= found.width, ends, 0))
    # what came before the earlier one, over its width
    before = steps.over(other.width)
    quiet = jnp.arange(before.shape[0]) < other.sample - 2 * other.width
    many = jnp.sum(quiet)
    squares = jnp.sum(jnp.where(quiet, jnp.square(before), 0.0))
    noise = jnp.sqrt(squares / jnp.maximum(many, 1).astype(before.dtype))
    clear = (
        (other.step > CLEAR * noise)
        & (other.step > STEP_SHARE * found.step)
        & (many >= 16)
        & (noise > 0)
    )
    chosen = [jnp.where(clear, a, b) for a, b in zip(other, found, strict=True)]
    return Front(*(lax.stop_gradient(x) for x in chosen))


def noise_before(samples: Float[Array, " sample"], quiet: Int[Array, ""]) -> Noise:
    """Return the noise of the first samples.

    Args:
        samples: Of a record, as shares of its largest.
        quiet: How many of them came before anything else did.
    """
    n = samples.shape[0]
    index = jnp.arange(n)
    inside = (index < quiet).astype(samples.dtype)
    count = jnp.maximum(jnp.sum(inside), 1.0)
    left, slope = _less_parabola(samples, inside, count)
    taps, power = _burg(left, index, quiet, count)
    tiny = jnp.finfo(samples.dtype).tiny
    used = jnp.sum((taps[1:] != 0).astype(samples.dtype))
    # the parabola takes what is slow, of which slow noise has more than its share
    slow = power / jnp.maximum(jnp.sum(left * left) / count, tiny)
    slow = jnp.maximum(slow / jnp.square(jnp.sum(taps)), 1.0)
    freedom = jnp.maximum(count - 3.0 * slow - used, 0.3 * count)
    known = quiet >= LEAST_QUIET
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
    """Return samples through the taps; the first `ORDER` of them are of no use."""
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
    r"""Return means over bins through the taps.

    Exact where samples are bins of their own. In wider ones a smooth signal passes as
    $\sum_k f_k\,m(t - k) = G\,m - D\,m'$, with $G = \sum f_k$ and $D = \sum k f_k$.

    Args:
        noise: The taps.
        bins: Where the means are.
        means: All that is in them.
        rings: What of it is not smooth.
        passed: And that through the taps.
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
    """Return the quiet part less a parabola, else zero; and its slope at the end."""
    n = samples.shape[0]
    x = jnp.arange(n).astype(samples.dtype) / count
    basis = jnp.stack([jnp.ones_like(x), x - 0.5, jnp.square(x - 0.5) - 1.0 / 12.0])
    masked = basis * inside[None, :]
    matrix = masked @ basis.T / count + 1e-12 * jnp.eye(3, dtype=samples.dtype)
    level = jnp.sum(samples * inside) / count
    moved = samples - level
    weights = jnp.linalg.solve(matrix, (masked @ moved)[:, None] / count)[:, 0]
    return (moved - weights @ basis) * inside, (weights[1] + weights[2]) / count


def _burg(left, index, quiet, count):
    """Return taps and power of what is left, by Burg's recursion."""
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
        least = SIGNIFICANT / jnp.sqrt(count)
        reflection = jnp.where(jnp.abs(found) > least, found, 0.0)
        # turned about its own end
        turned = jnp.concatenate([taps[k::-1], taps[k + 1 :]])
        taps = taps + reflection * turned
        forward = (ahead + reflection * behind) * here
        backward = (behind + reflection * ahead) * here
        power = power * (1.0 - reflection * reflection)
    return taps, power


def _of_differences(samples):
    """Return the variance of white noise by neighbours, large differences left out."""
    size = jnp.square(samples[1:] - samples[:-1])
    mean = jnp.mean(size)
    for _ in range(3):
        near = (size <= 9.0 * mean).astype(size.dtype)
        mean = jnp.sum(near * size) / jnp.maximum(jnp.sum(near), 1.0)
    return 0.5 * mean


def _least_step(samples):
    """Return the smallest difference of neighbours, a bit if there are bits."""
    size = jax.lax.stop_gradient(jnp.abs(samples[1:] - samples[:-1]))
    some = jnp.min(jnp.where(size > 0, size, jnp.inf))
    return jnp.where(jnp.isfinite(some), some, 0.0)


def bins_about_front(samples: int) -> Bins:
    """Return the bins that cover a record wherever its front lies.

    Args:
        samples: Of the record.
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
    """Return ends of bins from a distance on."""
    ends = [start]
    while ends[-1] < last:
        ends.append(ends[-1] + max(1, round(growth * ends[-1])))
    return ends[1:]


def means_in_bins(
    bins: Bins, samples: Float[Array, " sample"], front: Int[Array, ""]
) -> Float[Array, " bin"]:
    """Return the mean of the samples in each bin; of bins beyond the record, its ends.

    Args:
        bins: Where they lie.
        samples: Of a record.
        front: The sample that bins count from.
    """
    n = samples.shape[0]
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    first = jnp.clip(front + bins.first, 0, n - 1)
    last = jnp.clip(front + bins.first + bins.width, first + 1, n)
    wide = (sums[last] - sums[first]) / (last - first).astype(samples.dtype)
    # single samples themselves: a difference of sums has lost digits
    single = bins.single
    return wide.at[single].set(samples[first[single]])


def bins_within(
    bins: Bins,
    front: Int[Array, ""],
    first: Int[Array, ""] | int,
    last: Int[Array, ""] | int,
) -> Bool[Array, " bin"]:
    """Return which bins hold samples from the first to before the last only."""
    start = front + bins.first
    return (start >= first) & (start + bins.width <= last)


def bank_of(bins: Bins, samples: int) -> Bank:
    """Return pulses of all durations that a record may hold.

    Args:
        bins: Where they are looked at.
        samples: Of the record.
    """
    count = int(np.ceil(np.log(max(samples, 8) / SHORTEST) / np.log(STEP)))
    durations = SHORTEST * STEP ** np.arange(count)
    members = [(d, b, r * d, 0.0) for d in durations for b in DECAYS for r in RISES]
    members += [(d, b, 0.0, 1.0) for d in durations for b in CONTINUED_DECAYS]
    x, weight = bins.middle.astype(float), bins.width.astype(float)
    filters, energy = [], []
    for duration, decay, rise, continued in members:
        shape = _shape(x, duration, decay, rise, continued=continued > 0)
        inside = (x > -max(BEFORE * duration, 16.0)) & (x < BEHIND * duration)
        w = weight * inside
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
    """Return the unknowns to begin with, and the duration [samples].

    Args:
        bank: Pulses.
        means: Of the record over the bins, as shares of its largest sample.
        longest: Members may be so long [samples]; the shortest may always be.
        continued: Whether to begin with a pulse that continues below zero.
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
    """Return a pulse of unit peak, its rise a line about zero, with suction."""
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
        count: How many are the record's: the last of those repeats behind it, and is
            not clipped for that.
        full_scale: Largest size of a sample, of all or [*batch, 1]; None: not given.
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
        # neither a record of one value nor one that begins at its top was clipped there
        high = _in_a_row(inside & (samples == top) & (top > begin))
        low = _in_a_row(inside & (samples == bottom) & deep & (bottom < begin))
    kind = samples.dtype
    return high.astype(kind) - low.astype(kind)


def _in_a_row(equal):
    """Return which samples are in a stretch of `IN_A_ROW` such samples or more."""
    n = equal.shape[-1]
    many = IN_A_ROW - 1
    edge = [(0, 0)] * (equal.ndim - 1)
    padded = jnp.pad(equal, [*edge, (many, many)])
    # whether all are, of a stretch that begins at each place
    runs = padded[..., : n + many]
    for k in range(1, IN_A_ROW):
        runs = runs & padded[..., k : k + n + many]
    found = runs[..., :n]
    for k in range(1, IN_A_ROW):
        found = found | runs[..., k : k + n]
    return found
