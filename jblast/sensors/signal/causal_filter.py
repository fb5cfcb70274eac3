r"""Butterworth filters that hear nothing before it comes, block by block.

Each section is the analogue one with its integrators turned into trapezoidal sums (the
bilinear transform, pre-warped so that the corner stays where it is; Zavalishin 2012,
"The Art of VA Filter Design", ch. 3 and 4), so its state is that of two integrators,
$s = (s_1, s_2)$, which single precision holds where corners are far below the rate. A
cascade of them is one linear system,

$$s_{i+1} = A s_i + b\,x_i, \qquad y_i = c \cdot s_i + d\,x_i$$

and so are `CHUNK` samples of it at once: a triangular matrix of the impulse response on
the samples, and powers of $A$ on the state. These are products of matrices, and steps
are taken a chunk at a time; `calibration/filters.py` times it against a step a sample.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array

CHUNK = 32
"""Samples that are filtered at once."""

HIGHEST_ORDER = 4


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
