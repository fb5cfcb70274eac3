r"""What air leaves of a sound: a causal filter with the spectrum of ISO 9613-1.

The standard says how much of a tone is left, $|H(f)| = e^{-\alpha(f) d}$, and nothing
of when it comes. Of all filters with that spectrum the causal one of least delay is
taken: its phase is the Hilbert transform of $\ln|H|$ (Kramers and Kronig). For the
standard's relaxations it is the dispersion of the air,

$$\frac{A f^2}{f_\nu + f^2/f_\nu} = \mathrm{Re}\,\frac{A f_\nu\,jf}{f_\nu + jf}$$

whose right-hand side is causal as it stands: a front runs ahead at the speed of frozen
molecules, and what is slow follows. For the term in $f^2$ there is no causal filter
at all frequencies, only one up to half the rate; it comes late by
$\ln 2\,f_s\,c\,d/\pi^2$ for an absorption of $c f^2$ (0.3 ms at 5 km and 48 kHz).
"""

import math

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike, Complex, Float

from jblast.types import as_float_array
from jblast.waves.propagation.absorption import (
    iso_9613_absorption,
    stokes_absorption,
)

TAIL_S = 0.25
"""Silence behind a signal, so that its end does not wrap round to its start [s]. The
slowest relaxation, nitrogen's in dry air at 9 Hz, has fallen by e^-14 then."""

STOKES_FREQUENCY = 500.0 / (2.0 * math.pi)
"""The one frequency that the thesis absorbs all sound by, 500 rad/s [Hz]."""


def absorption_transfer(
    count: int,
    rate: float,
    distance: Float[ArrayLike, ""],
    temperature: Float[ArrayLike, ""],
    pressure: Float[ArrayLike, ""],
    relative_humidity: Float[ArrayLike, ""],
) -> Complex[Array, " frequency"]:
    """Return the transfer function at 0, rate / count, ... to half the rate [-].

    Args:
        count: Samples that are transformed, even.
        rate: Samples a second [Hz].
        distance: Way through the air [m], not negative.
        temperature: Of the air [K].
        pressure: Of the air [Pa].
        relative_humidity: Of the air, fraction, 0 to 1.
    """
    distance = as_float_array(distance)
    frequency = jnp.arange(count // 2 + 1, dtype=distance.dtype) * (rate / count)
    log_gain = -distance * iso_9613_absorption(
        frequency, temperature, pressure, relative_humidity
    )
    cepstrum = jnp.fft.irfft(log_gain, count)
    # all at positive times, twice: the logarithm of what has nothing at negative ones
    causal = cepstrum[1 : count // 2]
    phase = jnp.fft.rfft(jnp.pad(2.0 * causal, (1, count // 2))).imag
    gain = jnp.exp(log_gain)
    return lax.complex(gain * jnp.cos(phase), gain * jnp.sin(phase))


def absorb(
    samples: Float[ArrayLike, " sample"],
    rate: float,
    distance: Float[ArrayLike, ""],
    *,
    temperature: Float[ArrayLike, ""],
    pressure: Float[ArrayLike, ""],
    relative_humidity: Float[ArrayLike, ""],
) -> Float[Array, " sample"]:
    """Return what the air leaves of a signal, as many samples; spreading is not in it.

    Args:
        samples: Of the signal, silent before the first.
        rate: Samples a second [Hz].
        distance: Way through the air [m], not negative.
        temperature: Of the air [K].
        pressure: Of the air [Pa].
        relative_humidity: Of the air, fraction, 0 to 1.
    """
    samples = as_float_array(samples)
    n = samples.shape[0]
    count = 2 ** math.ceil(math.log2(n + TAIL_S * rate + 1))
    transfer = absorption_transfer(
        count, rate, distance, temperature, pressure, relative_humidity
    )
    spectrum = jnp.fft.rfft(samples, count)
    return jnp.fft.irfft(spectrum * transfer.astype(spectrum.dtype), count)[:n]


def absorb_by_stokes(
    samples: Float[ArrayLike, " sample"],
    distance: Float[ArrayLike, ""],
    *,
    air_density: Float[ArrayLike, ""],
    sound_speed: Float[ArrayLike, ""],
    temperature: Float[ArrayLike, ""],
) -> Float[Array, " sample"]:
    r"""Return a signal as the thesis absorbs it: all of it times $e^{-\alpha R}$.

    $\alpha$ is Stokes' at 500 rad/s, so after 35 m it is as loud as at the start.

    Args:
        samples: Of the signal.
        distance: Way through the air $R$ [m].
        air_density: Of the air [kg/m3].
        sound_speed: Of the air [m/s].
        temperature: Of the air [K].

    References:
        Parab's thesis, eqs. 3.1 and 3.2.
    """
    alpha = stokes_absorption(STOKES_FREQUENCY, air_density, sound_speed, temperature)
    return as_float_array(samples) * jnp.exp(-alpha * as_float_array(distance))
