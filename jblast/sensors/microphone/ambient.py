r"""What is heard without a blast: noise of a colour, or a recording in a loop.

At height $h$ it is $e^{-h/H}$ times as loud as on the ground. So the thesis's ambient
sound falls, with no scale printed; $H$ = 30 m is declared.

A recording loops without a seam: its end fades out while its start fades in, both with
the powers that add up to one, as unlike sounds need. It is brought to the microphone's
rate by its Fourier series, which is exact for what repeats.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from jblast.errors import InputError
from jblast.scene import Ambient
from jblast.sensors.signal.blocks import BLOCK
from jblast.sensors.signal.noise import (
    ColouredNoise,
    coloured_noise,
    noise_block,
    noise_start,
)

CROSS_FADE_S = 0.05
"""Of a loop's end and start [s]; of a short one, a quarter."""


class Loop(NamedTuple):
    """Sound that repeats.

    Attributes:
        samples: Of one turn and, after it, of a block of the next [Pa].
    """

    samples: Float[Array, " sample"]


def ambient_sound(
    ambient: Ambient, rate: float, key: Key[Array, ""]
) -> ColouredNoise | Loop:
    """Set the ambient sound up, as it is on the ground.

    Args:
        ambient: What it is.
        rate: The microphone's samples a second [Hz].
        key: What noise is drawn from.

    Raises:
        InputError: It is a recording that nobody has read.
    """
    if ambient.loop is not None:
        turn = at_rate(
            seamless(ambient.loop, ambient.loop_rate), ambient.loop_rate, rate
        )
        return Loop(jnp.resize(turn, (turn.size + BLOCK,)))
    if ambient.file:
        raise InputError(
            f"ambient: expected the samples of {ambient.file} in its loop, got none"
        )
    return coloured_noise(key, rate, ambient.level, ambient.slope)


def ambient_start(sound: ColouredNoise | Loop) -> Any:
    """Return the state that the ambient sound starts with."""
    if isinstance(sound, Loop):
        return jnp.zeros((), int)
    return noise_start(sound)


def ambient_block(
    sound: ColouredNoise | Loop, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    """Return the next state, and a block of the sound on the ground [Pa]."""
    if not isinstance(sound, Loop):
        return noise_block(sound, state, index)
    turn = sound.samples.size - BLOCK
    block = jnp.take(sound.samples, state + jnp.arange(BLOCK))
    return (state + BLOCK) % turn, block


def share_at_height(ambient: Ambient, up: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return how loud it is at a height above ground, over how loud on it."""
    return jnp.exp(-jnp.maximum(up, 0.0) / ambient.height)


def seamless(samples: Float[Array, " sample"], rate: float) -> Float[Array, " turn"]:
    """Return one turn of a loop, shorter by the cross-fade of its end and start."""
    fade = max(1, min(round(CROSS_FADE_S * rate), samples.size // 4))
    angle = np.arange(fade) / fade * (np.pi / 2)
    head, tail = samples[:fade], samples[samples.size - fade :]
    mixed = head * np.sin(angle) + tail * np.cos(angle)
    return jnp.concatenate([mixed, samples[fade : samples.size - fade]])


def at_rate(
    turn: Float[Array, " turn"], loop_rate: float, rate: float
) -> Float[Array, " sample"]:
    """Return a turn at another rate, to the nearest whole number of samples."""
    n = max(1, round(turn.size * rate / loop_rate))
    if n == turn.size:
        return turn
    spectrum = jnp.fft.rfft(turn)[: n // 2 + 1]
    return jnp.fft.irfft(spectrum, n) * (n / turn.size)
