r"""An instrument's effect on a signal: band, noise, full scale and bits.

The signal is filtered to the band between the instrument's corners, its noise is added,
and it is limited to the full scale and quantised, in this order, block by block.

Band. The filters are causal Butterworth filters. Each section is the analogue one with
its integrators replaced by trapezoidal sums (the bilinear transform, pre-warped so that
the corner keeps its frequency; Zavalishin 2012, "The Art of VA Filter Design", ch. 3
and 4). Its state is that of two integrators, $s = (s_1, s_2)$, which single precision
represents even if corners are far below the rate. A cascade of them is one linear
system,

$$s_{i+1} = A s_i + b\,x_i, \qquad y_i = c \cdot s_i + d\,x_i$$

and so are `CHUNK` samples together: a triangular matrix of the impulse response acts on
the samples, and powers of $A$ on the state. These are matrix products, with one step
per chunk.

Full scale $F$. Compressed, a signal $x$ becomes

$$y = x\,(1 + (x/F)^8)^{-1/8},$$

which is within 0.05 % of $x$ up to half of the full scale, smooth everywhere, 0.92 $F$
at the full scale and never above it. To read a peak, a compressed sample is expanded
again, $x = y\,(1 - (y/F)^8)^{-1/8}$, up to the full scale. Above it, small noise of $y$
corresponds to any $x$, so the reading is a lower bound.

The moving average is the filter by which the thesis smooths the radiation of the
ground (Parab's thesis, algorithm 2, lines 33 to 36; that the window is odd and that
$f_c$ is 25 Hz comes from the public plugin). A sample becomes the mean of an odd number
of samples around it, $f_s / (2 f_c)$ or one more, and of fewer at the ends. It is not
causal: a front appears half a window early. Its 3 dB corner is $0.886 f_c$, not $f_c$,
and nothing passes at $2 f_c$.
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
"""Samples that are filtered together: one matrix product and one step of the scan."""
HIGHEST_ORDER = 4
"""Highest order of a filter, 24 dB per octave: a declared limit."""
SHARPNESS = 8
"""Exponent of the compression: larger is closer to clipping, smaller bends earlier. At
8 a signal of half the full scale is off by 0.05 %, below any calibration error."""
FAR_BEYOND = 1e4
"""Multiple of full scale at which a compressed signal equals it to the last bit: the
deficit is 1e-32 / 8. A larger input is limited to it, so that powers stay finite."""
CUTOFF_HZ = 25.0
"""The plugin's $f_c$ [Hz]."""


class CausalFilter(NamedTuple):
    """A filter, prepared for blocks.

    Attributes:
        response: Impulse response as a triangular matrix, chunk to chunk.
        heard: Effect of the state on each sample of a chunk.
        kept: Effect of each sample of a chunk on the state after it.
        powers: $A^0$ to $A^{CHUNK}$.
    """

    response: Float[Array, "chunk chunk"]
    heard: Float[Array, "chunk state"]
    kept: Float[Array, "state chunk"]
    powers: Float[Array, "power state state"]


class Chain(NamedTuple):
    """An instrument, prepared for blocks.

    Attributes:
        instrument: Description of the instrument.
        filter: Filter of its corners, or None.
        key: Random key of its noise.
        noise: Coloured noise, or None.
    """

    instrument: Instrument
    filter: CausalFilter | None
    key: Key[Array, ""]
    noise: ColouredNoise | None


def instrument_chain(instrument: Instrument, key: Key[Array, ""]) -> Chain:
    """Return a prepared instrument; its noise depends only on the key."""
    rate = instrument.rate
    high_pass, low_pass = instrument.high_pass, instrument.low_pass
    passing = noise = None
    if high_pass is not None or low_pass is not None:
        passing = causal_filter(rate, high_pass, low_pass)
    if instrument.noise is not None and instrument.noise_slope is not None:
        noise = coloured_noise(key, rate, instrument.noise, instrument.noise_slope)
    return Chain(instrument, passing, key, noise)


def chain_start(chain: Chain) -> Any:
    """Return the initial state of an instrument: at rest."""
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
    """Return the next state and the recorded samples of a block.

    Args:
        chain: The instrument.
        state: State after the last block, or `chain_start`.
        index: Index of the block, from 0.
        samples: Signal at the sensor, [BLOCK].
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
    """Return a Butterworth filter with -3 dB at each corner.

    Args:
        rate: Sampling rate [Hz].
        high_pass: Corner below which it attenuates [Hz], or None.
        low_pass: Corner above which it attenuates [Hz], or None.
        order: Order of each side, 1 to 4: 6 dB per octave each.

    Raises:
        ValueError: A corner is not between zero and half the rate, or the order is out
            of range. Corners are not checked inside `jit`.
    """
    if not 1 <= order <= HIGHEST_ORDER:
        raise ValueError(f"order: expected 1 to {HIGHEST_ORDER}, got {order}")
    # an empty system passes its input: sections are appended to it
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
                f"{name}: expected a corner above 0 and below half the rate of "
                f"{rate:g} Hz, got {float(np.asarray(corner)):g} Hz"
            )
        # the tangent pre-warps the corner, which the bilinear transform would shift
        gain = jnp.tan(jnp.pi / rate * as_float_array(corner))
        sections = [_one_pole(gain, name)] if order % 2 else []
        # 1/Q of the pole pairs of a Butterworth filter: 2 cos of their angles
        sections += [
            _two_poles(
                gain,
                2.0 * math.cos(math.pi * (2 * i + 1 + order % 2) / (2 * order)),
                name,
            )
            for i in range(order // 2)
        ]
        for a2, b2, c2, d2 in sections:
            # in series: the system so far feeds the section
            nothing = jnp.zeros((a.shape[0], a2.shape[0]))
            a = jnp.block([[a, nothing], [b2 @ c, a2]])
            b = jnp.concatenate([b, b2 @ d])
            c, d = jnp.concatenate([d2 @ c, c2], axis=1), d2 @ d
    return _in_chunks(a, b, c, d)


def filter_start(filtering: CausalFilter) -> Float[Array, " state"]:
    """Return the initial state of a filter: at rest."""
    return jnp.zeros_like(filtering.heard[0])


def filter_block(
    filtering: CausalFilter,
    state: Float[Array, " state"],
    samples: Float[Array, " sample"],
) -> tuple[Float[Array, " state"], Float[Array, " sample"]]:
    """Return the next state and a filtered block of any length.

    Args:
        filtering: The filter.
        state: State after the last block, or `filter_start`.
        samples: Signal.
    """
    n = samples.shape[0]
    # the remainder is shorter than a chunk and takes the leading part of its matrices
    whole = n - n % CHUNK
    chunks = samples[:whole].reshape(-1, CHUNK)

    def step(state, driven):
        return filtering.powers[CHUNK] @ state + driven, state

    # The scan carries only the state from chunk to chunk; the samples are filtered in
    # one product for all chunks.
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
    """Return the gain of the amplitude of a continuous tone [-].

    Args:
        filtering: The filter.
        rate: Sampling rate [Hz].
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


def _one_pole(gain, name: str):
    """Return $A, b, c, d$ of a first-order section."""
    share = gain / (1.0 + gain)
    a, b = (1.0 - 2.0 * share)[None, None], (2.0 * share)[None, None]
    if name == "low_pass":
        return a, b, (1.0 - share)[None, None], share[None, None]
    return a, b, (share - 1.0)[None, None], (1.0 - share)[None, None]


def _two_poles(gain, damping: float, name: str):
    """Return $A, b, c, d$ of a second-order section."""
    a1 = 1.0 / (1.0 + gain * (gain + damping))
    a2 = gain * a1
    a3 = gain * a2
    # outputs of the two integrators half a step later (Zavalishin's v1 and v2)
    band, low = jnp.stack([a1, -a2]), jnp.stack([a2, 1.0 - a3])
    a = 2.0 * jnp.stack([band, low]) - jnp.eye(2)
    b = 2.0 * jnp.stack([a2, a3])[:, None]
    if name == "low_pass":
        return a, b, low[None, :], a3[None, None]
    c = -(damping * band + low)
    return a, b, c[None, :], (1.0 - damping * a2 - a3)[None, None]


def _in_chunks(a, b, c, d) -> CausalFilter:
    """Return a system's matrices for `CHUNK` samples together."""
    _, powers = lax.scan(
        lambda power, _: (a @ power, power), jnp.eye(a.shape[0]), length=CHUNK + 1
    )
    heard = (c @ powers[:CHUNK])[:, 0, :]
    after = jnp.concatenate([d[0], heard[: CHUNK - 1] @ b[:, 0]])
    lag = np.arange(CHUNK)[:, None] - np.arange(CHUNK)[None, :]
    # Toeplitz and causal: no sample depends on later ones
    response = jnp.where(lag >= 0, after[np.maximum(lag, 0)], 0.0)
    kept = (powers[:CHUNK] @ b)[::-1, :, 0].T
    return CausalFilter(response, heard, kept, powers)


class Clipping(NamedTuple):
    """Saturation of a record.

    Attributes:
        clipped: True if any of its samples saturated; its peak is then a lower bound.
        level: Largest recorded magnitude; infinite if there is no limit.
    """

    clipped: Bool[Array, "..."]
    level: Float[Array, ""]


def saturated(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples limited to the instrument's full scale."""
    full_scale = instrument.full_scale
    if full_scale is None:
        return samples
    if instrument.saturation == "clip":
        return jnp.clip(samples, -full_scale, full_scale)
    share = jnp.clip(samples / full_scale, -FAR_BEYOND, FAR_BEYOND)
    # scaled by the larger of both, so that all powers stay within single precision
    large = lax.stop_gradient(jnp.maximum(jnp.abs(share), 1.0))
    small = share / large
    power = small**SHARPNESS + large**-SHARPNESS
    return full_scale * small * power ** (-1 / SHARPNESS)


def quantised(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples as whole numbers of the instrument's smallest step.

    Codes range from -2^(bits-1) to 2^(bits-1) - 1, so the largest sample is one step
    below the full scale. The derivative is that of the signal before rounding: the true
    one is zero nearly everywhere.
    """
    if instrument.bits is None or instrument.full_scale is None:
        return samples
    codes = 2.0 ** (instrument.bits - 1)
    step = instrument.full_scale / codes
    limited = jnp.clip(samples, -instrument.full_scale, instrument.full_scale - step)
    # Straight-through derivative: the true one would hide the signal from a fit.
    return limited + lax.stop_gradient(step * jnp.round(limited / step) - limited)


def clipping(
    samples: Float[Array, "*batch sample"], instrument: Instrument
) -> Clipping:
    """Return whether a record saturated, and the level at which it does.

    A compressed record saturated where the signal exceeded the full scale.

    Args:
        samples: Recorded samples.
        instrument: Instrument that recorded them.
    """
    if instrument.full_scale is None:
        never = jnp.zeros(samples.shape[:-1], bool)
        return Clipping(never, jnp.full((), jnp.inf, samples.dtype))
    level = instrument.full_scale
    if instrument.saturation == "compress":
        # the output for an input of exactly the full scale
        level = level * 2.0 ** (-1 / SHARPNESS)
    if instrument.bits is not None:
        level = level - instrument.full_scale / 2.0 ** (instrument.bits - 1)
    # within 4 ulp: the limit itself is rounded when a sample is written
    beyond = jnp.abs(samples) >= level * (1 - 4 * jnp.finfo(samples.dtype).eps)
    return Clipping(jnp.any(beyond, axis=-1), level)


class PeakReading(NamedTuple):
    """Peak of a record, for a row of a log.

    Attributes:
        value: Largest sample; if it was clipped, a lower bound.
        sigma: Standard error of the value, same unit.
        lower_bound: True if it is a lower bound.
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
    """Return the peak of a record; a lower bound if it was clipped.

    Clipped suction does not make the peak a bound.

    Args:
        samples: Recorded samples.
        instrument: Instrument that recorded them.
        relative_sigma: Relative error of its calibration.
    """
    largest = jnp.max(samples, axis=-1)
    clipped = clipping(largest[..., None], instrument).clipped & (largest > 0)
    value = largest
    if instrument.full_scale is not None and instrument.saturation == "compress":
        full_scale = instrument.full_scale
        share = jnp.where(clipped, 0.0, largest / full_scale)
        expanded = largest * (1 - share**SHARPNESS) ** (-1 / SHARPNESS)
        value = jnp.where(clipped, full_scale, expanded)
    return PeakReading(value, jnp.asarray(relative_sigma) * jnp.abs(value), clipped)


def peak_log(
    sensors: Sequence[Sensor], readings: Sequence[PeakReading], *, shot: str = ""
) -> Observations:
    """Return peaks as a log: one row of peak overpressure per sensor.

    Args:
        sensors: Recording sensors with their positions.
        readings: Peak of each sensor's record [Pa].
        shot: Name of the event, if a log has several.
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
    """Return the odd number of samples in the average.

    Args:
        rate: Sampling rate $f_s$ [Hz].
        cutoff: $f_c$ [Hz], positive.

    Raises:
        ValueError: The cutoff is not positive.
    """
    if not cutoff > 0:
        raise ValueError(f"cutoff: expected a positive frequency, got {cutoff:g} Hz")
    return int(rate / (2 * cutoff)) // 2 * 2 + 1


def moving_average(
    samples: Float[ArrayLike, " sample"],
    rate: float,
    cutoff: float = CUTOFF_HZ,
) -> Float[Array, " sample"]:
    """Return the moving average of a signal.

    Args:
        samples: Signal.
        rate: Sampling rate [Hz].
        cutoff: Cutoff $f_c$ of the thesis [Hz].
    """
    samples = as_float_array(samples)
    n, half = samples.shape[0], averaged_samples(rate, cutoff) // 2
    # no running sum: in single precision it loses a quiet end behind a loud start
    window = jnp.ones(2 * half + 1, samples.dtype)
    sums = jnp.convolve(jnp.pad(samples, half), window, mode="valid")
    row = jnp.arange(n)
    counted = jnp.minimum(row, half) + jnp.minimum(n - 1 - row, half) + 1
    return sums / counted.astype(samples.dtype)
