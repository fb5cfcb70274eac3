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

from jblast.inference.picks.fit.computed_once import oscillation, polynomial
from jblast.inference.picks.ready.bins import Bins
from jblast.waves.waveform.pulse import Pulse

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
        slopes = jax.jacfwd(lambda x: _added(bins, x))(primals[0])
        return added(primals[0]), slopes @ tangents[0]

    return Ringing(*added(jnp.stack(numbers)))


def _added(bins: Bins, numbers: Float[Array, "9"]) -> Float[Array, "3 bin"]:
    """Return what resonance adds, by the numbers of `ringing`."""
    arrival, peak, rise, duration, decay, suction, length, omega, damping = numbers
    none = jnp.zeros_like(peak)
    pulse = Pulse(arrival, peak, rise, duration, decay, suction, length, none)
    ends = np.append(bins.start, bins.stop[-1]).astype(omega.dtype)
    forced, real, imaginary = response_moments(pulse, ends, omega, damping)
    moved = jnp.stack([forced + real, real, imaginary])
    return -(moved[:, 1:] - moved[:, :-1]) / bins.width.astype(omega.dtype)[None, :]


def response_moments(
    pulse: Pulse,
    time: Float[np.ndarray, " instant"],
    omega: Float[Array, ""],
    damping: Float[Array, ""],
) -> tuple[
    Float[Array, " instant"], Float[Array, " instant"], Float[Array, " instant"]
]:
    r"""Return $\mathrm{Re}\,(C z)$ at instants: what is forced, and the ring $C z$.

    Args:
        pulse: With nothing held.
        time: On the clock of its arrival.
        omega: $\omega$.
        damping: $\zeta$, below 1.
    """
    pole = pole_of(omega, damping)
    kind = pole.dtype
    rise, length, fall, end, decay, peak, suction = (
        number.astype(kind)
        for number in (
            *(pulse.rise_time, pulse.decay_duration, pulse.suction_duration),
            *(pulse.duration, pulse.decay, pulse.peak, pulse.suction),
        )
    )
    # c times what the moments are of
    size = -omega * omega / jnp.imag(pole)
    turned = lax.complex(jnp.zeros_like(size), size)
    weight = turned * (
        pole * (1.0 / (omega * omega)).astype(kind)
        + (2.0 * damping / omega).astype(kind)
    )
    # forced: by powers of the share of each piece that has passed
    up, begun = _rise_terms(pole * rise)
    up, begun = peak * rise * up, peak * rise * begun
    down = peak * length * _decay_terms(pole * length, decay)
    low = -6.75 * suction * fall * _suction_terms(pole * fall)
    # the ring of each piece, counted from where it begins
    at_peak = jnp.sum(up) + begun * jnp.exp(pole * rise) - down[0]
    at_end = jnp.sum(down) * jnp.exp(-decay) + at_peak * jnp.exp(pole * length) - low[0]
    at_last = jnp.sum(low) + at_end * jnp.exp(pole * fall)
    up, down, low = (jnp.real(weight * terms) for terms in (up, down, low))
    rings = weight * jnp.stack([begun, at_peak, at_end, at_last])

    since = time - pulse.arrival_time
    last = pulse.duration + pulse.suction_duration
    pieces = (since < pulse.rise_time, since < pulse.duration, since < last)

    def chosen(*of):
        return jnp.where(
            pieces[0],
            of[0],
            jnp.where(pieces[1], of[1], jnp.where(pieces[2], of[2], of[3])),
        )

    # which piece each instant lies in, 1 of 4, so that a product of matrices chooses
    ends = [jnp.zeros_like(since), *(x.astype(since.dtype) for x in pieces)]
    ends.append(jnp.ones_like(since))
    inside = jnp.diff(jnp.stack(ends), axis=0)
    x = jnp.clip(since / pulse.rise_time, 0.0, 1.0)
    s = jnp.clip((since - pulse.rise_time) / pulse.decay_duration, 0.0, 1.0)
    q = jnp.clip((since - pulse.duration) / pulse.suction_duration, 0.0, 1.0)
    none = jnp.zeros_like(since)
    falling = (down[0] + down[1] * s) * jnp.exp(-pulse.decay * s)
    forced = chosen(polynomial(up, x), falling, polynomial(low, q), none)
    starts = jnp.stack([none[0], pulse.rise_time, jnp.real(end), last])
    elapsed = jnp.maximum(since - starts @ inside, 0.0)
    cos, sin = oscillation(jnp.real(pole), jnp.imag(pole), elapsed)
    a, b = jnp.real(rings) @ inside, jnp.imag(rings) @ inside
    after = since >= 0
    return (
        jnp.where(after, forced, none),
        jnp.where(after, a * cos - b * sin, none),
        jnp.where(after, a * sin + b * cos, none),
    )


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
