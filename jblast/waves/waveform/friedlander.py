r"""The shape of a blast wave at a place: Friedlander's pulse.

$$p(t) = P_s \left(1 - \frac{t}{t_d}\right) e^{-b\,t/t_d}, \qquad t \ge 0$$

Friedlander (1946), with $b = 1$ as printed in Parab's thesis, eq. 3.5 (whose scan has
lost the exponential); with a decay $b$ of its own in NAVFAC DM-2.08, eq. 13a.

Time counts from the arrival: before it the pressure is exactly zero, at it $P_s$ (the
limit from inside, as are the derivatives there). The formula goes on past $t_d$, where
the positive phase ends, as a negative tail: lowest at $t_d(1 + 1/b)$ with
$-(P_s/b)\,e^{-(b+1)}$. The whole record has the impulse $P_s t_d (1/b - 1/b^2)$: none
at $b = 1$, and for less the tail outweighs the positive phase. `negative_phase.py` has
a tail that ends. For $b \le 0$ the tail has no end and grows: stop at $t_d$. For
$b < -1$ the pressure even rises behind the front, so $P_s$ is not the peak.

In single precision everything keeps five digits and more, but near $t_d$ the pressure
passes through zero, and its error is then a rounding of $P_s$.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Complex, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.waveform.friedlander_integrals import (
    decay_of_fraction,
    impulse_fraction,
)


@checked
def friedlander_pressure(
    time: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure of the pulse with decay 1 [Pa].

    $$p = P_s (1 - t/t_d)\,e^{-t/t_d}$$

    Args:
        time: $t$ since arrival [s]; negative before.
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Of the positive phase, $t_d$ [s], positive.
    """
    return modified_friedlander_pressure(time, peak_overpressure, duration, 1.0)


@checked
def modified_friedlander_pressure(
    time: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure of the pulse with a decay of its own [Pa].

    $$p = P_s (1 - t/t_d)\,e^{-b\,t/t_d}$$

    Args:
        time: $t$ since arrival [s]; negative before.
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Of the positive phase, $t_d$ [s], positive.
        decay: $b$ [-].
    """
    time, peak, duration, decay = as_float_arrays(
        time, peak_overpressure, duration, decay
    )
    before = time < 0
    phase = jnp.where(before, 0.0, time) / duration
    pressure = peak * (1.0 - phase) * jnp.exp(-decay * phase)
    return jnp.where(before, 0.0, pressure)


@checked
def friedlander_impulse(
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the impulse of the positive phase [Pa s].

    $$i = P_s t_d \left[\frac1b - \frac{1 - e^{-b}}{b^2}\right]$$

    At $b = 0$, a triangle, it is $P_s t_d/2$; a negative $b$ is allowed.

    Args:
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Of the positive phase, $t_d$ [s], positive.
        decay: $b$ [-].
    """
    peak, duration, decay = as_float_arrays(peak_overpressure, duration, decay)
    return peak * duration * impulse_fraction(decay)


@checked
def friedlander_decay(
    peak_overpressure: Float[ArrayLike, "..."],
    impulse: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the decay $b$ that gives a pulse its impulse [-].

    The root of `friedlander_impulse`: the one there is for every $k = i/(P_s t_d)$,
    0 at $k = 1/2$. Above it $b$ is negative; above $e - 2 = 0.718$ it is below $-1$,
    and peak, impulse and duration do not belong to one Friedlander pulse.

    Args:
        peak_overpressure: $P_s$ [Pa], positive.
        impulse: Of the positive phase, $i$ [Pa s], positive.
        duration: Of the positive phase, $t_d$ [s], positive.
    """
    peak, impulse, duration = as_float_arrays(peak_overpressure, impulse, duration)
    return decay_of_fraction(impulse / (peak * duration))


def friedlander_spectrum(
    frequency: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Complex[Array, "..."]:
    r"""Return the Fourier transform of the whole record, tail included [Pa/Hz].

    $$P(f) = \int_0^\infty p(t)\,e^{-i\omega t}\,dt = P_s t_d\,
    \frac{\sigma - 1}{\sigma^2}, \qquad \sigma = b + i\,\omega t_d,\ \omega = 2\pi f$$

    At $b = 1$ its magnitude is $P_s t_d\,\omega t_d/(1 + \omega^2 t_d^2)$, largest at
    $f = 1/(2\pi t_d)$; otherwise it is largest at $\omega t_d = \sqrt{b^2 - 2(b-1)^2}$,
    or at $f = 0$ where that is not real. Inside `jit`, a decay that is not positive
    gives NaN: its record has no transform.

    Args:
        frequency: $f$ [Hz].
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Of the positive phase, $t_d$ [s], positive.
        decay: $b$ [-], positive.

    Raises:
        ValueError: The decay is not positive.
    """
    if not isinstance(decay, Tracer) and np.any(np.asarray(decay) <= 0):
        raise ValueError(
            "decay must be positive for a record to have a spectrum, "
            f"got {np.min(np.asarray(decay)):g}"
        )
    return _spectrum(frequency, peak_overpressure, duration, decay)


@checked
def _spectrum(
    frequency: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Complex[Array, "..."]:
    frequency, peak, duration, decay = jnp.broadcast_arrays(
        *as_float_arrays(frequency, peak_overpressure, duration, decay)
    )
    decaying = decay > 0
    angle = 2.0 * jnp.pi * frequency * duration
    inverse = 1.0 / jax.lax.complex(jnp.where(decaying, decay, 1.0), angle)
    scale = jnp.where(decaying, peak * duration, jnp.nan)
    late = jax.lax.complex(scale * (decay - 1.0), scale * angle)
    return late * inverse * inverse
