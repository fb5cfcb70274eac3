r"""What a resonant sensor, and a high-pass, make of a pulse.

A sensor that is a damped oscillator, $\ddot y + 2\zeta\omega\dot y + \omega^2 y =
\omega^2 p$, has a pair of poles $\lambda = -\zeta\omega \pm i\Omega$, and

$$y = \mathrm{Re}\,(c\,z), \quad \dot y = \mathrm{Re}\,(c \lambda z), \quad
  z(t) = \int_0^t p(u)\,e^{\lambda(t-u)}\,\mathrm{d}u, \quad c = -i\,\omega^2/\Omega$$

In each piece of the pulse $z$ is a particular solution of $\dot z = \lambda z + p$ and
a multiple of $e^{\lambda t}$ that joins it to the piece before; the rise, which may be
much shorter than a period, is a power series in $\lambda\tau$ there. Means over bins
need no further integral: that of the oscillator's equation is
$\bar y = \bar p - [\dot y]/(\omega^2 \Delta) - 2\zeta\,[y]/(\omega \Delta)$.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Complex, Float

from jblast.inference.picks.ready.bins import Bins
from jblast.waves.waveform.pulse import Pulse

SMALL = 0.1
"""A rise of fewer radians of the pole is by the series; from there on the closed form
loses $12/0.1^4$ of rounding, 3e-11, by cancellation."""

TERMS = 8
"""Of the series: the first left out is below 2e-15 then."""


def ringing(
    bins: Bins,
    pulse: Pulse,
    omega: Float[Array, ""],
    damping: Float[Array, ""],
) -> Float[Array, " bin"]:
    r"""Return what resonance adds to the mean pressure over each bin.

    Args:
        bins: Contiguous.
        pulse: That the sensor feels; times in samples.
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

    return added(jnp.stack(numbers))


def _added(bins: Bins, numbers: Float[Array, "9"]) -> Float[Array, " bin"]:
    """Return what resonance adds, by the numbers of `ringing`."""
    arrival, peak, rise, duration, decay, suction, length, omega, damping = numbers
    none = jnp.zeros_like(peak)
    pulse = Pulse(arrival, peak, rise, duration, decay, suction, length, none)
    turned = omega * jnp.sqrt(1.0 - damping * damping)
    pole = lax.complex(-damping * omega, turned)
    ends = np.append(bins.start, bins.stop[-1]).astype(omega.dtype)
    z = pole_response(pulse, ends, pole)
    weight = lax.complex(jnp.zeros_like(omega), -omega * omega / turned)
    slope = jnp.real(weight * pole * z)
    value = jnp.real(weight * z)
    moved = slope / (omega * omega) + 2.0 * damping / omega * value
    return -(moved[1:] - moved[:-1]) / bins.width.astype(omega.dtype)


def pole_response(
    pulse: Pulse, time: Float[np.ndarray, " instant"], pole: Complex[Array, ""]
) -> Complex[Array, " instant"]:
    r"""Return $z$ at instants: the pulse through a pole with an oscillation.

    Args:
        pulse: With nothing held.
        time: On the clock of its arrival.
        pole: $\lambda$, its imaginary part not zero.
    """
    since = time - pulse.arrival_time
    rise, length = pulse.rise_time, pulse.decay_duration
    fall = pulse.suction_duration
    x = jnp.clip(since / rise, 0.0, 1.0)
    s = jnp.clip((since - rise) / length, 0.0, 1.0)
    q = jnp.clip((since - pulse.duration) / fall, 0.0, 1.0)
    over = jnp.maximum(since - pulse.duration - fall, 0.0)
    after = since > pulse.duration + fall
    x, s, q, over, rise, length, fall, peak, suction, decay = (
        number.astype(pole.dtype)
        for number in (
            *(x, s, q, over, rise, length, fall),
            *(pulse.peak, pulse.suction, pulse.decay),
        )
    )
    up = _through_rise(x, pole * rise) * (peak * rise)
    top = _through_rise(jnp.ones_like(rise), pole * rise) * (peak * rise)
    down = _through_decay(s, pole * length, decay) * (peak * length)
    first = _through_decay(jnp.zeros_like(rise), pole * length, decay)
    last = _through_decay(jnp.ones_like(rise), pole * length, decay)
    kept = top - first * (peak * length)
    down = down + kept * jnp.exp(pole * length * s)
    end = last * (peak * length) + kept * jnp.exp(pole * length)
    depth = -6.75 * suction * fall
    low = _through_suction(q, pole * fall) * depth
    kept = end - _through_suction(jnp.zeros_like(rise), pole * fall) * depth
    low = low + kept * jnp.exp(pole * fall * q)
    still = _through_suction(jnp.ones_like(rise), pole * fall) * depth
    still = (still + kept * jnp.exp(pole * fall)) * jnp.exp(pole * over)
    behind = jnp.where(since < pulse.duration, down, jnp.where(after, still, low))
    none = jnp.zeros_like(low)
    return jnp.where(since < 0, none, jnp.where(since < pulse.rise_time, up, behind))


def _through_rise(x, pole):
    """Return the integral of the smooth step through a pole, of a rise of length 1."""
    small = jnp.abs(pole) < SMALL
    near = jnp.where(small, pole, jnp.zeros_like(pole))
    series = jnp.zeros_like(x * near)
    for m in reversed(range(TERMS)):
        first, second = 6.0 / math.factorial(m + 3), 12.0 / math.factorial(m + 4)
        series = series * (near * x) + (first - second * x)
    far = jnp.where(small, jnp.ones_like(pole), pole)
    inverse = 1.0 / far
    steps = (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x), 6.0 - 12.0 * x)
    held = ((-12.0 * inverse + steps[2]) * inverse + steps[1]) * inverse + steps[0]
    start = (6.0 - 12.0 * inverse) * inverse**3
    return jnp.where(small, series * x**3, start * jnp.exp(far * x) - held * inverse)


def _through_decay(s, pole, decay):
    """Return the particular solution behind the front, of a decay of length 1."""
    both = 1.0 / (pole + decay)
    return -(1.0 - s - both) * both * jnp.exp(-decay * s)


def _through_suction(q, pole):
    """Return the particular solution within the suction, of length and depth 1."""
    inverse = 1.0 / pole
    slopes = (q * (1.0 - q) ** 2, (1.0 - q) * (1.0 - 3.0 * q), 6.0 * q - 4.0)
    total = 6.0 * inverse
    for slope in reversed(slopes):
        total = (total + slope) * inverse
    return -total
