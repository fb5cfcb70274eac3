"""A recording loops without a seam, at any rate."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Ambient
from jblast.sensors.microphone import (
    ambient_block,
    ambient_sound,
    ambient_start,
    at_rate,
    seamless,
)
from jblast.sensors.samples import BLOCK, first_samples


def played(loop, loop_rate, rate, n):
    ambient = Ambient(loop=loop, loop_rate=loop_rate)
    sound = ambient_sound(ambient, rate, jax.random.key(0))
    return np.asarray(first_samples(ambient_block, sound, ambient_start(sound), n))


@pytest.mark.parametrize("size", [2, 30, BLOCK, 10_000])
def test_a_loop_repeats_for_ever(size):
    loop = np.random.default_rng(0).normal(size=size)
    fade = max(1, min(200, size // 4))
    turn = size - fade
    samples = played(loop, 4000.0, 4000.0, 3 * size + BLOCK)
    assert np.array_equal(samples[turn:], samples[:-turn])
    assert np.array_equal(samples[fade:turn], loop[fade:turn])
    # the first sample follows the last one of the turn as it did in the recording
    assert samples[turn] == loop[turn]


def test_the_cross_fade_keeps_the_loudness_of_noise():
    loops = np.random.default_rng(1).normal(size=(400, 4000))
    turns = np.asarray(jax.vmap(lambda loop: seamless(loop, 4000.0))(loops))
    level = turns.std(axis=0)
    assert level == pytest.approx(1.0, abs=5 / np.sqrt(2 * 400))


def test_a_tone_that_fits_the_loop_is_the_same_tone_at_another_rate():
    time = np.arange(4410) / 44_100.0
    tone = np.sin(2 * np.pi * 440.0 * time)
    for rate in (8000.0, 48_000.0):
        there = np.asarray(at_rate(jnp.asarray(tone), 44_100.0, rate))
        expected = np.sin(2 * np.pi * 440.0 * np.arange(there.size) / rate)
        assert there == pytest.approx(expected, abs=1e-10)
