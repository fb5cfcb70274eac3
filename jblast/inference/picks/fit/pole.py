r"""What a resonant sensor makes of a pulse.

A sensor that is a damped oscillator, $\ddot y + 2\zeta\omega\dot y + \omega^2 y =
\omega^2 p$, has a pair of poles $\lambda = -\zeta\omega \pm i\Omega$, and

$$y = \mathrm{Re}\,(c\,z), \quad \dot y = \mathrm{Re}\,(c \lambda z), \quad
  z(t) = \int_0^t p(u)\,e^{\lambda(t-u)}\,\mathrm{d}u, \quad c = -i\,\omega^2/\Omega$$

Means over bins need no further integral: that of the oscillator's equation is
$\bar y = \bar p - [\dot y]/(\omega^2 \Delta) - 2\zeta\,[y]/(\omega \Delta) =
\bar p - [\mathrm{Re}\,(C z)]/\Delta$, with $C = c\,(\lambda/\omega^2 + 2\zeta/\omega)$.

In each piece of the pulse $z$ is a particular solution of $\dot z = \lambda z + p$, a
polynomial or one times the pulse's own decay, and a multiple of $e^{\lambda t}$ that
joins it to the piece before: the ring. Only numbers of a piece are complex; at the
instants nothing is but the ring. The rise, which may be much shorter than a period, is
a power series in $\lambda\tau$ there.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Complex, Float

from jblast.inference.picks.fit.ring_waves import Terms, sums_over, waves_over
from jblast.inference.picks.ready.bins import Bins
from jblast.waves.pulse import Pulse

SMALL = 0.1
"""A rise of fewer radians of the pole is by the series; from there on the closed form
loses $12/0.1^4$ of rounding, 3e-11, by cancellation."""

TERMS = 8
"""Of the series: the first left out is below 2e-15 then."""


class Ringing(NamedTuple):
    r"""What resonance adds to the mean pressure over each bin.

    Attributes:
        mean: All of it.
        real: Of that what rings: it oscillates within a bin that is wide.
        imaginary: The same a quarter of a period on: a filter that multiplies
            $e^{\lambda t}$ by $F$ makes $\mathrm{Re}\,F$ times the one less
            $\mathrm{Im}\,F$ times the other of it.
    """

    mean: Float[Array, " bin"]
    real: Float[Array, " bin"]
    imaginary: Float[Array, " bin"]


def pole_of(omega: Float[Array, ""], damping: Float[Array, ""]) -> Complex[Array, ""]:
    r"""Return $\lambda$.

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
    r"""Return what resonance adds to the mean pressure over each bin.

    Args:
        bins: Contiguous.
        pulse: That the sensor feels, with nothing held; times in samples.
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
        return _added(bins, numbers)

    @added.defjvp
    def _(primals, tangents):
        # slopes by these nine numbers once, not by each unknown that they depend on
        return added(primals[0]), tangents[0] @ ringing_slopes(bins, primals[0])

    return Ringing(*added(jnp.stack(numbers)))


def _added(bins: Bins, numbers: Float[Array, "9"]) -> Float[Array, "3 bin"]:
    """Return what resonance adds, by the numbers of `ringing`."""
    return sums_over(bins, numbers, terms_of(numbers))


def ringing_slopes(bins: Bins, numbers: Float[Array, "9"]) -> Float[Array, "3 9 bin"]:
    """Return the slopes of `Ringing` by the numbers of `ringing`.

    A wave that is moved or stretched a little is a sum of waves of its kind where they
    were: so the slopes are those of coefficients, and of few waves.
    """
    here, pole = terms_of(numbers), pole_of(numbers[7], numbers[8])
    _, _, first_rise, first_end, decay, _, first_fall, _, _ = numbers
    length = first_end - first_rise
    ring = lax.complex(here.real, here.imaginary)
    up = np.arange(1, here.up.size).astype(numbers.dtype) * here.up[1:]
    low = np.arange(1, here.low.size).astype(numbers.dtype) * here.low[1:]
    down = here.down[1] - decay * here.down[0], -decay * here.down[1]

    def coefficients(other):
        """Return those of other numbers, to first order about these."""
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
    """Return a polynomial of a share that begins later, of what lasts longer."""
    moved = terms - later * jnp.pad(slope, (0, 1))
    return moved - longer * jnp.pad(slope, (1, 0))


def terms_of(numbers: Float[Array, "9"]) -> Terms:
    """Return the coefficients, by the numbers of `ringing`."""
    pole = pole_of(numbers[7], numbers[8])
    kind = pole.dtype
    _, peak, rise, end, decay, suction, fall, omega, damping = numbers.astype(kind)
    length = end - rise
    # c times what the moments are of
    size = -jnp.square(numbers[7]) / jnp.imag(pole)
    weight = lax.complex(jnp.zeros_like(size), size)
    weight = weight * (pole / (omega * omega) + 2.0 * damping / omega)
    # forced: by powers of the share of each piece that has passed
    up, begun = _rise_terms(pole * rise)
    up, begun = peak * rise * up, peak * rise * begun
    down = peak * length * _decay_terms(pole * length, decay)
    low = -6.75 * suction * fall * _suction_terms(pole * fall)
    # the ring of each piece, counted from where it begins
    at_peak = jnp.sum(up) + begun * jnp.exp(pole * rise) - down[0]
    at_end = jnp.sum(down) * jnp.exp(-decay) + at_peak * jnp.exp(pole * length) - low[0]
    at_last = jnp.sum(low) + at_end * jnp.exp(pole * fall)
    rings = weight * jnp.stack([begun, at_peak, at_end, at_last])
    up, down, low = (jnp.real(weight * terms) for terms in (up, down, low))
    return Terms(up, down, low, jnp.real(rings), jnp.imag(rings))


def _rise_terms(pole):
    """Return the smooth step through a pole, a rise of length 1, and what rings."""
    small = jnp.abs(pole) < SMALL
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
    """Return what is forced behind the front, over its own decay, of length 1."""
    both = 1.0 / (pole + decay)
    return jnp.stack([both * both - both, both])


def _suction_terms(pole):
    """Return what is forced within the suction, of length and depth 1."""
    i = 1.0 / pole
    first = ((6.0 * i - 4.0) * i + 1.0) * i
    return -i * jnp.stack(
        [first, (6.0 * i - 4.0) * i + 1.0, 3.0 * i - 2.0, jnp.ones_like(i)]
    )
