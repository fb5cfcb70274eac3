r"""The spectrum of all that is random in a microphone's record.

A record is what laws and filters make of the blast, and noise: of the place and of the
wind, which the instrument filters, and of its own, which it does not. With $H$ the
filter's response and $q$ the smallest step that is written down,

$$S(f) = |H|^2 \big(e^{-2h/H_a} S_a + S_w\big) + S_i + q^2/12$$

each from the taps that `sensors.samples` draws it by. White noise of rms
$\sigma$ has $S = \sigma^2$: the mean over frequency is the square of the rms.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.scene import Instrument, Scene, Sensor
from jblast.sensors.microphone import WIND_SLOPE, share_at_height
from jblast.sensors.samples import BLOCK, coloured_noise
from jblast.waves.propagation import air_density, ambient as ambient_of


def noise_spectrum(scene: Scene, sensor: Sensor) -> Float[Array, " frequency"]:
    """Return the spectrum at `BLOCK` + 1 frequencies from 0 to half the rate [Pa2].

    Args:
        scene: What is there.
        sensor: A microphone, or a pressure gauge, which hears no ambient sound.
    """
    instrument = sensor.instrument or Instrument()
    rate = instrument.rate
    heard = jnp.zeros(BLOCK + 1)
    if sensor.kind != "pressure":
        heard = _around(scene, sensor, instrument)
    high_pass, low_pass = instrument.high_pass, instrument.low_pass
    if high_pass is not None or low_pass is not None:
        heard = heard * passed_power(rate, high_pass, low_pass, BLOCK + 1)
    if instrument.noise is not None and instrument.noise_slope is not None:
        own = coloured_noise(
            jax.random.key(0), rate, instrument.noise, instrument.noise_slope
        )
        heard = heard + _power(own.response)
    elif instrument.noise is not None:
        heard = heard + jnp.square(instrument.noise)
    if instrument.bits is not None and instrument.full_scale is not None:
        step = instrument.full_scale / 2.0 ** (instrument.bits - 1)
        heard = heard + jnp.square(step) / 12.0
    return heard


def passed_power(
    rate: float,
    high_pass: Float[ArrayLike, ""] | None,
    low_pass: Float[ArrayLike, ""] | None,
    count: int,
) -> Float[Array, " frequency"]:
    r"""Return what an instrument's filter leaves of power, from 0 to half the rate [-].

    With $w = \tan(\pi f/f_s)/\tan(\pi f_c/f_s)$, $1/(1 + w^4)$ of a Butterworth
    low-pass of second order turned by the bilinear transform,
    $w^4/(1 + w^4)$ of a high-pass: what `filter_gain` finds of `causal_filter` by
    solving its system, for batches of which XLA's pool of threads on the CPU may wait
    in vain, within a program that differentiates them (jaxlib 0.10).

    Args:
        rate: Samples a second [Hz].
        high_pass: Corner [Hz]; None: there is none.
        low_pass: Likewise.
        count: Of frequencies.
    """
    # at half the rate the tangent is infinite: just below it
    turn = jnp.linspace(0.0, 0.5 - 1e-6, count)
    passed = jnp.ones(count)
    for corner, is_high in ((high_pass, True), (low_pass, False)):
        if corner is None:
            continue
        over = jnp.tan(jnp.pi * turn) / jnp.tan(jnp.pi / rate * jnp.asarray(corner))
        fourth = jnp.square(jnp.square(over))
        passed = passed * (fourth if is_high else 1.0) / (1.0 + fourth)
    return passed


def _around(
    scene: Scene, sensor: Sensor, instrument: Instrument
) -> Float[Array, " frequency"]:
    """Return what is heard without a blast, before the instrument."""
    heard, ambient = jnp.zeros(BLOCK + 1), scene.ambient
    if ambient is not None and ambient.loop is None:
        unit = coloured_noise(jax.random.key(0), instrument.rate, 1.0, ambient.slope)
        share = share_at_height(ambient, sensor.position_m[2])
        heard = heard + jnp.square(share * ambient.level) * _power(unit.response)
    if instrument.wind_noise is not None:
        air = scene.air
        density = air_density(*ambient_of(air), air.relative_humidity)
        level = density * (air.wind_east**2 + air.wind_north**2)
        unit = coloured_noise(jax.random.key(0), instrument.rate, 1.0, WIND_SLOPE)
        heard += jnp.square(instrument.wind_noise * level) * _power(unit.response)
    return heard


def _power(response) -> Float[Array, " frequency"]:
    return jnp.square(response.real) + jnp.square(response.imag)
