r"""Means over bins of a pulse of any form, and of a resonant sensor's response to it.

With $u$ the time since the arrival, $x = u/\tau$, $L = t_d - \tau$,
$s = (u - \tau)/L$ and $r = (u - t_d)/t^-$, a pulse is

$$p = P R(x), \; x < 1; \qquad p = P (1-s)\,e^{-bs}, \; u < t_d; \qquad
  p = -P^- N(r).$$

$R$ is $3x^2 - 2x^3$, the smoother $10x^3 - 15x^4 + 6x^5$, close to the Gaussian
integral between 2.6 standard deviations on either side, $x$, or $x$ times the decay
(`concavity`). $N$ is the cubic $\tfrac{27}{4} r (1-r)^2$ (Granstroem 1956),
$\sin \pi r$, or a triangle that is deepest at a quarter (UFC 3-340-02, figure 2-8); or
the decay continues for all $s > 1$. An exponential rise multiplies Friedlander's
formula: with $s = u/t_d$ and $\kappa = 3 t_d/\tau$

$$p = P_0\,(1-s)\,e^{-bs}\,(1 - e^{-\kappa s}),$$

and $P$ is its maximum. All integrals are closed, with
$H(s) = \int_0^s (1-\sigma)\,e^{-b\sigma}\,\mathrm{d}\sigma$. The slope of a mean is the
difference of the antiderivative's slope between the two ends of a bin. Bins share their
ends, so seven slopes need one exponential an end. The means of the most frequent forms
are not computed as such differences, which lose digits (`waves/pulse.py`);
slopes have digits to spare.

A resonant sensor is a damped oscillator, $\ddot y + 2\zeta\omega\dot y + \omega^2 y =
\omega^2 p$, with poles $\lambda = -\zeta\omega \pm i\Omega$:

$$y = \mathrm{Re}\,(c\,z), \quad \dot y = \mathrm{Re}\,(c \lambda z), \quad
  z(t) = \int_0^t p(u)\,e^{\lambda(t-u)}\,\mathrm{d}u, \quad c = -i\,\omega^2/\Omega$$

Means over bins need no further integral: that of the oscillator's equation is
$\bar y = \bar p - [\dot y]/(\omega^2 \Delta) - 2\zeta\,[y]/(\omega \Delta) =
\bar p - [\mathrm{Re}\,(C z)]/\Delta$, with $C = c\,(\lambda/\omega^2 + 2\zeta/\omega)$.
In each of the four pieces of the pulse $z$ is a particular solution of
$\dot z = \lambda z + p$, a polynomial or one times the pulse's decay, and a multiple of
$e^{\lambda t}$ that joins it to the piece before: the ringing. Only the coefficients of
a piece are complex. In the rise, which may be much shorter than a period, the
particular solution is a power series in $\lambda\tau$.

XLA fuses an exponential into each of the seven slopes that use it, and calls a library
for each sine in double precision. A loop over two halves (`in_halves`) computes an
exponential once; `oscillation` has sine and cosine from additions and products alone
(Cody and Waite 1980, "Software Manual for the Elementary Functions"; coefficients of
the Cephes library, Moshier 1989).
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Complex, Float

from jblast.signals.picks.preparation import Bins
from jblast.signals.picks.unknowns import (
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
SMALL_EXPONENT = 0.02
"""Exponent below which the integral of x (1 - x) exp(-y x) is computed by its series.
The closed form divides a difference of order y by y, so it loses two digits there; the
first omitted term of the series is below 1e-9 of the result."""
SMALL_PHASE = 0.1
"""Phase of the pole over a rise below which the rise is computed by its series [rad].
Above it the closed form amplifies rounding by up to $12/0.1^4$, to 3e-11."""
TERMS = 8
"""Terms of that series; the first omitted one is then below 2e-15."""
Result = TypeVar("Result")
QUARTER = (201.0 / 128.0, 4.837512969970703125e-4, 7.549789954891882e-8)
r"""$\pi/2$ in three parts, the first two of few digits, so that their multiples are
exact."""
SINE = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
"""Coefficients of the sine in Cephes' `sin.c` up to pi/4, from the highest power."""
COSINE = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)
"""Coefficients of the cosine there."""


def means_over(bins: Bins, pulse: Pulse, form: Form) -> Float[Array, " bin"]:
    """Return the means of a pulse over bins.

    Args:
        bins: Contiguous bins.
        pulse: Pulse with a rise and without a hold time; times in samples.
        form: Its formulas.
    """

    # the form is an argument, since a custom_jvp must not close over traced values
    @jax.custom_jvp
    def of(numbers, form):
        return _means(bins, numbers, form)

    @of.defjvp
    def _(primals, tangents):
        # the slopes by seven numbers are computed once; JAX would push each of up to 18
        # unknowns through the formulas
        return of(*primals), tangents[0] @ mean_slopes(bins, *primals)

    return of(jnp.stack(pulse[:7]), form)


def _means(bins: Bins, numbers: Float[Array, "7"], form: Form):
    """Return the means of a pulse over bins."""
    kind = numbers.dtype
    start, stop = bins.start.astype(kind), bins.stop.astype(kind)
    first = (form.rise == SMOOTH) & (form.negative == CUBIC)

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
        # other forms are rare enough for antiderivatives, which lose digits
        return positive - suction * fall * bins.means_by(sucked[None, :])[0]

    return lax.cond(first, plain, other)


def _ramped_means(bins: Bins, numbers, form: Form):
    """Return the means of a rise by a polynomial and of the decay."""
    arrival, peak, rise, duration, decay, _, _ = numbers
    kind = numbers.dtype
    continued = form.negative == CONTINUED
    start, stop = bins.start.astype(kind) - arrival, bins.stop.astype(kind) - arrival
    span = bins.width.astype(kind)

    def part(first, last, length):
        """Return the share of the bin within a part, its middle and its half width.

        Middle and half width are relative to the length of the part.
        """
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
    """Return the elapsed share of the positive phase; unbounded if decay continues."""
    late = jnp.where(form.negative == CONTINUED, jnp.inf, 1.0).astype(s.dtype)
    return jnp.clip(s, 0.0, late)


def _fallen_by(s, decay):
    """Return the integral of the decay from 0 to s."""
    y = decay * s
    k = impulse_fraction(y)
    return _fallen(s, k, _late(y, k))


def _negative(form: Form, r):
    """Return a negative phase of depth 1 and its integral at elapsed shares."""

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
    """Return the slopes of means over bins by the seven numbers of a pulse.

    Args:
        bins: Contiguous bins.
        numbers: The first seven fields of a `Pulse`, in its order.
        form: Its formulas.
    """
    ends = bins.ends.astype(numbers.dtype)
    return bins.means_by(_antiderivative_slopes(ends, numbers, form))


def mean_columns(bins: Bins, pulse: Pulse) -> Float[Array, "2 bin"]:
    """Return the means over bins of a peak of 1 and of a suction of 1.

    Args:
        bins: Contiguous bins.
        pulse: Pulse with a rise and without a hold time; peak and suction are ignored.
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
    """Return the slopes of the integral up to each instant, [7, instant].

    Bins share their bounds, so one evaluation per bound serves two bins.
    """
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
    """Return the slopes of a polynomial rise and of the decay by five numbers."""
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
    # chain rule: the concavity itself depends on rise, duration and decay
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
    """Return the slopes of Friedlander's formula times an exponential rise."""
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
    # chain rule: the factor that makes the maximum `peak` depends on rise, duration and
    # decay, too
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
    """Return the integral of the smooth rise from 0 to x."""
    return x * x * x * (1.0 - 0.5 * x)


def _risen_smoother(x):
    """Return the integral of the smoother rise from 0 to x."""
    return x * x * x * x * (2.5 - x * (3.0 - x))


def _late(y, k):
    """Return the integral of x exp(-y x) over [0, 1] by k, that of (1-x) exp(-y x)."""
    return 1.0 - y * k - k


def _fallen(s, k, late):
    """Return the integral of the decay from 0 to s by the integrals k and late."""
    return s * ((1.0 - s) * (k + late) + s * k)


def _sucked(r):
    """Return the integral of the cubic suction from 0 to r, over 27/4."""
    return r * r * (0.5 + r * (0.25 * r - 2.0 / 3.0))


def _middle(y, k, late):
    """Return the integral of x (1 - x) exp(-y x) over 0 to 1 by k and late."""
    near = jnp.abs(y) < SMALL_EXPONENT
    series = 1.0 / 6.0 + y * (-1.0 / 12.0 + y * (1.0 / 40.0 - y / 180.0))
    return jnp.where(near, series, (k - late) / jnp.where(near, 1.0, y))


class Ringing(NamedTuple):
    r"""Contribution of resonance to the mean pressure over each bin.

    Attributes:
        mean: The whole contribution.
        real: Its oscillating part, which is not smooth within a wide bin.
        imaginary: The same a quarter of a period later. A filter that multiplies
            $e^{\lambda t}$ by $F$ turns the real part into $\mathrm{Re}\,F$ times it
            minus $\mathrm{Im}\,F$ times the imaginary part.
    """

    mean: Float[Array, " bin"]
    real: Float[Array, " bin"]
    imaginary: Float[Array, " bin"]


def pole_of(omega: Float[Array, ""], damping: Float[Array, ""]) -> Complex[Array, ""]:
    r"""Return the pole $\lambda$ of a resonant sensor.

    Args:
        omega: $\omega$ [1/sample].
        damping: $\zeta$, below 1.
    """
    turned = omega * jnp.sqrt(1.0 - damping * damping)
    return lax.complex(-damping * omega, turned)


def ringing(
    bins: Bins,
    pulse: Pulse,
    omega: Float[Array, ""],
    damping: Float[Array, ""],
) -> Ringing:
    r"""Return the contribution of resonance to the mean pressure over each bin.

    Args:
        bins: Contiguous bins.
        pulse: Pressure at the sensor, without a hold time; times in samples.
        omega: $\omega$ [1/sample].
        damping: $\zeta$, below 1.
    """
    p = pulse
    numbers = (
        *(p.arrival_time, p.peak, p.rise_time, p.duration, p.decay),
        *(p.suction, p.suction_duration, omega, damping),
    )

    @jax.custom_jvp
    def added(numbers):
        return sums_over(bins, numbers, terms_of(numbers))

    @added.defjvp
    def _(primals, tangents):
        # the slopes by nine numbers are computed once, not for each unknown
        return added(primals[0]), tangents[0] @ ringing_slopes(bins, primals[0])

    return Ringing(*added(jnp.stack(numbers)))


def ringing_slopes(bins: Bins, numbers: Float[Array, "9"]) -> Float[Array, "3 9 bin"]:
    """Return the slopes of `Ringing` by the numbers of `ringing`.

    A small shift or stretch of a wave is a sum of waves of the same kind at the same
    position. The slopes are therefore those of the coefficients of a few waves.
    """
    here, pole = terms_of(numbers), pole_of(numbers[7], numbers[8])
    _, _, first_rise, first_end, decay, _, first_fall, _, _ = numbers
    length = first_end - first_rise
    ring = lax.complex(here.real, here.imaginary)
    up = np.arange(1, here.up.size).astype(numbers.dtype) * here.up[1:]
    low = np.arange(1, here.low.size).astype(numbers.dtype) * here.low[1:]
    down = here.down[1] - decay * here.down[0], -decay * here.down[1]

    def coefficients(other):
        """Return the coefficients of other numbers, to first order about these."""
        there, turned = terms_of(other), pole_of(other[7], other[8])
        arrival, _, rise, end, steeper, _, fall, _, _ = other - numbers
        rising = _moved(there.up, up, arrival / first_rise, rise / first_rise)
        late, longer = (arrival + rise) / length, (end - rise) / length
        falling = [
            there.down[0] - down[0] * late,
            there.down[1] - down[1] * late - down[0] * longer - here.down[0] * steeper,
            -down[1] * longer - here.down[1] * steeper,
        ]
        last = _moved(there.low, low, (arrival + end) / first_fall, fall / first_fall)
        begins = arrival + jnp.stack([jnp.zeros_like(rise), rise, end, end + fall])
        now = lax.complex(there.real, there.imaginary)
        now = now - pole * ring * begins.astype(pole.dtype)
        grows = ring * (turned - pole)
        both = jnp.concatenate([now, grows])
        forced = jnp.concatenate([rising, jnp.stack(falling), last])
        return forced, jnp.real(both), jnp.imag(both)

    forced, real, imaginary = (slope.T for slope in jax.jacfwd(coefficients)(numbers))
    over = waves_over(bins, numbers, here)
    many = here.real.size
    (now, grows), (turns, bends) = (
        (x[:, :many], x[:, many:]) for x in (real, imaginary)
    )
    sums = [[now, -turns, grows, -bends], [turns, now, bends, grows]]
    rings = jnp.concatenate([jnp.concatenate(row, axis=1) for row in sums])
    rings = (rings @ over.rings).reshape(2, numbers.size, -1)
    return jnp.stack([forced @ over.forced + rings[0], rings[0], rings[1]])


def _moved(terms, slope, later, longer):
    """Return a polynomial of an elapsed share that begins later and lasts longer."""
    moved = terms - later * jnp.pad(slope, (0, 1))
    return moved - longer * jnp.pad(slope, (1, 0))


class Terms(NamedTuple):
    r"""The coefficients of $\mathrm{Re}\,(C z)$: forced response and ringing.

    Attributes:
        up: Of powers of the elapsed share of the rise.
        down: Of powers of that of the decay, each times the decay itself.
        low: Of powers of that of the suction.
        real: Of the ringing that starts with each of the three pieces and behind them.
        imaginary: The imaginary parts of these.
    """

    up: Float[Array, " power"]
    down: Float[Array, " power"]
    low: Float[Array, " power"]
    real: Float[Array, "4"]
    imaginary: Float[Array, "4"]


def terms_of(numbers: Float[Array, "9"]) -> Terms:
    """Return the coefficients, by the numbers of `ringing`."""
    pole = pole_of(numbers[7], numbers[8])
    kind = pole.dtype
    _, peak, rise, end, decay, suction, fall, omega, damping = numbers.astype(kind)
    length = end - rise
    # C = c (pole / omega^2 + 2 damping / omega) of the introduction
    size = -jnp.square(numbers[7]) / jnp.imag(pole)
    weight = lax.complex(jnp.zeros_like(size), size)
    weight = weight * (pole / (omega * omega) + 2.0 * damping / omega)
    # forced response by powers of the elapsed share of each piece
    up, begun = _rise_terms(pole * rise)
    up, begun = peak * rise * up, peak * rise * begun
    down = peak * length * _decay_terms(pole * length, decay)
    low = -6.75 * suction * fall * _suction_terms(pole * fall)
    # ringing of each piece from its start: z is continuous where pieces meet
    at_peak = jnp.sum(up) + begun * jnp.exp(pole * rise) - down[0]
    at_end = jnp.sum(down) * jnp.exp(-decay) + at_peak * jnp.exp(pole * length) - low[0]
    at_last = jnp.sum(low) + at_end * jnp.exp(pole * fall)
    rings = weight * jnp.stack([begun, at_peak, at_end, at_last])
    up, down, low = (jnp.real(weight * terms) for terms in (up, down, low))
    return Terms(up, down, low, jnp.real(rings), jnp.imag(rings))


def _rise_terms(pole):
    """Return the forced response to a smooth rise of length 1, and the ringing."""
    small = jnp.abs(pole) < SMALL_PHASE
    near = jnp.where(small, pole, jnp.zeros_like(pole))
    powers = [jnp.ones_like(pole)]
    for _ in range(TERMS):
        powers.append(powers[-1] * near)
    series = [jnp.zeros_like(pole)] * (TERMS + 4)
    for m in range(TERMS):
        first, second = 6.0 / math.factorial(m + 3), 12.0 / math.factorial(m + 4)
        series[m + 3] = series[m + 3] + first * powers[m]
        series[m + 4] = series[m + 4] - second * powers[m]
    i = 1.0 / jnp.where(small, jnp.ones_like(pole), pole)
    start = (6.0 - 12.0 * i) * i**3
    closed = [-start, (12.0 * i - 6.0) * i * i, (6.0 * i - 3.0) * i, 2.0 * i]
    closed += [jnp.zeros_like(pole)] * TERMS
    none = jnp.zeros_like(start)
    terms = jnp.where(small, jnp.stack(series), jnp.stack(closed))
    return terms, jnp.where(small, none, start)


def _decay_terms(pole, decay):
    """Return the forced response to a decay of length 1, over that decay."""
    both = 1.0 / (pole + decay)
    return jnp.stack([both * both - both, both])


def _suction_terms(pole):
    """Return the forced response to a suction of length and depth 1."""
    i = 1.0 / pole
    first = ((6.0 * i - 4.0) * i + 1.0) * i
    return -i * jnp.stack(
        [first, (6.0 * i - 4.0) * i + 1.0, 3.0 * i - 2.0, jnp.ones_like(i)]
    )


class Waves(NamedTuple):
    """Contributions of waves to the mean over each bin.

    Each is minus the difference of the wave between the bounds, over the bin's width.

    Attributes:
        forced: Powers in the rise, the decay and the suction; in the decay one power
            more than in `Terms`.
        rings: Real parts of the four ringings, then imaginary parts; then the same
            times the time since the start of each.
    """

    forced: Float[Array, "wave bin"]
    rings: Float[Array, "16 bin"]


class _Passed(NamedTuple):
    """Piece of the pulse at each instant, and elapsed shares of the pieces."""

    inside: Float[Array, "4 instant"]
    rise: Float[Array, " instant"]
    decay: Float[Array, " instant"]
    suction: Float[Array, " instant"]
    elapsed: Float[Array, " instant"]


def sums_over(
    bins: Bins, numbers: Float[Array, "9"], terms: Terms
) -> Float[Array, "3 bin"]:
    r"""Return the contribution of the sum of all waves, $\mathrm{Re}\,(C z)$.

    Args:
        bins: Contiguous bins.
        numbers: Numbers as for `waves_over`.
        terms: Coefficients by these numbers.

    Returns:
        The whole contribution to the means, then real and imaginary part of the
        ringing.
    """
    passed = _passed_shares(bins, numbers)
    up, down, low = passed.inside[:3]
    s = passed.decay
    falling = (terms.down[0] + terms.down[1] * s) * jnp.exp(-numbers[4] * s)
    rising = terms.up @ _powers(terms.up.size, passed.rise)
    sucked = terms.low @ _powers(terms.low.size, passed.suction)
    cos, sin = oscillation(*_pole(numbers), passed.elapsed)
    a, b = terms.real @ passed.inside, terms.imaginary @ passed.inside
    forced = up * rising + down * falling + low * sucked
    real, imaginary = a * cos - b * sin, a * sin + b * cos
    return -bins.means_by(jnp.stack([forced + real, real, imaginary]))


def waves_over(bins: Bins, numbers: Float[Array, "9"], terms: Terms) -> Waves:
    """Return the waves over bins.

    Args:
        bins: Contiguous bins.
        numbers: Arrival, peak, rise, duration, decay, suction and its duration,
            frequency and damping; times in samples.
        terms: Coefficients by these numbers, for the number of powers.
    """
    passed = _passed_shares(bins, numbers)
    both = oscillation(*_pole(numbers), passed.elapsed)
    falling = in_halves(lambda s: jnp.exp(-numbers[4] * s), passed.decay)
    up, down, low = passed.inside[:3]
    forced = [
        up[None, :] * _powers(terms.up.size, passed.rise),
        (down * falling)[None, :] * _powers(terms.down.size + 1, passed.decay),
        low[None, :] * _powers(terms.low.size, passed.suction),
    ]
    rings = jnp.concatenate([passed.inside * x[None, :] for x in both])
    rings = jnp.concatenate([rings, passed.elapsed[None, :] * rings])
    return Waves(-bins.means_by(jnp.concatenate(forced)), -bins.means_by(rings))


def _passed_shares(bins: Bins, numbers) -> _Passed:
    """Return the position of the bounds of bins in a pulse."""
    arrival, _, rise, duration, _, _, fall, _, _ = numbers
    since = bins.ends.astype(numbers.dtype) - arrival
    edges = jnp.stack([jnp.zeros_like(rise), rise, duration, duration + fall])
    begun = (since[None, :] >= edges[:, None]).astype(since.dtype)
    inside = begun - jnp.concatenate([begun[1:], jnp.zeros_like(begun[:1])])
    return _Passed(
        inside=inside,
        rise=jnp.clip(since / rise, 0.0, 1.0),
        decay=jnp.clip((since - rise) / (duration - rise), 0.0, 1.0),
        suction=jnp.clip((since - duration) / fall, 0.0, 1.0),
        elapsed=jnp.maximum(since - edges @ inside, 0.0),
    )


def _pole(numbers):
    """Return real and imaginary part of the pole, without complex numbers."""
    omega, damping = numbers[7], numbers[8]
    return -damping * omega, omega * jnp.sqrt(1.0 - damping * damping)


def _powers(many, x):
    """Return powers of numbers, [power, number]."""
    made = [jnp.ones_like(x)]
    for _ in range(many - 1):
        made.append(made[-1] * x)
    return jnp.stack(made)


def in_halves(of: Callable[..., Result], x: Float[Array, " instant"]) -> Result:
    """Return an elementwise function of numbers, by a loop over two halves.

    Args:
        of: Elementwise function, whose results have the length of its argument.
        x: The numbers.
    """
    # XLA does not fuse across a loop, so an exponential that several results share is
    # computed once; fused, it is computed for each of them
    count = x.shape[0]
    half = -(-count // 2)
    made = lax.map(of, jnp.pad(x, (0, 2 * half - count)).reshape(2, half))
    return jax.tree.map(lambda both: both.reshape(-1)[:count], made)


def oscillation(
    rate: Float[Array, ""], turn: Float[Array, ""], elapsed: Float[Array, " instant"]
) -> tuple[Float[Array, " instant"], Float[Array, " instant"]]:
    r"""Return real and imaginary part of $e^{(r + i w) t}$.

    Args:
        rate: $r$.
        turn: $w$.
        elapsed: $t$; for a phase $w t$ above 1e8 all digits are lost.
    """
    size = jnp.exp(rate * elapsed)
    sine, cosine = sine_and_cosine(turn * elapsed)
    return size * cosine, size * sine


def sine_and_cosine(
    phase: Float[Array, "..."],
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return sine and cosine, to two units in the last place of 1.

    Args:
        phase: Below 1e8 in double precision, 1e4 in single [rad].
    """
    # XLA calls a library for each double-precision sine; additions and products are
    # vectorized
    turns = jnp.round(phase * (2.0 / np.pi))
    x = phase
    for part in QUARTER:
        x = x - turns * part
    square = x * x
    sine = x + x * square * _polynomial(SINE, square)
    cosine = 1.0 - 0.5 * square + square * square * _polynomial(COSINE, square)
    quadrant = turns - 4.0 * jnp.floor(0.25 * turns)
    odd = (quadrant == 1.0) | (quadrant == 3.0)
    sine, cosine = jnp.where(odd, cosine, sine), jnp.where(odd, sine, cosine)
    return (
        jnp.where(quadrant >= 2.0, -sine, sine),
        jnp.where((quadrant == 1.0) | (quadrant == 2.0), -cosine, cosine),
    )


def _polynomial(coefficients, x):
    """Return a polynomial by Horner's rule, highest power first."""
    value = jnp.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value
