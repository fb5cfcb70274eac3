r"""Means of a pulse over bins, by any of its forms, and their slopes.

With $u$ the time since the arrival, $x = u/\tau$, $L = t_d - \tau$,
$s = (u - \tau)/L$ and $r = (u - t_d)/t^-$, a pulse is

$$p = P R(x), \; x < 1; \qquad p = P (1-s)\,e^{-bs}, \; u < t_d; \qquad
  p = -P^- N(r).$$

$R$ is $3x^2 - 2x^3$, the smoother $10x^3 - 15x^4 + 6x^5$, close to the Gaussian
integral between 2.6 standard deviations on either side, $x$, or $x$ times the decay
(`unknowns.concavity`). $N$ is the cubic
$\tfrac{27}{4} r (1-r)^2$ (Granstroem 1956), $\sin \pi r$, or a triangle that is
deepest at a quarter (UFC 3-340-02, figure 2-8); or the decay continues for all $s > 1$.
An exponential rise multiplies Friedlander's formula: with $s = u/t_d$ and
$\kappa = 3 t_d/\tau$

$$p = P_0\,(1-s)\,e^{-bs}\,(1 - e^{-\kappa s}),$$

and $P$ is its maximum. All integrals are closed, with
$H(s) = \int_0^s (1-\sigma)\,e^{-b\sigma}\,\mathrm{d}\sigma$.

The slope of a mean is a difference of what the slope of the antiderivative is at the
two ends of a bin, and bins meet: so all seven slopes take one exponential an end. The
means themselves of the most frequent forms are not such differences, which lose digits
(`waves/pulse.py`); a slope has them to spare.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.inference.picks.fit.computed_once import in_halves
from jblast.inference.picks.oscillation import sine_and_cosine
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.unknowns import (
    CONTINUED,
    CUBIC,
    EXPONENTIAL,
    RISEN,
    SMOOTH,
    SMOOTHER,
    Form,
    concavity,
    exponential_peak,
)
from jblast.waves.pulse import Pulse, pulse_mean
from jblast.waves.waveform import impulse_fraction

DEEPEST = 0.25
"""Share of the negative phase at which a triangle is deepest (UFC 3-340-02, 2-8)."""

SMALL = 0.02
"""Below it the integral of x (1 - x) exp(-y x) is by its series: closed, it cancels."""


def means_over(bins: Bins, pulse: Pulse, form: Form) -> Float[Array, " bin"]:
    """Return the means of a pulse over bins.

    Args:
        bins: Contiguous.
        pulse: With a rise, and nothing held; times in samples.
        form: Its formulas.
    """

    # the form is an argument: what is closed over may have no slope
    @jax.custom_jvp
    def of(numbers, form):
        return _means(bins, numbers, form)

    @of.defjvp
    def _(primals, tangents):
        # slopes by these seven numbers once, not by each unknown there is
        return of(*primals), tangents[0] @ mean_slopes(bins, *primals)

    return of(jnp.stack(pulse[:7]), form)


def _means(bins: Bins, numbers: Float[Array, "7"], form: Form):
    """Return the means of a pulse over bins."""
    kind = numbers.dtype
    start, stop = bins.start.astype(kind), bins.stop.astype(kind)
    first = _is(form, SMOOTH, CUBIC)

    def plain():
        return pulse_mean(Pulse(*numbers, hold_time=jnp.zeros((), kind)), start, stop)

    def other():
        arrival, _, _, duration, _, suction, fall = numbers
        positive = lax.cond(
            form.rise == EXPONENTIAL,
            lambda: _exponential_means(bins, numbers, form),
            lambda: _ramped_means(bins, numbers, form),
        )
        since = bins.ends.astype(kind) - arrival
        r = jnp.clip((since - duration) / fall, 0.0, 1.0)
        _, sucked = _negative(form, r)
        return positive - suction * fall * bins.means_by(sucked[None, :])[0]

    return lax.cond(first, plain, other)


def _is(form: Form, rise: int, negative: int) -> Bool[Array, ""]:
    """Return whether a form is the one of these formulas."""
    return (form.rise == rise) & (form.negative == negative)


def _ramped_means(bins: Bins, numbers, form: Form):
    """Return the means of a rise by a polynomial and of the decay."""
    arrival, peak, rise, duration, decay, _, _ = numbers
    kind = numbers.dtype
    continued = form.negative == CONTINUED
    start, stop = bins.start.astype(kind) - arrival, bins.stop.astype(kind) - arrival
    span = bins.width.astype(kind)

    def part(first, last, length):
        """Return share of the bin, middle and half width, these over the length."""
        width = span - jnp.maximum(first - start, 0) - jnp.maximum(stop - last, 0)
        width = jnp.maximum(width, 0)
        middle = 0.5 * (jnp.maximum(start, first) + jnp.minimum(stop, last))
        inside = jnp.clip(middle, first, last) - first
        return width / span, inside / length, 0.5 * width / length

    share, m, h = part(jnp.zeros_like(rise), rise, rise)
    smooth = m * m * (3.0 - 2.0 * m) + h * h * (1.0 - 2.0 * m)
    x = jnp.clip((bins.ends.astype(kind) - arrival) / rise, 0.0, 1.0)
    smoother = rise * bins.means_by(_risen_smoother(x)[None, :])[0]
    bent = concavity(form, rise, duration, decay)
    straight = m + bent * (m - m * m - h * h / 3.0)
    ramp = share * jnp.where(form.rise == SMOOTH, smooth, straight)
    total = jnp.where(form.rise == SMOOTHER, smoother, ramp)
    last = jnp.where(continued, jnp.inf, duration).astype(kind)
    share, m, h = part(rise, last, duration - rise)
    width = 2.0 * h
    k = impulse_fraction(decay * width)
    left = jnp.where(continued, 1.0 - m - h, jnp.maximum(1.0 - m - h, 0))
    shape = left * (1.0 - decay * width * k) + width * k
    return peak * (total + share * shape * jnp.exp(-decay * jnp.maximum(m - h, 0)))


def _exponential_means(bins: Bins, numbers, form: Form):
    """Return the means of Friedlander's formula times an exponential rise."""
    arrival, peak, rise, duration, decay, _, _ = numbers
    s = _passed((bins.ends.astype(numbers.dtype) - arrival) / duration, form)
    fast = RISEN * duration / rise
    at_ends = _fallen_by(s, decay) - _fallen_by(s, decay + fast)
    size = peak / exponential_peak(decay, fast)
    return size * duration * bins.means_by(at_ends[None, :])[0]


def _passed(s, form: Form):
    """Return the share of the positive phase that has passed, or multiples of it."""
    late = jnp.where(form.negative == CONTINUED, jnp.inf, 1.0).astype(s.dtype)
    return jnp.clip(s, 0.0, late)


def _fallen_by(s, decay):
    """Return the integral of the decay up to a share of it."""
    y = decay * s
    k = impulse_fraction(y)
    return _fallen(s, k, _late(y, k))


def _negative(form: Form, r):
    """Return the negative phase at shares of it, and its integral, for a depth of 1."""

    def cubic():
        return 6.75 * r * (1.0 - r) * (1.0 - r), 6.75 * _sucked(r)

    def half_sine():
        sine, cosine = sine_and_cosine(np.pi * r)
        return sine, (1.0 - cosine) / np.pi

    def triangle():
        late = (1.0 - r) / (1.0 - DEEPEST)
        early = r < DEEPEST
        deep = jnp.where(early, r / DEEPEST, late)
        whole = 0.5 - 0.5 * (1.0 - r) * late
        return deep, jnp.where(early, 0.5 * r * r / DEEPEST, whole)

    def continued():
        return jnp.zeros_like(r), jnp.zeros_like(r)

    return lax.switch(
        form.negative.astype(int), [cubic, half_sine, triangle, continued]
    )


def mean_slopes(
    bins: Bins, numbers: Float[Array, "7"], form: Form
) -> Float[Array, "7 bin"]:
    """Return the slopes of means over bins by arrival, peak, rise and so on.

    Args:
        bins: Contiguous.
        numbers: The first seven of a `Pulse`, in its order.
        form: Its formulas.
    """
    ends = bins.ends.astype(numbers.dtype)
    return bins.means_by(_antiderivative_slopes(ends, numbers, form))


def mean_columns(bins: Bins, pulse: Pulse) -> Float[Array, "2 bin"]:
    """Return the means over bins by a peak of 1, and by a suction of 1.

    Args:
        bins: Contiguous.
        pulse: With a rise, and nothing held; its peak and suction are not asked for.
    """
    since = bins.ends.astype(pulse.arrival_time.dtype) - pulse.arrival_time
    rise, length, fall = pulse.rise_time, pulse.decay_duration, pulse.suction_duration
    x = jnp.clip(since / rise, 0.0, 1.0)
    s = jnp.clip((since - rise) / length, 0.0, 1.0)
    r = jnp.clip((since - pulse.duration) / fall, 0.0, 1.0)
    at_ends = jnp.stack(
        [
            rise * _risen(x) + length * _fallen_by(s, pulse.decay),
            -6.75 * fall * _sucked(r),
        ]
    )
    return bins.means_by(at_ends)


def _antiderivative_slopes(time, numbers, form: Form):
    """Return the slopes of the integral up to each instant, [7, instant]."""
    arrival, _, _, duration, _, suction, fall = numbers
    since = time - arrival
    positive = lax.cond(
        form.rise == EXPONENTIAL,
        lambda: _exponential_slopes(since, numbers, form),
        lambda: _ramped_slopes(since, numbers, form),
    )
    r = jnp.clip((since - duration) / fall, 0.0, 1.0)
    low, sucked = _negative(form, r)
    low = suction * low
    negative = [low, -fall * sucked, r * low - suction * sucked]
    return jnp.stack(
        [
            positive[0] + low,
            positive[1],
            positive[2],
            positive[3] + low,
            positive[4],
            *negative[1:],
        ]
    )


def _ramped_slopes(since, numbers, form: Form):
    """Return those of a rise by a polynomial and of the decay, by the first five."""
    _, peak, rise, duration, decay, _, _ = numbers
    length = duration - rise
    x = jnp.clip(since / rise, 0.0, 1.0)
    s = _passed((since - rise) / length, form)
    smooth, smoother = form.rise == SMOOTH, form.rise == SMOOTHER
    bent = concavity(form, rise, duration, decay)
    under = x * x * (0.5 - x / 3.0)
    up = jnp.where(smooth, x * x * (3.0 - 2.0 * x), x + bent * x * (1.0 - x))
    up = jnp.where(smoother, x * x * x * (10.0 - x * (15.0 - 6.0 * x)), up)
    risen = jnp.where(smooth, _risen(x), 0.5 * x * x + bent * under)
    risen = jnp.where(smoother, _risen_smoother(x), risen)
    # by the concavity, and of that by rise, duration and decay
    by_bent = peak * rise * under
    bends = jax.grad(lambda n: concavity(form, *n))((rise, duration, decay))
    y = decay * s
    k, falling = in_halves(lambda y: (impulse_fraction(y), jnp.exp(-y)), y)
    late = _late(y, k)
    down = (1.0 - s) * falling
    fallen = _fallen(s, k, late)
    rising = since < rise
    return (
        -peak * jnp.where(rising, up, down),
        rise * risen + length * fallen,
        peak
        * jnp.where(
            rising, risen - x * up, 0.5 + bent / 6.0 - fallen - (1.0 - s) * down
        )
        + by_bent * bends[0],
        peak * (fallen - s * down) + by_bent * bends[1],
        by_bent * bends[2] - peak * length * _by_decay(s, y, k, late),
    )


def _by_decay(s, y, k, late):
    """Return minus the slope of the integral of the decay by its coefficient."""
    return s * s * ((1.0 - s) * late + s * _middle(y, k, late))


def _exponential_slopes(since, numbers, form: Form):
    """Return those of Friedlander's formula times an exponential rise."""
    _, peak, rise, duration, decay, _, _ = numbers
    s = _passed(since / duration, form)

    def of(decay):
        y = decay * s
        k, falling = in_halves(lambda y: (impulse_fraction(y), jnp.exp(-y)), y)
        late = _late(y, k)
        return (1.0 - s) * falling, _fallen(s, k, late), _by_decay(s, y, k, late)

    fast = RISEN * duration / rise
    down, fallen, bend = of(decay)
    off, taken, turn = of(decay + fast)
    shape, whole = down - off, fallen - taken
    # by the size, the time constant's rate and so on; then by peak, rise and duration
    scale, by_number = jax.value_and_grad(
        lambda n: jnp.log(exponential_peak(n[2], RISEN * n[1] / n[0]))
    )(jnp.stack([rise, duration, decay]))
    size = peak / jnp.exp(scale)
    integral = size * duration * whole
    by_fast = size * duration * turn
    return (
        -size * shape,
        duration * whole / jnp.exp(scale),
        -by_fast * fast / rise - integral * by_number[0],
        size * (whole - s * shape)
        + by_fast * fast / duration
        - integral * by_number[1],
        size * duration * (turn - bend) - integral * by_number[2],
    )


def _risen(x):
    """Return the integral of the rise up to a share of it."""
    return x * x * x * (1.0 - 0.5 * x)


def _risen_smoother(x):
    """Return the integral of the smoother rise up to a share of it."""
    return x * x * x * x * (2.5 - x * (3.0 - x))


def _late(y, k):
    """Return the integral of x exp(-y x), by that of 1 - x."""
    return 1.0 - y * k - k


def _fallen(s, k, late):
    """Return the integral of the decay up to a share of it, by those."""
    return s * ((1.0 - s) * (k + late) + s * k)


def _sucked(r):
    """Return the integral of the suction up to a share of it."""
    return r * r * (0.5 + r * (0.25 * r - 2.0 / 3.0))


def _middle(y, k, late):
    """Return the integral of x (1 - x) exp(-y x), by those of 1 - x and of x."""
    near = jnp.abs(y) < SMALL
    series = 1.0 / 6.0 + y * (-1.0 / 12.0 + y * (1.0 / 40.0 - y / 180.0))
    return jnp.where(near, series, (k - late) / jnp.where(near, 1.0, y))
