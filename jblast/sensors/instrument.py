r"""An instrument's effect on a signal: band, noise, full scale and bits.

The signal is filtered to the band between the instrument's corners, its noise is added,
and it is limited to the full scale and rounded to the bits, in this order, block by
block.

Band. The filters are causal Butterworth filters. Each section is the analogue one with
its integrators replaced by trapezoidal sums (the bilinear transform, pre-warped so that
the corner stays at its frequency; Zavalishin 2012, "The Art of VA Filter Design", ch. 3
and 4). Its state is that of two integrators, $s = (s_1, s_2)$, which single precision
represents where corners are far below the rate. A cascade of them is one linear system,

$$s_{i+1} = A s_i + b\,x_i, \qquad y_i = c \cdot s_i + d\,x_i$$

and so are `CHUNK` samples of it together: a triangular matrix of the impulse response
on the samples, and powers of $A$ on the state. These are products of matrices, and
steps are taken a chunk at a time; `calibration/filters.py` compares it with a step a
sample.

Full scale $F$. Compressed, a signal $x$ becomes

$$y = x\,(1 + (x/F)^8)^{-1/8},$$

which is within 0.05 % of $x$ up to half of the full scale, smooth everywhere, 0.92 $F$
at the full scale and never beyond it. To read a peak, a compressed sample is expanded
again, $x = y\,(1 - (y/F)^8)^{-1/8}$, up to the full scale. Beyond it a little noise of
$y$ is any $x$: the reading is then a lower bound.

The moving average is the filter by which the thesis smooths the radiation of the
ground (Parab's thesis, algorithm 2, lines 33 to 36; that the window is odd and that
$f_c$ is 25 Hz comes from the public plugin). A sample becomes the mean of an odd number
of samples around it, $f_s / (2 f_c)$ or one more, and of fewer at the ends. It is not
causal: a front appears half a window early. Its 3 dB corner is $0.886 f_c$, not $f_c$,
and nothing is left at $2 f_c$.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float, Int, Key

from jblast.observations import Observations, observed
from jblast.scene import Instrument, Sensor
from jblast.sensors.samples import (
    ColouredNoise,
    coloured_noise,
    noise_block,
    noise_start,
    white_noise,
)
from jblast.types import as_float_array

CHUNK = 32
"""Samples that are filtered at once."""
HIGHEST_ORDER = 4
SHARPNESS = 8
"""Exponent of the compression."""
FAR_BEYOND = 1e4
"""Full scales at which a compressed signal is the full scale to the last bit."""
CUTOFF_HZ = 25.0
"""The plugin's $f_c$ [Hz]."""


class CausalFilter(NamedTuple):
    """A filter that is set up.

    Attributes:
        response: Impulse response as a triangular matrix: chunk of samples to chunk.
        heard: What the state adds to each sample of a chunk.
        kept: What each sample of a chunk leaves in the state.
        powers: $A^0$ to $A^{CHUNK}$.
    """

    response: Float[Array, "chunk chunk"]
    heard: Float[Array, "chunk state"]
    kept: Float[Array, "state chunk"]
    powers: Float[Array, "power state state"]


class Chain(NamedTuple):
    """An instrument that is set up.

    Attributes:
        instrument: What it does.
        filter: Of its corners, if it has any.
        key: Random key of its noise.
        noise: That noise, if it has a colour.
    """

    instrument: Instrument
    filter: CausalFilter | None
    key: Key[Array, ""]
    noise: ColouredNoise | None


def instrument_chain(instrument: Instrument, key: Key[Array, ""]) -> Chain:
    """Set an instrument up; its noise comes from the key alone."""
    rate = instrument.rate
    high_pass, low_pass = instrument.high_pass, instrument.low_pass
    passing = noise = None
    if high_pass is not None or low_pass is not None:
        passing = causal_filter(rate, high_pass, low_pass)
    if instrument.noise is not None and instrument.noise_slope is not None:
        noise = coloured_noise(key, rate, instrument.noise, instrument.noise_slope)
    return Chain(instrument, passing, key, noise)


def chain_start(chain: Chain) -> Any:
    """Return the state that an instrument starts with: at rest."""
    return (
        None if chain.filter is None else filter_start(chain.filter),
        None if chain.noise is None else noise_start(chain.noise),
    )


def chain_block(
    chain: Chain,
    state: Any,
    index: Int[ArrayLike, ""],
    samples: Float[Array, " sample"],
) -> tuple[Any, Float[Array, " sample"]]:
    """Return the next state, and what is written down of a block.

    Args:
        chain: The instrument.
        state: What the last block left, or `chain_start`.
        index: Of the block, from 0.
        samples: Of the signal at its place, [BLOCK].
    """
    of_filter, of_noise = state
    if chain.filter is not None:
        of_filter, samples = filter_block(chain.filter, of_filter, samples)
    if chain.noise is not None:
        of_noise, noise = noise_block(chain.noise, of_noise, index)
        samples = samples + noise
    elif chain.instrument.noise is not None:
        samples = samples + chain.instrument.noise * white_noise(chain.key, index)
    written = quantised(saturated(samples, chain.instrument), chain.instrument)
    return (of_filter, of_noise), written


def causal_filter(
    rate: float,
    high_pass: Float[ArrayLike, ""] | None = None,
    low_pass: Float[ArrayLike, ""] | None = None,
    order: int = 2,
) -> CausalFilter:
    """Set a Butterworth filter up: -3 dB at each corner.

    Args:
        rate: Samples a second [Hz].
        high_pass: Corner below which it loses what is slow [Hz]; None loses none.
        low_pass: Corner above which it loses what is fast [Hz]; None loses none.
        order: Of either, 1 to 4: 6 dB an octave each.

    Raises:
        ValueError: A corner is not between zero and half the rate, or the order is no
            order; corners are not looked at inside `jit`.
    """
    if not 1 <= order <= HIGHEST_ORDER:
        raise ValueError(f"order must be 1 to {HIGHEST_ORDER}, got {order}")
    a, b, c, d = (
        jnp.zeros((0, 0)),
        jnp.zeros((0, 1)),
        jnp.zeros((1, 0)),
        jnp.ones((1, 1)),
    )
    for name, corner in (("high_pass", high_pass), ("low_pass", low_pass)):
        if corner is None:
            continue
        if not isinstance(corner, Tracer) and not np.all(
            (np.asarray(corner) > 0) & (np.asarray(corner) < rate / 2)
        ):
            raise ValueError(
                f"{name} must be positive and below half the rate of {rate:g} Hz, got "
                f"{float(np.asarray(corner)):g} Hz"
            )
        gain = jnp.tan(jnp.pi / rate * as_float_array(corner))
        sections = [_one_pole(gain, name)] if order % 2 else []
        sections += [_two_poles(gain, damping, name) for damping in _dampings(order)]
        for section in sections:
            a, b, c, d = _in_series((a, b, c, d), section)
    return _in_chunks(a, b, c, d)


def filter_start(filtering: CausalFilter) -> Float[Array, " state"]:
    """Return the state that a filter starts with: at rest."""
    return jnp.zeros_like(filtering.heard[0])


def filter_block(
    filtering: CausalFilter,
    state: Float[Array, " state"],
    samples: Float[Array, " sample"],
) -> tuple[Float[Array, " state"], Float[Array, " sample"]]:
    """Return the next state, and a block of any length filtered.

    Args:
        filtering: The filter.
        state: What the last block left, or `filter_start`.
        samples: Of the signal.
    """
    n = samples.shape[0]
    whole = n - n % CHUNK
    chunks = samples[:whole].reshape(-1, CHUNK)

    def step(state, driven):
        return filtering.powers[CHUNK] @ state + driven, state

    state, states = lax.scan(step, state, chunks @ filtering.kept.T)
    filtered = chunks @ filtering.response.T + states @ filtering.heard.T
    rest = samples[whole:]
    if not (left := n - whole):
        return state, filtered.reshape(-1)
    end = filtering.response[:left, :left] @ rest + filtering.heard[:left] @ state
    state = filtering.powers[left] @ state + filtering.kept[:, CHUNK - left :] @ rest
    return state, jnp.concatenate([filtered.reshape(-1), end])


def filter_gain(
    filtering: CausalFilter, rate: float, frequency: Float[ArrayLike, " frequency"]
) -> Float[Array, " frequency"]:
    """Return what is left of the amplitude of a tone that lasts [-].

    Args:
        filtering: The filter.
        rate: Samples a second [Hz].
        frequency: Frequencies [Hz].
    """
    step = filtering.powers[1]
    turned = 2.0 * jnp.pi / rate * as_float_array(frequency)
    turn = lax.complex(jnp.cos(turned), jnp.sin(turned))
    first, out, direct, step, identity = (
        x.astype(turn.dtype)
        for x in (
            filtering.kept[:, -1:],
            filtering.heard[0],
            filtering.response[0, 0],
            step,
            jnp.eye(step.shape[0]),
        )
    )
    system = turn[:, None, None] * identity[None] - step[None]
    moved = jnp.linalg.solve(system, jnp.broadcast_to(first, (turn.size, *first.shape)))
    return jnp.abs(moved[..., 0] @ out + direct)


def _dampings(order: int) -> list[float]:
    """Return $1/Q$ of the pairs of poles of a Butterworth filter."""
    odd = order % 2
    angles = [math.pi * (2 * i + 1 + odd) / (2 * order) for i in range(order // 2)]
    return [2.0 * math.cos(angle) for angle in angles]


def _one_pole(gain, name: str):
    """Return $A, b, c, d$ of a section of first order."""
    share = gain / (1.0 + gain)
    a, b = (1.0 - 2.0 * share)[None, None], (2.0 * share)[None, None]
    if name == "low_pass":
        return a, b, (1.0 - share)[None, None], share[None, None]
    return a, b, (share - 1.0)[None, None], (1.0 - share)[None, None]


def _two_poles(gain, damping: float, name: str):
    """Return $A, b, c, d$ of a section of second order."""
    a1 = 1.0 / (1.0 + gain * (gain + damping))
    a2 = gain * a1
    a3 = gain * a2
    # band and low are what the two integrators read half a step on
    band, low = jnp.stack([a1, -a2]), jnp.stack([a2, 1.0 - a3])
    a = 2.0 * jnp.stack([band, low]) - jnp.eye(2)
    b = 2.0 * jnp.stack([a2, a3])[:, None]
    if name == "low_pass":
        return a, b, low[None, :], a3[None, None]
    c = -(damping * band + low)
    return a, b, c[None, :], (1.0 - damping * a2 - a3)[None, None]


def _in_series(first, second):
    """Return the system of which the first feeds the second."""
    a1, b1, c1, d1 = first
    a2, b2, c2, d2 = second
    nothing = jnp.zeros((a1.shape[0], a2.shape[0]))
    a = jnp.block([[a1, nothing], [b2 @ c1, a2]])
    b = jnp.concatenate([b1, b2 @ d1])
    return a, b, jnp.concatenate([d2 @ c1, c2], axis=1), d2 @ d1


def _in_chunks(a, b, c, d) -> CausalFilter:
    """Return what a system makes of `CHUNK` samples at once."""
    _, powers = lax.scan(
        lambda power, _: (a @ power, power), jnp.eye(a.shape[0]), length=CHUNK + 1
    )
    heard = (c @ powers[:CHUNK])[:, 0, :]
    after = jnp.concatenate([d[0], heard[: CHUNK - 1] @ b[:, 0]])
    lag = np.arange(CHUNK)[:, None] - np.arange(CHUNK)[None, :]
    response = jnp.where(lag >= 0, after[np.maximum(lag, 0)], 0.0)
    kept = (powers[:CHUNK] @ b)[::-1, :, 0].T
    return CausalFilter(response, heard, kept, powers)


class Clipping(NamedTuple):
    """Whether a record saturated.

    Attributes:
        clipped: Whether any of its samples did: its peak is a lower bound then.
        level: Magnitude up to which a signal is written down; infinite: any.
    """

    clipped: Bool[Array, "..."]
    level: Float[Array, ""]


def saturated(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples as large as the instrument can have them."""
    full_scale = instrument.full_scale
    if full_scale is None:
        return samples
    if instrument.saturation == "clip":
        return jnp.clip(samples, -full_scale, full_scale)
    share = jnp.clip(samples / full_scale, -FAR_BEYOND, FAR_BEYOND)
    # scaled by the larger of both, for powers that stay within single precision
    large = lax.stop_gradient(jnp.maximum(jnp.abs(share), 1.0))
    small = share / large
    power = small**SHARPNESS + large**-SHARPNESS
    return full_scale * small * power ** (-1 / SHARPNESS)


def quantised(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples as whole numbers of the instrument's smallest step.

    Codes go from -2^(bits-1) to 2^(bits-1) - 1, so the largest sample is a step below
    the full scale. The slope is that of the signal, as if nothing were rounded: the
    true one is zero nearly everywhere and of no use.
    """
    if instrument.bits is None or instrument.full_scale is None:
        return samples
    codes = 2.0 ** (instrument.bits - 1)
    step = instrument.full_scale / codes
    limited = jnp.clip(samples, -instrument.full_scale, instrument.full_scale - step)
    # Straight-through derivative: that of rounding is zero almost everywhere, and
    # would hide the signal from a fit.
    return limited + lax.stop_gradient(step * jnp.round(limited / step) - limited)


def clipping(
    samples: Float[Array, "*batch sample"], instrument: Instrument
) -> Clipping:
    """Return whether a record saturated, and at what magnitude.

    A compressed one did where the signal was beyond the full scale.

    Args:
        samples: As the instrument wrote them.
        instrument: What wrote them.
    """
    if instrument.full_scale is None:
        never = jnp.zeros(samples.shape[:-1], bool)
        return Clipping(never, jnp.full((), jnp.inf, samples.dtype))
    level = instrument.full_scale
    if instrument.saturation == "compress":
        level = level * 2.0 ** (-1 / SHARPNESS)
    if instrument.bits is not None:
        level = level - instrument.full_scale / 2.0 ** (instrument.bits - 1)
    beyond = jnp.abs(samples) >= level * (1 - 4 * jnp.finfo(samples.dtype).eps)
    return Clipping(jnp.any(beyond, axis=-1), level)


class PeakReading(NamedTuple):
    """The peak of a record, as a row of a log has it.

    Attributes:
        value: The largest sample; where that was clipped, what it was at least.
        sigma: Error of a reading of the value, same unit.
        lower_bound: Whether it is a lower bound.
    """

    value: Float[Array, "..."]
    sigma: Float[Array, "..."]
    lower_bound: Bool[Array, "..."]


def peak_reading(
    samples: Float[Array, "*batch sample"],
    instrument: Instrument,
    *,
    relative_sigma: Float[ArrayLike, ""] = 0.05,
) -> PeakReading:
    """Return the peak of a record; a lower bound where it was clipped.

    Suction that is clipped is no bound of the peak.

    Args:
        samples: As the instrument wrote them.
        instrument: What wrote them.
        relative_sigma: Error of its calibration, as a share of the value.
    """
    largest = jnp.max(samples, axis=-1)
    held = clipping(largest[..., None], instrument).clipped & (largest > 0)
    value = largest
    if instrument.full_scale is not None and instrument.saturation == "compress":
        full_scale = instrument.full_scale
        share = jnp.where(held, 0.0, largest / full_scale)
        expanded = largest * (1 - share**SHARPNESS) ** (-1 / SHARPNESS)
        value = jnp.where(held, full_scale, expanded)
    return PeakReading(value, jnp.asarray(relative_sigma) * jnp.abs(value), held)


def peak_log(
    sensors: Sequence[Sensor], readings: Sequence[PeakReading], *, shot: str = ""
) -> Observations:
    """Return peaks as a log: a row of peak overpressure for each sensor.

    Args:
        sensors: Who recorded; each stands where its position says.
        readings: The peak of each one's record [Pa].
        shot: Name of the event, where a log has several.
    """
    n = len(sensors)
    bound = np.array([bool(reading.lower_bound) for reading in readings], bool)
    return observed(
        [sensor.name for sensor in sensors],
        ("peak_overpressure_pa",) * n,
        [float(reading.value) for reading in readings],
        [float(reading.sigma) for reading in readings],
        position=np.array([sensor.position_m for sensor in sensors]).reshape(n, 3),
        shot=(shot,) * n,
        lower_bound=bound if bound.any() else None,
    )


def averaged_samples(rate: float, cutoff: float = CUTOFF_HZ) -> int:
    """Return how many samples are averaged: odd.

    Args:
        rate: Samples a second $f_s$ [Hz].
        cutoff: $f_c$ [Hz], positive.

    Raises:
        ValueError: The cut-off is not positive.
    """
    if not cutoff > 0:
        raise ValueError(f"cutoff must be positive, got {cutoff:g} Hz")
    return int(rate / (2 * cutoff)) // 2 * 2 + 1


def moving_average(
    samples: Float[ArrayLike, " sample"],
    rate: float,
    cutoff: float = CUTOFF_HZ,
) -> Float[Array, " sample"]:
    """Return the mean of the samples about each.

    Args:
        samples: Of a signal.
        rate: Samples a second [Hz].
        cutoff: What the thesis calls cut-off $f_c$ [Hz].
    """
    samples = as_float_array(samples)
    n, half = samples.shape[0], averaged_samples(rate, cutoff) // 2
    # no running sum: in single precision it loses a quiet end behind a loud start
    window = jnp.ones(2 * half + 1, samples.dtype)
    sums = jnp.convolve(jnp.pad(samples, half), window, mode="valid")
    place = jnp.arange(n)
    counted = jnp.minimum(place, half) + jnp.minimum(n - 1 - place, half) + 1
    return sums / counted.astype(samples.dtype)
